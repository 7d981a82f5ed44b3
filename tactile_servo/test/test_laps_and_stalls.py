"""Contours that do not close, and stalls however often a hold comes in between."""

import math

import numpy as np
import pytest

from tactile_servo.control.progress import LapGuard, MISS, Stall, STALL_TIME

STEP = 1e-3  # m
PERIOD, ADVANCE = 0.01, 5e-4


def watch(path, heading):
    """Length at which a path (t -> x, y) is given up, and why; None if it never is."""
    guard, length, last = LapGuard(), 0.0, None
    for x, y, way in zip(*path, heading, strict=True):
        place = (x, y, 0.0)
        length += 0.0 if last is None else math.dist(place, last)
        last = place
        guard.see(place, (0.0, 0.0, 1.0), (math.cos(way), math.sin(way), 0.0), length)
        if guard.problem(length):
            return length, guard.problem(length)
    return None


def circle(radius, laps, drift=0.0):
    """Circle whose radius grows by `drift` a lap, and its headings."""
    angle = np.arange(0.0, 2.0 * math.pi * laps, STEP / radius)
    r = radius + drift * angle / (2.0 * math.pi)
    return (r * np.cos(angle), r * np.sin(angle)), angle + 0.5 * math.pi


def test_one_lap_and_an_edge_that_winds_to_and_fro_are_no_problem():
    assert watch(*circle(0.05, 1.0)) is None
    x = np.arange(0.0, 2.0, STEP)
    assert watch((x, 0.02 * np.sin(50.0 * x)), np.arctan(np.cos(50.0 * x))) is None


@pytest.mark.parametrize('drift', [0.0, 0.004])
def test_a_start_that_is_passed_nearby_is_the_end(drift):
    length, why = watch(*circle(0.05, 3.0, drift))
    assert 'passed its start' in why
    assert length == pytest.approx(2.0 * math.pi * 0.05, abs=6 * MISS)


def test_one_that_misses_its_start_by_far_ends_after_one_and_a_half_laps():
    length, why = watch(*circle(0.05, 3.0, 0.02))
    assert 'laps' in why
    assert 2.0 * math.pi * 0.05 * 1.5 < length < 2.0 * math.pi * 0.07 * 1.5


def test_the_other_side_of_a_strip_is_not_its_start():
    """There and back 3 mm beside: the way at the start is the opposite one."""
    x = np.append(np.arange(0.0, 0.2, STEP), np.arange(0.2, -0.1, -STEP))
    y = np.where(np.arange(len(x)) < 200, 0.0, 0.003)
    heading = np.where(np.arange(len(x)) < 200, 0.0, math.pi)
    assert watch((x, y), heading) is None


def cycles(count, speed=0.0, held=0, asked=0.03):
    """Cycles until it stalls, with a hold of 1 s every `held` of them; None if it does not."""
    stall, now, progress = Stall(), 0.0, 0.0
    for k in range(count):
        if held and k % held == held - 1:
            now, stall.seen = now + 1.0, None
        if stall.see(now, progress, ADVANCE, asked):
            return k
        now, progress = now + PERIOD, progress + speed * PERIOD


@pytest.mark.parametrize('held', [0, 7, 100])
def test_standing_still_is_a_stall(held):
    due = STALL_TIME / PERIOD
    lost = due / held if held else 0.0  # a cycle after a hold is not counted
    assert due <= cycles(1000, held=held) <= due + 1.3 * lost + 2


@pytest.mark.parametrize('held', [0, 7, 100])
def test_time_in_a_hold_does_not_count(held):
    slow = 2.0 * ADVANCE / STALL_TIME
    assert cycles(5000, slow, held=held) is None


def test_slower_than_that_is_no_progress_unless_it_was_asked_for():
    slow = 0.5 * ADVANCE / STALL_TIME
    assert cycles(2000, slow) is not None
    assert cycles(2000, slow, asked=1.2 * slow) is None
