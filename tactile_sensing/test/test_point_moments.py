"""Point contact from moments: closed forms, compensation factors, iteration and failures."""

from collections import namedtuple

from moments_of_a_point import plane_moments, rectangle_moments
import numpy as np
import pytest

from tactile_common.errors import ConfigurationError
from tactile_sensing.thesis import point
from tactile_sensing.thesis.compensation import compensated, compensation_factors
from tactile_sensing.thesis.point_moments import (
    basic,
    MomentFlag,
    normal_and_shear,
    one_layer,
    peak_position,
    two_layers,
    without_averaging,
)
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.moments import Moments

Layer = namedtuple('Layer', 'component depth')

DEPTH, DEEPER = 0.002, 0.004
ARRAY = TactelArray(26, 26, 0.001, 0.001)
LOADS = [(0.0012, -0.0007, 5.0, 1.4, -0.8), (-0.0031, 0.002, 2.0, -0.1, 0.9),
         (0.0, 0.0, 11.0, 3.3, 5.5)]
STRUCTURES = {
    'one layer': [Layer('zz', DEPTH)],
    'two layers': [Layer('zz', DEPTH), Layer('zz', DEEPER)],
    'normal and xz': [Layer('zz', DEPTH), Layer('xz', DEPTH)],
    'normal, xz and yz': [Layer('zz', DEPTH), Layer('xz', DEPTH), Layer('yz', DEPTH)]}


def parameters(estimate):
    return np.array([estimate.a, estimate.b, estimate.normal_force,
                     estimate.shear_force_x, estimate.shear_force_y])


def pictures(layers, load, *, averaging=False, array=ARRAY):
    x, y = array.x[None, :], array.y[:, None]
    if averaging:
        return np.array([point.average(
            layer.component, x, y, *load, layer.depth, array.pitch_x, array.pitch_y)
            for layer in layers])
    return np.array([point.stress(layer.component, x, y, *load, layer.depth)
                     for layer in layers])


def random_loads(count, reach, seed, least_shear=0.1):
    rng = np.random.default_rng(seed)
    for _ in range(count):
        force = rng.uniform(1.0, 15.0)
        shear = rng.uniform(least_shear, 0.5, 2) * rng.choice([-1.0, 1.0], 2) * force
        yield (*rng.uniform(-reach, reach, 2), force, *shear)


def errors(estimate, load):
    """Of the point [m] and of the forces as a fraction of P."""
    difference = parameters(estimate) - load
    return np.hypot(*difference[:2]), np.abs(difference[2:]).max() / load[2]


@pytest.mark.parametrize('load', LOADS)
def test_one_layer_is_exact_on_plane_moments(load):
    a, b, _, qx, qy = load
    moments = plane_moments(*load, DEPTH)
    # The peak lies from the contact towards the centroid, but not as far.
    peak = a + 0.1 * DEPTH * qx / load[2], b + 0.1 * DEPTH * qy / load[2]
    estimate = one_layer(moments, DEPTH, peak)
    np.testing.assert_allclose(parameters(estimate), load, rtol=1e-9, atol=1e-12)
    assert estimate.flags == 0


@pytest.mark.parametrize('load', LOADS)
def test_two_layers_are_exact_on_plane_moments(load):
    estimate = two_layers(plane_moments(*load, DEPTH), plane_moments(*load, DEEPER),
                          (DEPTH, DEEPER))
    np.testing.assert_allclose(parameters(estimate), load, rtol=1e-9, atol=1e-12)
    assert estimate.flags == 0


@pytest.mark.parametrize('load', LOADS)
@pytest.mark.parametrize('with_yz', [False, True])
def test_normal_and_shear_are_exact_on_plane_moments(load, with_yz):
    normal, shear_x, shear_y = (
        plane_moments(*load, DEPTH, component=c) for c in ('zz', 'xz', 'yz'))
    estimate = normal_and_shear(normal, shear_x, DEPTH, shear_y=shear_y if with_yz else None)
    np.testing.assert_allclose(parameters(estimate), load, rtol=1e-9, atol=1e-12)
    assert estimate.flags == 0


