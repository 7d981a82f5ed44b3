"""Pictures of the surface benchmark, including the thesis' Figures 6.11 to 6.14."""
import matplotlib
import matplotlib.pyplot as plt
import numpy as np

matplotlib.use('Agg')
COLOURS = {'predicted': '#0b6e99', 'thesis': '#c05a00'}
LABELS = {'predicted': 'predicted normal, PI', 'thesis': "the thesis' law"}


def draw(result, folder):
    """Write the pictures into a folder."""
    plt.rcParams.update({'font.size': 9, 'axes.spines.top': False, 'axes.spines.right': False})
    pictures = {'figures': _figures, 'speed': _speed}
    if not result['quick']:
        pictures.update(stability=_stability, models=_models)
    for name, make in pictures.items():
        figure = make(result)
        figure.savefig(folder / f'surface_{name}.png', dpi=110)
        plt.close(figure)


def _figures(result):
    figure, axes = plt.subplots(2, 2, figsize=(9, 6), layout='constrained')
    items = sorted(result['figures'], key=lambda item: item['figure'])
    for axis, item in zip(axes.flat, items, strict=True):
        points, errors = 1e3 * np.array(item['_points']), 1e6 * np.array(item['_errors'])
        shown = axis.scatter(points[:, 1], points[:, 2], c=errors, s=4, cmap='coolwarm',
                             vmin=-40, vmax=40)
        axis.set(title=f'Figure {item["figure"]}: {item["object"]}', xlabel='y [mm]',
                 ylabel='z [mm]', aspect='equal')
    figure.colorbar(shown, ax=axes, label='off the true surface [µm]')
    return figure


def _speed(result):
    measures = (('surface_rms', 1e3, 'surface, RMS [mm]', 0.05),
                ('centre_max', 1e3, 'off centre, largest [mm]', 0.5),
                ('force_rms_error', 1.0, 'force, RMS [N]', 0.05))
    rows = result['speed_and_accuracy']
    objects = list(dict.fromkeys(row['object'] for row in rows))
    figure, axes = plt.subplots(len(measures), len(objects), figsize=(11, 7), sharex=True,
                                sharey='row', layout='constrained')
    for column, name in enumerate(objects):
        axes[0, column].set_title(name)
        axes[-1, column].set_xlabel('speed asked for [mm/s]')
        for axis, (key, factor, label, bar) in zip(axes[:, column], measures, strict=True):
            for control, colour in COLOURS.items():
                own = [row for row in rows if (row['object'], row['control']) == (name, control)]
                speeds = np.array([1e3 * row['speed'] for row in own])
                values = np.array([factor * row[key] for row in own], dtype=float)
                lost = np.array([not row['ok'] for row in own])
                axis.plot(speeds, values, 'o-', color=colour, ms=4, label=LABELS[control])
                axis.plot(speeds[lost], values[lost], 'kx', ms=9)
            axis.axhline(bar, color='grey', linewidth=0.8, linestyle=(0, (6, 4)), label='bar')
            axis.set_yscale('log')
            axis.grid(alpha=0.3)
            if column == 0:
                axis.set_ylabel(label)
    axes[0, 0].plot([], [], 'kx', label='lost')
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc='outside upper right', ncols=4)
    return figure


def _stability(result):
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.8), sharey=True, layout='constrained')
    for axis, control in zip(axes, COLOURS, strict=True):
        own = [row for row in result['gains'] if row['control'] == control]
        latency, gain = (np.array([row[key] for row in own]) for key in ('latency', 'limit'))
        gain = gain * [row['share'] for row in own]
        error = np.array([row['force_rms_error'] if row['ok'] else np.nan for row in own])
        dots = axis.scatter(1e3 * latency, gain, c=np.log10(error), cmap='viridis', vmin=-2,
                            vmax=0.5, s=36)
        lost = np.isnan(error)
        axis.plot(1e3 * latency[lost], gain[lost], 'rx', label='lost')
        limits = result['stability']
        axis.plot([1e3 * row['latency'] for row in limits], [row['limit'] for row in limits], 'k-',
                  label='limit in theory')
        axis.set(title=LABELS[control], xlabel='latency of the images [ms]', yscale='log')
        axis.legend(frameon=False)
    axes[0].set_ylabel('gain of the force loop [1/s]')
    figure.colorbar(dots, ax=axes, label='log10 of the force error, RMS [N]')
    return figure


def _models(result):
    figure, (error, solved) = plt.subplots(1, 2, figsize=(9, 3.8), layout='constrained')
    for features, colour in (('centroid', '#0b6e99'), ('moments', '#c05a00')):
        own = [row for row in result['resolution'] if row['model'] == 'half-space'
               and row['features'] == features]
        error.plot([row['across'] for row in own], [100 * row['median'] for row in own], 'o-',
                   color=colour, ms=4, label=features)
    error.set(xlabel='contacts along each side of the pad', ylabel='error of a step, median [%]',
              ylim=(0, None), title='Tables of the half-space')
    error.legend(frameon=False, fontsize=8)
    rows = result['elements']
    solved.plot([row['elements'] for row in rows], [row['solve'] for row in rows], 'o-')
    solved.set(xlabel='elements', ylabel='processor time to solve [s]', title='Finite elements',
               xlim=(0, None), ylim=(0, None))
    solved.grid(alpha=0.3)
    return figure
