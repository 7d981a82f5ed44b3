"""The closed loop on a surface, and how well it was followed."""
from typing import Any

import numpy as np

from tactile_servo.laws.registry import law_for
from tactile_servo.laws.surface_goal import SurfaceGoal
from tactile_servo.track_statistics import SETTLING_LENGTH
from tactile_servo.types import State
from tactile_simulation.closed_loop import Simulation
from tactile_simulation.metrics import NAN, percentile, state_history
from tactile_simulation.scene_surface import SurfaceScene
from tactile_simulation.surface_metrics import measure_surface, place_on_pad, SurfaceTruth


class SurfaceSimulation(Simulation):
    """A servo that follows the surface of a scene, see `Simulation`."""

    def __init__(self, scene: SurfaceScene, tracker: str | None = None, **keywords):
        super().__init__(scene, law_for(scene.action, tracker), **keywords)

    def surface_truth(self) -> SurfaceTruth:
        """Where the probe really was, at each cycle."""
        log = self.log
        places = np.array([
            place_on_pad(self.scene, cycle.pose) if cycle.status.state == State.TRACK
            else (NAN, NAN) for cycle in log])
        time, force, progress = np.array([
            (cycle.time, cycle.force, cycle.status.progress) for cycle in log]).T
        tracking = np.array([cycle.status.state == State.TRACK for cycle in log])
        return SurfaceTruth(time, places, force, progress, tracking,
                            tracking & (progress >= SETTLING_LENGTH))

    @property
    def contacts(self) -> np.ndarray:
        """Contacts (N, 3) that were felt [m]."""
        contour = self.servo.result().contour
        return np.zeros((0, 3)) if contour is None else contour


def summarise_surface(simulation: SurfaceSimulation, goal: SurfaceGoal, status, *, seed: int,
                      elapsed: float = NAN) -> dict[str, Any]:
    """Summary of a run with the keys and SI units of every command."""
    scene, truth = simulation.scene, simulation.surface_truth()
    measured = measure_surface(scene, truth, simulation.contacts, goal.force,
                               simulation.accelerations())
    return {
        'ok': bool(simulation.servo.success) and not measured['broken'],
        'state': status.state.name.lower(), 'reason': status.reason.text,
        'reason_code': status.reason.code.name.lower(), 'scene': scene.name,
        'controller': simulation.servo.law.name, 'seed': seed, 'speed': goal.speed,
        'tracked_length': status.progress, **measured,
        'duration': float(np.ptp(truth.time)),
        'real_time_factor': float(np.ptp(truth.time)) / elapsed,
        'sensor_rate': simulation.sensor_rate, 'control_rate': simulation.control_rate,
        'latency_p50': simulation.latency, 'latency_p99': simulation.latency,
        'cpu_per_cycle': percentile(simulation.cycle_costs),
        'cpu_per_picture': percentile(simulation.picture_costs),
        'states': state_history(simulation)}
