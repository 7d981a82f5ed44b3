"""How well a surface was followed, against the truth of its scene."""
from typing import Any, NamedTuple

import numpy as np

from tactile_simulation.metrics import largest, NAN, rms, roughest
from tactile_simulation.scene_surface import SurfaceScene
from tactile_simulation.surface_objects import normal_at

TOUCHING = 0.05  # of the force, from which there is contact


class SurfaceTruth(NamedTuple):
    """Where the probe really was; arrays (N, ...)."""

    time: np.ndarray  # s
    place: np.ndarray  # (N, 2), of the contact on the pad while it tracks [m]
    force: np.ndarray  # N
    progress: np.ndarray  # that the servo had claimed [m]
    tracking: np.ndarray
    settled: np.ndarray  # from `SETTLING_LENGTH` after first contact


def place_on_pad(scene: SurfaceScene, pose: np.ndarray) -> np.ndarray:
    """Place (2,) on the pad that is nearest to the object, at a pose (4, 4) [m]."""
    rotation = pose[:3, :3]
    centre = pose[:3, 3] + rotation @ scene.dome.centre
    return scene.dome.place(rotation.T @ -normal_at(scene.surface, centre))


def measure_surface(scene: SurfaceScene, truth: SurfaceTruth, contacts: np.ndarray,
                    force: float, accelerations: np.ndarray) -> dict[str, Any]:
    """
    Numbers of a run with a wanted force [N], of the contacts (N, 3) that it felt [m].

    The accelerations (K, n) are those of the joints [rad/s^2].
    """
    errors = scene.surface.distance(contacts) if len(contacts) else np.zeros(0)
    aside, settled = np.hypot(*truth.place.T)[truth.settled], truth.force[truth.settled]
    tracked, fragile = truth.force[truth.tracking], scene.touch.fragile
    return {
        'surface_rms': rms(errors), 'surface_max': largest(errors),
        'centre_rms': rms(aside), 'centre_max': largest(aside),
        'contact_kept': float(np.mean(tracked > TOUCHING * force)) if len(tracked) else 0.0,
        'force_target': force, 'force_mean': float(np.mean(settled)) if len(settled) else NAN,
        'force_rms_error': rms(settled - force), 'force_max': largest(truth.force),
        'joint_acceleration_max': largest(accelerations),
        'joint_acceleration_rms': roughest(accelerations),
        'broken': bool(fragile and largest(truth.force) > fragile)}
