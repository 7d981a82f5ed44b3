"""A second leg of the edge is felt before it comes under the pad, and nothing else is."""

import numpy as np
import pytest

from tactile_sensing.contact.ridge import ridge_points
from tactile_sensing.types.array import TactelArray
from tactile_servo.edge_map.picture import coming_length
from tactile_simulation.render import render
from tactile_simulation.sensor import SceneSkin

PAD = TactelArray(16, 16, 0.0254 / 16, 0.0254 / 16)
HALF, DEPTH, NOISE, PRESSED = 0.0127, 0.002, 630.0, -1e-3


def coming(*ways, noise=NOISE, seed=0):
    """Length that is about to come under the pad at ways of the edge, each (M, 2)."""
    pressure = noise * np.random.default_rng(seed).standard_normal(PAD.shape)
    for way in ways:
        way = np.asarray(way, dtype=float)
        pressure += render(np.column_stack([way, np.full(len(way), PRESSED)]), PAD, SceneSkin())
    return coming_length(pressure, PAD.x, PAD.y, ridge_points(pressure, PAD, noise, DEPTH), noise,
                         DEPTH)


def leg_ahead(distance, turn):
    """Edge along y whose second leg, a quarter turn away, lies beyond the front border."""
    return [[0.0, -0.05], [0.0, HALF + distance], [turn * 0.05, HALF + distance]]


@pytest.mark.parametrize('turn', [-1, 1])
@pytest.mark.parametrize('seed', range(2))
def test_a_leg_along_the_border_is_felt_before_it_presses(turn, seed):
    near = coming(leg_ahead(1e-3, turn), seed=seed)
    assert near == pytest.approx(HALF, abs=4e-3)  # the run may go round the corner
    assert 0.2 * HALF < coming(leg_ahead(3e-3, turn), seed=seed) <= near + 1e-3
    assert coming(leg_ahead(8e-3, turn), seed=seed) == 0.0


@pytest.mark.parametrize('axis', [0, 1])
@pytest.mark.parametrize('side', [-1, 1])
def test_every_border_feels(axis, side):
    way = np.array([[side * (HALF + 1e-3), -0.05], [side * (HALF + 1e-3), 0.05]])
    own = np.array([[0.0, -0.05], [0.0, 0.05]])
    assert coming(np.roll(way, axis, axis=1), np.roll(own, axis, axis=1)) > 0.5 * HALF


@pytest.mark.parametrize('degrees', [0, 5, 20, 45, 70, 90])
def test_the_edge_itself_is_none(degrees):
    angle = np.radians(degrees)
    for offset in (0.0, 0.003, 0.008):
        way = np.outer([-0.05, 0.05], [np.sin(angle), np.cos(angle)])
        way += offset * np.array([np.cos(angle), -np.sin(angle)])
        for seed in range(3):
            assert coming(way, seed=seed) == 0.0
    assert coming([[0.0, -0.05], [0.0, 0.004]]) == 0.0  # its end


@pytest.mark.parametrize('noise', [630.0, 12600.0])
def test_noise_is_none(noise):
    own = [[0.0, -0.05], [0.0, 0.05]]
    found = [coming(own, noise=noise, seed=seed) for seed in range(100)]
    assert np.count_nonzero(found) <= 1
    assert coming(noise=noise) == 0.0
