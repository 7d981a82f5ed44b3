"""The last poses of the sensor, and those in between."""
import math

import numpy as np

from tactile_common.kernels import njit
from tactile_common.state_buffer import StateBuffer

NS = 1_000_000_000
RESTART = 10  # gaps that a recording which begins anew is behind its end


class PoseBuffer(StateBuffer[np.ndarray]):
    """
    The last poses (4, 4) of the sensor, and those in between.

    Parameters
    ----------
    max_gap : float
        Between poses farther apart nothing is interpolated [s].
    size : int
        Poses kept; at a kilohertz, half a second.
    """

    def __init__(self, max_gap: float = 0.1, size: int = 500):
        gap = round(max_gap * NS)
        super().__init__(pose_between, size=size, max_gap_ns=gap, restart_ns=RESTART * gap)


@njit(cache=True)
def pose_between(one: np.ndarray, other: np.ndarray, share: float) -> np.ndarray:
    """
    Pose (4, 4) on the way between two: position and rotation each at constant velocity.

    Half a turn between them has no direction; neither is there one in practice.
    """
    turn = np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            for k in range(3):
                turn[i, j] += one[k, i] * other[k, j]
    x, y = 0.5 * (turn[2, 1] - turn[1, 2]), 0.5 * (turn[0, 2] - turn[2, 0])
    z = 0.5 * (turn[1, 0] - turn[0, 1])
    sine, angle = math.sqrt(x * x + y * y + z * z), 0.0
    if sine > 1e-12:
        angle = share * math.atan2(sine, 0.5 * (turn[0, 0] + turn[1, 1] + turn[2, 2] - 1.0))
        x, y, z = x / sine, y / sine, z / sine
    pose = np.eye(4)
    s, c = math.sin(angle), math.cos(angle)
    rows = ((c + (1.0 - c) * x * x, (1.0 - c) * x * y - s * z, (1.0 - c) * x * z + s * y),
            ((1.0 - c) * x * y + s * z, c + (1.0 - c) * y * y, (1.0 - c) * y * z - s * x),
            ((1.0 - c) * x * z - s * y, (1.0 - c) * y * z + s * x, c + (1.0 - c) * z * z))
    for i in range(3):
        for j in range(3):
            pose[i, j] = (one[i, 0] * rows[0][j] + one[i, 1] * rows[1][j]
                          + one[i, 2] * rows[2][j])
        pose[i, 3] = one[i, 3] + share * (other[i, 3] - one[i, 3])
    return pose
