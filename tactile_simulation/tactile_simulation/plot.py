"""Plots of runs; every axis has a unit, and elements are labelled directly where possible."""
from io import BytesIO
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
import numpy as np

from tactile_simulation.metrics import largest

BLUE, ORANGE, GREY, INK = '#1f5fa8', '#d4691e', '#7a808a', '#22262b'
EDGE_COLOUR = '#c9cdd4'
FLATTEST = 0.3  # smallest ratio of the sides of a plot with equal scales
SIDES = np.array([-1.0, 1.0])


def new_figure(width: float, height: float) -> Any:
    """Return an empty figure with a size in inches."""
    figure = Figure(figsize=(width, height), dpi=160, layout='constrained')
    FigureCanvasAgg(figure)
    return figure


def png(figure: Figure) -> bytes:
    """Return a figure as PNG."""
    buffer = BytesIO()
    figure.savefig(buffer, format='png', facecolor='white')
    return buffer.getvalue()


def label(axes, xlabel='', ylabel='', title=''):
    """Label axes and apply the common style."""
    axes.set_xlabel(xlabel, fontsize=10, color=INK)
    axes.set_ylabel(ylabel, fontsize=10, color=INK)
    axes.tick_params(labelsize=9, colors='#4b5058')
    axes.set_title(title, fontsize=11, loc='left', color=INK)
    axes.spines[['top', 'right']].set_visible(False)
    axes.spines[['left', 'bottom']].set_color('#b8bcc4')
    axes.grid(color='#e6e8ec', linewidth=0.7)
    axes.set_axisbelow(True)


def equal_axes(axes):
    """Set equal scales, and a minimum width and height for a straight edge."""
    limits = np.array([axes.get_xlim(), axes.get_ylim()])
    middle = limits.mean(axis=1)
    half = np.maximum(0.5 * np.ptp(limits, axis=1), 0.5 * FLATTEST * np.ptp(limits, axis=1).max())
    axes.set(xlim=middle[0] + half[0] * SIDES, ylim=middle[1] + half[1] * SIDES, aspect='equal')


def show_contacts(figure, above, side, points, scene):
    """Draw contacts (N, 3) [m] on a surface from above and from the side, with their errors."""
    if not len(points):
        return
    errors, places = 1e6 * scene.surface.distance(points), 1e3 * (points - np.array(scene.top))
    most = max(np.abs(errors).max(), 1.0)
    for axes, first, second, title in (
            (above, 0, 1, 'From above'), (side, 1, 2, 'From the side')):
        dots = axes.scatter(places[:, first], places[:, second], c=errors, s=4, cmap='coolwarm',
                            vmin=-most, vmax=most)
        label(axes, f'{"xyz"[first]} [mm]', f'{"xyz"[second]} [mm]', title)
        axes.set_aspect('equal', adjustable='datalim')
    bar = figure.colorbar(dots, ax=[above, side], pad=0.02)
    bar.set_label('off the true surface [\u00b5m]', fontsize=10)
    bar.ax.tick_params(labelsize=9)
    bar.outline.set_visible(False)


def draw(simulation, path) -> None:
    """Draw the tracked object, the path over it, and errors or force; the suffix is the format."""
    figure = new_figure(10.0, 7.0)
    (_edge if simulation.scene.action == 'track_edge' else _surface)(figure, simulation)
    figure.suptitle(simulation.scene.name)
    figure.savefig(path, facecolor='white')


def _edge(figure, simulation):
    edge, truth = simulation.scene.edge, simulation.truth()
    plan, errors = figure.subplots(1, 2, width_ratios=(1, 1.6))
    outline = np.where(np.repeat(edge.solid, 2)[:, None], np.repeat(
        edge.points, 2, axis=0)[1:-1], np.nan)
    contour = simulation.servo.result().contour
    for points, colour, width, name in (
            (outline, EDGE_COLOUR, 4, 'edge'), (truth.poses[:, :3, 3], BLUE, 1, "pad's centre"),
            (contour, ORANGE, 1, 'rebuilt edge')):
        if points is not None:
            plan.plot(*1e3 * points[:, :2].T, color=colour, linewidth=width, label=name,
                      linestyle=':' if points is contour else '-')
    label(plan, 'x [mm]', 'y [mm]')
    equal_axes(plan)
    figure.legend(loc='outside lower center', ncols=3, fontsize=9.5, frameon=False)
    lateral = 1e3 * truth.lateral
    errors.plot(1e3 * truth.progress[truth.tracking], lateral[truth.tracking], color=BLUE)
    settled = largest(lateral[truth.settled])
    if np.isfinite(settled):
        errors.set_ylim(1.3 * max(settled, 5e-3) * SIDES)
    first = lateral[truth.tracking][:1]
    label(errors, 'tracked length [mm]', 'lateral error [mm]',
          f'Begins at {first[0]:+.2f} mm' if first.size else 'The edge was never touched')


def _surface(figure, simulation):
    truth = simulation.truth()
    above, side, force = figure.subplots(1, 3)
    show_contacts(figure, above, side, simulation.felt(), simulation.scene)
    way = 1e3 * truth.progress[truth.tracking]
    force.plot(way, truth.force[truth.tracking], color=BLUE)
    label(force, 'way [mm]', 'force [N]')
