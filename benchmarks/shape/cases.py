"""Surfaces, paths, noise and error measures of the shape benchmark."""
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from benchmarks.shape.surfaces import add_noise, cylinder, PLANE, sphere, Torus, Weave
from tactile_shape.types.patch import Kind, Patch

PATCH = (0.02, 0.004)  # m
TRACE = 0.028  # m along the course: a window of 24 mm and a lead-in
NOISE = {'position': 2e-5, 'normal': 5e-4, 'location': 1.5e-4}


@dataclass(frozen=True)
class Case:
    """
    A surface with the required errors.

    Attributes
    ----------
    name : str
    surface : Torus
    kind : Kind
    median, most, right : float
        Requirements: median and 95th percentile of the largest error over 20 x 4 mm [m], and the
        share of patches of the right kind.
    """

    name: str
    surface: Torus
    kind: Kind
    median: float
    most: float
    right: float


PLANE_CASE = Case('plane', PLANE, Kind.PLANE, 12e-6, 3e-5, 0.95)
CYLINDER_CASE = Case(
    'cylinder, radius 32.5 mm', cylinder(0.0325), Kind.CYLINDER, 4e-5, 1e-4, 0.95)
SPHERE_CASE = Case('sphere, radius 35 mm', sphere(0.035), Kind.SPHERE, 3.5e-5, 1e-4, 0.88)
TORUS_CASE = Case(
    'torus, 60 and 25 mm', Torus(0.06, 0.025), Kind.GENERAL, 4.5e-5, 1.1e-4, 0.98)
CASES = (
    PLANE_CASE, CYLINDER_CASE,
    Case('cylinder, radius 100 mm', cylinder(0.1), Kind.CYLINDER, 4e-5, 1e-4, 0.95),
    SPHERE_CASE, Case('sphere, radius 63 mm', sphere(0.063), Kind.SPHERE, 3.5e-5, 1e-4, 0.88),
    TORUS_CASE)


class Trial(NamedTuple):
    """Contacts (N, 3) and normals (N, 3) along a weave."""

    points: np.ndarray
    normals: np.ndarray
    weave: Weave


class Outcome(NamedTuple):
    """Errors (trials,) [m] from `patch_error`, and the patches."""

    errors: np.ndarray
    found: list[Patch]


def trial(case, rng, *, length=TRACE, noise=NOISE, **path):
    """Return noisy contacts along a weave of random heading."""
    if 'heading' not in path:
        path['heading'] = rng.uniform(0.0, np.pi)
    weave = Weave(**path)
    points, normals = weave.trace(case.surface, length)
    if noise:
        points, normals = add_noise(points, normals, rng, **noise)
    return Trial(points, normals, weave)


def patch_error(patch, case, weave):
    """
    Return the largest distance of a patch from the true surface over 20 x 4 mm [m].

    The long side is along the path's course. NaN if the patch is invalid or reports that one of
    its curvatures was not seen.
    """
    if not (patch.valid and patch.seen.all()):
        return np.nan
    return _error(patch, case, [np.cos(weave.heading), np.sin(weave.heading), 0.0])


def error_where_seen(patch, case):
    """Return the same error along a principal direction that was seen; NaN if none was."""
    if not patch.valid:
        return np.nan
    return _error(patch, case, patch.directions[np.argmax(patch.seen)])


def rectangle(patch, direction):
    """Return places (105, 2) of a patch's tangent plane, the long side along a direction (3,)."""
    x, y = patch.directions @ direction
    along, across = (0.5 * side * np.linspace(-1.0, 1.0, count)
                     for side, count in zip(PATCH, (21, 5), strict=True))
    places = np.column_stack([np.repeat(along, len(across)), np.tile(across, len(along))])
    return places @ np.array([[x, y], [-y, x]]) / np.hypot(x, y)


def _error(patch, case, direction):
    error = np.abs(case.surface.distance(patch.sheet(rectangle(patch, direction))))
    return float(error.max()) if np.isfinite(error).all() else np.inf


def run(method, case, trials, rng, **options):
    """Return the outcome of a method over many traces."""
    errors, found = [], []
    for _ in range(trials):
        points, normals, weave = trial(case, rng, **options)
        found.append(method(points, normals))
        errors.append(patch_error(found[-1], case, weave))
    return Outcome(np.array(errors), found)


def spread(errors):
    """Return median and 95th percentile of the finite errors, and the share of NaN."""
    good = errors[np.isfinite(errors)]
    median, most = np.percentile(good, [50, 95]) if len(good) else (np.nan, np.nan)
    return {'median': float(median), 'most': float(most),
            'refused': float(np.mean(np.isnan(errors)))}
