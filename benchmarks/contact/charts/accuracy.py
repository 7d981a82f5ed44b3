"""All pictures of the contact benchmark, and those of its accuracy and speed."""

import matplotlib
import matplotlib.pyplot as plt
import numpy as np

from benchmarks.contact.charts import limits
from benchmarks.contact.tables import accuracy as tables

matplotlib.use('Agg')
ORDER = ('fit', 'compensated', 'compensated as printed', 'basic')
OURS, THESIS, OTHERS = '#0b6e99', '#c05a00', '#666666'
# (contact, label) -> text and its offset in points; None: a neighbour's text speaks for it.
LABELS = {
    ('point', 'fit, model 1'): ('fit, models 1–3', (-44, 20), 'left'),
    ('point', 'fit, model 2'): None, ('point', 'fit, model 3'): None,
    ('point', 'estimator, fit, model 1'): ('whole estimator, fit,\nmodels 1–3', (-4, 16), 'left'),
    ('point', 'estimator, fit, model 2'): None, ('point', 'estimator, fit, model 3'): None,
    ('point', 'estimator, compensated, model 1'): (
        'whole estimator,\ncompensated', (36, -32), 'right'),
    ('point', 'estimator, moments, model 1'): ('whole estimator,\nmoments', (0, 9), 'center'),
    ('point', 'numpy Gauss-Newton, model 1'): (
        'numpy Gauss-Newton,\nbatched, and tuned', (-10, -28), 'left'),
    ('point', 'tuned numpy Gauss-Newton, model 1'): None,
    ('point', 'compensated, model 1'): ('compensated,\nmodels 1–3', (-24, -34), 'right'),
    ('point', 'compensated, model 2'): None, ('point', 'compensated, model 3'): None,
    ('point', 'compensated as printed, model 3'): ('as printed,\nmodel 3', (8, 14), 'left'),
    ('point', 'OpenCV moments + (2.3), model 1'): ('OpenCV moments\n+ (2.3)', (0, 8), 'center'),
    ('point', 'basic, model 1'): ('basic, models 1 and 2', (9, 1), 'left'),
    ('point', 'basic, model 2'): None,
    ('line', 'OpenCV moments'): ('OpenCV moments', (4, -16), 'right'),
    ('line', 'moments as printed'): ('moments as printed', (8, 5), 'left'),
    ('line', 'fit'): ('fit', (-6, 9), 'left'),
    ('line', 'estimator, fit'): ('whole estimator, fit', (-16, 9), 'left'),
    ('line', 'estimator, moments'): ('whole estimator,\nmoments', (-4, 12), 'center'),
    ('line', 'moments'): ('moments, corrected', (8, -9), 'left'),
    ('line', 'cv2.fitLine'): ('cv2.fitLine\n(no force)', (8, -4), 'left'),
    ('line', 'skimage orientation'): ('skimage orientation\n(no force)', (0, -28), 'center'),
    ('line', 'Berger-Khosla'): ('Berger–Khosla\n(no force)', (-2, -30), 'center')}
LIMITS = {'point': ((0.12, 600), (0.5, 90)), 'line': ((0.1, 100), (0.5, 200))}


def draw(result, folder):
    """Write every picture into a folder."""
    plt.rcParams.update({'font.size': 9, 'axes.spines.top': False, 'axes.spines.right': False})
    for name, make in (('speed', _speed), ('noise', _noise), ('table_2_4', _table_24),
                       ('table_3_3', _table_33), ('faults_point', limits.faults_of('point')),
                       ('faults_line', limits.faults_of('line')), ('choice', limits.confusion)):
        figure = make(result)
        figure.savefig(folder / f'contact_{name}.png', dpi=110)
        plt.close(figure)


def _colour(row):
    if row['method'] in ('fit', 'estimator, fit'):
        return OURS
    return OTHERS if row['peer'] or 'numpy' in row['method'] or 'Berger' in row['method'] \
        else THESIS


def _speed(result):
    figure, axes = plt.subplots(1, 2, figsize=(10.5, 4.8), layout='constrained')
    for axis, kind in zip(axes, ('point', 'line'), strict=True):
        unit = tables.reference_time(result, kind)
        for row in (r for r in result['speed_and_accuracy'] if r['contact'] == kind):
            colour = _colour(row)
            times = [row[key] / unit for key in ('single_s', 'batched_s') if row[key]]
            axis.plot(times, [row['ratio']] * len(times), color=colour, lw=0.8)
            if row['single_s']:
                axis.plot(times[0], row['ratio'], 'o', color=colour)
            if row['batched_s']:
                axis.plot(times[-1], row['ratio'], 's', color=colour, mfc='white')
            label = LABELS.get((kind, row['label']), (row['label'], (8, -3), 'left'))
            if label:
                text, offset, align = label
                axis.annotate(text, (times[0], row['ratio']), offset, color=colour, ha=align,
                              textcoords='offset points', fontsize=8.5, linespacing=0.95)
        axis.set(xscale='log', yscale='log', title=f'{kind} contact, 40 dB',
                 xlabel='time per frame / time of one call of the fit')
        axis.set(xlim=LIMITS[kind][0], ylim=LIMITS[kind][1])
        axis.axhline(1.0, color='black', lw=0.8, ls='--', zorder=0)
        axis.annotate('bound', (LIMITS[kind][0][0], 1.0), (3, -11), fontsize=8.5,
                      textcoords='offset points')
        axis.grid(alpha=0.25)
    axes[0].set_ylabel('RMS error / Cramér–Rao bound')
    axes[1].plot([], [], 'ko', label='one call')
    axes[1].plot([], [], 'ks', mfc='white', label='batched, per frame')
    axes[1].legend(loc='center left', frameon=False)
    return figure


