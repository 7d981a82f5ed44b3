"""
Estimator of the simplest surface that explains positions and normals along a path.

The thesis (chapter 4) determines ten parameters from a few contacts. This estimator determines
only the three numbers of the curvature K, in the tangent frame at the newest contact, from a whole
window of travel; height and slope are by-products. For a round finger it estimates the surface of
the finger's centre, which has no location error, and converts the curvature at the end.
"""
from dataclasses import dataclass
import math
from typing import Any

import numpy as np

from tactile_common.config import bounded, check_fields
from tactile_shape.local_surface.curvature_fit import CurvatureFit, ENOUGH, fit_curvature, Noise
from tactile_shape.types.patch import (
    certain_enough,
    MAX_CURVATURE_STD,
    NORMAL_NOISE,
    Patch,
    SurfaceEstimator,
)
from tactile_shape.types.tangent import tangent_frame

CELLS = 24  # usual number of cells in a window
MAX_CELLS = 3 * CELLS  # with noise, cells are shorter than intended
MAX_TURN = 0.7  # rad, largest turn of the normal within a window
# Smallest length of a cell, as a multiple of the noise of a contact's place, which would lengthen
# a path of shorter cells.
CELL_NOISE = 5.0
MAX_WEIGHT = 16.0  # largest number of independent contacts per cell, for a finger at rest
MISFIT = 2.0  # scatter per given position noise; above it, the newer half of the window is tried
BETTER = 0.6  # scatter of the newer half, as a share of that of all cells, below which it is used
SCATTERED = 0.3  # largest scatter of contacts on a surface, as a share of a cell's length
MAX_RESIDUAL = 4.0  # standard deviations, largest RMS residual of a valid patch
# m, assumed indentation of the skin, about that at 5 N: contacts lie on its undeformed surface.
YIELD = 1e-3
# Largest curvature of the surface of the finger's centre, as a share of 1 / finger radius; more is
# an edge or a point.
SHARP = 0.98


@dataclass(frozen=True)
class LocalQuadricConfig:
    """Settings of the estimator of local curvature."""

    window: float = bounded(
        0.024, 'length of the path that a patch is fitted to', 'm', 1e-4, 1.0)
    finger_radius: float = bounded(0.0, 'radius of a round finger; 0 = flat pad', 'm', 0.0, 1.0)
    position_noise: float = bounded(
        2e-5, "standard deviation of the pose's position, per axis", 'm', 1e-9, 0.1)
    location_noise: float = bounded(
        1.5e-4, 'standard deviation of the contact on the pad, per axis', 'm', 0.0, 0.1)

    def __post_init__(self) -> None:
        check_fields(self)


