"""Time and place in messages, and back."""
from builtin_interfaces.msg import Duration, Time
from geometry_msgs.msg import Pose
import numpy as np
import pytest

from tactile_common.errors import TactileError
from tactile_common.ros.conversions import (
    pose_from_msg,
    pose_to_msg,
    set_stamp,
    stamp_from_ns,
    stamp_to_ns,
    stamp_to_seconds,
)

RNG = np.random.default_rng(5)


@pytest.mark.parametrize('nanoseconds', [0, 1, 999_999_999, 1_000_000_000, 17_000_000_000_000_001])
def test_stamps(nanoseconds):
    stamp = stamp_from_ns(nanoseconds)
    assert stamp_to_ns(stamp) == nanoseconds
    assert stamp_to_seconds(stamp) == pytest.approx(nanoseconds * 1e-9)
    filled = Time(sec=9, nanosec=9)
    set_stamp(filled, nanoseconds)
    assert filled == stamp


def test_durations_are_stamps_as_well():
    assert stamp_to_ns(Duration(sec=-1, nanosec=500_000_000)) == -500_000_000
    assert stamp_from_ns(-500_000_000) == Time(sec=-1, nanosec=500_000_000)


def _rotation(axis, angle):
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


@pytest.mark.parametrize('angle', [0.0, 1e-9, 0.3, 2.0, np.pi - 1e-6, np.pi, -2.5])
def test_pose_round_trip(angle):
    for axis in [*np.eye(3), *RNG.normal(size=(20, 3))]:
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = _rotation(axis, angle), RNG.normal(size=3)
        np.testing.assert_allclose(pose_from_msg(pose_to_msg(matrix)), matrix, atol=1e-14)


def test_quarter_turn_about_z_has_the_usual_quaternion():
    matrix = np.eye(4)
    matrix[:3, :3] = _rotation(np.array([0.0, 0.0, 1.0]), np.pi / 2)
    q = pose_to_msg(matrix).orientation
    np.testing.assert_allclose([q.x, q.y, q.z, q.w], [0, 0, 0.5**0.5, 0.5**0.5], atol=1e-15)


def test_pose_without_orientation_is_refused():
    pose = Pose()
    pose.orientation.w = 0.0
    with pytest.raises(TactileError, match='length 1'):
        pose_from_msg(pose)
    pose.orientation.w, pose.position.x = 1.0, float('nan')
    with pytest.raises(TactileError, match='finite'):
        pose_from_msg(pose)


def test_what_is_not_known_of_a_pose_is_nan():
    pose = pose_to_msg(np.full((4, 4), np.nan))
    assert np.isnan([pose.position.x, pose.orientation.x, pose.orientation.w]).all()