def _noise(result):
    figure, axis = plt.subplots(figsize=(7, 3.8), layout='constrained')
    rows = result['fit_against_noise']
    styles = {('point', 1): ('o-', OURS), ('point', 2): ('s-', '#3c9d6a'),
              ('point', 3): ('^-', '#8a5aa8'), ('line', 1): ('D-', THESIS)}
    for (kind, model), (style, colour) in styles.items():
        own = [r for r in rows if (r['contact'], r['model']) == (kind, model)]
        label = f'point, model {model}' if kind == 'point' else 'line'
        axis.plot([r['decibels'] for r in own], [r['ratio'] for r in own], style, color=colour,
                  label=label, ms=5)
    for bar, text in ((1.10, 'goal for a point'), (1.05, 'goal for a line')):
        axis.axhline(bar, color='black', lw=0.7, ls=':')
        axis.annotate(text, (62, bar), (4, -3), textcoords='offset points', fontsize=8,
                      annotation_clip=False)
    axis.axhline(1.0, color='black', lw=0.8, ls='--')
    axis.set(xlabel='peak signal to noise [dB]', ylabel='RMS error / Cramér–Rao bound',
             title='The fits against noise', xticks=[20, 30, 40, 50, 60])
    axis.set_xlim(18, 62)
    axis.set_ylim(0.94, max(1.16, axis.get_ylim()[1]))
    axis.legend(frameon=False, ncols=4, fontsize=8, loc='upper center')
    return figure


def _table_24(result):
    rows = result['table_2_4']
    levels = list(dict.fromkeys(row['decibels'] for row in rows))
    load = list(dict.fromkeys(row['case'] for row in rows))
    names = sorted(dict.fromkeys((row['method'], row['model']) for row in rows),
                   key=lambda x: (x[1], ORDER.index(x[0])))
    sides = {(r['method'], r['model'], r['case'], r['decibels']): r['side_mm'] for r in rows}
    figure, axes = plt.subplots(1, 3, figsize=(10.5, 4.2), layout='constrained', sharey=True)
    for axis, case in zip(axes, load, strict=True):
        grid = np.array([[sides[(*name, case, level)] for level in levels]
                         + [tables.THESIS_24[case][name[1] - 1]] for name in names])
        shown = axis.imshow(grid, cmap='YlGnBu', vmin=0, vmax=26, aspect='auto')
        for (i, j), value in np.ndenumerate(grid):
            axis.text(j, i, f'{value}', ha='center', va='center',
                      color='white' if value > 15 else 'black')
        axis.axvline(len(levels) - 0.5, color='white', lw=4)
        axis.set_xticks(range(len(levels) + 1), [
            *('none' if x is None else f'{x:.0f} dB' for x in levels), 'thesis'], rotation=40,
            ha='right')
        axis.set_yticks(range(len(names)), [f'model {m}: {n}' for n, m in names])
        axis.spines[:].set_visible(False)
        axis.tick_params(length=0)
        for i in range(1, len(names)):
            if names[i][1] != names[i - 1][1]:
                axis.axhline(i - 0.5, color='white', lw=4)
        axis.set_title({'case 1': 'P 1 N, Qx .3 P, Qy .1 P', 'case 2': 'P 11 N, Qx .3 P, Qy .1 P',
                        'case 3': 'P 11 N, Qx .3 P, Qy .5 P'}[case])
    axes[1].set_xlabel('noise')
    figure.colorbar(shown, ax=axes, shrink=0.8, label='side of the sensible area [mm]')
    return figure


def _table_33(result):
    rows = result['table_3_3']
    names = list(dict.fromkeys(row['method'] for row in rows))
    loads = list(dict.fromkeys(row['case'] for row in rows))
    figure, axes = plt.subplots(1, 2, figsize=(9.5, 3.8), layout='constrained', sharey=True)
    for axis, key, text in zip(axes, ('rms_b_tactel', 'rms_alpha_deg'), (
            'RMS error of b at 40 dB [tactel]', 'RMS error of α at 40 dB [degrees]'), strict=True):
        for case, marker, colour in zip(loads, 'os^', (OURS, THESIS, '#3c9d6a'), strict=True):
            own = {row['method']: row[key] for row in rows if row['case'] == case}
            real = tables.THESIS_33[case][0]
            axis.plot([own[name] for name in names], range(len(names)), marker, color=colour,
                      label=f'{case}: b {real[0]} tactels, α {real[1]}°', mfc='none', ms=7)
        axis.set(xscale='log', xlabel=text)
        axis.set_yticks(range(len(names)), names)
        axis.grid(alpha=0.25)
    axes[0].invert_yaxis()
    figure.legend(*axes[0].get_legend_handles_labels(), loc='outside upper center', ncols=3,
                  frameon=False)
    return figure
