"""Loads of chapters 2 and 3: textbook formulas, integrals, moments and geometry."""

from dataclasses import astuple

from averages_over_tactels import all_moments, plane_moments
import numpy as np
import point_load as point
import pytest
from scipy.integrate import dblquad, quad

from tactile_sensing.image import image_moments
from tactile_sensing.skin.bumps import chord
from tactile_sensing.thesis import line
from tactile_sensing.thesis.line import line_from_moments
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.moments import Moments

DEPTH = 0.002
LOAD = (0.0012, -0.0007, 5.0, 1.4, -0.8)
ARRAY = TactelArray(16, 16, 0.0254 / 16, 0.0254 / 16)
X, Y = np.random.default_rng(1).uniform(-0.013, 0.013, (2, 60))


def test_a_point_is_boussinesq_and_cerruti_and_shear_the_slope_of_the_ray():
    a, b, normal, shear_x, shear_y = LOAD
    r5 = ((X - a)**2 + (Y - b)**2 + DEPTH**2)**2.5
    boussinesq = 3.0 * normal * DEPTH**3 / (2.0 * np.pi * r5)
    cerruti = 3.0 * (shear_x * (X - a) + shear_y * (Y - b)) * DEPTH**2 / (2.0 * np.pi * r5)
    for component, slope in (('zz', 1.0), ('xz', (X - a) / DEPTH), ('yz', (Y - b) / DEPTH)):
        np.testing.assert_allclose(point.stress(component, X, Y, *LOAD, DEPTH),
                                   slope * (boussinesq + cerruti), rtol=1e-12)


@pytest.mark.parametrize('component', ['zz', 'xz', 'yz'])
def test_moments_of_the_plane(component):
    expected = np.array(astuple(plane_moments(*LOAD, DEPTH, component)))
    known = np.isfinite(expected)
    assert known.sum() == (6 if component == 'zz' else 3)
    found = np.array(astuple(all_moments(LOAD, DEPTH, component)))
    np.testing.assert_allclose(found[known], expected[known], rtol=3e-3)


@pytest.mark.parametrize('shear', [0.0, 55.0, -400.0])
def test_a_line_is_the_point_load_integrated_along_it(shear):
    for v in (0.0, 0.0013):
        expected, _ = quad(lambda t, v=v: point.stress(
            'zz', v, 0.0, 0.0, t, 190.0, shear, 80.0, DEPTH), -np.inf, np.inf, epsrel=1e-10)
        assert line.pressure(v, 0.0, 0.0, 0.0, 190.0, DEPTH, shear) == pytest.approx(
            expected, rel=1e-7)
    assert line.pressure(0.0, 0.0, 0.0, 0.0, 190.0, DEPTH) == pytest.approx(
        line.peak_pressure(190.0, DEPTH))


def test_across_a_line_are_its_force_and_the_shift_by_shear():
    def integral(power):
        return quad(lambda v: v**power * line.pressure(
            v, 0.3, 0.0, 0.0, 190.0, DEPTH, 55.0), -np.inf, np.inf)[0]
    assert integral(0) == pytest.approx(190.0, rel=1e-7)
    assert integral(1) == pytest.approx(DEPTH * 55.0, rel=1e-6)  # by d Q / P, as Table 2.2


def test_yaw_is_right_handed_and_the_thesis_angle_is_not():
    rho, yaw = 0.003, 0.4
    expected = line.pressure(X, Y, rho, yaw, 190.0, DEPTH, 55.0)
    turned = line.pressure(-Y, X, rho, yaw + np.pi / 2, 190.0, DEPTH, 55.0)
    np.testing.assert_allclose(turned, expected, rtol=1e-9)
    # The edge x = b + y tan(alpha) of the thesis leans to +x for alpha > 0.
    alpha, y = -yaw, 0.005
    b = rho / np.cos(yaw)
    assert line.pressure(b + y * np.tan(alpha), y, rho, yaw, 190.0, DEPTH) == pytest.approx(
        line.peak_pressure(190.0, DEPTH))


@pytest.mark.parametrize('rho, yaw, expected', [
    (0.0, 0.0, 0.02), (0.004, 0.0, 0.02), (0.006, 0.0, 0.0), (0.0, np.pi / 2, 0.01),
    (0.0, np.pi / 6, 0.02)])
def test_the_chord_of_a_rectangle(rho, yaw, expected):
    first, last = chord(0.005, 0.01, rho, yaw)
    assert max(last - first, 0.0) == pytest.approx(expected, abs=1e-12)


def test_moments_of_a_strip_and_the_closed_form_that_comes_near():
    """The strip |y| <= L, all x: (3.2) to (3.7), with (3.9) corrected."""
    a, yaw, force, half = 0.002, -0.3, 180.0, 0.0127

    def moment(p, q):
        return dblquad(lambda x, y: x**p * y**q * line.pressure(
            x, y, a * np.cos(yaw), yaw, force, DEPTH), -half, half, -np.inf, np.inf,
            epsrel=1e-9)[0]
    m = Moments(*(moment(*order) for order in
                  ((0, 0), (1, 0), (0, 1), (2, 0), (0, 2), (1, 1))))
    m0, tan = 2.0 * force * half / np.cos(yaw), np.tan(-yaw)
    np.testing.assert_allclose(
        [m.m0, m.mx, m.my, m.myy, m.mxy, m.mxx],
        [m0, a * m0, 0.0, m0 * half**2 / 3, tan * m0 * half**2 / 3,
         m0 * (a**2 + tan**2 * half**2 / 3 + DEPTH**2 / np.cos(yaw)**2)], rtol=1e-6, atol=1e-9)
    found = line_from_moments(m, half)
    assert found.a == pytest.approx(a, rel=1e-6)
    assert found.line_force == pytest.approx(force, rel=0.02)
    assert found.yaw == pytest.approx(yaw, rel=5.0 * DEPTH**2 / half**2)
    printed = -0.5 * np.arctan(-m.mxy / (m.mxx - m.myy - 3.0 * a**2 * m.m0))
    assert abs(printed - yaw) > 0.1


def test_image_moments_skip_invalid_tactels_and_those_under_the_threshold():
    image = np.zeros(ARRAY.shape)
    image[3, 5], image[4, 4], image[8, 8] = 1000.0, np.nan, 10.0
    cell = ARRAY.pitch_x * ARRAY.pitch_y
    m = image_moments(image, ARRAY, threshold=50.0)
    assert m.m0 == pytest.approx(1000.0 * cell)
    assert m.centre_of_pressure == pytest.approx((ARRAY.x[5], ARRAY.y[3]))
    assert image_moments(image, ARRAY).m0 == pytest.approx(1010.0 * cell)


def test_elongation_separates_an_edge_from_a_flat():
    edge = line.pressure(ARRAY.x, ARRAY.y[:, None], 0.001, 0.2, 200.0, DEPTH)
    assert image_moments(edge, ARRAY).elongation() > 6.0
    assert image_moments(np.ones(ARRAY.shape), ARRAY).elongation() == pytest.approx(1.0)
    assert np.isnan(image_moments(np.zeros(ARRAY.shape), ARRAY).elongation())
