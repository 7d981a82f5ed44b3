"""Joint trajectories as a joint_trajectory_controller takes them."""

from dataclasses import dataclass

import numpy as np

from tactile_common.errors import ConfigurationError


@dataclass(eq=False)  # not frozen: one is made every cycle
class Trajectory:
    """
    Points of a joint trajectory; the shapes are checked, what they hold is the receiver's affair.

    Raises ConfigurationError where an array has another shape.
    """

    joint_names: tuple[str, ...]  # n, the order of the columns
    times: np.ndarray  # (K,) after the start [s]
    positions: np.ndarray  # (K, n) [rad or m]
    velocities: np.ndarray | None = None  # (K, n) [rad/s or m/s]
    accelerations: np.ndarray | None = None  # (K, n) [rad/s^2 or m/s^2]
    stamp_ns: int = 0  # of the start, in the robot's clock; 0 means as soon as it is received

    def __post_init__(self) -> None:
        shape = len(self.times), len(self.joint_names)
        for name in ('positions', 'velocities', 'accelerations'):
            values = getattr(self, name)
            if values is not None and values.shape != shape:
                raise ConfigurationError(
                    f'{name}: shape {values.shape}, must be (points, joints) = {shape}')
