"""Corners fitted to pictures: sharp or round, and refused where there is none."""

import math

import numpy as np
import pytest

from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.image import Layer
from tactile_servo.edge_map.corner import Corner, CornerShape, fit
from tactile_servo.edge_map.picture import Picture
from tactile_servo.edge_map.records import CLOUD_POINT, nodes_of
from tactile_servo.edge_map.traced_path import DENIALS, TracedPath
from tactile_simulation.edge_path import walk
from tactile_simulation.render import render
from tactile_simulation.sensor import SceneSkin

PAD = TactelArray(16, 16, 0.0254 / 16, 0.0254 / 16)
DEPTH, NOISE = 0.002, 630.0


def picture_of(turn, radius, vertex, seed=0, place=(0.0, 0.0), yaw=0.0):
    """Picture of a corner of the sensor frame, arriving along +y."""
    side = 0.05 - radius * math.tan(0.5 * abs(turn)), 0.0
    plan = walk(vertex - [0, 0.05], 0.5 * math.pi, [side, (radius * abs(turn), turn), side])
    pressure = render(np.column_stack([plan, np.full(len(plan), -1e-3)]), PAD, SceneSkin())
    pressure += NOISE * np.random.default_rng(seed).standard_normal(pressure.shape)
    return picture_at(pressure, pose_at(place, yaw))


def picture_at(pressure, pose):
    return Picture(Layer('zz', DEPTH, pressure, noise_std=NOISE), PAD, pose)


def pose_at(place, yaw):
    cos, sin = math.cos(yaw), math.sin(yaw)
    pose = np.eye(4)
    pose[:2, :2], pose[:2, 3] = [[cos, -sin], [sin, cos]], place
    return pose


def first_guess(turn, vertex, seed=0):
    rng = np.random.default_rng(seed)
    return CornerShape(*(vertex + 0.4e-3 * rng.standard_normal(2)), 0.5 * math.pi + 0.03,
                       0.5 * math.pi + turn - 0.03, 1e-3)


@pytest.mark.parametrize('turn', [-120, -90, 45, 90, 120])
@pytest.mark.parametrize('radius', [0.0, 1.5e-3])
def test_corner_of_one_picture(turn, radius):
    turn, vertex = math.radians(turn), np.array([0.001, 0.0005])
    shape, _ = fit(picture_of(turn, radius, vertex), first_guess(turn, vertex))
    apex = 1 / math.cos(0.5 * turn) - 1  # what the radius does to the edge
    assert np.hypot(*(shape.vertex - vertex)) < 0.3e-3
    assert abs(shape.radius - radius) * apex < 0.35e-3
    assert abs(shape.turn - turn) < 0.12


def test_pictures_of_one_corner_add_up():
    turn, vertex = math.radians(90), np.array([0.001, 0.0005])
    start = first_guess(turn, vertex)
    fits = [fit(picture_of(turn, 0.0, vertex, seed), start) for seed in range(12)]
    corner = Corner(*fits[0], DEPTH)
    for fitted in fits[1:]:
        corner.merge(*fitted)
    assert np.hypot(*(corner.shape.vertex - vertex)) < 0.05e-3
    assert corner.shape.radius < 0.3e-3


def test_the_pose_of_the_picture_is_taken_off():
    turn, vertex, yaw, place = math.radians(60), np.array([0.001, 0.0]), 0.4, (0.2, -0.1)
    there = pose_at(place, yaw)[:2] @ [*vertex, 0.0, 1.0]
    start = first_guess(turn, vertex)
    x, y = there + 0.3e-3
    start = start._replace(x=x, y=y, first=start.first + yaw, second=start.second + yaw)
    shape, _ = fit(picture_of(turn, 0.0, vertex, place=place, yaw=yaw), start)
    assert np.hypot(*(shape.vertex - there)) < 0.25e-3
    assert shape.first == pytest.approx(0.5 * math.pi + yaw, abs=0.06)


def test_a_straight_edge_is_no_corner_and_one_at_the_border_is_not_fitted():
    straight = picture_of(math.radians(0.01), 0.0, np.zeros(2))
    assert fit(straight, first_guess(math.radians(60), np.zeros(2))) is None
    far = np.array([0.0, 0.0115])
    assert fit(picture_of(0.5, 0.0, far), first_guess(0.5, far)) is None  # a leg leaves the pad


def test_path_through_a_corner_passes_its_vertex_or_its_fillet():
    shape = CornerShape(0.0, 0.0, 0.0, 0.5 * math.pi, 0.0)
    path = Corner(shape, np.eye(7), DEPTH).nodes()['place']
    assert (np.hypot(*path.T) < 1e-12).any()
    assert (np.diff(path.sum(axis=1)) > 0.0).all()
    path = Corner(shape._replace(radius=1e-3), np.eye(7), DEPTH).nodes()['place']
    assert np.hypot(*path.T).min() == pytest.approx(1e-3 * (math.sqrt(2) - 1), rel=0.05)


def test_a_corner_ahead_that_pictures_deny_is_dropped():
    """One guessed from its first sight must not be kept against all that is seen later."""
    turn, vertex = math.radians(90), np.array([0.0, 0.002])
    shown = picture_of(turn, 0.0, vertex)
    fitted = fit(shown, first_guess(turn, vertex))

    def flat(place):
        return picture_at(np.full(PAD.shape, 1e4), pose_at(place, 0.0))
    blank, away = flat((0.0, 0.0)), flat((0.1, 0.0))
    path = TracedPath(nodes_of((0.0, 0.0), 0.0, (0.0, 1.0)), np.empty(0, CLOUD_POINT), blank)
    ahead, under = Corner(*fitted, DEPTH), Corner(*fitted, DEPTH)
    ahead.entry, ahead.leave, under.entry, under.leave = 0.004, 0.012, 0.0, 0.008
    path.corners = [ahead, under]
    for picture in (*[blank] * (DENIALS - 1), shown, *[blank] * (DENIALS - 1), *[away] * 9):
        path.refine(picture, 0.005)
    assert path.corners == [ahead, under]  # seen in between, and one of elsewhere is mute
    path.refine(blank, 0.005)
    assert path.corners == [under]