def test_shear_layer_gives_a_on_any_window():
    load, limits = LOADS[0], ((-0.002, 0.007), (-0.009, 0.004))
    normal, shear_x, shear_y = (
        rectangle_moments(*limits, *load, DEPTH, component=c) for c in ('zz', 'xz', 'yz'))
    estimate = normal_and_shear(normal, shear_x, DEPTH, shear_y=shear_y)
    assert (estimate.a, estimate.b) == pytest.approx(load[:2], rel=1e-9)


def test_peak_lies_on_the_contact_s_side_of_the_centroid():
    for load in random_loads(50, 0.006, seed=3, least_shear=0.05):
        (image,) = pictures(STRUCTURES['one layer'], load)
        peak = peak_position(image, ARRAY)
        plane = plane_moments(*load, DEPTH)
        assert np.sign(plane.mx / plane.m0 - peak[0]) == np.sign(load[3])
        assert np.sign(plane.my / plane.m0 - peak[1]) == np.sign(load[4])


@pytest.mark.parametrize('ratio', [0.3, 1.0, 2.5, 6.5])
def test_compensation_factors_against_quadrature(ratio):
    half = ratio * DEPTH
    p, qx, qy = 5.0, 1.5, -0.7
    nodes, weights = np.polynomial.legendre.leggauss(200)
    x, y = half * nodes[None, :], half * nodes[:, None]

    def moment(component, i, j):
        return half**2 * np.sum(
            weights[None, :] * weights[:, None] * x**i * y**j
            * point.stress(component, x, y, 0.0, 0.0, p, qx, qy, DEPTH))
    k0, k1 = compensation_factors(half, DEPTH)
    assert moment('zz', 0, 0) == pytest.approx(k0 * p, rel=1e-10)
    assert moment('zz', 1, 0) == pytest.approx(k1 * DEPTH * qx, rel=1e-10)
    assert moment('zz', 0, 1) == pytest.approx(k1 * DEPTH * qy, rel=1e-10)
    assert moment('zz', 2, 0) == pytest.approx(k1 * DEPTH**2 * p, rel=1e-10)
    assert moment('zz', 0, 2) == pytest.approx(k1 * DEPTH**2 * p, rel=1e-10)
    assert moment('xz', 0, 0) == pytest.approx(k1 * qx, rel=1e-10)
    assert moment('xz', 1, 0) == pytest.approx(k1 * DEPTH * p, rel=1e-10)
    assert moment('yz', 0, 0) == pytest.approx(k1 * qy, rel=1e-10)


def test_compensation_factors_of_the_thesis_sensor():
    assert compensation_factors(0.013, DEPTH)[1] == pytest.approx(0.80, abs=0.005)
    assert compensation_factors(0.013, DEEPER)[1] == pytest.approx(0.61, abs=0.005)
    assert compensation_factors(1e6, DEPTH) == pytest.approx((1.0, 1.0), abs=1e-6)
    assert np.shape(compensation_factors(np.array([0.005, 0.013]), DEPTH)) == (2, 2)


@pytest.mark.parametrize('structure', STRUCTURES)
@pytest.mark.parametrize('averaging', [False, True], ids=['sampling', 'averaging'])
def test_compensated_converges_and_beats_basic_near_the_centre(structure, averaging):
    layers = STRUCTURES[structure]
    of_basic, of_compensated = [], []
    for load in random_loads(40, 0.003, seed=4):
        images = pictures(layers, load, averaging=averaging)
        estimate = compensated(images, ARRAY, layers, averaging=averaging)
        assert estimate.flags == 0
        assert 1 <= estimate.iterations <= 10
        of_compensated.append(errors(estimate, load))
        of_basic.append(errors(basic(images, ARRAY, layers, averaging=averaging), load))
    position, force = np.max(of_compensated, axis=0)
    assert position < 0.05e-3
    assert force < 0.04
    # With both shear layers the basic point is exact on any window; no iteration helps.
    if structure != 'normal, xz and yz':
        assert np.median(of_compensated, axis=0)[0] < 0.1 * np.median(of_basic, axis=0)[0]
    assert np.median(of_compensated, axis=0)[1] < 0.1 * np.median(of_basic, axis=0)[1]


