"""Ridge points of images: exact on straight edges, robust to noise and broken tactels."""
import math

import numpy as np
import pytest

from tactile_sensing.contact.ridge import centre_of_load, mend, ridge_points
from tactile_sensing.skin.kernel import pressure_transforms
from tactile_sensing.thesis.line import pressure as line_pressure
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.skin import Skin

PITCH = 0.0254 / 16
PAD = TactelArray(16, 16, PITCH, PITCH)
YAWS = [0.0, 0.3, math.pi / 4, -1.0, math.pi / 2]


def line(yaw, rho=0.001, noise=0.0, seed=0):
    clean = line_pressure(PAD.x, PAD.y[:, None], rho, yaw, 200.0, 0.002)
    return clean + noise * np.random.default_rng(seed).standard_normal(clean.shape)


def distance(points, yaw, rho=0.001):
    return points['x'] * math.cos(yaw) + points['y'] * math.sin(yaw) - rho


@pytest.mark.parametrize('yaw', YAWS)
def test_points_lie_on_a_straight_edge_and_run_along_it(yaw):
    points = ridge_points(line(yaw), PAD, 1.0, 0.002)
    assert len(points) >= 12
    np.testing.assert_allclose(distance(points, yaw), 0.0, atol=1e-9)
    along = points['tx'] * -math.sin(yaw) + points['ty'] * math.cos(yaw)
    np.testing.assert_allclose(np.abs(along), 1.0, atol=1e-9)
    # It allows for the area of the tactels, which the pressure of this line is not averaged over.
    np.testing.assert_allclose(points['pressure'], 2 * 200.0 / (math.pi * 0.002), rtol=0.04)
    np.testing.assert_allclose(points['quality'], 1.0, atol=1e-6)


@pytest.mark.parametrize('yaw', YAWS)
def test_at_40_db_a_point_is_good_for_a_hundredth_of_a_millimetre(yaw):
    errors = np.concatenate([
        distance(ridge_points(line(yaw, noise=630.0, seed=seed), PAD, 630.0, 0.002), yaw)
        for seed in range(20)])
    assert np.sqrt(np.mean(errors**2)) < 0.015e-3
    assert abs(errors.mean()) < 0.002e-3


@pytest.mark.parametrize('depth, thickness', [
    (0.001, 0.0011), (0.001, 0.002), (0.0016, 0.0026), (0.0024, 0.0034), (0.0024, 0.0064),
    (0.0024, math.inf), (0.0016, math.inf), (0.001, math.inf), (0.0008, math.inf),
    (0.0005, math.inf)])
def test_the_pressure_on_the_ridge_does_not_depend_on_the_place_between_tactels(
        depth, thickness):
    """With tactels wider than the skin is deep, it was .3 to 3.4 times the true one."""
    k = np.linspace(0.5, 20.0 / depth, 4000)
    of_skin = (np.exp(-k * depth) * (1.0 + k * depth) if thickness == math.inf else
               pressure_transforms(k, Skin(depth, thickness, 0.49))[0])
    across = np.linspace(0.0, 0.03, 6000)
    profile = np.cos(across[:, None] * k) @ of_skin * (k[1] - k[0]) / math.pi
    inner = (np.arange(9) - 4.0) / 9.0 * PITCH  # places on a tactel, which averages over its area
    for rho in np.linspace(0.0, PITCH, 11):
        for yaw in (0.0, 0.03, 0.3, math.pi / 4, math.pi / 2):
            v = sum(axis.reshape(shape) * way for axis, shape, way in (
                (PAD.x, (-1, 1, 1), math.cos(yaw)), (PAD.y, (-1, 1, 1, 1), math.sin(yaw)),
                (inner, (-1, 1), math.cos(yaw)), (inner, (-1,), math.sin(yaw)))) - rho
            pressure = np.interp(abs(v), across, profile).mean(axis=(2, 3))
            points = ridge_points(pressure, PAD, 1e-4 * pressure.max(), depth)
            assert len(points) >= 8
            force = 0.5 * math.pi * depth * np.median(points['pressure'])  # (3.1) at its peak
            assert 0.8 < force < 1.25


