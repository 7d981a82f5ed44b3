"""Tracing through clouds of points, and what is asked of a traced path."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tactile_common.polyline import arc_length
from tactile_servo.edge_map.path_queries import (
    length_on_pad,
    rise,
    speed_profile,
)
from tactile_servo.edge_map.records import CLOUD_POINT, joined, nodes_of
from tactile_servo.edge_map.tracing import trace

GRAIN, STEP = 2e-3, 0.5e-3


def cloud_of(places, directions, spread=0.0, seed=0):
    """Cloud (N,) of places (N, 3) with directions (N, 2) of random sense."""
    rng = np.random.default_rng(seed)
    sense = rng.choice([-1.0, 1.0], len(places))[:, None]
    cloud = np.ones(len(places), CLOUD_POINT)
    cloud['point'] = places + spread * rng.standard_normal(places.shape)
    cloud['way'] = sense * directions
    return cloud


def follow(cloud, length):
    """Trace from the origin along x."""
    return trace(cloud, nodes_of((0.0, 0.0), 0.0, (1.0, 0.0)), length, GRAIN)


def straight_cloud(**options):
    s = np.arange(0.0, 0.02, 0.4e-3)
    return cloud_of(np.column_stack([s, 0.0 * s, 0.1 * s]), np.tile([1.0, 0.0], (len(s), 1)),
                    **options)


def straight_nodes(count=41):
    s = STEP * np.arange(count)
    nodes = nodes_of(np.column_stack([s, 0 * s]), 0.1 * s, (1.0, 0.0))
    nodes['station'] = s
    return nodes


def test_straight_ridge_is_followed_to_its_end_and_noise_averaged():
    nodes = follow(straight_cloud(), 0.05)
    np.testing.assert_allclose(nodes['x'][:30], STEP * np.arange(1, 31), atol=1e-5)
    np.testing.assert_allclose(nodes['y'], 0.0, atol=1e-12)
    np.testing.assert_allclose(nodes['z'][4:30], 0.1 * nodes['x'][4:30], atol=2e-5)
    assert 0.019 < nodes['x'][-1] < 0.022
    nodes = follow(straight_cloud(spread=0.05e-3), 0.015)
    assert np.sqrt(np.mean(nodes['y']**2)) < 0.04e-3


def test_a_circle_is_followed():
    angle = np.linspace(0, 2, 200)
    circle = 0.01 * np.column_stack([np.sin(angle), 1 - np.cos(angle), 0 * angle])
    nodes = follow(cloud_of(circle, np.column_stack([np.cos(angle), np.sin(angle)])), 0.015)
    radius = np.hypot(nodes['x'], nodes['y'] - 0.01)
    assert len(nodes) == 30 and np.abs(radius - 0.01).max() < 0.05e-3


def test_the_length_and_a_crossing_ridge_are_heeded():
    s = np.arange(-0.01, 0.01, 0.4e-3)
    crossing = cloud_of(np.column_stack([0.005 + 0 * s, s, 0 * s]),
                        np.tile([0.0, 1.0], (len(s), 1)))
    nodes = follow(joined([straight_cloud(), crossing], CLOUD_POINT), 0.01)
    assert len(nodes) == 20
    np.testing.assert_allclose(nodes['y'], 0.0, atol=1e-6)
    assert len(follow(np.empty(0, CLOUD_POINT), 0.01)) == 0


@pytest.mark.parametrize('angle', [0.0, 0.7, 2.0])
def test_length_on_the_pad(angle):
    nodes = straight_nodes()
    pose, half = np.eye(4), 0.004
    pose[:3, :3] = Rotation.from_rotvec([0.0, 0.0, angle]).as_matrix()
    chord = 2 * half / max(abs(np.cos(angle)), abs(np.sin(angle)))
    assert length_on_pad(nodes, pose, 0.01, 0.0, half, half) == pytest.approx(chord)
    nodes['material'][20:30] = 0.0  # a gap of ten steps, of which the pad covers what it reaches
    covered = length_on_pad(nodes, np.eye(4), 0.012, 0.0, half, half)
    assert covered == pytest.approx(2 * half - 10 * STEP)


def test_rise_is_that_of_the_nodes_and_unknown_near_turns():
    nodes = straight_nodes()
    assert rise(nodes, 0.01, 0.008, STEP, False) == pytest.approx(0.1)
    nodes['way'][15:] = [0.0, 1.0]
    assert np.isnan(rise(nodes, 0.008, 0.003, STEP, False))


def test_speed_allows_for_the_turn_ahead():
    nodes = straight_nodes()
    assert speed_profile(nodes, 0.0, 0.1, 2.0, 0.1, 5e-5, 3e-4) == 0.1
    stop = speed_profile(nodes, 0.015, 1.0, 2.0, 0.02, 5e-5, 3e-4)
    assert stop == pytest.approx(np.sqrt(0.02**2 + 2 * 2.0 * 0.005))
    corner = nodes.copy()
    corner['place'][21:] = np.column_stack([0.01 + np.zeros(20), STEP * np.arange(1, 21)])
    corner['station'] = arc_length(corner['place'])
    at = speed_profile(corner, 0.01, 1.0, 2.0, 1.0, 5e-5, 3e-4)
    assert at == pytest.approx(np.sqrt(2.0 * 5e-5 / (np.sqrt(2) - 1)))
    assert speed_profile(corner, 0.0102, 1.0, 2.0, 1.0, 5e-5, 3e-4) == at
    assert speed_profile(corner, 0.012, 1.0, 2.0, 1.0, 5e-5, 3e-4) == 1.0
