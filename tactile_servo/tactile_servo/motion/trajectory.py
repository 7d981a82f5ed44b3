"""Joint trajectories in the form in which a joint_trajectory_controller takes them."""

from dataclasses import dataclass

import numpy as np

from tactile_common.errors import ConfigurationError


@dataclass(frozen=True, eq=False)
class Trajectory:
    """
    Points of a joint trajectory; the shapes are checked, what they hold is the receiver's affair.

    Parameters
    ----------
    joint_names : tuple of str
        Order of the columns (n joints).
    times : ndarray (K,)
        Times of the points after the start [s].
    positions : ndarray (K, n)
        [rad or m].
    velocities, accelerations : ndarray (K, n), optional
        [rad/s or m/s], [rad/s^2 or m/s^2].
    stamp : float
        Time of the start [s]; 0 means as soon as it is received.

    Raises
    ------
    ConfigurationError
        An array has another shape.

    """

    joint_names: tuple[str, ...]
    times: np.ndarray
    positions: np.ndarray
    velocities: np.ndarray | None = None
    accelerations: np.ndarray | None = None
    stamp: float = 0.0

    def __post_init__(self):
        shape = len(self.times), len(self.joint_names)
        for name in ('positions', 'velocities', 'accelerations'):
            values = getattr(self, name)
            if values is not None and values.shape != shape:
                raise ConfigurationError(
                    f'{name}: shape {values.shape}, must be (points, joints) = {shape}')
