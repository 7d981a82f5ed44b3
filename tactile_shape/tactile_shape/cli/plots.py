"""Plots of patches and contours; the only module that needs matplotlib."""
from os import PathLike
from typing import Any

from matplotlib.figure import Figure
import numpy as np

from tactile_shape.contour.object_model import ObjectModel
from tactile_shape.mesh import COLOURS, mesh_of
from tactile_shape.types.patch import Kind


def draw_patches(path: str | PathLike, position: np.ndarray, records: np.ndarray,
                 model: ObjectModel) -> None:
    """Draw contacts (N, 3) [m] and patches, and curvatures over time; records as of `fit`."""
    figure = Figure(figsize=(11, 4.5), layout='constrained')
    grid = figure.add_gridspec(1, 2, width_ratios=(1.1, 1.0))
    _model(figure.add_subplot(grid[0], projection='3d'), model, position)
    _curvature(figure.add_subplot(grid[1]), records)
    figure.savefig(path, dpi=110)


def _model(axis: Any, model: ObjectModel, samples: np.ndarray) -> None:
    """Draw patches and contacts (N, 3) [m] into 3-D axes, in mm."""
    vertices, colours, faces = mesh_of(model.patches)
    finite = samples[np.isfinite(samples).all(axis=1)][::max(1, len(samples) // 2000)]
    axis.plot(*1e3 * finite.T, '.', ms=1.5, color='black', label='contacts')
    if len(faces):
        from mpl_toolkits.mplot3d.art3d import Poly3DCollection
        axis.add_collection3d(Poly3DCollection(
            1e3 * vertices[faces], facecolors=colours[faces[:, 0]], alpha=0.5))
        for kind in sorted({patch.kind for patch in model.patches}):
            axis.plot([], [], 's', color=COLOURS[kind], label=kind.name.lower())
    points = 1e3 * np.concatenate([vertices, finite])
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
