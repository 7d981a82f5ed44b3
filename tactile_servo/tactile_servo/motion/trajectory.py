"""Joint trajectories for a joint_trajectory_controller."""

from dataclasses import dataclass

import numpy as np


@dataclass(eq=False)  # not frozen: one is made every cycle
class Trajectory:
    """Points of a joint trajectory."""

    joint_names: tuple[str, ...]  # n, the order of the columns
    times: np.ndarray  # (K,), since the start [s]
    positions: np.ndarray  # (K, n) [rad or m]
    velocities: np.ndarray | None = None  # (K, n) [rad/s or m/s]
    accelerations: np.ndarray | None = None  # (K, n) [rad/s^2 or m/s^2]
    stamp_ns: int = 0  # start in the robot's clock [ns]; 0 means start on reception
