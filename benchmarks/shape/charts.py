"""Pictures of the shape benchmark."""
import matplotlib
import matplotlib.pyplot as plt
from matplotlib.ticker import FuncFormatter
import numpy as np

from benchmarks.shape import tables, thesis

matplotlib.use('Agg')
OURS, THESIS, OTHERS = '#0b6e99', '#c05a00', '#666666'
SHADES = ('#1b7837', '#0b6e99', '#c05a00', '#762a83', '#666666', '#b2182b', '#8c6d00')
X = 1e3 * thesis.X


def draw(result, folder):
    """Write every picture into a folder."""
    plt.rcParams.update({'font.size': 9, 'axes.spines.top': False, 'axes.spines.right': False})
    for name, make in (('thesis', _thesis), ('speed', _speed), ('time', _time),
                       ('sweeps', _sweeps), ('kinds', _kinds), ('rank', _rank),
                       ('refusals', _refusals)):
        figure = make(result)
        figure.savefig(folder / f'shape_{name}.png', dpi=110)
        plt.close(figure)


def _row(result, form, noise, along, across=1e-2):
    return next(row for row in result['thesis'] if (
        row['form'], row['noise'], row['along'], row['across']) == (form, noise, along, across))


def _thesis(result):
    """Draw Figures 4.4 to 4.10."""
    literal, rotation, _ = thesis.FORMS
    figure = plt.figure(figsize=(11, 9.5), layout='constrained')
    grid = figure.add_gridspec(3, 2)
    _patch(figure.add_subplot(grid[0, 0], projection='3d'), literal)
    axis = figure.add_subplot(grid[0, 1])
    for shade, along in zip(SHADES, (2e-4, 1e-3, 5e-3, 2e-2, 5e-2), strict=False):
        axis.plot(X, 1e3 * np.array(_row(result, literal, '', along)['low']), color=shade,
                  label=f'Vx = {1e3 * along:g} mm/s')
    axis.set(yscale='symlog', title='Fig. 4.5: error for different Vx, as printed (ω = 0)')
    axis.set_yscale('symlog', linthresh=1e-2)
    axis.legend(fontsize=8)
    panels = (((1, 0), 'Fig. 4.6', 'Vx', 0.3), ((2, 0), 'Fig. 4.9', 'Vy', None),
              ((2, 1), 'Fig. 4.10', 'v', 0.4))
    for place, name, noise, goal in panels:
        axis = figure.add_subplot(grid[place])
        for form, shade, shift in ((literal, THESIS, -0.12), (rotation, OURS, 0.12)):
            row = _row(result, form, noise, 1e-3)
            low, high = 1e3 * np.array(row['low']), 1e3 * np.array(row['high'])
            label = 'as printed, ω = 0' if form == literal else "with the finger's rotation"
            axis.vlines(X + shift, low, high, color=shade, lw=2)
            axis.plot(X + shift, 0.5 * (low + high), '.', color=shade, ms=3, label=label)
        if goal:
            for sign in (-1, 1):
                axis.axhline(sign * goal, color='black', lw=0.8, ls='--')
            axis.annotate(f'thesis ±{goal} mm', (X[0], goal), (0, 3), fontsize=8,
                          textcoords='offset points')
        axis.set(title=f'{name}: least to largest error of 300, {noise} ±15 %, Vx = 1 mm/s')
        axis.margins(y=0.15)
        axis.legend(fontsize=8, loc='lower left')
    axis = figure.add_subplot(grid[1, 1])
    for shade, across in zip(SHADES, (1e-3, 1e-2, 5e-2), strict=False):
        axis.plot(X, 1e3 * np.array(_row(result, literal, '', 1e-3, across)['low']),
                  color=shade, label=f'Vy = {1e3 * across:g} mm/s',
                  lw=4 - 1.5 * SHADES.index(shade))
    axis.set(title='Figs. 4.7, 4.8: Vy makes no difference (Vx = 1 mm/s, ω = 0)')
    axis.legend(fontsize=8)
    for axis in figure.axes[1:]:
        axis.set(xlabel='x [mm]', ylabel='error [mm]')
        axis.grid(alpha=0.25)
    return figure


def _patch(axis, form):
    y = np.array([-2.0, 2.0])
    for along, shade in ((2e-4, OURS), (2e-2, THESIS)):
        fit = thesis.fit(form, thesis.zigzag(along, 1e-2, rotation=False))
        height = 1e3 * thesis.section(fit)
        axis.plot_surface(X[:, None] + 0 * y, y + 0 * X[:, None],
                          np.repeat(height[:, None], 2, axis=1), color=shade, alpha=0.5)
        axis.plot([], [], 's', color=shade, label=f'Vx = {1e3 * along:g} mm/s')
    true = 1e3 * (thesis.RADIUS - np.sqrt(thesis.RADIUS**2 - thesis.X**2))
    axis.plot(X, 0 * X, true, color='black', label='the cylinder')
    axis.set(xlabel='x [mm]', ylabel='y [mm]', title='Fig. 4.4: estimated patch, as printed')
    axis.set_zlabel('z [mm]')
    axis.legend(fontsize=8, loc='upper left')


