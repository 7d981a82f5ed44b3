"""Semantics of the trajectory controller, and the joints behind it."""

import re

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from tactile_common.errors import ConfigurationError, Rejected
from tactile_servo.motion.trajectory import Trajectory
from tactile_simulation.joint_controller import hermite, MockController
from tactile_simulation.plant import DelayedLag

PERIOD = 0.002
NAMES = ('a', 'b')
START = 100.0  # s, so that stamps differ from 0
NOW_NS = round(START * 1e9)


def controller(**changes):
    values = {
        'joint_names': NAMES, 'lower': [-3.0, -3.0], 'upper': [3.0, 3.0],
        'velocity_limit': [10.0, 10.0], 'initial_positions': [0.0, 0.0],
        'dead_time': 0.0, 'lag': 0.0} | changes
    return MockController(**values)


def trajectory(times, positions, velocities=None, accelerations=None, **more):
    arrays = [None if a is None else np.array(a, dtype=float)
              for a in (positions, velocities, accelerations)]
    return Trajectory(more.pop('names', NAMES), np.array(times, dtype=float), *arrays, **more)


def ramp(speed=0.5, duration=1.0, **more):
    """Reach (speed, -speed) * duration and stay there."""
    goal = np.array([[speed, -speed]]) * duration
    return trajectory([duration], goal, np.zeros((1, 2)), **more)


def playing(trajectory, **changes):
    """Controller that has begun to play a trajectory."""
    robot = controller(**changes)
    robot.step(START)
    robot.accept(trajectory, START)
    return robot


def play(robot, duration, since=START):
    """
    Times, measured and commanded positions at the controller's rate.

    What is commanded is what the trajectory has a period later.
    """
    times = since + PERIOD * np.arange(1, round(duration / PERIOD) + 1)
    rows = []
    for now in times:
        measured, _ = robot.step(now)
        rows.append((measured, robot.commanded[0]))
    measured, commanded = np.array(rows).transpose(1, 0, 2)
    return times - since, measured, commanded


# --- what is rejected ---------------------------------------------------------------------------

GOOD = {'times': [0.1, 0.2], 'positions': [[1, 2], [3, 2]], 'velocities': [[1, 1], [0, 0]]}


@pytest.mark.parametrize('changes, reason', [
    ({'names': (), 'times': [], 'positions': np.zeros((0, 0)), 'velocities': None},
     "Joints on incoming trajectory don't match the controller joints."),
    ({'names': ('a',), 'positions': [[1], [2]], 'velocities': None},
     "Joints on incoming trajectory don't match the controller joints."),
    ({'names': ('a', 'b', 'a'), 'positions': np.zeros((2, 3)), 'velocities': None},
     "Joints on incoming trajectory don't match the controller joints."),
    ({'times': [], 'positions': np.zeros((0, 2)), 'velocities': None},
     'Empty trajectory received.'),
    ({'names': ('a', 'z')}, "Incoming joint z doesn't match the controller's joints."),
    ({'names': ('a', 'a')}, 'one is named twice'),
    ({'times': [0.1, 0.1]}, 'Time between points 0 and 1 is not strictly increasing, it is '
     '0.100000 and 0.100000 respectively'),
    ({'times': [0.2, 0.1]}, 'not strictly increasing'),
    ({'times': [-0.1, 0.1]}, 'before the start'),
    ({'velocities': [[0, 0], [0, 1e-6]]},
     'Velocity of last trajectory point of joint b is not zero: 0.000001000000000'),
    ({'positions': [[1, 2], [np.nan, 2]]}, 'positions must be finite'),
    ({'velocities': [[1, np.inf], [0, 0]]}, 'velocities must be finite'),
    ({'accelerations': np.full((2, 2), np.nan)}, 'accelerations must be finite'),
    ({'times': [0.1, np.nan]}, 'times must be finite'),
    ({'positions': None, 'velocities': None}, 'positions must be finite'),
    ({'stamp_ns': NOW_NS - 300_000_000}, 'Received trajectory with non-zero start time '
     '(99.700000) that ends in the past (99.900000)'),
])
def test_rejected_and_nothing_changes(changes, reason):
    robot, same = controller(), controller()
    for each in (robot, same):
        each.step(START)
        each.accept(ramp(), START)
        play(each, 0.1)
    with pytest.raises(Rejected, match=re.escape(reason)) as caught:
        robot.accept(trajectory(**(GOOD | changes)), START + 0.1)
    assert '\n' not in str(caught.value)
    np.testing.assert_array_equal(
        play(robot, 0.5, START + 0.1)[1], play(same, 0.5, START + 0.1)[1])


