"""Contours that do not close."""

import math

import numpy as np
import pytest

from tactile_servo.control.lap_guard import LapGuard, MISS

STEP = 1e-3  # m


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


def test_one_lap_is_no_problem():
    assert watch(*circle(0.05, 1.0)) is None


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


def test_an_edge_that_winds_to_and_fro_is_followed():
    x = np.arange(0.0, 2.0, STEP)
    assert watch((x, 0.02 * np.sin(50.0 * x)), np.arctan(np.cos(50.0 * x))) is None
