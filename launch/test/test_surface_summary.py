"""What a summary says of the surface that was felt."""
from types import SimpleNamespace

import numpy as np
import pytest

from edge_tracking.recording.run import Poses
from edge_tracking.recording.summary import shape_of_surface
from tactile_shape.local_surface.local_quadric import LocalQuadric

RADIUS = 0.035


def shape_of(patches):
    """What a summary says of patches."""
    felt, shape = shape_of_surface(SimpleNamespace(patches=patches, touches=Poses.of([])))
    assert felt.shape == (0, 3)
    return shape


def patches(way):
    """Patches along a way of unit vectors (N, 3) over a ball."""
    surface = LocalQuadric()
    return [surface.update(RADIUS * out, -out) for out in way / np.linalg.norm(
        way, axis=1, keepdims=True)]


def test_a_straight_way_over_a_ball_does_not_see_it_bend_across():
    angle = np.linspace(-0.8, 0.8, 400)
    told = shape_of(patches(np.column_stack([np.sin(angle), 0.0 * angle, np.cos(angle)])))
    assert told['surface_radius'] == pytest.approx(RADIUS, rel=0.01)
    assert told['surface_kind'] == 'cylinder' and not told['surface_seen_across']


def test_a_winding_way_over_a_ball_sees_all_of_it():
    angle = np.linspace(-0.8, 0.8, 2000)
    told = shape_of(patches(np.column_stack(
        [np.sin(angle), 0.15 * np.sin(40.0 * angle), np.cos(angle)])))
    assert told['surface_radius'] == pytest.approx(RADIUS, rel=0.01)
    assert told['surface_kind'] == 'sphere' and told['surface_seen_across']


def test_nothing_is_told_of_nothing():
    told = shape_of([])
    assert told['surface_kind'] == 'none' and np.isnan(told['surface_radius'])
    assert not told['surface_seen_across']
