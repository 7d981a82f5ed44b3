"""Motion in the plane: back to the path, and how fast along it."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from tactile_sensing.types.array import TactelArray
from tactile_servo.control.path_controller import PathConfig, PathController
from tactile_servo.control.scaling import ramp, slewed
from tactile_servo.control.speed_planner import (
    contact_scale,
    overload_scale,
    SpeedConfig,
    SpeedPlanner,
    stray_scale,
)
from tactile_servo.edge_map.picture import PadScale
from tactile_servo.edge_map.traced_path import PathEnd

DT, ACCELERATION = 0.0025, 2.0
SCALE = PadScale.of(TactelArray(16, 16, 0.0254 / 16, 0.0254 / 16), 0.002)
S, P = SpeedConfig(), PathConfig()


def edge(end=PathEnd.VIEW, limit=math.inf):
    """An edge map as far as the planner looks at one."""
    asked = []

    def speed_limit(station, top, acceleration, end_speed, cut, settle):
        asked.append(end_speed)
        return min(top, limit)
    return SimpleNamespace(path=SimpleNamespace(end=end), speed_limit=speed_limit, asked=asked)


def top(speed=0.2, pressed=1.0, distance=0.0, age=0.0, **options):
    return SpeedPlanner(S, P).top(speed, pressed=pressed, distance=distance, scale=SCALE, age=age,
                                  **{'coming': 0.0, **options})


@pytest.mark.parametrize('scale, none, all_', [
    (contact_scale, 0.3, 0.7), (overload_scale, 1.3, 1.1),
    (lambda grains: stray_scale(grains * 0.002, 0.002), 0.6, 0.1)])
def test_scales_go_from_nothing_to_all(scale, none, all_):
    assert scale(none) == scale(2 * none - all_) == 0.0
    assert scale(all_) == scale(2 * all_ - none) == 1.0
    assert scale(0.5 * (none + all_)) == pytest.approx(0.5)


def test_ramp_and_slope():
    assert ramp(math.nan, 0.0, 1.0) != ramp(math.nan, 0.0, 1.0)
    assert slewed(1.0, 5.0, 0.5) == 1.5 and slewed(1.0, -5.0, 0.5) == 0.5
    assert slewed(1.0, 1.2, 0.5) == 1.2


def test_nothing_slows_down_a_pad_that_does_right():
    assert top() == 0.2


def test_each_trouble_slows_it_down():
    assert top(pressed=0.3) == 0.0 and top(pressed=0.3, coasting=True) == 0.2
    assert top(pressed=1.2) == pytest.approx(0.1)
    assert top(distance=0.6 * SCALE.grain) == 0.0
    assert top(coming=0.0127) == pytest.approx(S.entry)
    assert top(coming=0.0127 / 2) == pytest.approx(0.5 * (0.2 + S.entry))


def test_late_images_bound_the_way_that_is_not_seen():
    assert top(age=0.02) == pytest.approx(S.unseen * SCALE.grain / 0.025)
    assert top(age=10.0) == S.entry
    assert top(speed=0.01, age=10.0) == 0.01


@pytest.mark.parametrize('end, speed', [
    (PathEnd.VIEW, S.blind), (PathEnd.RIDGE, S.search), (PathEnd.CLOSED, 0.2)])
def test_speed_at_the_end_of_the_path(end, speed):
    seen = edge(end)
    SpeedPlanner(S, P).plan(seen, 0.0, 0.2, DT)
    assert seen.asked == [speed]


def test_the_plan_speeds_up_by_its_acceleration_and_keeps_the_limit():
    planner = SpeedPlanner(S, P)
    assert planner.plan(edge(), 0.0, 0.2, DT) == pytest.approx(S.acceleration * DT)
    for _ in range(100):
        speed = planner.plan(edge(), 0.0, 0.2, DT)
    assert speed == 0.2
    assert planner.plan(edge(limit=0.05), 0.0, 0.2, DT) == 0.05
    assert planner.search(0.2) == S.search and planner.search(0.001) == 0.001
    planner.reset()
    assert planner.speed == 0.0


def test_the_pad_comes_to_the_path_and_does_not_overshoot():
    controller, place, places = PathController(P, ACCELERATION), np.array([0.004, 0.0]), []
    for _ in range(800):
        velocity = controller.follow((0.0, 1.0), 0.05, (-place[0], 0.0), DT)
        place = place + np.array(velocity) * DT
        places.append(place[0])
    assert abs(places[-1]) < 1e-7 and min(places) > -1e-4
    assert controller.velocity[1] == pytest.approx(0.05)


def test_acceleration_in_the_plane_is_bounded_and_keeps_its_direction():
    controller = PathController(P, ACCELERATION)
    x, y = controller.change(3.0, 4.0, DT)
    assert math.hypot(x, y) == pytest.approx(ACCELERATION * DT) and y / x == pytest.approx(4 / 3)
    controller.reset()
    assert controller.velocity == (0.0, 0.0)
