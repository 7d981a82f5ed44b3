"""Point model: quadrature, derivatives, invariances and moments."""

from averages_over_tactels import point_average_jacobian
from moments_of_a_point import plane_moments, rectangle_moments
import numpy as np
import pytest
from scipy.integrate import dblquad

from tactile_common.errors import ConfigurationError
from tactile_sensing.image import image_moments
from tactile_sensing.thesis import point
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.moments import Moments

DEPTH = 0.002
PARAMETERS = np.array([0.0012, -0.0007, 5.0, 1.4, -0.8])
COMPONENTS = ('zz', 'xz', 'yz')
ORDERS = ((0, 0), (1, 0), (0, 1), (2, 0), (0, 2), (1, 1))
FIELDS = ('m0', 'mx', 'my', 'mxx', 'myy', 'mxy')


def points(count=60, seed=1):
    return np.random.default_rng(seed).uniform(-0.013, 0.013, (2, count))


def as_array(moments):
    return np.array([getattr(moments, name) for name in FIELDS])


def finite_differences(function, at, steps):
    columns = []
    for k, step in enumerate(steps):
        shift = np.zeros(len(at))
        shift[k] = step
        columns.append((function(at + shift) - function(at - shift)) / (2.0 * step))
    return np.stack(columns, axis=-1)


def quadrature(integrand, x_limits, y_limits):
    return dblquad(integrand, *y_limits, *x_limits, epsabs=0.0, epsrel=1e-9)[0]


def test_pressure_is_boussinesq_and_cerruti():
    x, y = points()
    a, b, normal, shear_x, shear_y = PARAMETERS
    r5 = ((x - a)**2 + (y - b)**2 + DEPTH**2)**2.5
    boussinesq = 3.0 * normal * DEPTH**3 / (2.0 * np.pi * r5)
    cerruti = 3.0 * (shear_x * (x - a) + shear_y * (y - b)) * DEPTH**2 / (2.0 * np.pi * r5)
    np.testing.assert_allclose(
        point.stress('zz', x, y, *PARAMETERS, DEPTH), boussinesq + cerruti, rtol=1e-12)


def test_shear_is_the_pressure_times_the_slope_of_the_ray():
    x, y = points()
    pressure = point.stress('zz', x, y, *PARAMETERS, DEPTH)
    np.testing.assert_allclose(
        point.stress('xz', x, y, *PARAMETERS, DEPTH),
        (x - PARAMETERS[0]) / DEPTH * pressure, rtol=1e-12)
    np.testing.assert_allclose(
        point.stress('yz', x, y, *PARAMETERS, DEPTH),
        (y - PARAMETERS[1]) / DEPTH * pressure, rtol=1e-12)


@pytest.mark.parametrize('component', COMPONENTS)
@pytest.mark.parametrize('size', [None, (0.001, 0.0015)], ids=['sampling', 'averaging'])
def test_jacobian_against_finite_differences(component, size):
    x, y = points()
    model, jacobian = (point.stress, point.stress_jacobian) if size is None \
        else (point.average, point_average_jacobian)
    size = size or ()
    analytic = jacobian(component, x, y, *PARAMETERS, DEPTH, *size)
    numeric = finite_differences(
        lambda q: model(component, x, y, *q, DEPTH, *size),
        PARAMETERS, (1e-7, 1e-7, 1e-3, 1e-3, 1e-3))
    assert analytic.shape == (x.size, 5)
    scale = np.abs(analytic).max(axis=0)
    np.testing.assert_allclose(analytic / scale, numeric / scale, atol=2e-8)


@pytest.mark.parametrize('component', COMPONENTS)
@pytest.mark.parametrize('centre', [(0.0012, -0.0007), (0.003, 0.001), (-0.011, 0.012)])
def test_average_against_quadrature(component, centre):
    x, y = centre
    size_x, size_y = 0.001, 0.0016
    expected = quadrature(
        lambda u, v: point.stress(component, u, v, *PARAMETERS, DEPTH),
        (x - size_x / 2, x + size_x / 2), (y - size_y / 2, y + size_y / 2)) / (size_x * size_y)
    got = point.average(component, x, y, *PARAMETERS, DEPTH, size_x, size_y)
    assert got == pytest.approx(expected, rel=1e-8)


