"""Line model: quadrature, derivatives, geometry and closed forms."""

import numpy as np
import pytest
from scipy.integrate import dblquad, quad

from tactile_sensing.image import image_moments
from tactile_sensing.thesis import line
from tactile_sensing.thesis.line_moments import line_from_moments
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.moments import Moments

DEPTH = 0.002
ARRAY = TactelArray(16, 16, 0.0254 / 16, 0.0254 / 16)


def picture(a, yaw, line_force, array=ARRAY, depth=DEPTH):
    return line.pressure(
        array.x[None, :], array.y[:, None], a * np.cos(yaw), yaw, line_force, depth)


def strip_moments(a, yaw, line_force, depth, half):
    """Moments over the strip |y| <= half, all x: what (3.2) to (3.7) integrate."""
    def moment(p, q):
        def integrand(x, y):
            return x**p * y**q * line.pressure(
                x, y, a * np.cos(yaw), yaw, line_force, depth)
        return dblquad(integrand, -half, half, -np.inf, np.inf, epsrel=1e-9)[0]
    return Moments(*[moment(*order) for order in
                     ((0, 0), (1, 0), (0, 1), (2, 0), (0, 2), (1, 1))])


def test_pressure_is_the_boussinesq_point_load_integrated_along_the_line():
    line_force, v = 180.0, 0.0013

    def point_load(t):
        return 1.5 / np.pi * DEPTH**3 * line_force * (v**2 + t**2 + DEPTH**2)**-2.5
    expected, _ = quad(point_load, -np.inf, np.inf, epsrel=1e-10)
    assert line.pressure(v, 0.0, 0.0, 0.0, line_force, DEPTH) == pytest.approx(expected, rel=1e-8)


def test_pressure_across_the_line_integrates_to_the_line_force():
    total, _ = quad(lambda v: line.pressure(v, 0.3, 0.0, 0.0, 180.0, 1.0), -np.inf, np.inf)
    assert total == pytest.approx(180.0, rel=1e-8)


def test_peak_pressure_is_the_pressure_on_the_line():
    rho, yaw = 0.003, 0.4
    x, y = rho * np.cos(yaw), rho * np.sin(yaw)
    assert line.pressure(x, y, rho, yaw, 180.0, DEPTH) == pytest.approx(
        line.peak_pressure(180.0, DEPTH))


def test_yaw_is_right_handed_and_the_thesis_angle_is_not():
    # The edge x = b + y tan(alpha) of the thesis leans to +x for alpha > 0.
    alpha = 0.3
    yaw = -alpha
    y = 0.005
    assert line.signed_distance(0.002 + y * np.tan(alpha), y, 0.002 * np.cos(yaw), yaw) == (
        pytest.approx(0.0, abs=1e-15))


@pytest.mark.parametrize('rho, yaw, expected', [
    (0.0, 0.0, 0.02), (0.004, 0.0, 0.02), (0.006, 0.0, 0.0), (0.0, np.pi / 2, 0.01),
    (0.0, np.pi / 6, 0.02)])
def test_chord_length_within_a_rectangle(rho, yaw, expected):
    assert line.chord_length(rho, yaw, 0.005, 0.01) == pytest.approx(expected, abs=1e-12)


def test_strip_moments_match_the_closed_expressions():
    a, yaw, force, half = 0.002, -0.3, 180.0, 0.0127
    m = strip_moments(a, yaw, force, DEPTH, half)
    m0 = 2.0 * force * half / np.cos(yaw)
    tan = np.tan(-yaw)
    np.testing.assert_allclose(
        [m.m0, m.mx, m.my, m.myy, m.mxy, m.mxx],
        [m0, a * m0, 0.0, m0 * half**2 / 3, tan * m0 * half**2 / 3,
         m0 * (a**2 + tan**2 * half**2 / 3 + DEPTH**2 / np.cos(yaw)**2)], rtol=1e-6, atol=1e-9)


def test_corrected_closed_form_comes_near_and_the_printed_one_does_not():
    a, yaw, force, half = 0.002, -0.3, 180.0, 0.0127
    m = strip_moments(a, yaw, force, DEPTH, half)
    corrected, printed = line_from_moments(m, half), line_from_moments(m, half, printed=True)
    assert corrected.a == pytest.approx(a, rel=1e-6)
    assert corrected.line_force == pytest.approx(force, rel=0.02)
    assert corrected.yaw == pytest.approx(yaw, rel=5.0 * DEPTH**2 / half**2)
    assert abs(printed.yaw - yaw) > 0.1


def test_image_moments_skip_invalid_tactels_and_those_under_the_threshold():
    image = np.zeros(ARRAY.shape)
    image[3, 5], image[4, 4], image[8, 8] = 1000.0, np.nan, 10.0
    cell = ARRAY.pitch_x * ARRAY.pitch_y
    m = image_moments(image, ARRAY, threshold=50.0)
    assert m.m0 == pytest.approx(1000.0 * cell)
    assert m.centre_of_pressure == pytest.approx((ARRAY.x[5], ARRAY.y[3]))
    assert image_moments(image, ARRAY).m0 == pytest.approx(1010.0 * cell)


def test_elongation_tells_an_edge_from_a_flat():
    assert image_moments(picture(0.001, 0.2, 200.0), ARRAY).elongation() > 6.0
    assert image_moments(np.ones(ARRAY.shape), ARRAY).elongation() == pytest.approx(1.0)
    assert np.isnan(image_moments(np.zeros(ARRAY.shape), ARRAY).elongation())
