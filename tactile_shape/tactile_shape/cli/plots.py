"""Pictures of patches and contours; the only module that needs matplotlib."""
from os import PathLike
from typing import Any

from matplotlib.figure import Figure
import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_shape.contact_recording import ContactRecording
from tactile_shape.contour.object_model import COLOURS, ObjectModel
from tactile_shape.patch_table import PatchTable
from tactile_shape.types.patch import Kind


def draw_patches(path: str | PathLike, recording: ContactRecording, table: PatchTable,
                 model: ObjectModel) -> None:
    """
    Draw samples and patches, curvatures, and the error where it is known.

    ConfigurationError if the file cannot be written, or matplotlib does not know its format.
    """
    known = np.isfinite(table.errors).any()
    figure = Figure(figsize=(11, 6 if known else 4.5), layout='constrained')
    grid = figure.add_gridspec(2 if known else 1, 2, width_ratios=(1.1, 1.0))
    draw_model(figure.add_subplot(grid[:, 0], projection='3d'), model, recording.position)
    _curvature(figure.add_subplot(grid[0, 1]), table.records)
    if known:
        axis = figure.add_subplot(grid[1, 1])
        axis.semilogy(recording.t, 1e3 * table.errors, '.', ms=2, color='#0b6e99')
        axis.set(xlabel='time [s]', ylabel='error over 20×4 mm [mm]')
        axis.grid(alpha=0.3)
    try:
        figure.savefig(path, dpi=110)
    except (OSError, ValueError) as error:
        raise ConfigurationError(f'{path}: cannot be drawn: {error}') from error


def draw_model(axis: Any, model: ObjectModel, samples: np.ndarray | None = None) -> None:
    """Draw an object model, and contacts (N, 3) [m] if given, into 3-D axes, in mm."""
    vertices, colours, faces = model.mesh()
    shown = [vertices, model.contour]
    if samples is not None:
        finite = samples[np.isfinite(samples).all(axis=1)][::max(1, len(samples) // 2000)]
        axis.plot(*1e3 * finite.T, '.', ms=1.5, color='black', label='contacts')
        shown.append(finite)
    else:
        for stroke in model.strokes:
            axis.plot(*1e3 * np.array(stroke).T, color='black', lw=1)
    if len(faces):
        from mpl_toolkits.mplot3d.art3d import Poly3DCollection
        axis.add_collection3d(Poly3DCollection(
            1e3 * vertices[faces], facecolors=colours[faces[:, 0]], alpha=0.5))
        for kind in sorted({patch.kind for patch in model.patches}):
            axis.plot([], [], 's', color=COLOURS[kind], label=kind.name.lower())
    points = 1e3 * np.concatenate(shown)
    if len(points):
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
        half = 0.5 * max(np.ptp(points, axis=0).max(), 1.0)
        axis.set(**{f'{name}lim': (place - half, place + half)
                    for name, place in zip('xyz', middle, strict=True)})
    axis.set(xlabel='x [mm]', ylabel='y [mm]', zlabel='z [mm]')
    axis.legend(loc='upper left', fontsize=8)


def _curvature(axis: Any, records: np.ndarray) -> None:
    t = records['t']
    for column, colour in ((0, '#0b6e99'), (1, '#c05a00')):
        good = records['valid'] & records['seen'][:, column]
        value = np.where(good, records['curvature'][:, column], np.nan)
        std = np.sqrt(np.where(good, records['covariance'][:, column, column], np.nan))
        axis.fill_between(t, value - 2 * std, value + 2 * std, color=colour, alpha=0.25, lw=0)
        axis.plot(t, value, '.', ms=2, color=colour,
                  label=f'{("first", "second")[column]}, ±2 standard deviations')
    bottom = axis.get_ylim()[0]
    for kind in Kind:
        here = t[records['kind'] == kind]
        if len(here):
            axis.plot(here, np.full(len(here), bottom), 's', ms=4, color=COLOURS[kind])
    axis.set(xlabel='time [s]', ylabel='curvature seen [1/m]')
    axis.legend(fontsize=8)
    axis.grid(alpha=0.3)