class LocalQuadric(SurfaceEstimator):
    """
    Estimates the surface at each new contact of a path.

    Contacts within one cell, usually a 24th of the window, are averaged. This bounds time and
    memory however slowly the finger moves, and prevents noise from lengthening the path. The
    window ends where the normal has turned by more than `MAX_TURN`.
    """

    method = 'local_quadric'

    def __init__(self, config: LocalQuadricConfig | None = None):
        self.config = config or LocalQuadricConfig()
        c = self.config
        on_finger = c.location_noise / c.finger_radius if c.finger_radius else 0.0
        self._noise = Noise(
            c.position_noise, c.location_noise, math.hypot(NORMAL_NOISE, on_finger),
            c.finger_radius * NORMAL_NOISE)
        # Contacts nearer than this are averaged [m].
        self._cell = max(
            c.window / CELLS, CELL_NOISE * math.hypot(c.position_noise, c.location_noise))
        self.reset()

    def reset(self) -> None:  # noqa: D102
        # Mean centre of the finger, mean normal and number of contacts of each cell, oldest first.
        self._kept = np.empty((0, 7))
        self._cells = self._kept  # those of the window
        self._start = np.full(3, np.nan)  # first centre of the newest cell

    def add(self, position: np.ndarray, normal: np.ndarray) -> None:  # noqa: D102
        self._normal = normal
        self._centre = position - self.config.finger_radius * normal
        contact = np.concatenate([self._centre, normal])
        away = self._centre - self._start
        if away @ away < self._cell**2:  # false for the first contact: start is NaN
            newest = self._kept[-1]
            newest[6] += 1.0
            newest[:6] += (contact - newest[:6]) / newest[6]
        else:
            self._kept = np.vstack([self._kept[1 - MAX_CELLS:], [*contact, 1.0]])
            self._start = self._centre
        normals = self._kept[:, 3:6]
        # From the newest cell backwards.
        travel = np.cumsum(_steps(self._kept)[::-1])
        lengths = np.sqrt((normals * normals).sum(axis=1))
        turned = normals @ normals[-1] < np.cos(MAX_TURN) * lengths * lengths[-1]
        beyond = (travel > self.config.window) | turned[-2::-1]
        steps = int(beyond.argmax()) if beyond.any() else len(beyond)
        self._cells = self._kept[len(self._kept) - 1 - steps:]

    def estimate(self) -> Patch:  # noqa: D102
        if not len(self._cells):
            return self.refused('no contact yet')
        cells, fit = self._best_fit()
        extent = float(_steps(cells).sum())
        known: dict[str, Any] = {
            'extent': extent, 'samples': int(cells[:, 6].sum()), 'residual': fit.residual,
            'frame': _frame(self._centre, fit, self.config.finger_radius)}
        if fit.scatter > SCATTERED * self._cell or fit.residual > MAX_RESIDUAL:
            return self.refused(
                'no surface of second order fits the contacts, or their noise is far above the '
                f'given one: they scatter by {1e3 * fit.scatter:.2g} mm, residuals are '
                f'{fit.residual:.2g} standard deviations', **known)
        curvature, covariance, variance = np.array(fit.principal[:2]), fit.covariance, fit.seen
        radius = self.config.finger_radius
        if radius:
            # The finger's centre moves on a surface whose radii are larger by the finger's radius;
            # over an edge its radius is the finger's.
            shrink = 1.0 - radius * curvature
            if shrink.min() < 1.0 - SHARP:
                return self.refused('an edge or a point: its curvature is above what a finger of '
                                    'this radius can measure', **known)
            curvature = curvature / shrink
            covariance = covariance / np.outer(shrink, shrink)**2
            variance = variance / shrink**4
        shift = YIELD * curvature**2
        known |= {'curvature': curvature, 'covariance': covariance + np.outer(shift, shift)}
        seen = certain_enough(variance, curvature)
        if seen.any():
            return Patch(fit.kind, True, '', self.method, seen=seen, **known)
        why = 'too short, or too noisy, to show any curvature'
        if fit.along < MAX_CURVATURE_STD**2:
            why = 'straight and along no principal direction: the curvature across is unseen'
        return self.refused(f'the path of {1e3 * extent:.2g} mm is {why}', **known)

    def _best_fit(self) -> tuple[np.ndarray, CurvatureFit]:
        """Fit all cells, or only the newer half if the older cells lie on another surface."""
        cells, newer = self._cells, self._cells[(len(self._cells) + 1) // 2:]
        fit = self._fit(cells)
        if fit.scatter > MISFIT * self._noise.position and len(cells) >= 2 * ENOUGH:
            fit_of_newer = self._fit(newer)
            if fit_of_newer.scatter < BETTER * fit.scatter:
                return newer, fit_of_newer
        return cells, fit

    def _fit(self, cells: np.ndarray) -> CurvatureFit:
        return fit_curvature(
            cells[:, :3] - self._centre, cells[:, 3:6], np.minimum(cells[:, 6], MAX_WEIGHT),
            tangent_frame(self._normal), self._noise)


def _steps(cells: np.ndarray) -> np.ndarray:
    """Return the distances (m - 1,) between successive cells (m, 7) [m]."""
    steps = np.diff(cells[:, :3], axis=0)
    return np.sqrt((steps * steps).sum(axis=1))


def _frame(centre: np.ndarray, fit: CurvatureFit, radius: float) -> np.ndarray:
    """Return the contact frame's pose: fitted origin and normal, x along the first direction."""
    normal = fit.axes @ [-fit.slope[0], -fit.slope[1], 1.0]
    normal /= np.linalg.norm(normal)
    x = fit.axes[:, :2] @ [math.cos(fit.principal.heading), math.sin(fit.principal.heading)]
    x -= (x @ normal) * normal
    x /= np.linalg.norm(x)
    frame = np.eye(4)
    frame[:3, :3] = np.column_stack([x, np.cross(normal, x), normal])
    frame[:3, 3] = centre + fit.height * fit.axes[:, 2] + radius * normal
    return frame
