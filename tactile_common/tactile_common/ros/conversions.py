"""Conversions between ROS messages of time and pose and the values used by the core."""
from collections.abc import Iterable
from enum import Enum
import math
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Pose
import numpy as np

from tactile_common.errors import TactileError
from tactile_common.state_buffer import NS


def set_stamp(stamp: Any, nanoseconds: int) -> None:
    """Set the fields of a stamp or duration to a time [ns]."""
    stamp.sec, stamp.nanosec = divmod(nanoseconds, NS)


def stamp_from_ns(nanoseconds: int) -> Time:
    """Return the stamp of a time [ns]."""
    seconds, rest = divmod(int(nanoseconds), NS)
    return Time(sec=seconds, nanosec=rest)


def stamp_to_ns(stamp: Any) -> int:
    """Convert a stamp or duration to nanoseconds."""
    return stamp.sec * NS + stamp.nanosec


def stamp_to_seconds(stamp: Any) -> float:
    """Convert a stamp or duration to seconds."""
    return stamp.sec + 1e-9 * stamp.nanosec


def name_in(kind: Iterable[Enum], number: int) -> str:
    """Return the name in an enumeration of a message's number; of an unknown one its digits."""
    return next((it.name.lower() for it in kind if it.value == number), str(number))


def pose_from_msg(pose: Any) -> np.ndarray:
    """
    Convert a geometry_msgs/Pose to a homogeneous transform (4, 4) [m].

    Raises a TactileError if the length of the quaternion differs from 1 by more than 1e-3, or if a
    number is not finite.
    """
    x, y, z, w = (getattr(pose.orientation, axis) for axis in 'xyzw')
    position = tuple(getattr(pose.position, axis) for axis in 'xyz')
    square = x * x + y * y + z * z + w * w
    if not (abs(square - 1.0) < 2e-3 and all(map(math.isfinite, position))):
        raise TactileError(
            f'pose: quaternion ({x:.4g}, {y:.4g}, {z:.4g}, {w:.4g}) at {position}, must be '
            'finite and of length 1')
    s = 2.0 / square
    return np.array([
        [1.0 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y), position[0]],
        [s * (x * y + w * z), 1.0 - s * (x * x + z * z), s * (y * z - w * x), position[1]],
        [s * (x * z - w * y), s * (y * z + w * x), 1.0 - s * (x * x + y * y), position[2]],
        [0.0, 0.0, 0.0, 1.0]])


def pose_to_msg(matrix: np.ndarray, into: Pose | None = None) -> Pose:
    """Convert a homogeneous transform (4, 4) [m] to a Pose message; NaN values stay NaN."""
    pose = Pose() if into is None else into
    place, turn = pose.position, pose.orientation
    place.x, place.y, place.z = matrix[:3, 3].tolist()
    turn.x, turn.y, turn.z, turn.w = quaternion(matrix[:3, :3])
    return pose


def quaternion(rotation: np.ndarray) -> tuple[float, float, float, float]:
    """Convert a rotation matrix (3, 3) to a quaternion (x, y, z, w), by its largest component."""
    (a, b, c), (d, e, f), (g, h, i) = rotation.tolist()
    # Four times the products of each component with all four; the diagonal are their squares.
    products = ((1.0 + a - e - i, b + d, c + g, h - f), (b + d, 1.0 - a + e - i, f + h, c - g),
                (c + g, f + h, 1.0 - a - e + i, d - b), (h - f, c - g, d - b, 1.0 + a + e + i))
    largest = max(range(4), key=lambda k: products[k][k])
    x, y, z, w = (0.5 * value / math.sqrt(products[largest][largest])
                  for value in products[largest])
    return x, y, z, w
