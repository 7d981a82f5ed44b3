"""Turning a pad along an edge and square to it."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tactile_servo.control.attitude_controller import AttitudeController, off_edge

GAIN, MAX_RATE, ACCELERATION = 5.0, 1.5, 5.0  # 1/s, rad/s, rad/s^2
STILL = np.zeros(3)
ALONG_Y = (0.0, 1.0)


def rate(rotation, way=ALONG_Y, slope=0.0, direction=1, max_turn=7.0, dt=1.0):
    return AttitudeController(GAIN, MAX_RATE).rate(
        off_edge(rotation.as_matrix(), way, slope, direction, max_turn), STILL, dt, ACCELERATION)


@pytest.mark.parametrize('way, direction', [(ALONG_Y, 1), ((0.0, -1.0), -1)])
def test_a_pad_that_lies_right_stands(way, direction):
    np.testing.assert_allclose(
        rate(Rotation.identity(), way, direction=direction), 0.0, atol=1e-12)


@pytest.mark.parametrize('axis', range(3))
@pytest.mark.parametrize('angle', [-0.05, 0.02])
def test_a_small_rotation_is_turned_back_at_its_gain(axis, angle):
    wrong = np.zeros(3)
    wrong[axis] = angle
    np.testing.assert_allclose(rate(Rotation.from_rotvec(wrong)), -GAIN * wrong, atol=0.01)


@pytest.mark.parametrize('seed', range(5))
def test_the_error_falls_from_anywhere_near(seed):
    """After a step of this rate the pad's normal stands squarer to the edge and to its side."""
    rng = np.random.default_rng(seed)
    start = Rotation.from_rotvec(rng.uniform(-0.3, 0.3, 3))
    angle, slope = rng.uniform(-0.3, 0.3), rng.uniform(-0.2, 0.2)
    way = math.sin(angle), math.cos(angle)
    controller = AttitudeController(GAIN, MAX_RATE)
    edge = np.array([*way, slope]) / math.sqrt(1.0 + slope**2)
    side = np.array([way[1], -way[0], 0.0])
    pose, errors = start, []
    for _ in range(4000):
        normal, y = pose.as_matrix()[:, 2], pose.as_matrix()[:, 1]
        heading = math.atan2(y[0] * way[1] - y[1] * way[0], y[:2] @ way)
        errors.append(np.abs([normal @ edge, normal @ side, heading]).max())
        error = off_edge(pose.as_matrix(), way, slope, 1, 7.0)
        turn = controller.rate(error, STILL, 1e-3, ACCELERATION)
        pose = Rotation.from_rotvec(turn * 1e-3) * pose
    assert errors[-1] < 0.01 * errors[0] + 1e-4


def test_rate_and_its_change_are_bounded():
    quarter = Rotation.from_rotvec([0.0, 0.0, 0.5 * math.pi])
    assert rate(quarter)[2] == -MAX_RATE
    assert rate(quarter, dt=1e-3)[2] == pytest.approx(-ACCELERATION * 1e-3)
    over = Rotation.from_rotvec([0.8, 0.0, 0.0])
    assert np.abs(rate(over)).max() <= MAX_RATE


def test_beyond_its_largest_turn_the_pad_is_kept():
    turned = Rotation.from_rotvec([0.0, 0.0, 0.6])
    further, back = (-math.sin(0.9), math.cos(0.9)), ALONG_Y
    assert rate(turned, further, max_turn=0.5)[2] == 0.0
    assert rate(turned, further)[2] > 0.0
    assert rate(turned, back, max_turn=0.5)[2] < 0.0


def test_a_rate_ahead_is_followed_and_one_that_cannot_be_is_late():
    controller, ahead = AttitudeController(GAIN, MAX_RATE), np.array([0.0, 0.1, 0.0])
    assert controller.rate(STILL, ahead, 1.0, ACCELERATION) == pytest.approx(ahead)
    assert not controller.late
    assert controller.way(np.array([0.1, 0.0, 0.0]), ahead) == pytest.approx([1.0, 0.0, 0.0])
    controller.rate(np.array([0.2, 0.0, 0.0]), ahead, 1e-3, acceleration=1.0)
    assert controller.late
    controller.reset()
    assert not controller.late
    assert controller.rate(STILL, STILL, 1.0, ACCELERATION) == pytest.approx(STILL)