def _speed(result):
    figure, axes = plt.subplots(1, 3, figsize=(11, 3.9), layout='constrained', sharey=True)
    for axis, noise, goal in zip(axes, ('', 'Vx', 'v'), (0.02, 0.3, 0.4), strict=True):
        for form, shade, style in zip(thesis.FORMS, (THESIS, OURS, 'black'), ('o-', 's-', 'x--'),
                                      strict=True):
            rows = [row for row in result['thesis'] if (
                row['form'], row['noise'], row['across']) == (form, noise, 1e-2)]
            axis.loglog([1e3 * row['along'] for row in rows],
                        [max(1e3 * row['most'], 1e-14) for row in rows], style, color=shade,
                        label=form, ms=4)
        axis.axhline(goal, color='black', lw=0.8, ls=':')
        axis.annotate(f'thesis: {goal} mm', (0.011, goal), (0, 3), textcoords='offset points',
                      fontsize=8)
        axis.set(xlabel='Vx [mm/s], one contact a second',
                 title='no noise' if not noise else f'{noise} ±15 %, 95 % of runs')
        axis.grid(alpha=0.25)
    axes[0].set_ylabel('largest error over the cross-section [mm]')
    axes[0].legend(fontsize=8, loc='center')
    return figure


def _time(result):
    names = list(dict.fromkeys(row['case'] for row in result['error_and_time']))
    order = list(dict.fromkeys(row['method'] for row in result['error_and_time']))
    figure, axes = plt.subplots(2, 3, figsize=(11, 6.6), layout='constrained', sharex=True,
                                sharey=True)
    marks = dict(zip(order, 'osD^xv', strict=True))
    for axis, name in zip(axes.flat, names, strict=True):
        refused = []
        for row in (row for row in result['error_and_time'] if row['case'] == name):
            method, x = row['method'], 1e6 * row['time_median']
            shade = OURS if 'quadric' in method else OTHERS if 'parabol' in method else THESIS
            if row['refused'] > 0.005:
                refused.append(f'{method.replace("surface_matrix, ", "")}: '
                               f'{100 * row["refused"]:.0f} %')
            if row['refused'] < 0.999:
                axis.plot([x, x], [1e3 * row['median'], 1e3 * row['most']], '_-', color=shade,
                          lw=1)
                axis.plot(x, 1e3 * row['median'], marks[method], color=shade, ms=5)
        if refused:
            axis.text(0.98, 0.98, 'refused or not all seen\n' + '\n'.join(refused), ha='right',
                      va='top', fontsize=7.5, color=THESIS, transform=axis.transAxes)
        bar = next(row for row in result['bars'] if row['case'] == name)
        axis.axhline(1e3 * bar['bar_most'], color='black', lw=0.7, ls=':')
        axis.axhline(1e3 * bar['bar_median'], color='black', lw=0.7, ls='--')
        axis.set(xscale='log', yscale='log', title=name, ylim=(1e-3, 3))
        axis.set_xticks([100, 200, 500, 1000], ['100', '200', '500', '1000'])
        axis.set_xticks([], minor=True)
        axis.grid(alpha=0.25)
    for method in order:
        shade = OURS if 'quadric' in method else OTHERS if 'parabol' in method else THESIS
        axes[0, 0].plot([], [], marks[method], color=shade, ms=5, label=method)
    axes[0, 0].plot([], [], color='black', lw=0.7, ls='--', label='goal, median')
    axes[0, 0].plot([], [], color='black', lw=0.7, ls=':', label='goal, 95 %')
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc='outside upper center', ncols=4,
                  fontsize=8)
    figure.supxlabel('time of one update [µs]', fontsize=9)
    figure.supylabel('error over 20×4 mm [mm]: median, and 95 % (bar)', fontsize=9)
    return figure


