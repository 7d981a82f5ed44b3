"""Messages to core types and back."""

from builtin_interfaces.msg import Time
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message
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
from tactile_servo.types import State, Status, Timing

TIMING = Timing(2e-3, 1e-3, 5e-4, 12, 5)


@settings(max_examples=60)
@given(data=st.data())
def test_a_trajectory_comes_back_from_its_message(data):
    names = tuple(data.draw(st.lists(st.text('abü_1', max_size=9), min_size=1, max_size=7)))
    points = data.draw(st.integers(1, 4))
    rows = st.lists(st.lists(st.floats(allow_nan=False), min_size=len(names),
                             max_size=len(names)), min_size=points, max_size=points)
    fields = [None if values is None else np.array(values)
              for values in (data.draw(rows), *data.draw(st.tuples(*[st.none() | rows] * 2)))]
    times = data.draw(st.lists(st.integers(0, 10**12), min_size=points, max_size=points))
    stamp = data.draw(st.integers(0, 2**31 - 1))
    sent = Trajectory(names, np.array(times) * 1e-9, *fields, stamp_ns=stamp * 10**9)
    got = trajectory_from_msg(deserialize_message(
        serialize_message(trajectory_to_msg(sent)), JointTrajectory))
    assert (got.joint_names, got.stamp_ns) == (sent.joint_names, sent.stamp_ns)
    np.testing.assert_allclose(got.times, sent.times, atol=1e-9)
    for name in ('positions', 'velocities', 'accelerations'):
        np.testing.assert_array_equal(getattr(got, name), getattr(sent, name))


def test_a_message_that_is_filled_again_is_as_a_new_one():
    status = ServoStatus()
    for value in (0.25, -1.0):
        told = Status(State.HOLD, Reason(ReasonCode.NOT_FOLLOWING, f'joint {value}'),
                      12_000_000_034, True, value > 0, *[value] * 7, value * np.arange(6.0), 0.5,
                      'position of a' * (value > 0), value)
        assert status_to_msg(told, 'trace', TIMING, status) is status
        assert status == status_to_msg(told, 'trace', TIMING)
    state = JointState()
    for values in (np.arange(3.0), np.ones(2)):
        names = 'abc'[:len(values)]
        assert joint_state_to_msg(Time(sec=3), names, values, -values, state) == (
            joint_state_to_msg(Time(sec=3), names, values, -values))


def test_status_says_every_field():
    told = Status(State.TRACK, Reason(ReasonCode.CONTACT), 12_000_000_034, True, False, 0.1, 0.15,
                  0.2, 0.3, 0.4, 0.5, 0.6, np.arange(6.0), 0.7, 'position of a', 0.8)
    message = status_to_msg(told, 'trace', TIMING)
    assert (message.controller, message.state) == ('trace', 2)
    assert (message.reason_code, message.reason) == (ServoReason.CONTACT, 'contact')
    assert (message.contact_stamp.sec, message.contact_stamp.nanosec) == (12, 34)
    assert (message.contact_fresh, message.joints_fresh) == (True, False)
    numbers = [getattr(message, name) for name in (
        'lateral_error', 'longitudinal_error', 'angle_error', 'normal_force', 'force_target',
        'speed', 'progress', 'limit_scale', 'manipulability')]
    np.testing.assert_allclose(numbers, [0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8])
    assert message.limited_by == 'position of a'
    assert tuple(getattr(message, name) for name in Timing._fields) == TIMING
    linear, angular = message.twist.linear, message.twist.angular
    assert [linear.x, linear.y, linear.z, angular.x, angular.y, angular.z] == [0, 1, 2, 3, 4, 5]


def test_times_are_rounded_and_an_empty_trajectory_is_no_error():
    message = trajectory_to_msg(
        Trajectory(('a',), np.array([0.9999999999]), np.zeros((1, 1))))
    assert message.points[0].time_from_start.sec == 1
    assert message.points[0].time_from_start.nanosec == 0
    empty = trajectory_from_msg(JointTrajectory())
    assert empty.joint_names == () and empty.positions.shape == (0, 0)


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
    with pytest.raises(Rejected, match='point 1 has 0 velocities for 1 joints'):
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
