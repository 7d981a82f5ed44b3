"""Picture of the contact benchmark: error against time."""

import matplotlib
import matplotlib.pyplot as plt

from benchmarks.contact.tables import reference_time

matplotlib.use('Agg')
OURS, THESIS, OTHERS = '#0b6e99', '#c05a00', '#666666'


def draw(result, folder):
    """Write the picture into a folder."""
    plt.rcParams.update({'font.size': 9, 'axes.spines.top': False, 'axes.spines.right': False})
    rows = result['speed_and_accuracy']
    figure, axes = plt.subplots(1, 2, figsize=(10.5, 4.8), layout='constrained')
    for axis, kind in zip(axes, ('point', 'line'), strict=True):
        unit = reference_time(rows, kind)
        for row in (row for row in rows if row['contact'] == kind):
            _mark(axis, row, unit)
        axis.axhline(1.0, color='black', lw=0.8, ls='--', zorder=0)
        axis.annotate('bound', (0.0, 1.0), (3, -11), fontsize=8.5, textcoords='offset points',
                      xycoords=('axes fraction', 'data'))
        axis.set(xscale='log', yscale='log', title=f'{kind} contact, 40 dB', ylim=(0.5, None),
                 xlabel='time per frame / time of one call of the estimator')
        axis.margins(x=0.25)
        axis.grid(alpha=0.25)
    axes[0].set_ylabel('RMS error / Cramér–Rao bound')
    axes[1].plot([], [], 'ko', label='one call')
    axes[1].plot([], [], 'ks', mfc='white', label='batched, per frame')
    axes[1].legend(frameon=False)
    figure.savefig(folder / 'contact_speed.png', dpi=110)
    plt.close(figure)


def _mark(axis, row, unit):
    """Draw the calls of one method; only rows of model 1 get a name."""
    own, thesis = row['method'].startswith('estimator'), row['method'].startswith('thesis')
    colour = OURS if own else THESIS if thesis else OTHERS
    times = [row[key] / unit for key in ('single_s', 'batched_s') if row[key]]
    axis.plot(times, [row['ratio']] * len(times), color=colour, lw=0.8)
    if row['single_s']:
        axis.plot(times[0], row['ratio'], 'o', color=colour)
    if row['batched_s']:
        axis.plot(times[-1], row['ratio'], 's', color=colour, mfc='white')
    if row['model'] == 1:
        below = 'unknown' in row['method']  # next to the estimator that knows the skin
        axis.annotate(row['method'], (min(times), row['ratio']), (0, -15 if below else 7),
                      color=colour, ha='center', textcoords='offset points', fontsize=8.5)
