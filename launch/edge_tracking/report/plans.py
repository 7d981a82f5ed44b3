"""Where a run went: path of the pad, rebuilt outline, surface."""
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
import numpy as np

from edge_tracking.recording.run import RunData
from tactile_common.polyline import arc_length
from tactile_servo.track_statistics import SETTLING_LENGTH
from tactile_shape.cli.plots import draw_model
from tactile_shape.contour.object_model import model_of
from tactile_shape.contour.outline import Outline
from tactile_simulation.edge_world import EdgeScene, EdgeTruth
from tactile_simulation.plot import (
    BLUE,
    EDGE_COLOUR,
    equal_axes,
    label,
    new_figure,
    note,
    ORANGE,
    show_contacts,
    show_settled,
)
from tactile_simulation.surface_world import SurfaceScene


def trajectory(run: RunData, scene: EdgeScene, real: EdgeTruth) -> Figure:
    """Path of the pad over the true edge, seen from above, with the pad at both ends."""
    line = scene.edge.points
    wide, high = np.ptp(from_above(line, line), axis=0)
    figure = new_figure(10.0, float(np.clip(9.0 * high / wide, 3.4, 7.0)))
    plan = figure.subplots()
    plan.plot(*from_above(line, line).T, color=EDGE_COLOUR, linewidth=6, solid_capstyle='butt')
    plan.plot(*from_above(line, run.poses.position[real.tracking]).T, color=BLUE, linewidth=1.6)
    _pads(plan, run, scene, real)
    equal_axes(plan)
    label(plan, 'along the first edge [mm]', 'across [mm]', 'From above, equal axes')
    return figure


def from_above(line, points):
    """Horizontal coordinates [mm], `(N, 2)`, in which a line begins at 0 and runs along x."""
    along = line[1, :2] - line[0, :2]
    along = along / max(np.linalg.norm(along), 1e-12)
    across = np.array([-along[1], along[0]])
    relative = 1e3 * (np.asarray(points)[:, :2] - line[0, :2])
    return relative @ np.stack([along, across], axis=1)


def _pads(axes, run, scene, real):
    touching, array = np.flatnonzero(real.tracking), run.images.array
    if not touching.size or array is None:
        return
    x, y = array.half_width_x, array.half_width_y
    corners = np.array([[-x, -y, 0, 1], [x, -y, 0, 1], [x, y, 0, 1], [-x, y, 0, 1]])
    for index in touching[[0, -1]]:
        outline = from_above(scene.edge.points, (corners @ run.poses.matrix[index].T)[:, :3])
        axes.add_patch(Polygon(outline, closed=True, facecolor='#1f5fa812', edgecolor=BLUE,
                               linewidth=1.0))
    axes.autoscale_view()


def outline(run: RunData, scene: EdgeScene | None, found: Outline) -> Figure:
    """Outline rebuilt from touch; over the true edge, and how far it is from it, in a scene."""
    figure = new_figure(10.0, 4.6)
    plan, *beside = figure.subplots(1, 2, width_ratios=(1.2, 1)) if scene else (
        figure.subplots(),)
    line = scene.edge.points if scene else found.points
    contour, rebuilt, corners = (from_above(line, points).T for points in (
        run.contour, found.points, found.corners))
    if scene:
        plan.plot(*from_above(line, line).T, color=EDGE_COLOUR, linewidth=6,
                  solid_capstyle='butt')
    plan.plot(*contour, '.', color=BLUE, markersize=2.5)
    plan.plot(*rebuilt, color=ORANGE, linewidth=1.2)
    plan.plot(*corners, 'o', color=ORANGE, markersize=5)
    middle = rebuilt[1].mean()
    for side in found.sides:
        x, y = from_above(line, side.points).mean(axis=0)
        text = f'{1e3 * side.length:.2f} mm'
        if side.kind == 'arc':
            text += f', R {1e3 * side.radius:.1f}'
        up = y >= middle  # beside the line, not on it
        note(plan, x, y, text, ha='center', va='bottom' if up else 'top', xytext=(
            0, 8 if up else -8), textcoords='offset points')
    plan.margins(0.1)
    equal_axes(plan)
    label(plan, 'along the first edge [mm]', 'across [mm]',
          'True edge, contacts (dots), outline (line)' if scene else
          'Contacts (dots), outline (line)')
    if scene:
        off, = beside
        lateral, _ = scene.edge.nearest(run.contour)
        way = arc_length(run.contour)
        off.plot(1e3 * way, 1e3 * lateral, color=BLUE, linewidth=1.2)
        show_settled(off, 1e3 * lateral[way >= SETTLING_LENGTH], 5e-3)
        label(off, 'along the contour [mm]', 'contacts left of the edge [mm]',
              'Contacts against the true edge')
    return figure


def felt(run: RunData, scene: SurfaceScene) -> Figure:
    """Contacts from above and from the side, with their errors."""
    figure = new_figure(10.0, 4.2)
    above, side = figure.subplots(1, 2)
    show_contacts(figure, above, side, run.touches.position, scene)
    return figure


def curvatures(run: RunData) -> Figure:
    """Principal curvatures along the way of the contact."""
    figure = new_figure(10.0, 3.2)
    axes = figure.subplots()
    way = 1e3 * arc_length(np.array([patch.origin for patch in run.patches]))
    for axis, colour in enumerate((BLUE, ORANGE)):
        there = np.array([patch.seen[axis] for patch in run.patches], bool)
        bend = np.array([patch.curvature[axis] for patch in run.patches])
        if there.any():
            axes.plot(way[there], bend[there], '.', color=colour, markersize=2.5,
                      label=('first', 'second')[axis])
            axes.legend(fontsize=9.5, frameon=False)
    label(axes, 'way [mm]', 'principal curvatures [1/m]', 'Curvature, where the path could see it')
    return figure


def surface(run: RunData) -> Figure:
    """Patches of the surface that was touched, coloured by what they are."""
    figure = new_figure(7.0, 6.0)
    draw_model(figure.add_subplot(projection='3d'), model_of(run.patches))
    return figure
