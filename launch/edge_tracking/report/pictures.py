"""Pictures of a run in a scene: the pad's path, and the pad with its tactile image."""
from os import PathLike
from pathlib import Path
from typing import Any

from matplotlib.patches import Polygon
import numpy as np
from PIL import Image

from edge_tracking.recording.run import RunData
from edge_tracking.report.charts import from_above, pad_outline
from tactile_common.errors import ConfigurationError
from tactile_simulation.edge_world import EdgeScene
from tactile_simulation.plot import (
    BLUE,
    EDGE_COLOUR,
    equal_axes,
    INK,
    label,
    new_figure,
    png,
    show_contacts,
)

RATE = 15.0  # pictures per second, in real time
MOST = 150  # pictures; a longer run is shown faster
MOVED = 1e-4  # m
DPI = 80
COLOURS = 96
NS = 1e-9
ESTIMATE_COLOUR = '#10a4b8'  # on pressures


def picture(run: RunData, scene: Any, real: Any, path: str | PathLike) -> None:
    """Save the main picture of a run as PNG: path over an edge, or contacts on a surface."""
    figure = new_figure(10.0, 4.2)
    if scene.action == 'track_surface':
        above, side = figure.subplots(1, 2)
        show_contacts(figure, above, side, run.touches.position, scene)
    else:
        edge, plan = scene.edge.points, figure.subplots()
        plan.plot(*from_above(edge, edge).T, color=EDGE_COLOUR, linewidth=6,
                  solid_capstyle='butt')
        plan.plot(*from_above(edge, run.poses.position[real.tracking]).T, color=BLUE,
                  linewidth=1.6)
        equal_axes(plan)
        label(plan, 'along the first edge [mm]', 'across [mm]', 'Path of the pad over the edge')
    Path(path).write_bytes(png(figure))


def animate(run: RunData, scene: EdgeScene, path: str | PathLike) -> None:
    """
    Write a run along the edge of a scene as an animated GIF.

    Raises a ConfigurationError if the run has no images with poses, or the file cannot be written.
    """
    chosen = _chosen(run)
    figure = new_figure(10.0, 4.4)
    figure.set_dpi(DPI)
    plan, felt = figure.subplots(1, 2, width_ratios=(1.5, 1))
    update = _draw(plan, felt, run, scene, chosen)
    frames = []
    for index in chosen:
        update(index)
        figure.canvas.draw()
        figure.set_layout_engine('none')  # keep the layout of the first frame
        frames.append(Image.fromarray(np.asarray(figure.canvas.buffer_rgba())[..., :3]))
    palette = frames[len(frames) // 2].quantize(COLOURS, dither=Image.Dither.NONE)
    first, *others = [frame.quantize(palette=palette, dither=Image.Dither.NONE)
                      for frame in frames]
    try:
        first.save(path, format='GIF', save_all=True, append_images=others, optimize=True,
                   duration=round(1e3 / RATE), loop=0)
    except OSError as error:
        raise ConfigurationError(f'{path}: cannot be written: {error.strerror}') from error


def _chosen(run):
    """Return the indices of the images to show: from the first motion on, with known pose."""
    stamps, known = run.images.stamp_ns, run.poses.stamp_ns
    if run.images.array is None or not len(stamps) or not len(known):
        raise ConfigurationError('the recording has no pictures with poses: nothing to animate')
    way = np.linalg.norm(run.poses.position - run.poses.position[0], axis=1)
    first = max(stamps[0], known[np.argmax(way > MOVED)])
    last = min(stamps[-1], known[-1])
    count = int(np.clip(NS * (last - first) * RATE, 1, MOST))
    return np.minimum(np.searchsorted(stamps, np.linspace(first, last, count)), len(stamps) - 1)


def _nearest(stamps, stamp):
    """Return the index of the last stamp that is not after `stamp`; 0 if there is none."""
    return max(int(np.searchsorted(stamps, stamp, side='right')) - 1, 0)


def _draw(plan, felt, run, scene, chosen):
    """Draw the static parts; return the function that draws the image with an index."""
    array, poses, contacts = run.images.array, run.poses, run.contacts
    x, y = array.half_width_x, array.half_width_y
    edge = scene.edge.points
    way = from_above(edge, poses.position)
    plan.plot(*from_above(edge, edge).T, color=EDGE_COLOUR, linewidth=6,
              solid_capstyle='butt')
    path, = plan.plot([], [], color=BLUE, linewidth=1.8)
    pad = plan.add_patch(Polygon(np.zeros((5, 2)), facecolor='#1f5fa830', edgecolor=BLUE))
    plan.update_datalim(np.concatenate([way - 1.5e3 * x, way + 1.5e3 * x]))
    plan.autoscale_view()
    plan.set_aspect('equal')
    label(plan, 'along the first edge [mm]', 'across [mm]', 'The pad over the edge')
    top = float(np.nanmax(run.images.frames[chosen], initial=0.0))
    scale, unit = (1e-3, 'kPa') if run.images.unit == 'Pa' else (1.0, run.images.unit)
    felt.set_facecolor('#dfe2e7')  # invalid tactels
    shown = felt.imshow(
        np.zeros(array.shape), origin='lower', cmap='magma_r', interpolation='nearest',
        extent=(-1e3 * x, 1e3 * x, -1e3 * y, 1e3 * y), vmin=0.0, vmax=max(scale * top, 1e-9))
    line, = felt.plot([], [], color=ESTIMATE_COLOUR, linewidth=2.2)
    label(felt, 'x [mm]', 'y [mm]')
    felt.grid(False)
    along = 2.0 * np.hypot(x, y) * np.array([-1.0, 1.0])  # [m], beyond the pad
    dark = f'What it feels (darkest: {scale * top:.0f} {unit})'

    def update(index):
        stamp = run.images.stamp_ns[index]
        here = _nearest(poses.stamp_ns, stamp)
        path.set_data(*way[:here + 1].T)
        pad.set_xy(from_above(edge, pad_outline(array, poses.matrix[here])))
        shown.set_data(scale * np.ma.masked_invalid(run.images.frames[index]))
        line.set_data([], [])
        text = dark
        if len(contacts.stamp_ns) and stamp >= contacts.stamp_ns[0]:
            k = _nearest(contacts.stamp_ns, stamp)
            if contacts.valid[k] and np.isfinite(contacts.yaw[k]):
                line.set_data(1e3 * (contacts.x[k] - along * np.sin(contacts.yaw[k])),
                              1e3 * (contacts.y[k] + along * np.cos(contacts.yaw[k])))
            if contacts.force_valid[k]:
                text += f'; {contacts.normal_force[k]:.1f} N'
        felt.set_title(text, fontsize=11, loc='left', color=INK)
    return update