def test_average_of_a_small_tactel_is_the_sample():
    x, y = points()
    sample = point.stress('zz', x, y, *PARAMETERS, DEPTH)
    averaged = point.average('zz', x, y, *PARAMETERS, DEPTH, 2e-5, 2e-5)
    np.testing.assert_allclose(averaged, sample, atol=1e-4 * sample.max())


def test_models_broadcast_over_an_array():
    array = TactelArray(6, 8, 0.001, 0.0012)
    x, y = array.x[None, :], array.y[:, None]
    size = array.pitch_x, array.pitch_y
    assert point.stress('xz', x, y, *PARAMETERS, DEPTH).shape == (6, 8)
    assert point.stress_jacobian('xz', x, y, *PARAMETERS, DEPTH).shape == (6, 8, 5)
    assert point.average('xz', x, y, *PARAMETERS, DEPTH, *size).shape == (6, 8)
    assert point_average_jacobian('xz', x, y, *PARAMETERS, DEPTH, *size).shape == (6, 8, 5)


@pytest.mark.parametrize('component', COMPONENTS)
@pytest.mark.parametrize('limits', [
    ((-0.013, 0.013), (-0.013, 0.013)), ((0.002, 0.009), (-0.004, 0.011))])
def test_rectangle_moments_against_quadrature(component, limits):
    got = as_array(rectangle_moments(*limits, *PARAMETERS, DEPTH, component=component))
    # Gauss-Legendre on pieces shorter than the depth; dblquad would take seconds.
    nodes, weights = np.polynomial.legendre.leggauss(200)
    (x1, x2), (y1, y2) = limits
    x = 0.5 * (x1 + x2) + 0.5 * (x2 - x1) * nodes[None, :]
    y = 0.5 * (y1 + y2) + 0.5 * (y2 - y1) * nodes[:, None]
    weighted = 0.25 * (x2 - x1) * (y2 - y1) * weights[None, :] * weights[:, None] \
        * point.stress(component, x, y, *PARAMETERS, DEPTH)
    expected = [np.sum(weighted * x**p * y**q) for p, q in ORDERS]
    absolute = [np.sum(np.abs(weighted * x**p * y**q)) for p, q in ORDERS]
    np.testing.assert_allclose(got / absolute, np.array(expected) / absolute, atol=1e-11)


def test_rectangle_moments_against_adaptive_quadrature():
    limits = (0.002, 0.009), (-0.004, 0.011)
    got = rectangle_moments(*limits, *PARAMETERS, DEPTH)
    for name, (p, q) in zip(FIELDS, ORDERS, strict=True):
        expected = quadrature(
            lambda x, y, p=p, q=q: x**p * y**q * point.stress(
                'zz', x, y, *PARAMETERS, DEPTH), *limits)
        assert getattr(got, name) == pytest.approx(expected, rel=1e-7), name


@pytest.mark.parametrize('component', COMPONENTS)
def test_rectangle_moments_add_up(component):
    def moments(x_limits):
        return as_array(rectangle_moments(
            x_limits, (-0.005, 0.007), *PARAMETERS, DEPTH, component=component))
    whole = moments((-0.01, 0.01))
    np.testing.assert_allclose(
        moments((-0.01, 0.0015)) + moments((0.0015, 0.01)), whole,
        atol=1e-12 * np.abs(whole).max())


def test_rectangle_moments_are_the_sum_over_averaging_tactels():
    array = TactelArray(26, 26, 0.001, 0.001)
    picture = point.average(
        'zz', array.x[None, :], array.y[:, None], *PARAMETERS, DEPTH, 0.001, 0.001)
    got = image_moments(picture, array)
    expected = rectangle_moments(
        (-0.013, 0.013), (-0.013, 0.013), *PARAMETERS, DEPTH)
    assert got.m0 == pytest.approx(expected.m0, rel=1e-12)