def test_rounding_of_the_last_velocity_and_a_stamp_that_is_not_over_are_accepted():
    robot = controller()
    robot.accept(trajectory([0.1], [[0.1, 0.1]], [[1e-8, -1e-8]],
                            stamp_ns=NOW_NS - 50_000_000), START)


def test_wrong_shape_is_refused_by_the_trajectory_itself():
    with pytest.raises(ConfigurationError, match='velocities: shape'):
        trajectory([0.1], [[1, 2]], [[0]])


# --- interpolation ------------------------------------------------------------------------------

def test_holds_until_told_otherwise():
    robot = controller(initial_positions=[0.3, -0.2])
    _, measured, _ = play(robot, 0.1)
    np.testing.assert_array_equal(measured, np.tile([0.3, -0.2], (50, 1)))


def test_positions_alone_are_joined_by_straight_lines():
    robot = playing(trajectory([0.1, 0.3], [[0.2, 0.1], [0.4, -0.1]]))
    t, _, desired = play(robot, 0.4)
    t += PERIOD
    # The clock of a stamp 0 starts at the step that finds it; its line starts a step before.
    knots = [0.0, PERIOD + 0.1, PERIOD + 0.3]
    np.testing.assert_allclose(desired[:, 0], np.interp(t, knots, [0, 0.2, 0.4]), atol=1e-12)
    np.testing.assert_allclose(desired[:, 1], np.interp(t, knots, [0, 0.1, -0.1]), atol=1e-12)


@pytest.mark.parametrize('degree', [3, 5])
def test_polynomials_are_reproduced_and_the_end_is_held(degree):
    """A cubic (quintic) whose derivatives are given at the points is its own spline."""
    # From 0 to 1, at rest at both ends; the quintic without acceleration there.
    rest = np.polynomial.Polynomial([0, 0, 3, -2]) if degree == 3 else (
        np.polynomial.Polynomial([0, 0, 0, 10, -15, 6]))
    span = 0.2
    t_points = np.array([0.05, 0.11, 0.2])
    u = t_points / span
    rows = [rest(u), rest.deriv()(u) / span, rest.deriv(2)(u) / span**2]
    rows = [np.column_stack([row, -2 * row]) for row in rows]
    robot = playing(trajectory(
        t_points, *rows[:2 if degree == 3 else 3], stamp_ns=NOW_NS))
    t, _, desired = play(robot, 0.3)
    expected = rest(np.minimum((t + PERIOD) / span, 1.0))
    np.testing.assert_allclose(desired, np.column_stack([expected, -2 * expected]), atol=1e-9)
    velocity = robot.commanded[1]
    np.testing.assert_array_equal(velocity, 0.0)


