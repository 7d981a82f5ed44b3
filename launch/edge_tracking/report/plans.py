"""A run along the edge of a scene, seen from above: path, rebuilt outline, surface."""
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
import numpy as np

from edge_tracking.recording.run import RunData
from tactile_common.polyline import arc_length
from tactile_shape.cli.plots import draw_model
from tactile_shape.contour.object_model import model_of
from tactile_shape.contour.outline import Outline
from tactile_simulation.edge_world import EdgeScene, EdgeTruth
from tactile_simulation.plot import (
    BLUE,
    EDGE_COLOUR,
    equal_axes,
    GREY,
    label,
    new_figure,
    note,
    ORANGE,
)

# Of the run, shown enlarged [mm].
DETAIL_LENGTH = 30.0


def trajectory(run: RunData, scene: EdgeScene, real: EdgeTruth) -> Figure:
    """Path of the pad over the true edge, seen from above, and its first part enlarged."""
    edge, path = (from_above(scene, points) for points in (
        scene.edge.points, run.poses.position))
    width, height = np.ptp(edge, axis=0)
    beside = height > 0.4 * width
    figure = new_figure(10.0, 4.8 if beside else 5.6)
    whole, detail = figure.subplots(1, 2, width_ratios=(1, 1.2)) if beside else figure.subplots(
        2, 1, height_ratios=(1, 1.5))
    whole.plot(*edge.T, color=EDGE_COLOUR, linewidth=6, solid_capstyle='butt')
    whole.plot(*path[real.tracking].T, color=BLUE, linewidth=1.6)
    _pads(whole, run, scene, real)
    whole.set_aspect('equal')
    label(whole, 'along the first edge [mm]', 'across [mm]', 'From above, equal axes')
    _detail(detail, real)
    return figure


def from_above(scene, points):
    """Return horizontal coordinates [mm], `(N, 2)`, in which the first chord runs along x."""
    along = scene.edge.tangent_at(0.0)[:2]
    along = along / np.linalg.norm(along)
    across = np.array([-along[1], along[0]])
    relative = 1e3 * (np.asarray(points)[:, :2] - scene.edge.points[0, :2])
    return relative @ np.stack([along, across], axis=1)


def _pads(axes, run, scene, real):
    touching, array = np.flatnonzero(real.tracking), run.images.array
    if not touching.size or array is None:
        return
    x, y = array.half_width_x, array.half_width_y
    corners = np.array([[-x, -y, 0, 1], [x, -y, 0, 1], [x, y, 0, 1], [-x, y, 0, 1]])
    for index in touching[[0, -1]]:
        outline = (corners @ run.poses.matrix[index].T)[:, :3]
        axes.add_patch(Polygon(from_above(scene, outline), closed=True, facecolor='#1f5fa812',
                               edgecolor=BLUE, linewidth=1.0))
    axes.autoscale_view()


def _detail(axes, real):
    """Distance from the edge over the first way along it."""
    label(axes, 'along the edge since first contact [mm]', 'centre left of the edge [mm]',
          'The first part, across enlarged')
    touching = np.flatnonzero(real.tracking)
    if not touching.size:
        note(axes, 0.0, 0.0, 'The edge was never touched.')
        return
    first = touching[0]
    way = 1e3 * np.abs(real.along - real.along[first])
    lateral = 1e3 * real.lateral
    axes.axhline(0.0, color=EDGE_COLOUR, linewidth=6, zorder=1)
    axes.plot(way[touching], lateral[touching], color=BLUE, linewidth=1.8)
    axes.plot(way[first], lateral[first], 'o', color=BLUE, markersize=6)
    axes.set_xlim(-0.03 * DETAIL_LENGTH, DETAIL_LENGTH)
    near = lateral[touching][way[touching] <= DETAIL_LENGTH]
    low, high = min(near.min(), 0.0), max(near.max(), 0.0)
    spread = max(high - low, 0.1)
    axes.set_ylim(low - 0.2 * spread, high + 0.2 * spread)
    beyond = -0.1 * spread if abs(low) > high else 0.1 * spread
    note(axes, 0.02 * DETAIL_LENGTH, lateral[first] + beyond,
         f'first contact, {abs(lateral[first]):.2f} mm off', BLUE)
    note(axes, DETAIL_LENGTH, -beyond, 'true edge', GREY, ha='right')
    settled = np.flatnonzero(real.settled)
    if settled.size:
        axes.axvline(way[settled[0]], color=GREY, linewidth=1.0, linestyle=':')
        note(axes, way[settled[0]] + 0.01 * DETAIL_LENGTH, low + 0.6 * spread,
              'the statistics count from here', GREY)


def outline(run: RunData, scene: EdgeScene, found: Outline) -> Figure:
    """Outline rebuilt from touch over the true edge, and how far it is from it."""
    figure = new_figure(10.0, 4.6)
    plan, off = figure.subplots(1, 2, width_ratios=(1.2, 1))
    edge, contour, rebuilt, corners = (from_above(scene, points).T for points in (
        scene.edge.points, run.contour, found.points, found.corners))
    plan.plot(*edge, color=EDGE_COLOUR, linewidth=6, solid_capstyle='butt')
    plan.plot(*contour, '.', color=BLUE, markersize=2.5)
    plan.plot(*rebuilt, color=ORANGE, linewidth=1.2)
    plan.plot(*corners, 'o', color=ORANGE, markersize=5)
    for side in found.sides:
        x, y = from_above(scene, side.points).mean(axis=0)
        text = f'{1e3 * side.length:.2f} mm'
        if side.kind == 'arc':
            text += f', R {1e3 * side.radius:.1f}'
        note(plan, x, y, text, ha='center')
    plan.margins(0.1)
    equal_axes(plan)
    label(plan, 'along the first edge [mm]', 'across [mm]',
          'True edge, contacts (dots), outline (line)')
    lateral, _ = scene.edge.nearest(run.contour)
    off.plot(1e3 * arc_length(run.contour), 1e3 * lateral, color=BLUE, linewidth=1.2)
    label(off, 'along the contour [mm]', 'contacts left of the edge [mm]',
          'Contacts against the true edge')
    return figure


def surface(run: RunData) -> Figure:
    """Patches of the surface that was touched, coloured by what they are."""
    figure = new_figure(7.0, 6.0)
    draw_model(figure.add_subplot(projection='3d'), model_of(run.patches))
    return figure