@pytest.mark.parametrize('structure', STRUCTURES)
def test_estimates_follow_a_half_turn_and_the_scale_of_force(structure):
    layers = STRUCTURES[structure]
    images = pictures(layers, LOADS[0])
    # About z: x, y and every tangential quantity change sign.
    turned = images[:, ::-1, ::-1] * [[[-1.0 if la.component != 'zz' else 1.0]] for la in layers]
    for estimator in (basic, compensated):
        expected = parameters(estimator(images, ARRAY, layers))
        np.testing.assert_allclose(
            parameters(estimator(turned, ARRAY, layers)),
            expected * [-1.0, -1.0, 1.0, -1.0, -1.0], rtol=1e-9, atol=1e-10)
        np.testing.assert_allclose(
            parameters(estimator(3.0 * images, ARRAY, layers)),
            expected * [1.0, 1.0, 3.0, 3.0, 3.0], rtol=1e-9, atol=1e-10)


def test_averaging_tactels_make_the_discriminant_negative_unless_corrected():
    load = (0.0, 0.0, 5.0, 0.3, 0.3)  # below P h / (sqrt(12) d) = 0.72 N
    plane = plane_moments(*load, DEPTH)
    widened = Moments(plane.m0, plane.mx, plane.my, plane.mxx + 1e-6 / 12 * plane.m0,
                      plane.myy + 1e-6 / 12 * plane.m0, plane.mxy)
    flagged = one_layer(widened, DEPTH, (0.0, 0.0))
    assert flagged.flags == \
        MomentFlag.NEGATIVE_DISCRIMINANT_X | MomentFlag.NEGATIVE_DISCRIMINANT_Y
    assert (flagged.shear_force_x, flagged.shear_force_y) == (0.0, 0.0)
    assert flagged.a == plane.mx / plane.m0
    mended = one_layer(without_averaging(widened, 0.001, 0.001), DEPTH, (0.0, 0.0))
    assert mended.flags == 0
    np.testing.assert_allclose(parameters(mended), load, rtol=1e-9, atol=1e-12)


def test_one_negative_discriminant_leaves_the_other_axis_alone():
    plane = plane_moments(*LOADS[0], DEPTH)
    wide = Moments(plane.m0, plane.mx, plane.my, plane.mxx * 2.0, plane.myy, plane.mxy)
    estimate = one_layer(wide, DEPTH, LOADS[0][:2])
    assert estimate.flags == MomentFlag.NEGATIVE_DISCRIMINANT_X
    assert (estimate.b, estimate.shear_force_y) == pytest.approx(LOADS[0][1::3], rel=1e-9)