def _sweeps(result):
    sweeps = list(dict.fromkeys(row['sweep'] for row in result['sweeps']))
    names = list(dict.fromkeys(row['case'] for row in result['sweeps']))
    figure, axes = plt.subplots(2, 2, figsize=(11, 7.4), layout='constrained', sharey=True)
    for axis, sweep in zip(axes.flat, sweeps, strict=True):
        for shade, name in zip(SHADES, names, strict=False):
            for method in ('local_quadric', 'surface_matrix'):
                rows = [row for row in result['sweeps'] if row['sweep'] == sweep
                        and row['case'] == name and row['method'].startswith(method)
                        and row['refused'] < 0.5]
                scale = 1.0 if 'N' in sweep else 1e3
                axis.plot([scale * row['value'] for row in rows],
                          [1e3 * row['median'] for row in rows],
                          'o-' if method == 'local_quadric' else 'x:', color=shade, ms=4,
                          label=name if method == 'local_quadric' else None)
        symlog = 'noise' in sweep
        axis.set(xlabel=sweep.replace('[m', '[mm'), yscale='log')
        axis.set_xscale('symlog' if symlog else 'log', **({'linthresh': 0.04} if symlog else {}))
        ticks = sorted({row['value'] * (1.0 if 'N' in sweep else 1e3)
                        for row in result['sweeps'] if row['sweep'] == sweep})
        axis.set_xticks(ticks, [f'{tick:g}' for tick in ticks])
        axis.xaxis.set_minor_formatter(FuncFormatter(lambda *_: ''))
        axis.grid(alpha=0.25)
    axes[1, 1].set_title('surface_matrix alone', fontsize=9)
    axes[0, 0].plot([], [], 'o-', color='black', label='local_quadric')
    axes[0, 0].plot([], [], 'x:', color='black', label='surface_matrix, N = 6')
    axes[1, 1].legend(*axes[0, 0].get_legend_handles_labels(), fontsize=8, loc='lower right')
    figure.supylabel('median error over 20×4 mm [mm]; left out where most are refused or see one '
                     'curvature', fontsize=9)
    return figure


def _kinds(result):
    share = np.array([[row['kinds'][kind] for kind in tables.KINDS] for row in result['bars']])
    figure, axis = plt.subplots(figsize=(7, 3.6), layout='constrained')
    _map(axis, share, [f'{100 * value:.1f}' for value in share.flat],
         tables.KINDS, [row['case'] for row in result['bars']], 'Blues')
    axis.set(xlabel='found', title='surface found, in % of 1000 paths with realistic noise')
    return figure


def _rank(result):
    motions = list(dict.fromkeys(row['motion'] for row in result['rank']))
    counts = sorted({row['contacts'] for row in result['rank']})
    rank = np.array([[next(row['rank'] for row in result['rank'] if (
        row['motion'], row['contacts']) == (motion, count)) for count in counts]
        for motion in motions])
    figure, axis = plt.subplots(figsize=(8.5, 4), layout='constrained')
    labels = []
    for motion in motions:
        last = next(row for row in result['rank'] if row['motion'] == motion
                    and row['contacts'] == counts[-1])
        labels.append(f'{motion}\nunseen: {", ".join(last["unseen"]) or "nothing"}')
    _map(axis, rank / 9.0, [str(value) for value in rank.flat], counts, labels, 'Greens')
    axis.set(xlabel='contacts', title='how many of the nine unknowns are seen, without noise')
    return figure


def _refusals(result):
    methods = list(dict.fromkeys(row['method'] for row in result['refusals']))
    names = list(dict.fromkeys(row['case'] for row in result['refusals']))
    travels = sorted({row['travel'] for row in result['refusals']})
    breadths = sorted({row['breadth'] for row in result['refusals']})
    figure, axes = plt.subplots(2, 2, figsize=(11, 7.6), layout='constrained')
    for line, method in zip(axes, methods, strict=True):
        for axis, name in zip(line, names, strict=True):
            rows = {(row['travel'], row['breadth']): row for row in result['refusals']
                    if (row['method'], row['case']) == (method, name)}
            refused = np.array([[rows[t, b]['refused'] for t in travels] for b in breadths])
            texts = []
            for b in breadths:
                for t in travels:
                    row = rows[t, b]
                    one = 1.0 - row['refused'] - row['both']
                    parts = (('both', row['both']), ('one', one), ('wrong', row['wrong']))
                    texts.append('\n'.join(f'{label} {100 * share:.0f}' for label, share in parts
                                           if share > 0.004) or 'refused')
            _map(axis, refused, texts, [f'{1e3 * t:g}' for t in travels],
                 [f'{1e3 * b:g}' for b in breadths], 'Oranges')
            axis.set(xlabel='travel [mm]', ylabel='breadth of the weave, ± [mm]',
                     title=f'{method}, {name}')
    figure.suptitle('patches in which both curvatures, or one, were seen [%]; "wrong": off by '
                    'more than 0.5 mm over 20×4 mm along what was seen; colour: share refused',
                    fontsize=10)
    return figure


def _map(axis, values, texts, columns, rows, colours):
    axis.imshow(values, cmap=colours, vmin=0.0, vmax=1.15, aspect='auto')
    axis.set_xticks(range(len(columns)), columns)
    axis.set_yticks(range(len(rows)), rows)
    for index, text in enumerate(texts):
        row, column = divmod(index, len(columns))
        axis.text(column, row, text, ha='center', va='center', fontsize=8,
                  color='white' if values[row, column] > 0.75 else 'black')
    for side in axis.spines.values():
        side.set_visible(False)
