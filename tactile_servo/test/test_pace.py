"""When cycles begin, on a clock of the test's own."""

import math

import numpy as np
import pytest

from tactile_servo.nodes.pace import Pace

PERIOD = 0.0025  # s


def cycles_of(gap, seconds, *, first=0.0007, jitter=0.0, lost=(), seed=0):
    """Begins of cycles, and arrivals of pictures that come every `gap` [s]."""
    rng = np.random.default_rng(seed)
    pace, timer, begins = Pace(PERIOD), PERIOD, []
    pictures = [first + k * gap + jitter * rng.uniform(-1.0, 1.0)
                for k in range(int(seconds / gap)) if k not in lost]
    waiting = [*pictures, math.inf]
    while (now := min(timer, waiting[0])) < seconds:
        if now == waiting[0]:
            waiting.pop(0)
            if not pace.hear(now):
                continue
        pace.begin(now)
        begins.append(now)
        timer = now + pace.end(now, 0.0)
    assert pace.missed == 0 and pace.cycles == len(begins)
    return np.array(begins), np.array(pictures)


def waits(begins, pictures):
    """Times from a picture to the cycle that has it [s], of those that have one."""
    pictures = pictures[pictures <= begins[-1]]
    return begins[np.searchsorted(begins, pictures)] - pictures


@pytest.mark.parametrize('first', [0.0001, 0.0007, 0.0013, 0.0024])
@pytest.mark.parametrize('gap', [1.1, 1.5, 1.9, 2.0, 2.3, 4.0, 7.7])
def test_a_picture_begins_a_cycle_whatever_its_phase(gap, first):
    begins, pictures = cycles_of(gap * PERIOD, 1.0, first=first, jitter=0.1 * PERIOD)
    late = waits(begins, pictures)[10:]  # until the time between them is known
    assert late.max() == 0.0
    between = np.diff(begins)[20:]
    assert between.min() > 0.5 * PERIOD and between.max() < 2.1 * PERIOD
    assert len(begins) < 1.2 / PERIOD


def test_without_pictures_or_at_half_their_rate_cycles_are_evenly_spread():
    begins, _ = cycles_of(2.0 * PERIOD, 1.0)
    np.testing.assert_allclose(np.diff(begins)[10:], PERIOD, rtol=1e-6)
    begins, _ = cycles_of(10.0, 0.5)
    np.testing.assert_allclose(np.diff(begins), PERIOD, rtol=1e-6)


@pytest.mark.parametrize('gap', [0.05, 0.4, 0.75])
def test_pictures_faster_than_cycles_do_not_hasten_them(gap):
    begins, _ = cycles_of(gap * PERIOD, 1.0)
    np.testing.assert_allclose(np.diff(begins)[10:], PERIOD, rtol=1e-6)


def test_lost_pictures_leave_no_gap():
    begins, pictures = cycles_of(2.0 * PERIOD, 1.0, lost=(60, 90, 91, *range(120, 160)))
    assert np.diff(begins).max() < 1.6 * PERIOD
    assert np.count_nonzero(waits(begins, pictures)[10:]) <= 4


def test_cycles_that_are_due_and_do_not_come_are_missed():
    pace = Pace(PERIOD)
    pace.begin(1.0)
    assert pace.end(1.001, 0.0) == pytest.approx(0.0015)
    pace.begin(1.0 + 1.9 * PERIOD)  # late, but there is none between
    assert pace.missed == 0
    pace.end(1.0 + 6.9 * PERIOD, 0.0)
    pace.begin(1.0 + 6.9 * PERIOD)  # four were due since
    assert (pace.missed, pace.cycles) == (4, 3)
    assert pace.longest == pytest.approx(5.0 * PERIOD)


def test_the_timer_begins_no_cycle_before_it_is_due():
    pace = Pace(PERIOD)
    assert pace.is_due(1.0)
    pace.begin(1.0)
    wait = pace.end(1.0005, 0.0)
    assert not pace.is_due(1.001) and pace.is_due(1.0005 + wait)
    pace.begin(1.0 + PERIOD)
    # A cycle of more than a period leaves time to others before the next.
    assert pace.end(1.0 + 2.5 * PERIOD, 0.0) == 0.25 * PERIOD
    assert pace.is_due(1.0 + 2.75 * PERIOD)


def test_a_message_tells_the_mean_cost_of_cycles_since_the_last():
    pace = Pace(PERIOD)
    pace.begin(1.0)
    assert math.isnan(pace.timing(1.0, math.nan).cpu_time)
    pace.end(1.0, 0.2)
    pace.begin(1.1)
    pace.end(1.1, 0.4)
    pace.begin(1.2)
    timing = pace.timing(1.25, 0.5)
    assert (timing.latency, timing.cycles) == (0.5, 3)
    assert (timing.cpu_time, timing.cycle_time) == pytest.approx((0.3, 0.05))
    assert math.isnan(pace.timing(1.25, 0.5).cpu_time)
