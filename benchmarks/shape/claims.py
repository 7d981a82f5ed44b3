"""How far patches are as certain as they claim: errors of curvatures over their deviations."""
from typing import NamedTuple

import numpy as np

from benchmarks.shape import cases, methods
from tactile_servo.laws.surface_goal import Pattern, SurfaceGoal
from tactile_shape.local_surface.local_quadric import LocalQuadric
from tactile_shape.types.patch import Kind
from tactile_simulation.closed_loop import Simulation

STEP = 2e-4  # m, of the differences that give the true curvature
ALIKE = (0.0, 4.0, 20.0)  # contacts over which successive errors are alike
SCENES = {'plane': Kind.PLANE, 'cylinder_120': Kind.CYLINDER, 'sphere_126': Kind.SPHERE,
          'torus': Kind.GENERAL}
GOAL = SurfaceGoal(0.08, 3.0, Pattern.RASTER, (0.83, 0.56, 0.0), size=(0.024, 0.012),
                   step_over=0.003)
LEAD, EVERY = 200, 5  # contacts until the first patch, and from patch to patch


class Claims(NamedTuple):
    """Errors of the seen curvatures over their standard deviations (N,), and the patches."""

    scores: np.ndarray
    found: list


def claims_of(found, solid):
    """Return the Claims of patches; `solid` gives the signed distances of points."""
    scores = []
    for patch in found:
        for seen, direction, curvature, variance in zip(
                patch.seen, patch.directions, patch.curvature, np.diag(patch.covariance),
                strict=True):
            if patch.valid and seen:
                at = patch.origin + STEP * np.outer([-1.0, 0.0, 1.0], direction)
                true = np.diff(solid.distance(at), 2).item() / STEP**2
                scores.append((curvature - true) / np.sqrt(variance))
    return Claims(np.array(scores), found)


def with_noise(case, alike, trials, rng):
    """Return the Claims after random paths, whose errors are alike over some contacts."""
    found = cases.run(methods.local_quadric(), case, trials, rng,
                      noise={**cases.NOISE, 'alike': alike}).found
    return claims_of(found, case.surface)


def in_the_loop(scene, seed=0):
    """Return the Claims while the servo follows a raster over a scene's surface."""
    simulation, estimator, found = Simulation(scene, seed=seed), LocalQuadric(), []
    stamps = []

    def take(_):
        touch = simulation.servo.law.touch
        if touch and touch.stamp_ns not in stamps[-1:]:
            stamps.append(touch.stamp_ns)
            patch = estimator.update(touch.point, touch.normal)
            if len(stamps) > LEAD and len(stamps) % EVERY == 0:
                found.append(patch)
        return False

    simulation.run(GOAL, 60.0, take)
    return claims_of(found, scene.surface)