@pytest.mark.parametrize('first, last', [(1, 1), (1, 3), (2, 2), (3, 2), (3, 3)])
def test_polynomial_meets_what_both_states_know(first, last):
    """Its derivatives at both ends are those asked for; its degree is the least."""
    rng, duration = np.random.default_rng(3), 0.7
    begin, end = rng.normal(size=(first, 2)), rng.normal(size=(last, 2))
    polynomial, known = hermite(begin, end, duration), min(first, last)
    assert polynomial.shape == (3, 2 * known, 2)
    for u, state in ((0.0, begin), (1.0, end)):
        found = u ** np.arange(2 * known) @ polynomial
        np.testing.assert_allclose(found[:known], state[:known], atol=1e-9)
    # Velocity and acceleration are the derivatives of the position, by the time.
    step, u = 1e-4, 0.3 + 1e-4 * np.arange(-1, 2)[:, None]
    (before, _, _), now, (after, _, _) = np.einsum(
        'ij,kjl->ikl', u ** np.arange(2 * known), polynomial)
    np.testing.assert_allclose(now[1], (after - before) / (2 * step * duration), atol=1e-5)
    np.testing.assert_allclose(
        now[2], (after - 2.0 * now[0] + before) / (step * duration)**2, atol=1e-3)


def test_joints_may_stand_in_any_order():
    robot, other = controller(), controller()
    for each in (robot, other):
        each.step(START)
    robot.accept(trajectory([0.1], [[0.1, 0.3]], [[0, 0]], [[1, 2]]), START)
    other.accept(trajectory([0.1], [[0.3, 0.1]], [[0, 0]], [[2, 1]], names=('b', 'a')), START)
    np.testing.assert_array_equal(play(robot, 0.2)[1], play(other, 0.2)[1])
    np.testing.assert_allclose(robot.commanded[0], [0.1, 0.3])


def test_first_point_at_once_jumps():
    robot = playing(trajectory([0.0, 1.0], [[0.5, 0], [0.5, 0]]), velocity_limit=[1.0, 1.0])
    robot.step(START + PERIOD)
    assert robot.commanded[0, 0] == 0.5
    assert robot.limit_violations == 1  # the joints do not jump


def test_points_of_the_past_are_left_out():
    robot = playing(trajectory(
        [0.1, 0.3], [[0.5, 0], [0.7, 0]], stamp_ns=NOW_NS - 196_000_000))
    robot.step(START + PERIOD)
    np.testing.assert_allclose(robot.commanded[0, 0], 0.6, atol=1e-9)


def test_start_in_the_future_is_approached_from_now():
    robot = playing(trajectory([0.1], [[0.2, 0.0]], stamp_ns=NOW_NS + 100_000_000))
    t, _, desired = play(robot, 0.2)
    np.testing.assert_allclose(desired[:-1, 0], t[:-1] + PERIOD, atol=1e-9)


@pytest.mark.parametrize('from_desired', [True, False])
def test_new_trajectory_starts_from_desired_or_measured_state(from_desired):
    robot = playing(ramp(1.0), lag=0.05, interpolate_from_desired_state=from_desired)
    _, measured, desired = play(robot, 0.5)
    assert desired[-1, 0] - measured[-1, 0] > 0.01
    robot.accept(ramp(1.0, stamp_ns=NOW_NS), START + 0.5)
    robot.step(START + 0.5 + PERIOD)
    start, slack = (desired[-1] if from_desired else measured[-1]), 3 * PERIOD
    np.testing.assert_allclose(robot.commanded[0], start, atol=slack)


def test_stream_of_windows_is_followed_without_a_seam():
    """Windows of three points, renewed at every step, as a servo sends them."""
    robot = controller()
    robot.step(START)

    def course(t):
        return 0.3 * np.sin(t), 0.3 * np.cos(t)

    now, desired = START, []
    for k in range(500):
        now += PERIOD
        t = k * PERIOD + np.array([0.01, 0.03, 0.05])
        q, v = course(t)
        v[-1] = 0.0
        robot.accept(trajectory(t - k * PERIOD, np.column_stack([q, q]),
                                np.column_stack([v, v])), now - PERIOD)
        robot.step(now)
        desired.append(robot.commanded[0])
        if k > 50:
            assert abs(robot.commanded[0, 0] - course(k * PERIOD)[0]) < 2e-3
    assert robot.limit_violations == 0
    velocity = np.diff(desired, axis=0) / PERIOD
    assert np.abs(velocity).max() < 2.0  # while it catches up with a course under way
    assert np.abs(np.diff(velocity[50:], axis=0)).max() / PERIOD < 0.5


