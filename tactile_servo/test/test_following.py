"""Following: what a robot may lag behind, and what it may not."""

import numpy as np
import pytest

from tactile_servo.following import FollowingCheck, LATE
from tactile_servo.motion.inverse import ROTATION_LENGTH
from tactile_servo.reasons import ReasonCode

PERIOD = 0.0025  # s
DISTANCE = 0.002  # m


def pose(x=0.0, angle=0.0):
    """Pose at x [m], turned about z [rad]."""
    it = np.eye(4)
    it[0, 3] = x
    it[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return it


def problem_of(commanded, measured, seconds=1.0):
    """Time and reason of the first problem of two poses over time, or None."""
    following = FollowingCheck(DISTANCE)
    for k in range(round(seconds / PERIOD)):
        now = k * PERIOD
        reason = following.problem(measured(now), now, commanded(now))
        if reason is not None:
            assert reason.code == ReasonCode.NOT_FOLLOWING and reason.detail
            return now, reason
        following.sent(now, commanded(now), measured(now))
    return None


@pytest.mark.parametrize('speed', [0.001, 0.01, 0.03, 0.2])
@pytest.mark.parametrize('late', [0.0, 0.02, 0.045])
def test_a_robot_that_comes_late_follows(speed, late):
    assert problem_of(lambda now: pose(speed * now),
                      lambda now: pose(speed * max(now - late, 0.0))) is None


@pytest.mark.parametrize('speed', [0.0024, 0.01, 0.03, 0.2])
def test_a_robot_that_stops_is_found_out_before_it_is_far_behind(speed):
    stopped = 0.3
    now, _ = problem_of(lambda now: pose(speed * now), lambda now: pose(speed * min(now, stopped)))
    # The time in which it may follow, and a twentieth of 2 mm, by 20 % of which it had moved.
    assert now - stopped < LATE + 0.13e-3 / speed + 2 * PERIOD


def test_a_robot_that_answers_too_late_is_found_out():
    now, reason = problem_of(lambda now: pose(0.01 * now),
                             lambda now: pose(0.01 * max(now - 0.08, 0.0)))
    assert now < 0.08 and 'does not move' in reason.detail


@pytest.mark.parametrize('offset, follows', [(0.0019, True), (0.0021, False)])
def test_an_offset_may_be_as_large_as_configured(offset, follows):
    for measured in (pose(offset), pose(angle=offset / ROTATION_LENGTH)):
        found = problem_of(lambda _: pose(), lambda _, at=measured: at)
        assert (found is None) == follows


def test_a_motion_to_and_fro_is_no_standstill():
    """A period of twice the time it may take: what is measured ends where it began."""
    omega = np.pi / LATE
    assert problem_of(lambda now: pose(1e-3 * np.sin(omega * now)),
                      lambda now: pose(0.5e-3 * np.sin(omega * (now - 0.02)))) is None


@pytest.mark.parametrize('place, follows', [(0.004, True), (0.009, True), (0.0125, False)])
def test_a_robot_goes_on_to_the_end_of_its_window(place, follows):
    """While cycles are missed: at 200 mm/s in 30 ms farther than it may be off its way."""
    following = FollowingCheck(DISTANCE)
    following.sent(0.0, pose(), pose())
    assert (following.problem(pose(place), 0.04, pose(0.01)) is None) == follows
    following.sent(0.04, pose(0.01), pose(place))  # and lags behind the next command
    assert (following.problem(pose(place), 0.045, pose(0.01)) is None) == follows


def test_what_is_not_finite_does_not_follow():
    _, reason = problem_of(lambda _: pose(), lambda now: pose(np.nan if now > 0.1 else 0.0))
    assert reason.code == ReasonCode.NOT_FOLLOWING


def test_a_new_start_forgets():
    following = FollowingCheck(DISTANCE)
    following.sent(0.0, pose(1.0), pose())
    assert following.problem(pose(), 0.0, pose(1.0)) is not None
    following.reset()
    assert following.problem(pose(), 0.0, pose(1.0)) is None
