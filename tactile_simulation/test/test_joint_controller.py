"""Semantics of the trajectory controller, and the joints behind it."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from tactile_common.errors import ConfigurationError, Rejected
from tactile_servo.motion.trajectory import Trajectory
from tactile_simulation.joint_controller import DelayedLag, MockController
from tactile_simulation.world import Plant

PERIOD = 0.002
NAMES = ('a', 'b')
START = 100.0  # s, so that stamps differ from 0
NOW_NS = round(START * 1e9)


def controller(start=(0.0, 0.0), dead_time=0.0, lag=0.0, from_desired=True, **changes):
    robot = {'joint_names': NAMES, 'lower': np.full(2, -3.0), 'upper': np.full(2, 3.0),
             'velocity_limit': np.full(2, 10.0)}
    robot |= {name: np.array(values) for name, values in changes.items()}
    return MockController(SimpleNamespace(**robot), start, Plant(dead_time=dead_time, lag=lag),
                          from_desired=from_desired)


def trajectory(times, positions, velocities=None, **more):
    positions = np.array(positions, dtype=float)
    velocities = np.zeros_like(positions) if velocities is None else np.array(velocities, float)
    return Trajectory(more.pop('names', NAMES), np.array(times, float), positions, velocities,
                      **more)


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


GOOD = {'times': [0.1, 0.2], 'positions': [[1, 2], [3, 2]], 'velocities': [[1, 1], [0, 0]]}


@pytest.mark.parametrize('changes, reason', [
    ({'names': (), 'times': [], 'positions': np.zeros((0, 0)), 'velocities': None},
     'joints are none, must be a, b'),
    ({'names': ('a',), 'positions': [[1], [2]], 'velocities': None}, 'joints are a, must be a, b'),
    ({'names': ('b', 'a')}, 'joints are b, a, must be a, b'),
    ({'times': [], 'positions': np.zeros((0, 2)), 'velocities': None}, 'has no points'),
    ({'times': [0.1, 0.1]}, 'strictly increase'),
    ({'times': [0.2, 0.1]}, 'strictly increase'),
    ({'times': [-0.1, 0.1]}, 'must not be negative'),
    ({'velocities': [[0, 0], [0, 1e-6]]}, 'velocity of the last point is not zero'),
    ({'positions': [[1, 2], [np.nan, 2]]}, 'positions must be finite'),
    ({'velocities': [[1, np.inf], [0, 0]]}, 'velocities must be finite'),
    ({'times': [0.1, np.nan]}, 'times must be finite'),
    ({'stamp_ns': NOW_NS - 300_000_000}, 'has ended 0.200000 s ago'),
])
def test_rejected_and_nothing_changes(changes, reason):
    robot, same = controller(), controller()
    for each in (robot, same):
        each.step(START)
        each.accept(ramp(), START)
        play(each, 0.1)
    with pytest.raises(Rejected, match=reason):
        robot.accept(trajectory(**(GOOD | changes)), START + 0.1)
    np.testing.assert_array_equal(
        play(robot, 0.5, START + 0.1)[1], play(same, 0.5, START + 0.1)[1])


def test_rounding_of_the_last_velocity_and_a_stamp_that_is_not_over_are_accepted():
    robot = controller()
    robot.accept(trajectory([0.1], [[0.1, 0.1]], [[1e-8, -1e-8]],
                            stamp_ns=NOW_NS - 50_000_000), START)


def test_a_cubic_is_reproduced_and_its_end_is_held():
    rest, span = np.polynomial.Polynomial([0, 0, 3, -2]), 0.2  # from 0 to 1, at rest at both ends
    u = np.array([0.25, 0.55, 1.0])
    rows = [np.column_stack([row, -2 * row]) for row in (rest(u), rest.deriv()(u) / span)]
    robot = playing(trajectory(span * u, *rows, stamp_ns=NOW_NS))
    t, _, desired = play(robot, 0.3)
    expected = rest(np.minimum((t + PERIOD) / span, 1.0))
    np.testing.assert_allclose(desired, np.column_stack([expected, -2 * expected]), atol=1e-9)
    np.testing.assert_array_equal(robot.commanded[1:], 0.0)


def test_first_point_at_once_jumps():
    robot = playing(trajectory([0.0, 1.0], [[0.5, 0], [0.5, 0]]), velocity_limit=[1.0, 1.0])
    robot.step(START + PERIOD)
    assert robot.commanded[0, 0] == 0.5
    assert robot.limit_violations == 1  # the joints do not jump


def test_start_in_the_future_is_approached_from_now():
    robot = playing(trajectory([0.1], [[0.2, 0.0]], stamp_ns=NOW_NS + 100_000_000))
    t, _, desired = play(robot, 0.2)
    u = np.minimum((t + PERIOD) / 0.2, 1.0)
    np.testing.assert_allclose(desired[:, 0], 0.2 * u**2 * (3.0 - 2.0 * u), atol=1e-9)


@pytest.mark.parametrize('from_desired', [True, False])
def test_new_trajectory_starts_from_desired_or_measured_state(from_desired):
    robot = playing(ramp(1.0), lag=0.05, from_desired=from_desired)
    _, measured, desired = play(robot, 0.5)
    assert desired[-1, 0] - measured[-1, 0] > 0.01
    robot.accept(ramp(1.0, stamp_ns=NOW_NS), START + 0.5)
    robot.step(START + 0.5 + PERIOD)
    start, slack = (desired[-1] if from_desired else measured[-1]), 3 * PERIOD
    np.testing.assert_allclose(robot.commanded[0], start, atol=slack)


@pytest.mark.parametrize('from_desired', [True, False])
def test_a_window_of_the_past_is_played_as_it_is(from_desired):
    """Whatever was commanded before, one period ahead, and whenever it is received."""
    robot = controller(lag=0.05, from_desired=from_desired)
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
    before, speed = robot.commanded[:2, 0]
    robot.accept(trajectory([10.0], [[before + 10.0, 0.0]]), START + 0.5)
    robot.step(START + 0.5 + PERIOD)
    # From the step before to two periods after it.
    assert robot.commanded[0, 0] - before == pytest.approx(2.0 * PERIOD * speed, rel=1e-2)


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


def test_position_limit_is_kept_and_counted():
    robot = playing(ramp(0.5), upper=[0.25, 3.0])
    _, measured, desired = play(robot, 1.2)
    assert measured[:, 0].max() == 0.25 and desired[:, 0].max() > 0.49
    np.testing.assert_allclose(measured[-1, 1], -0.5)
    assert robot.limit_violations == np.count_nonzero(desired[:, 0] > 0.25 + 1e-9)


def test_velocity_limit_is_kept_and_counted_and_a_speed_at_it_is_none():
    robot = playing(trajectory([1.0], [[0.8, 0.8]]), velocity_limit=[0.4, 10.0])
    _, measured, desired = play(robot, 2.2)
    assert np.diff(measured[:, 0]).max() <= 0.4 * PERIOD * (1 + 1e-9)
    np.testing.assert_allclose(measured[-1], 0.8)  # late, but there
    assert robot.limit_violations > 0
    assert np.diff(desired[:, 0]).max() == pytest.approx(1.2 * PERIOD, rel=0.01)
    robot = playing(trajectory([0.0, 1.0], [[0.0, 0.0], [0.8, -0.8]]), velocity_limit=[1.2, 1.2])
    play(robot, 1.2)
    assert robot.limit_violations == 0


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


def test_clock_that_jumps_back_holds_and_starts_over():
    robot = playing(ramp(), lag=0.01, dead_time=0.0025)
    _, measured, _ = play(robot, 0.5)
    _, after, _ = play(robot, 0.2, since=0.0)
    np.testing.assert_allclose(after, np.tile(measured[-1], (100, 1)), atol=1e-12)
    robot.accept(ramp(), 0.2)
    np.testing.assert_allclose(play(robot, 1.5, since=0.2)[1][-1], [0.5, -0.5], atol=1e-9)
    assert robot.limit_violations == 0


@pytest.mark.parametrize('start, message', [
    ([0.0], 'must be 2 numbers'), ([0.0, np.nan], 'b = nan'),
    ([0.0, 4.0], 'b = 4, must be within -3..3')])
def test_a_start_that_is_no_place_of_the_joints_is_refused(start, message):
    with pytest.raises(ConfigurationError, match=message):
        controller(start)


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