def test_moments_of_a_large_window_are_those_of_the_plane():
    half = 2.0e3 * DEPTH
    for component in COMPONENTS:
        got = as_array(rectangle_moments(
            (-half, half), (-half, half), *PARAMETERS, DEPTH, component=component))
        expected = as_array(plane_moments(*PARAMETERS, DEPTH, component=component))
        known = np.isfinite(expected)
        assert known.sum() == (6 if component == 'zz' else 3)
        np.testing.assert_allclose(got[known], expected[known], rtol=3e-3)


def test_plane_moments_including_mxy():
    a, b, p, qx, qy = PARAMETERS
    assert plane_moments(*PARAMETERS, DEPTH) == Moments(
        p, DEPTH * qx + a * p, DEPTH * qy + b * p, 2 * a * DEPTH * qx + p * (DEPTH**2 + a**2),
        2 * b * DEPTH * qy + p * (DEPTH**2 + b**2), a * b * p + DEPTH * (a * qy + b * qx))
    m = plane_moments(*PARAMETERS, DEPTH)
    # Central: -d^2 Qx Qy / P for pressure, so its sign couples the signs of the shear.
    assert m.mxy - m.mx * m.my / m.m0 == pytest.approx(-DEPTH**2 * qx * qy / p, rel=1e-9)


def test_shear_moment_identity_holds_on_any_window():
    limits = (-0.002, 0.007), (-0.009, 0.004)
    normal = rectangle_moments(*limits, *PARAMETERS, DEPTH)
    for component, first, at in (('xz', 'mx', 0), ('yz', 'my', 1)):
        shear = rectangle_moments(*limits, *PARAMETERS, DEPTH, component=component)
        assert DEPTH * shear.m0 == pytest.approx(
            getattr(normal, first) - PARAMETERS[at] * normal.m0, rel=1e-10)


@pytest.mark.parametrize('component', COMPONENTS)
def test_translation(component):
    x, y = points()
    shift = 0.0031, -0.0042
    moved = PARAMETERS + [*shift, 0.0, 0.0, 0.0]
    np.testing.assert_allclose(
        point.stress(component, x + shift[0], y + shift[1], *moved, DEPTH),
        point.stress(component, x, y, *PARAMETERS, DEPTH), rtol=1e-9)


@pytest.mark.parametrize(('component', 'turned', 'sign'), [
    ('zz', 'zz', 1.0), ('xz', 'yz', 1.0), ('yz', 'xz', -1.0)])
def test_rotation_by_a_quarter_turn_swaps_the_roles(component, turned, sign):
    x, y = points()
    a, b, p, qx, qy = PARAMETERS
    rotated = -b, a, p, -qy, qx
    size = 0.001, 0.0015
    np.testing.assert_allclose(
        sign * point.stress(turned, -y, x, *rotated, DEPTH),
        point.stress(component, x, y, *PARAMETERS, DEPTH), rtol=1e-12)
    np.testing.assert_allclose(
        sign * point.average(turned, -y, x, *rotated, DEPTH, *size[::-1]),
        point.average(component, x, y, *PARAMETERS, DEPTH, *size), rtol=1e-5)


@pytest.mark.parametrize('component', COMPONENTS)
def test_scale_of_force_and_length(component):
    x, y = points()
    force, length = 3.7, 1.9
    scaled = PARAMETERS * [length, length, force, force, force]
    np.testing.assert_allclose(
        point.stress(component, length * x, length * y, *scaled, length * DEPTH),
        force / length**2 * point.stress(component, x, y, *PARAMETERS, DEPTH), rtol=1e-11)


@pytest.mark.parametrize('component', ['xx', None, ['zz']])
def test_unknown_component_is_refused(component):
    with pytest.raises(ConfigurationError, match='component is'):
        point.stress(component, 0.0, 0.0, *PARAMETERS, DEPTH)
