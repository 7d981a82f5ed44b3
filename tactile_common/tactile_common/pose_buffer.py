"""The last poses of the sensor, and those in between."""
from collections import deque
import math

import numpy as np

from tactile_common.kernels import njit

NS = 1_000_000_000


class PoseBuffer:
    """
    The last poses of the sensor, and those in between.

    Parameters
    ----------
    max_gap : float
        Between poses farther apart nothing is interpolated [s].
    size : int
        Poses kept; at a kilohertz, half a second.
    """

    def __init__(self, max_gap=0.1, size=500):
        self._max_gap = round(max_gap * NS)
        self._poses = deque(maxlen=size)

    def clear(self):
        """Forget all poses."""
        self._poses.clear()

    @property
    def newest_ns(self):
        """Stamp of the newest pose, None without one [ns]."""
        return self._poses[-1][0] if self._poses else None

    def add(self, stamp_ns, pose):
        """Add a pose (4, 4); False, and it is left out, if it is no later than the newest."""
        if self._poses and stamp_ns <= self._poses[-1][0]:
            return False
        self._poses.append((stamp_ns, pose))
        return True

    def at(self, stamp_ns):
        """Pose (4, 4) at a stamp, None where there are no poses close on both sides."""
        after = None
        for stamp, pose in reversed(self._poses):
            if stamp == stamp_ns:
                return pose
            if stamp < stamp_ns:
                if after is None or after[0] - stamp > self._max_gap:
                    return None
                return pose_between(pose, after[1], (stamp_ns - stamp) / (after[0] - stamp))
            after = stamp, pose
        return None


@njit(cache=True)
def pose_between(one, other, share):
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
