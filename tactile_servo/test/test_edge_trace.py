"""Tracing through clouds of points, and what is asked of a traced path."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tactile_servo.edge_map.tracing import (
    into_plane,
    length_on_pad,
    place_at,
    project,
    rise,
    speed_profile,
    STEP,
    trace,
)


def cloud_of(places, ways, spread=0.0, seed=0):
    """Cloud (N, 6) of places (N, 3) with directions (N, 2) of random sense."""
    rng = np.random.default_rng(seed)
    sense = rng.choice([-1.0, 1.0], len(places))[:, None]
    noise = spread * rng.standard_normal(places.shape)
    return np.column_stack([places + noise, sense * ways, np.ones(len(places))])


def straight_cloud(**options):
    s = np.arange(0.0, 0.02, 0.4e-3)
    return cloud_of(np.column_stack([s, 0.0 * s, 0.1 * s]), np.tile([1.0, 0.0], (len(s), 1)),
                    **options)


def straight_nodes(count=41):
    s = STEP * np.arange(count)
    return np.column_stack([s, 0 * s, 0.1 * s, np.ones(count), np.zeros(count),
                            np.ones(count)]), s


def test_points_of_a_picture_are_put_into_the_plane():
    rng = np.random.default_rng(2)
    points = np.column_stack([rng.normal(size=(9, 4)), rng.random((9, 2))])
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_rotvec([0.1, -0.2, 1.9]).as_matrix()
    pose[:3, 3] = [0.3, -0.1, 0.02]
    cloud = into_plane(points, pose, 0.05)
    places = np.column_stack([points[:, :2], -0.05 * points[:, 4], np.ones(9)]) @ pose.T
    np.testing.assert_allclose(cloud[:, :3], places[:, :3])
    ways = points[:, 2:4] @ pose[:2, :2].T
    np.testing.assert_allclose(
        cloud[:, 3:5], ways / np.linalg.norm(ways, axis=1, keepdims=True))
    np.testing.assert_array_equal(cloud[:, 5], points[:, 5])


def test_straight_ridge_is_followed_to_its_end_in_steps():
    nodes = trace(straight_cloud(), 0.0, 0.0, 1.0, 0.0, 0.05)
    np.testing.assert_allclose(nodes[:30, 0], STEP * np.arange(1, 31), atol=1e-5)
    np.testing.assert_allclose(nodes[:, 1], 0.0, atol=1e-12)
    np.testing.assert_allclose(nodes[4:30, 2], 0.1 * nodes[4:30, 0], atol=2e-5)
    assert 0.019 < nodes[-1, 0] < 0.022


def test_noise_of_the_points_is_averaged():
    nodes = trace(straight_cloud(spread=0.05e-3), 0.0, 0.0, 1.0, 0.0, 0.015)
    assert np.sqrt(np.mean(nodes[:, 1]**2)) < 0.04e-3


def test_a_circle_is_followed():
    angle = np.linspace(0, 2, 200)
    places = 0.01 * np.column_stack([np.sin(angle), 1 - np.cos(angle), 0 * angle])
    nodes = trace(cloud_of(places, np.column_stack([np.cos(angle), np.sin(angle)])),
                  0.0, 0.0, 1.0, 0.0, 0.015)
    radius = np.hypot(nodes[:, 0], nodes[:, 1] - 0.01)
    assert len(nodes) == 30 and np.abs(radius - 0.01).max() < 0.05e-3


def test_the_length_and_a_crossing_ridge_are_heeded():
    s = np.arange(-0.01, 0.01, 0.4e-3)
    crossing = cloud_of(np.column_stack([0.005 + 0 * s, s, 0 * s]),
                        np.tile([0.0, 1.0], (len(s), 1)))
    nodes = trace(np.vstack([straight_cloud(), crossing]), 0.0, 0.0, 1.0, 0.0, 0.01)
    assert len(nodes) == 20
    np.testing.assert_allclose(nodes[:, 1], 0.0, atol=1e-6)
    assert len(trace(np.empty((0, 6)), 0.0, 0.0, 1.0, 0.0, 0.01)) == 0


def test_projection_and_place_are_inverse():
    nodes, stations = straight_nodes()
    station, x, y, left, ux, uy = project(nodes, stations, 0.0052, 0.001, 0.0, 0.02)
    assert (station, x, y, left) == pytest.approx((0.0052, 0.0052, 0.0, 0.001))
    assert (ux, uy) == pytest.approx((1.0, 0.0))
    assert place_at(nodes, stations, 0.0052) == pytest.approx((0.0052, 0.0, 0.00052))
    assert place_at(nodes, stations, 1.0)[0] == pytest.approx(0.02)
    assert project(nodes, stations, 0.0, 0.0, 0.008, 0.02)[0] >= 0.0075  # the window holds


@pytest.mark.parametrize('angle', [0.0, 0.7, 2.0])
def test_length_on_the_pad(angle):
    nodes, _ = straight_nodes()
    cos, sin = np.cos(angle), np.sin(angle)
    half = 0.004
    chord = 2 * half / max(abs(cos), abs(sin))
    assert length_on_pad(nodes, 0.01, 0.0, cos, sin, half, half) == pytest.approx(chord)
    nodes[20:30, 5] = 0.0  # a gap of ten steps, of which the pad covers those it reaches
    covered = length_on_pad(nodes, 0.012, 0.0, 1.0, 0.0, half, half)
    assert covered == pytest.approx(2 * half - 10 * STEP)


def test_rise_is_that_of_the_nodes_and_unknown_near_turns():
    nodes, stations = straight_nodes()
    assert rise(nodes, stations, 0.01, 0.008, False) == pytest.approx(0.1)
    nodes[15:, 3:5] = [0.0, 1.0]
    assert np.isnan(rise(nodes, stations, 0.008, 0.003, False))


def test_speed_allows_for_the_turn_ahead():
    nodes, stations = straight_nodes()
    assert speed_profile(nodes, stations, 0.0, 0.1, 2.0, 0.1, 5e-5, 3e-4) == 0.1
    stop = speed_profile(nodes, stations, 0.015, 1.0, 2.0, 0.02, 5e-5, 3e-4)
    assert stop == pytest.approx(np.sqrt(0.02**2 + 2 * 2.0 * 0.005))
    corner = np.vstack([nodes[:21], nodes[1:21] * 0])
    corner[21:, 0], corner[21:, 1] = 0.01, STEP * np.arange(1, 21)
    at = speed_profile(corner, stations[:41], 0.01, 1.0, 2.0, 1.0, 5e-5, 3e-4)
    assert at == pytest.approx(np.sqrt(2.0 * 5e-5 / (np.sqrt(2) - 1)))
    assert speed_profile(corner, stations[:41], 0.0102, 1.0, 2.0, 1.0, 5e-5, 3e-4) == at
    assert speed_profile(corner, stations[:41], 0.012, 1.0, 2.0, 1.0, 5e-5, 3e-4) == 1.0
