"""Pressure in a layer of skin on a rigid backing: limits, equilibrium, averages over tactels."""

from averages_over_tactels import line_average, point_average
import numpy as np
import point_load as point
import pytest
from scipy.special import j0, j1

from tactile_common.errors import ConfigurationError
from tactile_sensing.skin.half_spaces import half_spaces
from tactile_sensing.skin.kernel import pressure_transforms
from tactile_sensing.skin.pressure import SkinPressure
from tactile_sensing.thesis import line
from tactile_sensing.types.skin import Skin

DEPTH = 0.002
X = np.linspace(-0.012, 0.012, 25)
Y = X[:, None]
POINT = (1e-3, 2e-3, 1.0, 0.3, -0.2)
LINE = (1e-3, 0.3, 200.0, 60.0)


def off(found, expected):
    """Return the largest difference relative to the peak."""
    return np.abs(found - expected).max() / np.abs(expected).max()


@pytest.mark.parametrize('thickness', [np.inf, 1.0, 0.1])
def test_thick_skin_is_a_half_space(thickness):
    skin = SkinPressure(Skin(DEPTH, thickness, 0.4))
    assert off(skin.point(X, Y, *POINT), point.stress('zz', X, Y, *POINT, DEPTH)) < 1e-4
    assert off(skin.line(X, Y, *LINE), line.pressure(X, Y, *LINE[:3], DEPTH, LINE[3])) < 1e-4


@pytest.mark.parametrize('thickness, bound', [
    (np.inf, 3e-4), (0.006, 0.01), (0.004, 0.01), (0.0025, 0.025)])
def test_a_skin_is_a_sum_of_half_spaces(thickness, bound):
    skin, (rho, yaw, force, _) = Skin(DEPTH, thickness, 0.45), LINE
    found = sum(part['weight'] * line.pressure(X, Y, rho, yaw, force, part['depth'])
                for part in half_spaces(skin))
    assert off(found, SkinPressure(skin).line(X, Y, rho, yaw, force)) < bound


@pytest.mark.parametrize('thickness', [0.002, 0.004, 0.01])
@pytest.mark.parametrize('poisson', [0.3, 0.49, 0.5])
def test_pressure_carries_the_load(thickness, poisson):
    skin = SkinPressure(Skin(DEPTH, thickness, poisson))
    r = np.linspace(0.0, 5.0 * thickness, 2001)
    carried = np.trapezoid(2.0 * np.pi * r * skin.point(r, 0.0, 0.0, 0.0, 3.0), r)
    assert carried == pytest.approx(3.0, rel=0.02)  # farther out the pressure is slightly negative
    carried = np.trapezoid(2.0 * skin.line(r, 0.0, 0.0, 0.0, 7.0), r)
    assert carried == pytest.approx(7.0, rel=0.02)


def test_rest_upon_the_base_has_the_pressure_of_the_thin_layer():
    # A load that is almost constant over many thicknesses is transmitted unchanged.
    for poisson in (0.0, 0.3, 0.45):
        normal, shear = pressure_transforms(np.array([1.0]), Skin(DEPTH, 2 * DEPTH, poisson))
        assert normal == pytest.approx(1.0, abs=1e-4)
        assert shear == pytest.approx(DEPTH, rel=1e-2)  # equilibrium of the layer above


@pytest.mark.parametrize('thickness, poisson', [(0.002, 0.49), (0.003, 0.3), (0.006, 0.5)])
def test_polynomials_are_the_transforms(thickness, poisson):
    layer = Skin(DEPTH, thickness, poisson)
    k = (np.arange(30000) + 0.5) * 1e-3 / DEPTH  # the midpoint rule, to 30 / DEPTH
    r = np.linspace(0.0, 6.0, 25) * DEPTH
    normal, shear = (transform * k * (k[1] - k[0]) / (2.0 * np.pi)
                     for transform in pressure_transforms(k, layer))
    found = SkinPressure(layer)
    assert off(found.point(r, 0.0, 0.0, 0.0, 1.0), j0(np.outer(r, k)) @ normal) < 3e-4
    assert off(found.point(r, 0.0, 0.0, 0.0, 0.0, 1.0), j1(np.outer(r, k)) @ shear) < 1e-3


@pytest.mark.parametrize('pitch_x, pitch_y, most', [
    (0.001, 0.001, 5e-4), (0.0016, 0.0016, 2.5e-3), (0.0025, 0.0025, 1e-3), (0.004, 0.004, 1e-3),
    (0.0014, 0.001, 3e-3), (0.004, 0.0016, 5e-3)])
def test_tactels_average_over_their_area(pitch_x, pitch_y, most):
    skin = SkinPressure(Skin(DEPTH), pitch_x, pitch_y)
    assert off(skin.point(X, Y, *POINT),
               point_average('zz', X, Y, *POINT, DEPTH, pitch_x, pitch_y)) < most
    for yaw in (0.0, 0.4, np.pi / 4):
        load = (1e-3, yaw, 200.0, 60.0)
        assert off(skin.line(X, Y, *load),
                   line_average(X, Y, *load, DEPTH, pitch_x, pitch_y)) < most


def test_line_is_a_row_of_points():
    skin = SkinPressure(Skin(DEPTH, 2 * DEPTH, 0.49), 0.001, 0.001)
    places = np.arange(-0.06, 0.06, 0.0005)
    row = sum(skin.point(X, 0.0, 0.0, b, 0.0005, 0.0001) for b in places)
    assert off(row, skin.line(X, 0.0, 0.0, 0.0, 1.0, 0.2)) < 5e-4


@pytest.mark.parametrize('radius', [0.5e-3, 1.3e-3, 2.9e-3])
def test_patch_is_hertz_pressure(radius):
    skin = SkinPressure(Skin(DEPTH))
    # Equal shares of Hertz' force over rings, each at the place of its middle.
    share = (np.arange(60)[:, None] + 0.5) / 60
    distance = radius * np.sqrt(1.0 - (1.0 - share) ** (2.0 / 3.0))
    turn = 2.0 * np.pi * (np.arange(24) + 0.5) / 24
    u, v = (distance * np.cos(turn)).ravel(), (distance * np.sin(turn)).ravel()
    expected = np.mean([point.stress('zz', X, 0.0, a, b, 1.0, 0.0, 0.0, DEPTH)
                        for a, b in zip(u, v, strict=True)], axis=0)
    assert off(skin.point(X, 0.0, 0.0, 0.0, 1.0, radius=radius), expected) < 2e-3
    angle = np.pi * np.arange(1, 41) / 41  # Gauss-Chebyshev, exact for a half ellipse
    strip = sum(2.0 / 41 * np.sin(t)**2 * line.pressure(
        X, 0.0, 0.9 * radius * np.cos(t), 0.0, 1.0, DEPTH) for t in angle)
    assert off(skin.line(X, 0.0, 0.0, 0.0, 1.0, half_width=0.9 * radius), strip) < 2e-3


@pytest.mark.parametrize('values, message', [
    ((0.0,), 'depth'), ((np.nan,), 'depth'), ((0.002, 0.001), 'thickness is 0.001'),
    ((0.002, np.nan), 'thickness'), ((0.002, 0.004, 0.6), 'poisson is 0.6'),
    (('x',), 'depth is')])
def test_impossible_skins_are_refused(values, message):
    with pytest.raises(ConfigurationError, match=message):
        Skin(*values)
