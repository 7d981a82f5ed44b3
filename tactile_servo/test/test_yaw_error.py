"""Angle of the mounting about the normal, from the ridge under a pad and its way."""
import math

import numpy as np
import pytest

from tactile_servo.edge_map.edge_map import YawError


def seen(ridge, angle, noise=0.0, jump=0.0, aside=0.0):
    """
    Return the angle found along a ridge, complex (N,) [m], with images turned by -angle [rad].

    A pad that is `aside` (N,) [m] to the left sees the ridge twice as far away as it is.
    """
    rng, check = np.random.default_rng(0), YawError(2e-3)
    way = np.gradient(ridge)
    way = way / abs(way) * np.exp(-1j * angle)
    places = ridge + noise * (rng.normal(size=len(ridge)) + 1j * rng.normal(size=len(ridge)))
    left = np.zeros(len(ridge)) + aside
    places -= 1j * left
    places[len(ridge) // 2:] += 1j * jump
    left[len(ridge) // 2:] -= jump
    for image in zip(places, way, left, strict=True):
        check.see(*image)
    return check.angle


LENGTH = np.linspace(0.0, 0.08, 501)  # m
ROUND = 0.02 * (np.exp(1j * LENGTH / 0.02) - 1.0)


@pytest.mark.parametrize('ridge', [LENGTH, ROUND, ROUND.conj()], ids=['line', 'left', 'right'])
@pytest.mark.parametrize('angle', [0.0, 0.05, -0.15])
def test_the_way_shows_the_angle_on_lines_and_arcs(ridge, angle):
    found = seen(ridge, angle, noise=4e-5)
    # The assumption of no error counts for 2 mm, so 3 % are missing after 80 mm.
    assert found == pytest.approx(angle, rel=0.05, abs=2e-3)


def test_an_object_that_jumps_is_no_angle():
    assert abs(seen(LENGTH.astype(complex), 0.0, jump=1e-3)) < 1e-3


def test_a_pad_that_moves_towards_the_ridge_is_no_angle():
    """Coarse tactels show a ridge beside the pad's centre at a wrong place."""
    aside = np.maximum(3e-3 - 0.3 * LENGTH, 0.0)
    assert abs(seen(LENGTH.astype(complex), 0.0, aside=aside)) < 1e-3


def test_turned_images_show_the_ridge_along_the_way():
    check = YawError(2e-3)
    for x in LENGTH:
        check.see(complex(x), complex(math.cos(0.05), -math.sin(0.05)), 0.0)
    turned = check.turn[:2, :2] @ [math.cos(0.05), -math.sin(0.05)]
    assert turned == pytest.approx([1.0, 0.0], abs=5e-3)
