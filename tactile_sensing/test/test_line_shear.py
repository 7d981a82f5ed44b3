"""Line load with shear across it: quadrature, derivatives, averages and invariances."""

from averages_over_tactels import line_average, line_average_jacobian
import numpy as np
import pytest
from scipy.integrate import dblquad, quad

from tactile_sensing.thesis import line, point

DEPTH = 0.002
PARAMETERS = np.array([0.0008, 0.3, 190.0, 55.0])
SIZE = 0.0016, 0.0012
# Along both axes, nearly so on both sides of the switch to quadrature, and between.
YAWS = (0.0, 1e-9, 0.01, 0.0832, 0.0836, 0.3, -0.9, np.pi / 2, np.pi / 2 - 0.0624,
        np.pi / 2 - 0.0626, 2.0)


def points(count=40, seed=2):
    return np.random.default_rng(seed).uniform(-0.012, 0.012, (2, count))


def with_yaw(yaw):
    return np.array([PARAMETERS[0], yaw, *PARAMETERS[2:]])


def test_without_shear_it_is_the_pressure():
    x, y = points()
    np.testing.assert_allclose(
        line.stress_with_shear(x, y, *PARAMETERS[:3], 0.0, DEPTH),
        line.pressure(x, y, *PARAMETERS[:3], DEPTH), rtol=1e-12)


def test_it_is_the_point_load_integrated_along_the_line():
    v = 0.0013
    for shear in (55.0, -400.0):
        expected, _ = quad(
            lambda t, q=shear: point.stress('zz', v, 0.0, 0.0, t, 190.0, q, 80.0, DEPTH),
            -np.inf, np.inf, epsrel=1e-10)
        assert line.stress_with_shear(v, 0.0, 0.0, 0.0, 190.0, shear, DEPTH) == pytest.approx(
            expected, rel=1e-7)


def test_shear_shifts_the_centroid_as_it_does_for_a_point():
    def integral(power):
        return quad(lambda v: v**power * line.stress_with_shear(
            v, 0.0, 0.0, 0.0, *PARAMETERS[2:], DEPTH), -np.inf, np.inf)[0]
    assert integral(0) == pytest.approx(PARAMETERS[2], rel=1e-7)
    # By d Q / P, the equivalent of Table 2.2.
    assert integral(1) == pytest.approx(DEPTH * PARAMETERS[3], rel=1e-6)


@pytest.mark.parametrize('yaw', YAWS)
@pytest.mark.parametrize('size', [(), SIZE], ids=['sampling', 'averaging'])
def test_jacobian_against_finite_differences(yaw, size):
    x, y = points()
    model, jacobian = (line_average, line_average_jacobian) if size \
        else (line.stress_with_shear, line.stress_with_shear_jacobian)
    at = with_yaw(yaw)
    analytic = jacobian(x, y, *at, DEPTH, *size)
    assert analytic.shape == (x.size, 4)
    for k, step in enumerate((1e-7, 1e-5, 1e-2, 1e-2)):
        shift = np.zeros(4)
        shift[k] = step
        numeric = (model(x, y, *(at + shift), DEPTH, *size)
                   - model(x, y, *(at - shift), DEPTH, *size)) / (2.0 * step)
        scale = np.abs(analytic[:, k]).max()
        np.testing.assert_allclose(analytic[:, k] / scale, numeric / scale, atol=2e-7)


@pytest.mark.parametrize('yaw', YAWS)
def test_average_against_quadrature(yaw):
    at = with_yaw(yaw)
    for x, y in ((0.001, -0.0005), (0.004, 0.003)):
        expected = dblquad(
            lambda v, u: line.stress_with_shear(u, v, *at, DEPTH),
            x - SIZE[0] / 2, x + SIZE[0] / 2, y - SIZE[1] / 2, y + SIZE[1] / 2,
            epsrel=1e-11)[0] / (SIZE[0] * SIZE[1])
        got = line_average(x, y, *at, DEPTH, *SIZE)
        assert got == pytest.approx(expected, rel=1e-9)


def test_average_over_a_large_tactel_is_exact():
    at = with_yaw(0.3)
    expected = dblquad(
        lambda v, u: line.stress_with_shear(u, v, *at, DEPTH),
        -0.01, 0.01, -0.01, 0.01, epsrel=1e-9)[0] / 0.02**2
    assert line_average(0.0, 0.0, *at, DEPTH, 0.02, 0.02) == pytest.approx(
        expected, rel=1e-8)


def test_translation_rotation_and_scale():
    x, y = points()
    rho, yaw, force, shear = PARAMETERS
    expected = line.stress_with_shear(x, y, rho, yaw, force, shear, DEPTH)
    moved = rho + 0.003 * np.cos(yaw) - 0.002 * np.sin(yaw)
    np.testing.assert_allclose(
        line.stress_with_shear(x + 0.003, y - 0.002, moved, yaw, force, shear, DEPTH),
        expected, rtol=1e-9, atol=1e-9 * expected.max())
    np.testing.assert_allclose(
        line.stress_with_shear(-y, x, rho, yaw + np.pi / 2, force, shear, DEPTH),
        expected, rtol=1e-9, atol=1e-9 * expected.max())
    # The same line seen from its other side.
    np.testing.assert_allclose(
        line.stress_with_shear(x, y, -rho, yaw + np.pi, force, -shear, DEPTH),
        expected, rtol=1e-9, atol=1e-9 * expected.max())
    np.testing.assert_allclose(
        line.stress_with_shear(2 * x, 2 * y, 2 * rho, yaw, 6 * force, 6 * shear, 2 * DEPTH),
        3 * expected, rtol=1e-9, atol=1e-9 * expected.max())
