"""Nodes of a path: curves, corners, and where a contour closes."""

import numpy as np
import pytest

from tactile_common.polyline import arc_length
from tactile_servo.edge_map.path import (
    closing_node,
    sharpest_turn,
    unblurred,
)
from tactile_servo.edge_map.records import nodes_of

STEP, DEPTH = 0.5e-3, 2e-3


def measured(nodes, first=0.0):
    nodes['station'] = first + arc_length(nodes['place'])
    return nodes


def test_a_curve_is_moved_out_by_its_curvature():
    """A circle to the left of 10 mm radius, and any part of it, grows by blur / radius."""
    angles = np.linspace(0.0, 1.5, 31)
    circle = nodes_of(0.01 * np.column_stack([np.sin(angles), 1.0 - np.cos(angles)]), 0.0,
                      np.column_stack([np.cos(angles), np.sin(angles)]))
    for count in (6, 11, 31):
        grown = unblurred(circle[:count], 2.4e-6, STEP, DEPTH)
        np.testing.assert_allclose(np.hypot(grown['x'], grown['y'] - 0.01), 0.01024, atol=1e-9)
    np.testing.assert_array_equal(unblurred(circle[:5], 2.4e-6, STEP, DEPTH)['row'],
                                  circle[:5]['row'])  # too short to tell
    sharp = circle.copy()
    sharp['way'] = circle['way'][::-1]  # turns right, and is moved left
    assert (np.hypot(*(unblurred(sharp, 2.4e-6, STEP, DEPTH)['place'] - sharp['place']).T)
            < 2.4e-6 * 0.6 / DEPTH + 1e-12).all()


@pytest.mark.parametrize('turn, found', [(0.0, False), (0.2, False), (0.8, True), (-2.0, True)])
def test_a_corner_is_a_sharp_turn_and_a_curve_is_none(turn, found):
    def leg_of(angles):
        return nodes_of(np.zeros((len(angles), 2)), 0.0,
                        np.column_stack([np.cos(angles), np.sin(angles)]))
    corner = np.where(np.arange(40) < 25, 3.0, 3.0 + turn)
    sharpest = sharpest_turn(leg_of(corner), 0.25)
    assert sharpest == ((12, 30) if found else None)
    assert sharpest_turn(leg_of(3.0 + np.linspace(0.0, turn, 40)), 0.25) is None
    assert sharpest_turn(leg_of(corner)[20:30], 0.25) is None  # too short to tell


def ring(radius=0.02, begin=0.0, end=6.7):
    angles = np.arange(begin, end, STEP / radius)
    place = radius * np.column_stack([np.cos(angles), np.sin(angles)])
    return measured(nodes_of(place, 0.0, np.column_stack([-np.sin(angles), np.cos(angles)])), 0.1)


def test_a_path_closes_where_it_meets_its_start_the_same_way():
    nodes = ring()
    k = closing_node(nodes, 0.2, 0.104, 1.2e-3)
    assert 0 < k < len(nodes) - 1
    assert nodes['station'][k] == pytest.approx(0.104 + 2 * np.pi * 0.02, abs=STEP)
    against = nodes.copy()
    against['way'][k - 3:] *= -1.0
    assert closing_node(against, 0.2, 0.104, 1.2e-3) is None
    assert closing_node(ring(end=6.0), 0.2, 0.104, 1.2e-3) is None
    assert closing_node(nodes, 9.0, 0.104, 1.2e-3) is None  # nothing is ahead
    # The very last node may only be passing by.
    assert closing_node(nodes[:k + 1], 0.2, 0.104, 1.2e-3) is None
