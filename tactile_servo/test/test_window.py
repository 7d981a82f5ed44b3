"""Windows: what is committed stays, what is added keeps the limits, and the end is a rest."""

from hypothesis import given, settings
from hypothesis import strategies as st
from limited import limit_velocities
import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from tactile_servo.motion.limits import JointLimits
from tactile_servo.motion.window import APART, at_rest, committed, extended, Window

PERIOD, AHEAD, COAST = 0.0025, 0.004, 0.005
LIMITS = JointLimits(
    ('one', 'two', 'three'), np.array([-1.0, -2.0, -np.inf]), np.array([1.0, 0.5, np.inf]),
    np.array([2.0, 1.0, 4.0]), np.array([10.0, 8.0, 10.0]))

speeds = st.floats(-50.0, 50.0) | st.sampled_from([0.0, float('nan'), float('inf'), 1e300])
# s between two cycles: in time, early, late, and so late that the window is over.
pauses = st.sampled_from([PERIOD, PERIOD, PERIOD, 1e-9, 1e-3, 0.004, 0.03, 0.1, 2.0])


def spline_of(window):
    """Read a window as the controller does: cubics through positions and velocities."""
    return CubicHermiteSpline(window.times, window.positions, window.velocities)


def accelerations(window):
    """Acceleration (2, K - 1, n) where each segment begins and ends."""
    curve = spline_of(window).derivative(2)
    ends = np.array([window.times[:-1], window.times[1:]])
    within = ends + 1e-6 * np.array([[1.0], [-1.0]]) * np.diff(window.times)
    return curve(within)


def next_window(window, elapsed, wanted):
    """What a cycle does: go on from what is committed within the limits."""
    kept = committed(window, elapsed, AHEAD)
    velocities, _ = limit_velocities(
        LIMITS, kept.positions[-1], kept.velocities[-1], wanted, PERIOD, COAST + PERIOD)
    return kept, extended(kept, velocities, velocities, PERIOD, COAST, LIMITS.acceleration)


@settings(max_examples=40)
@given(start=st.tuples(st.floats(-1.0, 1.0), st.floats(-2.0, 0.5), st.floats(-9, 9)),
       cycles=st.lists(st.tuples(pauses, st.tuples(speeds, speeds, speeds), st.integers(1, 30)),
                       min_size=1, max_size=12))
def test_any_wish_at_any_time_keeps_every_limit_in_the_whole_window(start, cycles):
    window = at_rest(np.array(start), 0.0)
    for elapsed, wish, repeat in cycles:
        for _ in range(repeat):
            before = window
            kept, window = next_window(before, elapsed, np.array(wish))
            assert (np.diff(window.times) > 0.0).all() and window.times[0] == 0.0
            assert not window.velocities[-1].any()
            assert (window.positions >= LIMITS.lower - 1e-9).all()
            assert (window.positions <= LIMITS.upper + 1e-9).all()
            assert (np.abs(window.velocities) <= LIMITS.velocity + 1e-9).all()
            spans = np.diff(window.times)
            long = spans > 1e-5  # rounding in shorter ones is large
            # A point within APART after now is left out: its acceleration changes that much early.
            slack = 1e-3 + 8.0 * LIMITS.acceleration * APART / spans[long, None]
            assert (np.abs(accelerations(window)[:, long]) <= LIMITS.acceleration + slack).all()
            # Whoever changes over within what is committed notices nothing.
            then = np.linspace(0.0, AHEAD, 9)
            at = np.clip(elapsed + then, before.times[0], before.times[-1])
            np.testing.assert_allclose(
                spline_of(window)(then), spline_of(before)(at), atol=1e-9)


def test_before_its_first_point_a_window_is_left_as_it_is():
    window = at_rest(np.ones(3), 0.1)
    kept = committed(window, 0.02, AHEAD)
    np.testing.assert_allclose(kept.times, [0.08])
    np.testing.assert_array_equal(kept.positions, np.ones((1, 3)))
    kept = committed(window, 0.0975, AHEAD)  # the first point comes within what is committed
    np.testing.assert_allclose(kept.times, [0.0025, AHEAD])


def test_points_that_nearly_coincide_become_one():
    moving = Window(np.array([0.0, 0.1, 0.2]), np.zeros((3, 3)), np.zeros((3, 3)))
    kept = committed(moving, 0.1 - 1e-9, AHEAD)
    assert len(kept.times) == 2
    kept = committed(moving, 0.1 - AHEAD + 1e-9, AHEAD)
    assert len(kept.times) == 2


def test_cycles_that_nearly_coincide_do_not_bend_what_is_committed():
    window, wish = at_rest(np.zeros(3), 0.0), np.array([2.0, 1.0, 4.0])
    for _ in range(3):
        _, window = next_window(window, PERIOD, wish)
    for _ in range(300):  # each brakes, and would take a nanosecond of it into the old course
        _, window = next_window(window, 1e-9, -wish)
        assert (np.abs(accelerations(window)) <= LIMITS.acceleration + 1e-3).all()


@pytest.mark.parametrize('target', [[2.0, -1.0, 4.0], [0.1, 0.0, -0.02], [0.0, 0.0, 0.0]])
def test_the_end_brakes_evenly_within_the_acceleration(target):
    target, limits = np.array(target), LIMITS
    kept = Window(np.array([AHEAD]), np.zeros((1, 3)), target[None])
    window = extended(kept, target, target, PERIOD, COAST, limits.acceleration)
    np.testing.assert_allclose(np.diff(window.times)[:2], [PERIOD, COAST])
    stop = window.times[-1] - window.times[-2]
    assert stop == pytest.approx(max(0.01, (np.abs(target) / limits.acceleration).max()))
    np.testing.assert_allclose(
        window.positions[-1], (PERIOD + COAST + 0.5 * stop) * target, atol=1e-12)
