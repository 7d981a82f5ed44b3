"""Kernels on the nodes of a path against the same in whole arrays."""

import numpy as np
import pytest

from tactile_servo.edge_map.path import (
    closing_node,
    headings,
    nodes_from,
    sharpest_turn,
    stations_of,
    unblurred,
)

STEP = 0.5e-3


def walk(seed, count=60, bend=0.3, heading=3.0):
    """Nodes (count, 6) of a path that bends at random, its stations too; heading near pi."""
    rng = np.random.default_rng(seed)
    angles = heading + np.cumsum(bend * rng.standard_normal(count))
    ways = np.column_stack([np.cos(angles), np.sin(angles)])
    nodes = np.column_stack([np.cumsum(STEP * ways, axis=0), rng.normal(size=count), ways,
                             np.ones(count)])
    return nodes, angles


@pytest.mark.parametrize('seed', range(5))
def test_stations_and_headings(seed):
    nodes, angles = walk(seed)
    chords = np.linalg.norm(np.diff(nodes[:, :2], axis=0), axis=1)
    np.testing.assert_allclose(
        stations_of(nodes, 0.25), 0.25 + np.concatenate([[0.0], np.cumsum(chords)]), atol=1e-15)
    turned = headings(nodes)
    np.testing.assert_allclose(turned - turned[0], angles - angles[0], atol=1e-9)
    assert abs(turned[0]) <= np.pi


@pytest.mark.parametrize('count', [5, 6, 11, 12, 60])
def test_a_curve_is_moved_out_by_its_curvature(count):
    leg, angles = walk(7, count)
    moved = unblurred(leg, 2.4e-6, STEP)
    np.testing.assert_array_equal(moved[:, 2:], leg[:, 2:])
    if count < 6:
        np.testing.assert_array_equal(moved, leg)
        return
    span = min(5, (count - 1) // 2)
    curvature = np.empty(count)
    curvature[span:-span] = (angles[2 * span:] - angles[:-2 * span]) / (2 * span * STEP)
    curvature[:span], curvature[-span:] = curvature[span], curvature[-span - 1]
    curvature = np.clip(curvature, -300.0, 300.0)
    out = np.column_stack([leg[:, 4], -leg[:, 3]])  # right of the way
    np.testing.assert_allclose(
        moved[:, :2], leg[:, :2] + 2.4e-6 * curvature[:, None] * out, atol=1e-15)
    # A circle to the left of 10 mm radius grows by blur / radius.
    angles = np.linspace(0.0, 1.5, 31)
    circle = np.column_stack([0.01 * np.sin(angles), 0.01 - 0.01 * np.cos(angles), 0 * angles,
                              np.cos(angles), np.sin(angles), 1 + 0 * angles])
    grown = unblurred(circle, 2.4e-6, STEP)
    np.testing.assert_allclose(np.hypot(grown[:, 0], grown[:, 1] - 0.01), 0.01024, atol=1e-9)


@pytest.mark.parametrize('turn, found', [(0.0, False), (0.2, False), (0.8, True), (-2.0, True)])
def test_a_corner_is_a_sharp_turn_and_a_curve_is_none(turn, found):
    def leg_of(angles):
        return np.column_stack([np.zeros((len(angles), 3)), np.cos(angles), np.sin(angles),
                                np.ones(len(angles))])
    corner = np.where(np.arange(40) < 25, 3.0, 3.0 + turn)
    first, last = sharpest_turn(leg_of(corner), 0.25)
    assert (first, last) == ((12, 30) if found else (-1, -1))
    assert sharpest_turn(leg_of(3.0 + np.linspace(0.0, turn, 40)), 0.25) == (-1, -1)
    assert sharpest_turn(leg_of(corner)[20:30], 0.25) == (-1, -1)  # too short to tell


def ring(radius=0.02, begin=0.0, end=6.5):
    angles = np.arange(begin, end, STEP / radius)
    nodes = np.column_stack([radius * np.cos(angles), radius * np.sin(angles), 0 * angles,
                             -np.sin(angles), np.cos(angles), 1 + 0 * angles])
    return nodes, stations_of(nodes, 0.1)


def test_a_path_closes_where_it_meets_its_start_the_same_way():
    nodes, stations = ring()
    k = closing_node(nodes, stations, 0.2, 0.104, 1.2e-3)
    assert stations[k] == pytest.approx(0.104 + 2 * np.pi * 0.02, abs=STEP)
    against = nodes.copy()
    against[k - 3:, 3:5] *= -1.0
    assert closing_node(against, stations, 0.2, 0.104, 1.2e-3) == -1
    short = ring(end=6.0)
    assert closing_node(*short, 0.2, 0.104, 1.2e-3) == -1
    assert closing_node(nodes, stations, 9.0, 0.104, 1.2e-3) == -1  # nothing is ahead
    # The very last node may only be passing by.
    assert closing_node(nodes[:k + 1], stations[:k + 1], 0.2, 0.104, 1.2e-3) == -1


@pytest.mark.parametrize('open_start', [False, True])
@pytest.mark.parametrize('open_end', [False, True])
def test_nodes_around_the_pad_lead_straight_on(open_start, open_end):
    nodes, _ = walk(3, 30, 0.0)
    stations = stations_of(nodes, 0.0)
    near = nodes_from(nodes, stations, -0.01, 0.03, open_start, open_end)
    assert len(near) == 30 + open_start + open_end
    np.testing.assert_array_equal(near[int(open_start):30 + open_start], nodes)
    if open_end:
        np.testing.assert_allclose(near[-1, :2], nodes[-1, :2] + 0.03 * nodes[-1, 3:5])
        np.testing.assert_array_equal(near[-1, 2:], nodes[-1, 2:])
    if open_start:
        np.testing.assert_allclose(near[0, :2], nodes[0, :2] - 0.03 * nodes[0, 3:5])
    part = nodes_from(nodes, stations, stations[9], 0.03, open_start, open_end)
    assert len(part) == 20 + open_end
    np.testing.assert_array_equal(part[0], nodes[10])
    np.testing.assert_array_equal(
        nodes_from(nodes, stations, 9.0, 0.03, open_start, False), nodes[-1:])