@pytest.mark.parametrize('yaw', YAWS)
def test_a_noisy_edge_on_coarse_tactels_has_a_ridge(yaw):
    """Smoothed against the noise, it seemed too wide for the depth of a thin skin."""
    coarse, fine = TactelArray(7, 7, 4e-3, 4e-3), (np.arange(20) - 9.5) / 20.0 * 4e-3
    places = [np.add.outer(axis, fine).ravel() for axis in (coarse.x, coarse.y)]
    pressure = line_pressure(places[0], places[1][:, None], 1e-3, yaw, 75.0, 1e-3)
    pressure = pressure.reshape(7, 20, 7, 20).mean(axis=(1, 3))
    noise = 0.06 * pressure.max()
    for seed in range(10):
        image = pressure + noise * np.random.default_rng(seed).standard_normal(pressure.shape)
        points = ridge_points(image, coarse, noise, 1e-3)
        assert len(points) >= 4
        assert np.abs(distance(points, yaw)).mean() < 1.2e-3


def test_a_ridge_in_noise_has_a_pressure():
    """Where only the smoothed image shows it, the sum over tactels was below 0."""
    found = 0
    for seed in range(300):
        rng = np.random.default_rng(seed)
        image = line(rng.uniform(0.0, math.pi)) * rng.uniform(0.0, 0.02) + 630.0 * (
            rng.standard_normal(PAD.shape))
        points = ridge_points(image, PAD, 200.0, 0.002)  # the noise is larger than it says
        found += len(points)
        assert (points['pressure'] > 0.0).all()
    assert found > 1000


def test_what_is_no_edge_has_no_ridge():
    noise = 630.0 * np.random.default_rng(0).standard_normal(PAD.shape)
    assert len(ridge_points(noise, PAD, 630.0, 0.002)) == 0
    assert len(ridge_points(np.zeros(PAD.shape), PAD, 1.0, 0.002)) == 0
    assert len(ridge_points(np.full(PAD.shape, 4e3), PAD, 630.0, 0.002)) == 0
    broad = line_pressure(PAD.x, PAD.y[:, None], 0.0, 0.2, 1000.0, 0.008)
    assert len(ridge_points(broad, PAD, 1.0, 0.002)) == 0
    assert len(ridge_points(np.full((2, 2), 1e5), TactelArray(2, 2, PITCH, PITCH),
                            1.0, 0.002)) == 0


@pytest.mark.parametrize('yaw', YAWS)
@pytest.mark.parametrize('value', [np.nan, 0.0])
def test_broken_tactels_on_the_ridge_are_mended(yaw, value):
    picture = line(yaw)
    broken = picture.copy()
    r, c = np.unravel_index(np.argmax(picture[3:13, 3:13]), (10, 10))
    broken[r + 3, c + 3] = value
    mended = mend(broken, 630.0)
    assert mended[r + 3, c + 3] == pytest.approx(picture[r + 3, c + 3], rel=0.15)
    assert np.abs(distance(ridge_points(broken, PAD, 630.0, 0.002), yaw)).max() < 0.15e-3


@pytest.mark.parametrize('columns', [(8, 9), (7, 8)])
def test_an_invalid_neighbour_is_no_witness(columns):
    picture = line(0.0, rho=0.5 * PITCH)
    broken = picture.copy()
    broken[6, list(columns)] = np.nan
    np.testing.assert_allclose(mend(broken, 630.0), picture)


def test_the_centre_of_the_load_is_that_of_its_stronger_part():
    picture = np.zeros(PAD.shape)
    picture[3, 5], picture[3, 7], picture[9, 2] = 4e4, 4e4, 1e4
    assert centre_of_load(picture, PAD.x, PAD.y, 0.3) == pytest.approx((PAD.x[6], PAD.y[3]))
    expected = (8 * PAD.x[6] + PAD.x[2]) / 9, (8 * PAD.y[3] + PAD.y[9]) / 9
    assert centre_of_load(picture, PAD.x, PAD.y, 0.2) == pytest.approx(expected)
    assert centre_of_load(0.0 * picture, PAD.x, PAD.y, 0.3) == (0.0, 0.0)


def test_sound_pictures_are_left_alone():
    for yaw in YAWS:
        picture = line(yaw, noise=630.0)
        assert (mend(picture, 630.0) == picture).mean() > 0.99
