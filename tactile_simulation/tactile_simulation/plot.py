"""Plot of a simulated run: every axis has a unit."""
from typing import Any

from matplotlib.figure import Figure
import numpy as np

from tactile_simulation.metrics import largest

BLUE, ORANGE, EDGE_COLOUR = '#1f5fa8', '#d4691e', '#c9cdd4'


def draw(simulation: Any, path: str) -> None:
    """Draw the tracked object, the path over it, and errors or force; the suffix is the format."""
    figure = Figure(figsize=(10.0, 7.0), dpi=160, layout='constrained')
    (_edge if simulation.scene.action == 'track_edge' else _surface)(figure, simulation)
    figure.suptitle(simulation.scene.name)
    figure.savefig(path)


def _label(axes: Any, xlabel: str, ylabel: str, title: str = '') -> None:
    axes.set(xlabel=xlabel, ylabel=ylabel)
    axes.set_title(title, fontsize=11, loc='left')
    axes.grid(color='#e6e8ec')
    axes.set_axisbelow(True)


def _edge(figure: Figure, simulation: Any) -> None:
    edge, truth = simulation.scene.edge, simulation.truth()
    plan, errors = figure.subplots(1, 2, width_ratios=(1, 1.6))
    outline = np.where(np.repeat(edge.solid, 2)[:, None], np.repeat(
        edge.points, 2, axis=0)[1:-1], np.nan)
    contour = simulation.servo.result().contour
    for points, style, name in (
            (outline, {'color': EDGE_COLOUR, 'linewidth': 4}, 'edge'),
            (truth.poses[:, :3, 3], {'color': BLUE, 'linewidth': 1}, "pad's centre"),
            (contour, {'color': ORANGE, 'linewidth': 1, 'linestyle': ':'}, 'rebuilt edge')):
        if points is not None:
            plan.plot(*1e3 * points[:, :2].T, label=name, **style)
    _label(plan, 'x [mm]', 'y [mm]')
    plan.set_aspect('equal', adjustable='datalim')
    figure.legend(loc='outside lower center', ncols=3, frameon=False)
    lateral = 1e3 * truth.lateral
    errors.plot(1e3 * truth.progress[truth.tracking], lateral[truth.tracking], color=BLUE)
    settled = largest(lateral[truth.settled])
    if np.isfinite(settled):  # the beginning may lie outside of the plot
        errors.set_ylim(1.3 * max(settled, 5e-3) * np.array([-1.0, 1.0]))
    first = lateral[truth.tracking][:1]
    _label(errors, 'tracked length [mm]', 'lateral error [mm]',
           f'Begins at {first[0]:+.2f} mm' if first.size else 'The edge was never touched')


def _surface(figure: Figure, simulation: Any) -> None:
    truth, felt, surface = simulation.truth(), simulation.felt(), simulation.scene.surface
    *views, force = figure.subplots(1, 3)
    errors, places = 1e6 * surface.distance(felt), 1e3 * (felt - np.array(surface.top))
    most = max(np.abs(errors).max(initial=0.0), 1.0)
    for axes, (first, second), title in zip(
            views, ((0, 1), (1, 2)), ('From above', 'From the side'), strict=True):
        dots = axes.scatter(places[:, first], places[:, second], c=errors, s=4, cmap='coolwarm',
                            vmin=-most, vmax=most)
        _label(axes, f'{"xyz"[first]} [mm]', f'{"xyz"[second]} [mm]', title)
        axes.set_aspect('equal', adjustable='datalim')
    figure.colorbar(dots, ax=views, label='off the true surface [\u00b5m]')
    force.plot(1e3 * truth.progress[truth.tracking], truth.force[truth.tracking], color=BLUE)
    _label(force, 'way [mm]', 'force [N]')