@pytest.mark.parametrize('from_desired', [True, False])
def test_a_window_of_the_past_is_played_as_it_is(from_desired):
    """Whatever was commanded before, one period ahead, and whenever it is received."""
    robot = controller(lag=0.05, interpolate_from_desired_state=from_desired)
    robot.step(START)
    rng, times = np.random.default_rng(2), np.linspace(0.0, 0.3, 4)
    for count in range(1, 40):
        now, points = START + count * PERIOD, rng.normal(size=(4, 2))
        window = trajectory(times, points, np.zeros((4, 2)),
                            stamp_ns=round((now - 0.0013) * 1e9))
        robot.accept(window, now)
        robot.step(now)
        expected = CubicHermiteSpline(times, points, np.zeros((4, 2)))(0.0013 + PERIOD)
        np.testing.assert_allclose(robot.commanded[0], expected, atol=1e-9)


def test_a_window_that_begins_later_gains_a_period_at_its_seam():
    """What is commanded for t + period counts as that of t: the seam that stamps avoid."""
    robot = playing(ramp(1.0, 2.0))
    play(robot, 0.5)
    before = robot.commanded[0, 0]
    robot.accept(trajectory([10.0], [[before + 10.0, 0.0]]), START + 0.5)
    robot.step(START + 0.5 + PERIOD)
    # At 1 rad/s from the step before to two periods after it.
    assert robot.commanded[0, 0] - before == pytest.approx(2.0 * PERIOD, rel=1e-3)


def test_deactivated_it_holds_and_does_not_listen():
    robot = playing(ramp(), lag=0.01)
    _, _, commanded = play(robot, 0.3)
    robot.activate(False)
    robot.accept(ramp(), START + 0.3)
    with pytest.raises(Rejected):
        robot.accept(trajectory([], np.zeros((0, 2))), START + 0.3)
    _, measured, held = play(robot, 0.3, START + 0.3)
    np.testing.assert_array_equal(held, np.tile(commanded[-1], (150, 1)))
    np.testing.assert_allclose(measured[-1], commanded[-1], atol=1e-9)
    robot.activate(True)
    np.testing.assert_array_equal(play(robot, 0.1, START + 0.6)[2], held[:50])
    robot.accept(ramp(), START + 0.7)
    np.testing.assert_allclose(play(robot, 1.5, START + 0.7)[1][-1], [0.5, -0.5], atol=1e-9)


# --- limits -------------------------------------------------------------------------------------

def test_position_limit_is_kept_and_counted():
    robot = playing(ramp(0.5), upper=[0.25, 3.0])
    _, measured, desired = play(robot, 1.2)
    assert measured[:, 0].max() == 0.25 and desired[:, 0].max() > 0.49
    np.testing.assert_allclose(measured[-1, 1], -0.5)
    assert robot.limit_violations == np.count_nonzero(desired[:, 0] > 0.25 + 1e-9)


def test_velocity_limit_is_kept_and_counted():
    robot = playing(trajectory([1.0], [[0.8, 0.8]]), velocity_limit=[0.4, 10.0])
    _, measured, desired = play(robot, 2.2)
    assert np.diff(measured[:, 0]).max() <= 0.4 * PERIOD * (1 + 1e-9)
    np.testing.assert_allclose(measured[-1], 0.8)  # late, but there
    assert robot.limit_violations > 0
    assert np.diff(desired[:, 0]).max() == pytest.approx(0.8 * PERIOD, rel=0.01)


def test_speed_at_the_limit_is_no_violation():
    robot = playing(trajectory([0.0, 1.0], [[0.0, 0.0], [0.8, -0.8]]), velocity_limit=[0.8, 0.8])
    play(robot, 1.2)
    assert robot.limit_violations == 0


# --- the joints ---------------------------------------------------------------------------------

