"""The closed loop on a surface, and how well it was followed."""
from typing import Any, NamedTuple

import numpy as np

from tactile_servo.laws.surface_goal import SurfaceGoal
from tactile_servo.track_statistics import SETTLING_LENGTH
from tactile_servo.types import State
from tactile_simulation.closed_loop import Simulation
from tactile_simulation.metrics import largest, NAN, percentile, rms, state_history
from tactile_simulation.scene_surface import SurfaceScene
from tactile_simulation.surface_objects import normal_at

LAW = 'tactile_jacobian'
TOUCHING = 0.05  # of the force, from which there is contact


class SurfaceTruth(NamedTuple):
    """Where the probe really was, at each cycle; arrays (N, ...)."""

    time: np.ndarray  # s
    place: np.ndarray  # (N, 2), of the contact on the pad [m]
    force: np.ndarray  # N
    progress: np.ndarray  # m
    tracking: np.ndarray
    settled: np.ndarray  # from `SETTLING_LENGTH` after first contact


class SurfaceSimulation(Simulation):
    """A servo that follows the surface of a scene, see `Simulation`."""

    def __init__(self, scene: SurfaceScene, tracker: str = LAW, **keywords):
        super().__init__(scene, tracker, **keywords)

    def surface_truth(self) -> SurfaceTruth:
        """Where the probe really was."""
        scene, log = self.scene, self.log
        places = np.full((len(log), 2), np.nan)
        for k, cycle in enumerate(log):
            if cycle.status.state == State.TRACK:
                centre = cycle.pose[:3, 3] + cycle.pose[:3, :3] @ scene.dome.centre
                inward = -normal_at(scene.surface, centre)
                places[k] = scene.dome.place(cycle.pose[:3, :3].T @ inward)
        time, force, progress = np.array([
            (cycle.time, cycle.force, cycle.status.progress) for cycle in log]).T
        tracking = np.array([cycle.status.state == State.TRACK for cycle in log])
        return SurfaceTruth(time, places, force, progress, tracking,
                            tracking & (progress >= SETTLING_LENGTH))


def surface_errors(simulation: SurfaceSimulation) -> np.ndarray:
    """Distances (N,) of the contacts that were felt from the true surface [m]."""
    contour = simulation.servo.result().contour
    return np.zeros(0) if contour is None else simulation.scene.surface.distance(contour)


def summarise_surface(simulation: SurfaceSimulation, goal: SurfaceGoal, status, *, seed: int,
                      elapsed: float = NAN) -> dict[str, Any]:
    """Summary of a run with the keys and SI units of every command."""
    truth = simulation.surface_truth()
    errors = surface_errors(simulation)
    aside = np.hypot(*truth.place.T)
    scene, settled = simulation.scene, truth.settled
    fragile = scene.touch.fragile
    broken = bool(fragile and truth.force.max() > fragile)
    tracked = truth.force[truth.tracking]
    return {
        'ok': bool(simulation.servo.success) and not broken,
        'state': status.state.name.lower(), 'reason': status.reason.text,
        'reason_code': status.reason.code.name.lower(), 'scene': scene.name,
        'controller': simulation.servo.law.name, 'seed': seed, 'speed': goal.speed,
        'tracked_length': status.progress, 'surface_rms': rms(errors),
        'surface_max': largest(errors) if len(errors) else NAN,
        'centre_rms': rms(aside[settled]), 'centre_max': largest(aside[settled])
        if settled.any() else NAN,
        'contact_kept': float(np.mean(tracked > TOUCHING * goal.force)) if len(tracked) else 0.0,
        'force_target': goal.force, 'force_mean': float(np.mean(truth.force[settled]))
        if settled.any() else NAN,
        'force_rms_error': rms(truth.force[settled] - goal.force),
        'force_max': float(truth.force.max()), 'broken': broken,
        'duration': float(np.ptp(truth.time)),
        'real_time_factor': float(np.ptp(truth.time)) / elapsed,
        'sensor_rate': simulation.sensor_rate, 'control_rate': simulation.control_rate,
        'latency_p50': simulation.latency, 'latency_p99': simulation.latency,
        'cpu_per_cycle': percentile(simulation.cycle_costs),
        'cpu_per_picture': percentile(simulation.picture_costs),
        'states': state_history(simulation)}
