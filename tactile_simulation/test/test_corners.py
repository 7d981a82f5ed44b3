"""Corners fitted to pictures: sharp or round, and refused where there is none."""

import math

import numpy as np
import pytest

from tactile_sensing.types.array import TactelArray
from tactile_servo.edge_map.corner import Corner, guess, Picture
from tactile_servo.edge_map.edge_map import DENIALS, TracedEdge
from tactile_simulation.edge_shapes import polygon
from tactile_simulation.renderer import render
from tactile_simulation.scene import Skin

PAD = TactelArray(16, 16, 0.0254 / 16, 0.0254 / 16)
DEPTH, NOISE = 0.002, 630.0


def picture_of(turn, radius, vertex, seed=0, place=(0.0, 0.0), yaw=0.0):
    """Picture of a corner of the sensor frame, arriving along +y."""
    leave = np.array([-math.sin(turn), math.cos(turn)])
    plan = polygon([vertex - [0, 0.05], vertex, vertex + 0.05 * leave], radius, False)
    pressure, _ = render(np.column_stack([plan, np.full(len(plan), -1e-3)]), PAD, Skin())
    pressure += NOISE * np.random.default_rng(seed).standard_normal(pressure.shape)
    return Picture(pressure, PAD, DEPTH, NOISE, np.array(place), yaw, 0.0)


def first_guess(turn, vertex, seed=0):
    rng = np.random.default_rng(seed)
    return np.array([*(vertex + 0.4e-3 * rng.standard_normal(2)), 0.5 * math.pi + 0.03,
                     0.5 * math.pi + turn - 0.03, 1e-3, 0.0, 0.0])


@pytest.mark.parametrize('turn', [-120, -90, 45, 90, 120])
@pytest.mark.parametrize('radius', [0.0, 1.5e-3])
def test_corner_of_one_picture(turn, radius):
    turn, vertex = math.radians(turn), np.array([0.001, 0.0005])
    p, information = picture_of(turn, radius, vertex).fit(first_guess(turn, vertex))
    apex = 1 / math.cos(0.5 * turn) - 1  # what the radius does to the edge
    assert np.hypot(*(p[:2] - vertex)) < 0.3e-3
    assert abs(p[4] - radius) * apex < 0.35e-3
    assert abs(Corner(p, information).turn - turn) < 0.12


def test_pictures_of_one_corner_add_up():
    turn, vertex = math.radians(90), np.array([0.001, 0.0005])
    start = first_guess(turn, vertex)
    fits = [picture_of(turn, 0.0, vertex, seed).fit(start) for seed in range(12)]
    corner = Corner(*fits[0])
    for fit in fits[1:]:
        corner.merge(*fit)
    assert np.hypot(*(corner.vertex - vertex)) < 0.05e-3
    assert corner.p[4] < 0.3e-3


def test_the_pose_of_the_picture_is_taken_off():
    turn, vertex, yaw, place = math.radians(60), np.array([0.001, 0.0]), 0.4, (0.2, -0.1)
    cos, sin = math.cos(yaw), math.sin(yaw)
    there = np.array([[cos, -sin], [sin, cos]]) @ vertex + place
    start = first_guess(turn, vertex)
    start[:2], start[2:4] = there + 0.3e-3, start[2:4] + yaw
    p, _ = picture_of(turn, 0.0, vertex, place=place, yaw=yaw).fit(start)
    assert np.hypot(*(p[:2] - there)) < 0.25e-3
    assert p[2] == pytest.approx(0.5 * math.pi + yaw, abs=0.06)


def test_a_straight_edge_is_no_corner_and_one_at_the_border_is_not_fitted():
    straight = picture_of(math.radians(0.01), 0.0, np.zeros(2))
    assert straight.fit(first_guess(math.radians(60), np.zeros(2))) is None
    far = np.array([0.0, 0.0115])
    assert picture_of(0.5, 0.0, far).fit(first_guess(0.5, far)) is None  # its leg leaves the pad


def test_guess_is_where_the_legs_meet():
    p = guess(np.array([0.0, -1.0]), np.array([0.0, 1.0]), np.array([2.0, 0.0]),
              np.array([1.0, 0.0]))
    np.testing.assert_allclose(p[:4], [0.0, 0.0, 0.5 * math.pi, 0.0], atol=1e-12)
    behind = guess(np.array([0.0, 1.0]), np.array([0.0, 1.0]), np.array([2.0, 0.0]),
                   np.array([1.0, 0.0]))
    assert behind is None
    assert guess(np.zeros(2), np.array([0.0, 1.0]), np.array([0.0, 2.0]),
                 np.array([0.0, 1.0])) is None


def test_path_through_a_corner_passes_its_vertex_or_its_fillet():
    p = np.array([0.0, 0.0, 0.0, 0.5 * math.pi, 0.0, 0.0, 0.0])
    nodes = Corner(p, np.eye(7)).nodes()
    assert (np.hypot(nodes[:, 0], nodes[:, 1]) < 1e-12).any()
    assert (np.diff(nodes[:, 0] + nodes[:, 1]) > 0.0).all()
    p[4] = 1e-3
    nodes = Corner(p, np.eye(7)).nodes()
    middle = np.hypot(nodes[:, 0], nodes[:, 1]).min()
    assert middle == pytest.approx(1e-3 * (math.sqrt(2) - 1), rel=0.05)


def test_a_corner_ahead_that_pictures_deny_is_dropped():
    """One guessed from its first sight must not be kept against all that is seen later."""
    turn, vertex = math.radians(90), np.array([0.0, 0.002])
    shown = picture_of(turn, 0.0, vertex)
    p, information = shown.fit(first_guess(turn, vertex))
    edge = TracedEdge(DEPTH)
    blank = Picture(np.full(PAD.shape, 1e4), PAD, DEPTH, NOISE, np.zeros(2), 0.0, 0.0)
    away = Picture(np.full(PAD.shape, 1e4), PAD, DEPTH, NOISE, np.array([0.1, 0.0]), 0.0, 0.0)
    ahead, under = Corner(p.copy(), information), Corner(p.copy(), information)
    ahead.span, under.span, edge.corners = (0.004, 0.012), (0.0, 0.008), [ahead, under]
    for picture in (*[blank] * (DENIALS - 1), shown, *[blank] * (DENIALS - 1), *[away] * 9):
        edge.see(np.empty((0, 6)), picture)
        edge.refine(0.005)
    assert edge.corners == [ahead, under]  # seen in between, and a picture of elsewhere is mute
    edge.see(np.empty((0, 6)), blank)
    edge.refine(0.005)
    assert edge.corners == [under]
