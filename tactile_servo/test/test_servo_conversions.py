"""Messages to core types and back."""

from builtin_interfaces.msg import Time
import numpy as np
import pytest
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from tactile_common.errors import Rejected
from tactile_msgs.msg import ServoReason, ServoStatus
from tactile_servo.conversions import (
    joint_positions,
    joint_state_to_msg,
    status_to_msg,
    trajectory_from_msg,
    trajectory_to_msg,
)
from tactile_servo.motion.trajectory import Trajectory
from tactile_servo.reasons import Reason, ReasonCode
from tactile_servo.types import State, Status

RNG = np.random.default_rng(3)


@pytest.mark.parametrize('fields', [0, 1, 2])
def test_trajectory_round_trip(fields):
    arrays = [RNG.normal(size=(4, 2)) for _ in range(3)]
    sent = Trajectory(('a', 'b'), np.array([0.0, 0.0025, 0.1, 3.5]), *arrays[:fields + 1],
                      stamp_ns=12_250_000_001)
    got = trajectory_from_msg(trajectory_to_msg(sent))
    assert got.joint_names == sent.joint_names
    assert got.stamp_ns == sent.stamp_ns
    np.testing.assert_allclose(got.times, sent.times, atol=1e-9)
    for name in ('positions', 'velocities', 'accelerations'):
        expected = getattr(sent, name)
        if expected is None:
            assert getattr(got, name) is None
        else:
            np.testing.assert_array_equal(getattr(got, name), expected)


def test_a_message_that_is_filled_again_is_as_a_new_one():
    rng = np.random.default_rng(4)
    message = JointTrajectory()
    for points, fields in ((3, 2), (3, 1), (2, 3), (3, 2), (0, 1)):  # rows of each are given
        arrays = [rng.normal(size=(points, 2)) for _ in range(fields)]
        sent = Trajectory(('a', 'b'), np.arange(1.0, points + 1.0), *arrays,
                          stamp_ns=int(rng.integers(10**9)))
        assert trajectory_to_msg(sent, message) is message
        assert message == trajectory_to_msg(sent)
    status = ServoStatus()
    for value in (0.25, -1.0):
        told = Status(State.HOLD, Reason(ReasonCode.NOT_FOLLOWING, f'joint {value}'),
                      12_000_000_034, True, value > 0, *[value] * 7, value * np.arange(6.0), 0.5,
                      'position of a' * (value > 0), value)
        assert status_to_msg(told, 'trace', 1e-3, 7, status) is status
        assert status == status_to_msg(told, 'trace', 1e-3, 7)
    state = JointState()
    for values in (np.arange(3.0), np.ones(2)):
        names = 'abc'[:len(values)]
        assert joint_state_to_msg(Time(sec=3), names, values, -values, state) == (
            joint_state_to_msg(Time(sec=3), names, values, -values))


def test_status_says_every_field():
    told = Status(State.TRACK, Reason(ReasonCode.CONTACT), 12_000_000_034, True, False, 0.1, 0.15,
                  0.2, 0.3, 0.4, 0.5, 0.6, np.arange(6.0), 0.7, 'position of a', 0.8)
    message = status_to_msg(told, 'trace', 0.9, 5)
    assert (message.controller, message.state) == ('trace', 2)
    assert (message.reason_code, message.reason) == (ServoReason.CONTACT, 'contact')
    assert (message.contact_stamp.sec, message.contact_stamp.nanosec) == (12, 34)
    assert (message.contact_fresh, message.joints_fresh) == (True, False)
    numbers = [getattr(message, name) for name in (
        'lateral_error', 'longitudinal_error', 'angle_error', 'normal_force', 'force_target',
        'speed', 'progress', 'limit_scale', 'manipulability', 'cycle_time')]
    np.testing.assert_allclose(numbers, [0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9])
    assert (message.limited_by, message.missed_cycles) == ('position of a', 5)
    linear, angular = message.twist.linear, message.twist.angular
    assert [linear.x, linear.y, linear.z, angular.x, angular.y, angular.z] == [0, 1, 2, 3, 4, 5]


def test_trajectory_of_transposed_arrays_keeps_its_rows():
    positions = RNG.normal(size=(2, 3)).T
    message = trajectory_to_msg(Trajectory(('a', 'b'), np.array([1.0, 2.0, 3.0]), positions))
    np.testing.assert_array_equal([p.positions for p in message.points], positions)


def test_times_are_rounded_to_nanoseconds():
    message = trajectory_to_msg(
        Trajectory(('a',), np.array([0.9999999999]), np.zeros((1, 1))))
    assert message.points[0].time_from_start.sec == 1
    assert message.points[0].time_from_start.nanosec == 0


def test_empty_trajectory_is_no_error_of_the_conversion():
    trajectory = trajectory_from_msg(JointTrajectory())
    assert trajectory.joint_names == () and trajectory.positions.shape == (0, 0)


@pytest.mark.parametrize('point, reason', [
    ({}, '0 positions for 2 joints'),
    ({'positions': [1.0]}, '1 positions for 2 joints'),
    ({'positions': [1.0, 2.0], 'velocities': [0.0]}, '1 velocities'),
    ({'positions': [1.0, 2.0], 'accelerations': [0.0] * 3}, '3 accelerations'),
    ({'positions': [1.0, 2.0], 'effort': [0.0, 0.0]}, 'effort'),
])
def test_malformed_points_are_rejected(point, reason):
    message = JointTrajectory(joint_names=['a', 'b'], points=[JointTrajectoryPoint(**point)])
    with pytest.raises(Rejected, match=reason):
        trajectory_from_msg(message)


def test_velocities_in_some_points_only_are_rejected():
    message = JointTrajectory(joint_names=['a'], points=[
        JointTrajectoryPoint(positions=[1.0], velocities=[1.0]),
        JointTrajectoryPoint(positions=[2.0])])
    with pytest.raises(Rejected, match='point 1 has no velocities'):
        trajectory_from_msg(message)


def test_joint_state():
    message = joint_state_to_msg(
        Time(sec=3, nanosec=5), ('a', 'b', 'c'), np.array([1.0, 2.0, 3.0]), np.arange(3.0))
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (3, 5)
    assert list(message.velocity) == [0.0, 1.0, 2.0] and not message.effort
    np.testing.assert_array_equal(joint_positions(message, ('c', 'a')), [3.0, 1.0])


@pytest.mark.parametrize('message', [
    JointState(), JointState(name=['a'], position=[1.0]), JointState(name=['a', 'b']),
    JointState(name=['a', 'b'], position=[1.0])])
def test_joint_state_without_a_joint(message):
    assert joint_positions(message, ('a', 'b')) is None
