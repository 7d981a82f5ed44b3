"""Pictures of the edge benchmark."""

import matplotlib
import matplotlib.pyplot as plt
import numpy as np

matplotlib.use('Agg')
COLOURS = {'trace': '#0b6e99', 'resolved_rate': '#c05a00'}
MARKS = {'trace': 'o', 'resolved_rate': 's'}
VERDICTS = {'held': '#2a9d4a', 'cut': '#e0a000', 'lost': '#c22e2e'}


def draw(result, folder):
    """Write every picture into a folder."""
    plt.rcParams.update({'font.size': 9, 'axes.spines.top': False, 'axes.spines.right': False})
    for name, make in (('speed', _speed), ('stability', _stability), ('corners', _corners),
                       ('figures', _figures)):
        figure = make(result)
        figure.savefig(folder / f'edge_{name}.png', dpi=110)
        plt.close(figure)


def _speed(result):
    rows = result['speed_and_accuracy']
    courses = list(dict.fromkeys(row['course'] for row in rows))
    measures = (('lateral_rms', 1e3, 'lateral error, RMS [mm]'),
                ('lateral_max', 1e3, 'largest lateral error [mm]'),
                ('force_rms_error', 1.0, 'force error, RMS [N]'),
                ('cpu_per_cycle', 1e6, 'CPU per cycle [µs]'))
    figure, axes = plt.subplots(len(measures), len(courses), figsize=(11, 9), sharex=True,
                                sharey='row', layout='constrained')
    for column, course in enumerate(courses):
        axes[0, column].set_title(course.replace('_', ' '))
        for line, (key, factor, label) in enumerate(measures):
            axis = axes[line, column]
            for tracker, colour in COLOURS.items():
                own = [row for row in rows if (row['course'], row['tracker']) == (
                    course, tracker)]
                speeds = np.array([1e3 * row['speed'] for row in own])
                values = np.array([factor * row[key] for row in own])
                lost = np.array([row['ok'] < row['runs'] for row in own])
                axis.plot(speeds, values, color=colour, marker=MARKS[tracker], ms=4,
                          label=tracker)
                axis.plot(speeds[lost], values[lost], 'x', color='black', ms=9, zorder=5,
                          label='lost' if lost.any() else None)
            axis.set_yscale('log' if key != 'cpu_per_cycle' else 'linear')
            axis.grid(alpha=0.3)
            if column == 0:
                axis.set_ylabel(label)
            if line == len(measures) - 1:
                axis.set_xlabel('speed asked for [mm/s]')
    handles = {}
    for axis in axes.flat:
        handles.update(dict(zip(*reversed(axis.get_legend_handles_labels()), strict=True)))
    figure.legend(handles.values(), handles.keys(), loc='outside upper right', ncols=3)
    return figure


def _stability(result):
    figure, axes = plt.subplots(1, 2, figsize=(9, 4), sharey=True, layout='constrained')
    for axis, tracker in zip(axes, COLOURS, strict=True):
        rows = [row for row in result['stability'] if row['tracker'] == tracker]
        limit = sorted({(row['latency'], row['limit']) for row in rows})
        axis.plot([1e3 * latency for latency, _ in limit], [gain for _, gain in limit], 'k--',
                  label='limit of a loop through the image')
        for stable, colour, label in ((True, VERDICTS['held'], 'stable'),
                                      (False, VERDICTS['lost'], 'unstable')):
            own = [row for row in rows if row['stable'] == stable]
            axis.plot([1e3 * row['latency'] for row in own], [row['gain'] for row in own],
                      'o' if stable else 'x', color=colour, label=label)
        axis.set(title=tracker, xlabel='image latency [ms]')
        axis.grid(alpha=0.3)
    axes[0].set_ylabel('lateral gain [1/s]')
    axes[0].legend(fontsize=8)
    return figure


def _corners(result):
    figure, axes = plt.subplots(1, 2, figsize=(10, 4), layout='constrained')
    for axis, kind, label, factor in (
            (axes[0], 'corner', 'turn of a sharp corner [°]', 1.0),
            (axes[1], 'radius', 'radius of a quarter circle [mm]', 1e3)):
        for tracker, colour in COLOURS.items():
            own = [row for row in result['corners'] if (row['kind'], row['tracker']) == (
                kind, tracker)]
            sizes = [factor * row['size'] for row in own]
            errors = [1e3 * row['lateral_max'] if row['lateral_max'] == row['lateral_max']
                      else np.nan for row in own]
            axis.plot(sizes, errors, color=colour, lw=1)
            for size, error, row in zip(sizes, errors, own, strict=True):
                axis.plot(size, error, MARKS[tracker], color=VERDICTS[row['verdict']],
                          mec=colour, ms=8)
        axis.set(xlabel=label, ylabel='largest lateral error [mm]', yscale='log')
        axis.grid(alpha=0.3, which='both')
    axes[1].set_xscale('log')
    axes[1].set_xticks([5, 10, 20, 30, 60], ['5', '10', '20', '30', '60'])
    axes[1].minorticks_off()
    handles = [plt.Line2D([], [], color=colour, marker=MARKS[name], mfc='white', label=name)
               for name, colour in COLOURS.items()]
    handles += [plt.Line2D([], [], ls='', color=colour, marker='o', label=name)
                for name, colour in VERDICTS.items()]
    figure.legend(handles=handles, loc='outside upper center', ncols=5)
    return figure


def _figures(result):
    names = list(dict.fromkeys(row['figure'] for row in result['figures']))
    figure = plt.figure(figsize=(11, 7.5), layout='constrained')
    for number, name in enumerate(names):
        own = [row for row in result['figures'] if row['figure'] == name]
        space = own[0]['scene'] == 'straight_3d'
        axis = figure.add_subplot(2, 3, number + 1)
        columns = (1, 2) if space else (0, 1)
        edge = 1e3 * np.array(own[0]['_edge'])
        axis.plot(*edge[:, columns].T, color='0.75', lw=5, label='edge')
        for row in own:
            way = 1e3 * np.array(row['_way'])
            axis.plot(*way[:, columns].T, color=COLOURS[row['tracker']], lw=1.2,
                      label=row['tracker'])
            if row['_contour'] and row['scene'] == 'tape_case':
                axis.plot(*(1e3 * np.array(row['_contour']))[:, columns].T, 'k:', lw=1,
                          label='rebuilt outline')
        axis.set(title=f'{name}: {own[0]["scene"].replace("_", " ")}, '
                 f'{1e3 * own[0]["speed"]:g} mm/s',
                 xlabel='y [mm]' if space else 'x [mm]', ylabel='z [mm]' if space else 'y [mm]')
        if not space:
            axis.set_aspect('equal', adjustable='datalim')
        axis.legend(fontsize=7)
    return figure
