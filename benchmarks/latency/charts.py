"""Picture of the latency benchmark: parts of the time of a control cycle."""
import matplotlib
import matplotlib.pyplot as plt

from benchmarks.latency.runs import BAR, CYCLE

matplotlib.use('Agg')
LEAST = 0.015  # ms, smallest part that is labelled


def draw(result, folder):
    """Write the picture into a folder."""
    plt.rcParams.update({'font.size': 9, 'axes.spines.top': False, 'axes.spines.right': False})
    figure, axis = plt.subplots(figsize=(9, 1.6 + 0.7 * len(result['runs'])), layout='constrained')
    rows = [_row(run['cpu']) for run in result['runs']]
    begin = [0.0] * len(rows)
    for shade, part in zip(plt.get_cmap('tab20').colors, rows[0], strict=False):
        widths = [row[part] for row in rows]
        bars = axis.barh(range(len(rows)), widths, left=begin, color=shade, label=part, height=0.6)
        axis.bar_label(bars, [f'{width:.2f}' if width > LEAST else '' for width in widths],
                       label_type='center', fontsize=8)
        begin = [before + width for before, width in zip(begin, widths, strict=True)]
    axis.axvline(1e3 * BAR, color='black', ls='--', lw=0.8)
    axis.text(1e3 * BAR, 1.0, ' wanted', transform=axis.get_xaxis_transform(), fontsize=8)
    axis.set(yticks=range(len(rows)), xlabel='processor time of a control cycle, mean [ms]',
             yticklabels=[f'{run["rate"]:g} Hz' + ',\nkept awake' * run['awake']
                          for run in result['runs']])
    axis.invert_yaxis()
    figure.legend(loc='outside lower center', ncols=5, fontsize=8, frameon=False)
    figure.savefig(folder / 'latency_cycle.png', dpi=110)
    plt.close(figure)


def _row(cpu):
    """Return the parts of a mean cycle and the rest [ms]."""
    parts = {name.removeprefix('- '): 1e3 * part['mean'] * part['calls']
             for name, part in cpu.items() if name.startswith('- ')}
    return {**parts, 'the rest': max(1e3 * cpu[CYCLE]['mean'] - sum(parts.values()), 0.0)}
