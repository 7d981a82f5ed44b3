"""Draws frames.svg: the array seen from the object, and the pad over an edge from the side."""
from pathlib import Path

import matplotlib
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch, Rectangle

INK, SKIN, EDGE, GREY = '#20262c', '#5aa897', '#c05a00', '#aab3b8'
# Reproducible output, with text as text.
matplotlib.rcParams.update({'svg.hashsalt': 'frames', 'svg.fonttype': 'none'})


def arrow(axis, begin, end, text, at, colour=INK):
    """Draw an arrow with a name."""
    axis.annotate('', end, begin, arrowprops={'arrowstyle': '-|>', 'color': colour, 'lw': 1.6})
    axis.text(*at, text, color=colour, ha='center', va='center', fontsize=11)


def from_the_object(axis):
    """Draw the array seen along -z: x to the right, y up."""
    axis.set_title('seen from the object (z points at you)', fontsize=11)
    axis.add_patch(Rectangle((-8, -8), 16, 16, color=SKIN, alpha=0.25))
    for i in range(16):
        axis.plot([k - 7.5 for k in range(16)], [i - 7.5] * 16, 's', color=GREY, ms=6)
    for k, i, text in ((0, 0, 'row 0,\ncolumn 0'), (15, 15, 'last row,\nlast column')):
        axis.plot(k - 7.5, i - 7.5, 's', color=INK, ms=6)
        axis.text(k - 7.5, i - 7.5 + (2.5 if i else -2.5), text, ha='center', va='center',
                  fontsize=9)
    axis.plot([5.1, 0.9], [-10, 12], color=EDGE, lw=3)
    axis.text(-2.2, 10.6, 'edge, yaw > 0', color=EDGE, fontsize=10, ha='center')
    arrow(axis, (0, 0), (0, 6.5), 'y', (-0.9, 6))
    arrow(axis, (0, 0), (6.8, 0), 'x', (7.2, -1))
    axis.plot(3.19, 0, 'o', color=EDGE)  # middle of the edge's part on the array
    axis.text(1.6, -1.2, '(x, y)', color=EDGE, fontsize=10)
    axis.set(xlim=(-12, 12), ylim=(-13, 13))


def from_the_side(axis):
    """Draw robot, pad and edge from the side."""
    axis.set_title('from the side', fontsize=11)
    axis.add_patch(Rectangle((-3, 13), 6, 6, color=GREY))
    axis.text(0, 16, 'flange', ha='center', va='center', fontsize=10)
    axis.add_patch(Rectangle((-1.2, 5), 2.4, 8, color=GREY, alpha=0.6))
    axis.add_patch(FancyBboxPatch((-6, 1), 12, 4, boxstyle='round,pad=0', color=SKIN, alpha=0.6))
    axis.plot([-5.5, 5.5], [3, 3], '|', color=INK, ms=6)
    axis.plot(range(-5, 6), [3] * 11, 's', color=INK, ms=4)
    axis.text(6.6, 3.1, 'tactels, at the depth', fontsize=9, va='center')
    axis.text(6.6, 1.0, "skin's surface:\norigin of the frame", fontsize=9, va='center')
    arrow(axis, (0, 1), (0, -5.5), 'z', (-1, -4.5))
    arrow(axis, (0, 1), (4.8, 1), 'x', (4.6, 0))
    axis.fill([1.5, 12, 12, 1.5], [-7, -7, -11, -11], color=EDGE, alpha=0.35, lw=0)
    axis.plot([1.5, 12], [-7, -7], color=EDGE, lw=2)
    axis.plot(1.5, -7, 'o', color=EDGE)
    axis.text(7, -9, 'object', fontsize=10, color=EDGE, ha='center', va='center')
    axis.text(0.6, -8.3, 'edge', fontsize=10, color=EDGE, ha='right')
    axis.annotate('', (-4.6, 13), (-4.6, 5), arrowprops={'arrowstyle': '<->', 'color': INK})
    axis.text(-5.2, 9, '<origin xyz>\nof the mount', fontsize=9, ha='right', va='center')
    axis.set(xlim=(-12, 14), ylim=(-13, 20))


def main() -> None:
    """Write the drawing."""
    figure = Figure(figsize=(9, 4.6), layout='constrained')
    left, right = figure.subplots(1, 2)
    from_the_object(left)
    from_the_side(right)
    for axis in (left, right):
        axis.set_aspect('equal')
        axis.axis('off')
    figure.savefig(Path(__file__).parent / 'frames.svg', metadata={'Date': None})


if __name__ == '__main__':
    main()