@pytest.mark.parametrize('lag', [0.0, 0.01])
@pytest.mark.parametrize('dead_time', [0.0, 0.0013, 0.0025, 0.02])
def test_response_to_a_ramp_is_exact_at_irregular_steps(lag, dead_time):
    joints = DelayedLag(np.zeros(1), dead_time, lag)
    now = 0.0
    joints.command(now, np.zeros(1))
    joints.advance(now)
    for period in np.random.default_rng(1).uniform(0.0005, 0.004, 200):
        now += period
        joints.command(now, np.array([2.0 * now]))
        position, velocity = joints.advance(now)
        t = max(now - dead_time, 0.0)
        if lag:
            decay = np.exp(-t / lag)
            expected = 2.0 * (t - lag * (1.0 - decay)), 2.0 * (1.0 - decay)
        else:
            expected = 2.0 * t, 2.0 * (t > 0.0)
        assert position[0] == pytest.approx(expected[0], abs=1e-12)
        assert velocity[0] == pytest.approx(expected[1], abs=1e-9)


def test_joints_hold_the_last_command_and_go_on_from_there():
    joints = DelayedLag(np.zeros(1), 0.0, 0.0)
    joints.advance(0.0)
    joints.command(1.0, np.array([2.0]))
    assert [joints.advance(t)[0][0] for t in (0.25, 1.0, 5.0)] == [0.5, 2.0, 2.0]
    joints.command(7.0, np.array([4.0]))
    assert joints.advance(6.0)[0][0] == 3.0


def test_clock_that_jumps_back_holds_and_starts_over():
    robot = playing(ramp(), lag=0.01, dead_time=0.0025)
    _, measured, _ = play(robot, 0.5)
    _, after, _ = play(robot, 0.2, since=0.0)
    np.testing.assert_allclose(after, np.tile(measured[-1], (100, 1)), atol=1e-12)
    robot.accept(ramp(), 0.2)
    np.testing.assert_allclose(play(robot, 1.5, since=0.2)[1][-1], [0.5, -0.5], atol=1e-9)
    assert robot.limit_violations == 0


def test_same_time_twice_changes_nothing():
    robot = playing(ramp(), lag=0.01)
    play(robot, 0.1)
    first = robot.step(START + 0.1)
    np.testing.assert_array_equal(robot.step(START + 0.1), first)


@pytest.mark.parametrize('changes, message', [
    ({'lower': [0.0]}, 'lower: .* must be 2 numbers'),
    ({'initial_positions': [0.0, np.nan]}, 'initial_positions'),
    ({'initial_positions': [0.0, 4.0]}, 'b = 4, must be within -3..3'),
    ({'velocity_limit': [1.0, 0.0]}, 'velocity_limit')])
def test_bad_configuration(changes, message):
    with pytest.raises(ConfigurationError, match=message):
        controller(**changes)


@pytest.mark.parametrize('stall', [3, 10, 100])  # periods
def test_a_process_that_stalls_is_no_controller_that_does(stall):
    steady, stalled = (controller(dead_time=0.0025, lag=0.01) for _ in range(2))
    for robot in (steady, stalled):
        robot.accept(ramp(), START)
        play(robot, 0.1)
    resumed = START + 0.1 + PERIOD * stall
    play(steady, PERIOD * stall, START + 0.1)
    stalled.run_to(resumed)
    for robot in (steady, stalled):
        robot.accept(ramp(stamp_ns=round(1e9 * resumed)), resumed)
    np.testing.assert_allclose(stalled.measured(resumed), steady.measured(resumed), atol=1e-9)
    np.testing.assert_allclose(
        play(stalled, 0.1, resumed)[1], play(steady, 0.1, resumed)[1], atol=1e-9)


def test_a_clock_that_leaps_is_not_caught_up_with():
    robot = controller()
    robot.accept(ramp(stamp_ns=NOW_NS), START)
    play(robot, 0.1)
    robot.run_to(START + 1e6)
    np.testing.assert_allclose(robot.commanded[0], [0.5, -0.5])