def test_singular_without_shear_along_x():
    load = (0.001, -0.002, 5.0, 0.0, 0.9)
    normal, shear_x, shear_y = (
        plane_moments(*load, DEPTH, component=c) for c in ('zz', 'xz', 'yz'))
    estimate = normal_and_shear(normal, shear_x, DEPTH)
    assert estimate.flags == MomentFlag.SINGULAR
    assert np.isfinite(parameters(estimate)).all()
    assert estimate.shear_force_y == 0.0
    complete = normal_and_shear(normal, shear_x, DEPTH, shear_y=shear_y)
    assert complete.flags == 0
    np.testing.assert_allclose(parameters(complete), load, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize('structure', STRUCTURES)
@pytest.mark.parametrize('value', [0.0, -1.0, np.nan, np.inf])
def test_no_force_is_flagged(structure, value):
    layers = STRUCTURES[structure]
    images = np.full((len(layers), *ARRAY.shape), value)
    for estimator in (basic, compensated):
        estimate = estimator(images, ARRAY, layers)
        assert estimate.flags == MomentFlag.NO_FORCE
        assert np.isnan(parameters(estimate)).all()


def test_no_force_from_moments_that_are_not_finite():
    plane = plane_moments(*LOADS[0], DEPTH)
    broken = Moments(plane.m0, np.nan, plane.my, plane.mxx, plane.myy, plane.mxy)
    assert one_layer(broken, DEPTH, (0.0, 0.0)).flags == MomentFlag.NO_FORCE
    assert one_layer(plane, DEPTH, (np.nan, 0.0)).flags == MomentFlag.NO_FORCE
    assert two_layers(plane, broken, (DEPTH, DEEPER)).flags == MomentFlag.NO_FORCE
    assert normal_and_shear(plane, broken, DEPTH).flags == MomentFlag.NO_FORCE


@pytest.mark.parametrize('scale', [1e-320, 1e-160, 1e160, 1e300])
def test_extreme_forces_give_numbers_or_a_flag(scale):
    for layers in STRUCTURES.values():
        images = scale * pictures(layers, LOADS[0])
        for estimator in (basic, compensated):
            estimate = estimator(images, ARRAY, layers)
            finite = np.isfinite(parameters(estimate)).all()
            assert finite or estimate.flags & MomentFlag.NO_FORCE


def test_contact_at_the_border_is_flagged():
    layers = STRUCTURES['normal, xz and yz']
    load = (0.0122, 0.0, 5.0, 1.0, 0.5)
    estimate = compensated(pictures(layers, load), ARRAY, layers)
    assert estimate.flags == MomentFlag.OFF_PAD
    assert np.isfinite(parameters(estimate)).all()


@pytest.mark.parametrize('structure', ['normal and xz', 'normal, xz and yz'])
@pytest.mark.parametrize('place', [(0.009, 0.0), (0.0, 0.01), (0.008, -0.009)])
def test_shear_layers_converge_near_the_border(structure, place):
    layers, load = STRUCTURES[structure], (*place, 11.0, 3.3, 5.5)
    estimate = compensated(pictures(layers, load), ARRAY, layers)
    assert estimate.flags == 0
    assert estimate.iterations <= 10
    position, force = errors(estimate, load)
    assert position < 0.02e-3
    assert force < 0.02


def test_printed_factors_overshoot_near_the_border():
    layers, load = STRUCTURES['normal and xz'], (0.0, 0.009, 11.0, 3.3, 5.5)
    k0, k1 = compensation_factors(0.004, DEPTH)
    assert k0 / k1 > 2.0
    estimate = compensated(pictures(layers, load), ARRAY, layers, printed=True)
    assert estimate.flags == MomentFlag.NOT_CONVERGED


def test_too_few_steps_are_flagged():
    layers = STRUCTURES['one layer']
    estimate = compensated(pictures(layers, LOADS[1]), ARRAY, layers, max_steps=1)
    assert estimate.flags == MomentFlag.NOT_CONVERGED
    assert estimate.iterations == 1


@pytest.mark.parametrize('structure', STRUCTURES)
def test_noise_gives_numbers_or_a_flag(structure):
    layers = STRUCTURES[structure]
    rng = np.random.default_rng(5)
    for scale in (1.0, 1e5):
        for _ in range(50):
            images = scale * rng.standard_normal((len(layers), *ARRAY.shape))
            for estimator in (basic, compensated):
                estimate = estimator(images, ARRAY, layers)
                finite = np.isfinite(parameters(estimate)).all()
                assert finite or estimate.flags & MomentFlag.NO_FORCE


def test_peak_position_takes_the_vertex_and_skips_nan():
    array = TactelArray(3, 4, 0.001, 0.002)
    image = -((array.x[None, :] - 0.0003)**2) - (array.y[:, None] + 0.0006)**2
    assert peak_position(image, array) == pytest.approx((0.0003, -0.0006), abs=1e-12)
    image[1, 2] = np.nan
    assert np.isfinite(peak_position(image, array)).all()
    assert np.isnan(peak_position(np.full((3, 4), np.nan), array)).all()


@pytest.mark.parametrize(('call', 'message'), [
    (lambda m: one_layer(m, 0.0, (0.0, 0.0)), 'depth is 0.0'),
    (lambda m: two_layers(m, m, (DEPTH, DEPTH)), 'must increase'),
    (lambda m: normal_and_shear(m, m, np.nan), 'depth is nan'),
    (lambda m: basic(np.zeros((1, 3, 3)), ARRAY, STRUCTURES['one layer']), 'shape'),
    (lambda m: basic(np.ones((1, 26, 26)), ARRAY, [Layer('xz', DEPTH)]), 'layers are xz'),
    (lambda m: basic(np.ones((2, 26, 26)), ARRAY, [Layer('zz', DEPTH), Layer('xz', DEEPER)]),
     'at one depth'),
    (lambda m: compensated(np.ones((1, 26, 26)), ARRAY, STRUCTURES['one layer'], tolerance=0.0),
     'tolerance is 0.0'),
    (lambda m: compensated(np.ones((1, 26, 26)), ARRAY, STRUCTURES['one layer'], max_steps=0),
     'max_steps is 0')])
def test_bad_configuration_is_refused(call, message):
    with pytest.raises(ConfigurationError, match=message):
        call(plane_moments(*LOADS[0], DEPTH))
