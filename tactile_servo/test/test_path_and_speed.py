"""Motion in the plane: back to the path, and how fast along it."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from tactile_sensing.types.array import TactelArray
from tactile_servo.control.attitude_controller import TURNING
from tactile_servo.control.scaling import slewed
from tactile_servo.edge_map.picture import PadScale
from tactile_servo.edge_map.traced_path import PathEnd
from tactile_servo.laws import edge_motion
from tactile_servo.laws.edge_motion import EdgeFollowingConfig
from tactile_servo.laws.edge_sight import Load
from tactile_servo.types import EdgeGoal

DT, FORCE = 0.0025, 5.0
SCALE = PadScale.of(TactelArray(16, 16, 0.0254 / 16, 0.0254 / 16), 0.002)


def arm(across=math.inf, turning=math.inf, passing=math.inf):
    """An arm whose joints allow these accelerations, and this speed on any way."""
    return SimpleNamespace(
        across=lambda: across, turning=lambda: turning, passing=lambda way: passing)


UNBOUNDED = arm()


def at(x=0.0, way=(0.0, 1.0)):
    """A pad that is level, with the path at x beside it."""
    return SimpleNamespace(here=0.0, ahead=0.0, aside=(x, 0.0), there=np.eye(4), way=way)


class Edge:
    """An edge map as far as motion looks at one, and what it was asked for."""

    scale = SCALE

    def __init__(self, end=PathEnd.VIEW, limit=math.inf):
        self.path, self._limit = SimpleNamespace(end=end), limit

    def speed_limit(self, station, top, acceleration, end_speed, cut, settle):
        self.top, self.end_speed, self.acceleration = top, end_speed, acceleration
        return min(top, self._limit)

    def way(self, first, last):
        return 0.0, 1.0


def motion_on(edge, load=None, speed=0.2, slope=0.0, lifted=False):
    sight = SimpleNamespace(
        edge=edge, load=load or Load(FORCE, 0.0254), slope=slope, lifted=lifted)
    return edge_motion.EdgeMotion(EdgeFollowingConfig(), EdgeGoal(speed, FORCE), sight, 5e3)


def top(pressed=1.0, distance=0.0, coming=0.0, **options):
    """Speed that is safe, whatever lies ahead."""
    edge = Edge()
    place = at(distance)
    motion_on(edge, Load(pressed * FORCE, 0.0254, coming)).along(place, UNBOUNDED, DT, **options)
    return edge.top


@pytest.mark.parametrize('slope', [-0.5, 0.5])
def test_a_slope_is_followed_as_fast_as_the_pad_can_rise(slope):
    edge, place = Edge(), at()
    motion_on(edge, slope=slope).along(place, UNBOUNDED, DT)
    assert 0.5 * edge.top <= edge_motion.NORMAL


def test_speeds_change_by_no_more_than_they_may():
    assert slewed(1.0, 5.0, 0.5) == 1.5 and slewed(1.0, -5.0, 0.5) == 0.5
    assert slewed(1.0, 1.2, 0.5) == 1.2


def test_each_trouble_slows_it_down():
    assert top() == 0.2
    assert top(pressed=0.3) == 0.0 and top(pressed=0.3, may_lift=True) == 0.2
    assert top(pressed=1.2) == pytest.approx(0.1)
    assert top(distance=0.6 * SCALE.grain) == pytest.approx(0.0, abs=1e-12)
    assert top(distance=0.1 * SCALE.grain) == 0.2
    assert top(coming=0.0127) == pytest.approx(edge_motion.ENTRY)
    assert top(coming=0.0127 / 2) == pytest.approx(0.5 * (0.2 + edge_motion.ENTRY))


@pytest.mark.parametrize('end, lifted, speed', [
    (PathEnd.RIDGE, False, 0.2), (PathEnd.CLOSED, False, 0.2), (PathEnd.RIDGE, True, 0.0)])
def test_speed_at_the_end_of_the_path(end, lifted, speed):
    seen = Edge(end)
    place = at()
    motion_on(seen, lifted=lifted).along(place, UNBOUNDED, DT)
    assert seen.end_speed == speed


@pytest.mark.parametrize('across', [2.0, 0.5, 0.1])
def test_any_robot_can_stop_just_beyond_what_the_pad_sees(across):
    seen = Edge(PathEnd.VIEW)
    motion_on(seen).along(at(), arm(across=across), DT)
    way, speed = 0.0, seen.end_speed
    while speed > 0.0:  # brakes from the next cycle on
        way += speed * DT
        speed -= edge_motion.AGILE * across * DT
    assert 0.8 * edge_motion.OVERRUN < way <= edge_motion.OVERRUN < 1e-3


def test_the_pad_speeds_up_by_its_acceleration_and_keeps_the_limit():
    edge, place = Edge(), at()
    motion = motion_on(edge)
    motion.along(place, UNBOUNDED, DT)
    assert edge.acceleration == edge_motion.AGILE * EdgeFollowingConfig().acceleration
    assert motion.speed == pytest.approx(edge.acceleration * DT)
    for _ in range(100):
        motion.along(place, UNBOUNDED, DT)
    assert motion.speed == 0.2
    edge._limit = 0.05
    motion.along(place, UNBOUNDED, DT)
    assert motion.speed == 0.05
    weak = arm(across=0.5)
    motion.along(place, weak, DT)
    assert edge.acceleration == edge_motion.AGILE * 0.5
    motion.reset()
    assert motion.speed == 0.0


def test_the_pad_comes_to_the_path_and_does_not_overshoot():
    motion, x, places = motion_on(Edge(limit=0.05)), 0.4 * SCALE.grain, []
    for _ in range(800):
        place = at(-x)
        velocity = motion.along(place, UNBOUNDED, DT)
        x += velocity[0] * DT
        places.append(x)
    assert abs(places[-1]) < 1e-7 and min(places) > -1e-4
    assert velocity[1] == pytest.approx(0.05)


def test_acceleration_in_the_plane_is_bounded_and_keeps_its_direction():
    motion = motion_on(Edge())
    x, y = motion.aside(3.0, 4.0, DT)
    assert math.hypot(x, y) == pytest.approx(EdgeFollowingConfig().acceleration * DT)
    assert y / x == pytest.approx(4 / 3)
    motion.reset()
    assert motion.velocity == (0.0, 0.0)


@pytest.mark.parametrize('joints, bound', [
    (math.inf, edge_motion.TURN_ACCELERATION), (2.0, 2.0 * TURNING)])
def test_a_turn_is_no_harder_than_the_joints_allow(joints, bound):
    place = at(way=(1.0, 0.0))  # a quarter turn away
    turn = motion_on(Edge()).turn(place, arm(turning=joints), DT)
    assert np.linalg.norm(turn) == pytest.approx(bound * DT)


def test_near_a_singularity_way_and_turn_are_no_faster_than_the_joints_allow():
    """Where they are, the arm cannot keep the pad on its path, or its force."""
    edge, slow = Edge(), arm(passing=0.03)
    motion = motion_on(edge)
    motion.along(at(), slow, DT)
    assert edge.top == 0.03
    for _ in range(200):
        turn = motion.turn(at(way=(1.0, 0.0)), slow, DT)
    assert np.linalg.norm(turn) == pytest.approx(0.03)
