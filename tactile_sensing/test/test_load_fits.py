"""Fits of loads: exactness, efficiency, invariances and garbage."""

import numpy as np
import pytest

from tactile_common.errors import ConfigurationError
from tactile_sensing.contact.gauss_newton import FIT
from tactile_sensing.contact.load_fits import fit_loads
from tactile_sensing.half_space import line
from tactile_sensing.half_space.layers import Layer
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import ContactType

ARRAY = TactelArray(26, 26, 1e-3, 1e-3)
MODELS = {
    'model 1': [('zz', 2e-3)],
    'model 1, deep': [('zz', 4e-3)],
    'model 2': [('zz', 2e-3), ('zz', 4e-3)],
    'model 3': [('zz', 2e-3), ('xz', 2e-3)],
    'model 3, deep': [('zz', 4e-3), ('xz', 4e-3)],
    'both shears': [('zz', 2e-3), ('xz', 2e-3), ('yz', 2e-3)],
}
NAMES = ('a', 'b', 'force', 'shear_x', 'shear_y')
LOAD = np.array([1.3e-3, -2.1e-3, 5.0, 1.2, -1.8])


def make_layers(model, noise=100.0):
    return [Layer(component, depth, noise) for component, depth in MODELS[model]]


def stress_of(loads, layers, array=ARRAY, offsets=((0.0, 0.0, 1.0),)):
    """Stress of loads (N, 5) in plain numpy, from (2.2) and (2.5): (N, layers, R, C)."""
    a, b, p, qx, qy = (column[:, None, None] for column in np.atleast_2d(loads).T)
    total = np.zeros((a.shape[0], len(layers), *array.shape))
    for dx, dy, weight in offsets:
        u, v = array.x + dx - a, array.y[:, None] + dy - b
        for k, layer in enumerate(layers):
            d = layer.depth
            pressure = 1.5 / np.pi * d**2 * (p * d + qx * u + qy * v) * (
                u**2 + v**2 + d**2) ** -2.5
            lever = {'zz': 1.0, 'xz': u / d, 'yz': v / d}[layer.component]
            total[:, k] += weight * lever * pressure
    return total


def jacobian_of(loads, layers, array=ARRAY):
    """Derivatives of `stress_of`, analytic: (N, layers, R, C, 5)."""
    a, b, p, qx, qy = (column[:, None, None] for column in np.atleast_2d(loads).T)
    u, v = array.x - a, array.y[:, None] - b
    result = np.empty((a.shape[0], len(layers), *array.shape, 5))
    for k, layer in enumerate(layers):
        d = layer.depth
        s = u**2 + v**2 + d**2
        shape = 1.5 / np.pi * d**2 * s**-2.5
        load = p * d + qx * u + qy * v
        lever, by_u, by_v = {'zz': (1.0, 0.0, 0.0), 'xz': (u / d, 1 / d, 0.0),
                             'yz': (v / d, 0.0, 1 / d)}[layer.component]
        result[:, k, ..., 0] = shape * (lever * (5 * load * u / s - qx) - by_u * load)
        result[:, k, ..., 1] = shape * (lever * (5 * load * v / s - qy) - by_v * load)
        result[:, k, ..., 2] = shape * lever * d
        result[:, k, ..., 3] = shape * lever * u
        result[:, k, ..., 4] = shape * lever * v
    return result


def random_loads(rng, count, half):
    force = rng.uniform(1.0, 10.0, count)
    shear, angle = force * rng.uniform(0.0, 0.5, count), rng.uniform(-np.pi, np.pi, count)
    return np.stack([*rng.uniform(-half, half, (2, count)), force, shear * np.cos(angle),
                     shear * np.sin(angle)], axis=1)


def fit_points(stress, array, layers, **options):
    return fit_loads(ContactType.POINT, stress, array, layers, **options).view(np.recarray)


def fit_point(stress, array, layers, **options):
    return fit_points(np.asarray(stress)[None], array, layers, **options)[0]


def covariance(fit, count=5):
    """Inverse of the information of so many parameters; NaN where there is none."""
    information = fit.normal[..., :count, :count]
    scale = 1.0 / np.sqrt(np.diagonal(information, axis1=-2, axis2=-1))
    outer = scale[..., :, None] * scale[..., None, :]
    unit = information * outer
    bad = ~np.isfinite(unit).all(axis=(-2, -1), keepdims=True)
    return np.where(bad, np.nan, np.linalg.inv(np.where(bad, np.eye(count), unit)) * outer)


def parameters(fit):
    return np.stack([getattr(fit, name) for name in NAMES], axis=-1)


def covariance_bound(loads, layers):
    jacobian = jacobian_of(loads, layers) / np.array(
        [layer.noise_std for layer in layers])[:, None, None, None]
    information = np.einsum('nkrci,nkrcj->nij', jacobian, jacobian)
    scale = 1.0 / np.sqrt(np.einsum('nii->ni', information))
    outer = scale[:, :, None] * scale[:, None, :]
    return np.linalg.inv(information * outer) * outer


@pytest.mark.parametrize('model', MODELS)
def test_analytic_jacobian_agrees_with_finite_differences(model):
    layers = make_layers(model)
    jacobian = jacobian_of(LOAD, layers)
    for i, h in enumerate((1e-7, 1e-7, 1e-3, 1e-3, 1e-3)):
        step = h * np.eye(5)[i]
        numeric = (stress_of(LOAD + step, layers) - stress_of(LOAD - step, layers)) / (2 * h)
        np.testing.assert_allclose(
            jacobian[..., i], numeric, rtol=1e-6, atol=1e-6 * np.abs(numeric).max())


@pytest.mark.parametrize('model', MODELS)
def test_noise_free_loads_are_exact_up_to_the_border(model):
    layers = make_layers(model)
    loads = random_loads(np.random.default_rng(1), 2000, 12.5e-3)
    fit = fit_points(stress_of(loads, layers), ARRAY, layers)
    assert fit.converged.all()
    assert np.abs(parameters(fit) - loads)[:, :2].max() < 1e-7
    np.testing.assert_allclose(parameters(fit)[:, 2:], loads[:, 2:], atol=1e-4)


def test_corner_of_the_array_is_exact():
    layers = make_layers('model 1')
    for x, y in np.array([(1, 1), (1, -1), (-1, 1), (-1, -1)]) * 12.5e-3:
        fit = fit_point(stress_of([x, y, 3.0, 1.0, -1.0], layers)[0], ARRAY, layers)
        np.testing.assert_allclose(parameters(fit), [x, y, 3.0, 1.0, -1.0], atol=1e-6)


def test_without_shear_three_parameters_are_fitted():
    layers = make_layers('model 2')
    load = np.array([2.2e-3, 3.1e-3, 4.0, 0.0, 0.0])
    fit = fit_point(stress_of(load, layers)[0], ARRAY, layers, shear=False)
    np.testing.assert_allclose(parameters(fit), load, atol=1e-8)
    assert np.isfinite(covariance(fit, 3)).all()
    assert not fit.normal[3:, :3].any()
    assert fit.converged


def test_shear_beyond_friction_takes_more_steps():
    layers = make_layers('model 1')
    loads = random_loads(np.random.default_rng(2), 500, 8e-3)
    loads[:, 3:] *= 4.0  # up to 2 P
    fit = fit_points(stress_of(loads, layers), ARRAY, layers)
    assert np.abs(parameters(fit) - loads)[:, :2].max() < 1e-7


@pytest.mark.parametrize('decibels', (20, 40, 60))
@pytest.mark.parametrize('model', MODELS)
def test_error_is_at_the_cramer_rao_bound(model, decibels):
    rng = np.random.default_rng(decibels)
    loads = random_loads(rng, 1500, 8e-3)
    clean = stress_of(loads, make_layers(model))
    peak = clean[:, 0].max(axis=(1, 2))
    loads[:, 2:] /= peak[:, None]
    clean /= peak[:, None, None, None]  # so that one noise is the same SNR for every frame
    noise = 10 ** (-decibels / 20)
    layers = make_layers(model, noise)
    fit = fit_points(clean + rng.normal(0.0, noise, clean.shape), ARRAY, layers)
    good = fit.converged
    assert good.mean() > 0.99
    error = (parameters(fit) - loads)[good]
    variance = np.einsum('nii->ni', covariance_bound(loads, layers))[good]
    ratio = np.sqrt((error**2 / variance).mean(axis=0))
    assert np.exp(np.log(ratio).mean()) < 1.10


@pytest.mark.parametrize('model', ('model 1', 'model 3'))
def test_covariance_is_the_spread(model):
    rng = np.random.default_rng(5)
    clean = stress_of(LOAD, make_layers(model))[0]
    layers = make_layers(model, 0.01 * clean.max())
    noisy = clean + rng.normal(0.0, layers[0].noise_std, (4000, *clean.shape))
    fit = fit_points(noisy, ARRAY, layers)
    predicted = np.median(covariance(fit), axis=0)
    spread = np.cov(parameters(fit).T)
    scale = np.sqrt(np.diag(predicted))
    np.testing.assert_allclose(spread / np.outer(scale, scale),
                               predicted / np.outer(scale, scale), atol=0.06)
    assert fit.squared_error.mean() / (fit.used - 5).mean() == pytest.approx(1.0, abs=0.02)
    assert fit.chi_square.mean() < fit.squared_error.mean()


def noisy_frames(model, count=20, level=0.01, seed=8):
    rng = np.random.default_rng(seed)
    clean = stress_of(random_loads(rng, count, 5e-3), make_layers(model))
    layers = make_layers(model, level * clean.max())
    return clean + rng.normal(0.0, layers[0].noise_std, clean.shape), layers


def test_invariant_under_shifts_by_whole_tactels():
    frames, layers = noisy_frames('model 3')
    rolled = np.roll(frames, (2, -3), axis=(2, 3))
    before, after = (parameters(fit_points(f, ARRAY, layers)) for f in (frames, rolled))
    np.testing.assert_allclose(
        after, before + [-3e-3, 2e-3, 0.0, 0.0, 0.0], rtol=1e-7, atol=1e-9)


def test_mirror_negates_position_and_shear():
    frames, layers = noisy_frames('both shears')
    mirrored = frames[..., ::-1].copy()
    mirrored[:, 1] *= -1.0
    before, after = (parameters(fit_points(f, ARRAY, layers)) for f in (frames, mirrored))
    np.testing.assert_allclose(after, before * [-1, 1, 1, -1, 1], rtol=1e-7, atol=1e-10)


def test_force_scales_with_stress_and_noise():
    frames, layers = noisy_frames('model 2')
    scaled = [Layer(layer.component, layer.depth, 1e3 * layer.noise_std) for layer in layers]
    before = fit_points(frames, ARRAY, layers)
    after = fit_points(1e3 * frames, ARRAY, scaled)
    np.testing.assert_allclose(
        parameters(after), parameters(before) * [1, 1, 1e3, 1e3, 1e3], rtol=1e-7, atol=1e-12)
    np.testing.assert_allclose(after.chi_square, before.chi_square, rtol=1e-7)


def test_position_scales_with_pitch_and_depth():
    frames, layers = noisy_frames('model 3')
    large = TactelArray(26, 26, 4e-3, 4e-3)
    scaled = [Layer(layer.component, 4 * layer.depth, layer.noise_std) for layer in layers]
    before = parameters(fit_points(frames, ARRAY, layers))
    after = parameters(fit_points(frames, large, scaled))
    np.testing.assert_allclose(after, before * [4, 4, 16, 16, 16], rtol=1e-7, atol=1e-12)


@pytest.mark.parametrize('shear', (True, False))
def test_batch_is_the_same_as_one_at_a_time(shear):
    frames, layers = noisy_frames('model 3')
    batch = fit_points(frames, ARRAY, layers, shear=shear)
    for i, frame in enumerate(frames):
        fit = fit_point(frame, ARRAY, layers, shear=shear)
        for name in FIT.names:
            np.testing.assert_array_equal(fit[name], batch[name][i])


def test_tactels_without_value_have_no_weight():
    layers = make_layers('model 2')
    stress = stress_of(LOAD, layers)[0]
    peak = np.unravel_index(stress[0].argmax(), ARRAY.shape)
    full = fit_point(stress, ARRAY, layers)
    stress[:, peak[0], peak[1]] = np.nan
    stress[0, peak[0] + 2, peak[1]] = np.inf
    stress[1, :, peak[1] - 2] = np.nan
    fit = fit_point(stress, ARRAY, layers)
    np.testing.assert_allclose(parameters(fit), LOAD, atol=1e-5)
    assert fit.converged
    assert fit.used < full.used


def test_averaging_over_the_tactels_area():
    layers = make_layers('model 3')
    nodes, weights = np.polynomial.legendre.leggauss(10)
    offsets = [(0.5e-3 * p, 0.5e-3 * q, 0.25 * u * w)
               for p, u in zip(nodes, weights, strict=True)
               for q, w in zip(nodes, weights, strict=True)]
    loads = random_loads(np.random.default_rng(4), 50, 8e-3)
    stress = stress_of(loads, layers, offsets=offsets)
    bias = {}
    for points in (1, 2, 3):
        fit = fit_points(stress, ARRAY, layers, tactel_points=points)
        bias[points] = np.abs(fit.force / loads[:, 2] - 1.0).max()
    assert bias[1] > 0.02
    assert bias[2] < 2e-3
    assert bias[3] < 1e-4


@pytest.mark.parametrize('frame', (
    np.full((1, 26, 26), np.nan), np.full((1, 26, 26), np.inf), np.full((1, 26, 26), -np.inf),
    np.zeros((1, 26, 26)), np.full((1, 26, 26), -5.0), np.full((1, 26, 26), 1e308),
    np.full((1, 26, 26), 1e-320), np.eye(26)[None] * 1e200,
), ids=('nan', 'inf', 'minus inf', 'zeros', 'tension', 'huge', 'denormal', 'huge diagonal'))
def test_garbage_does_not_converge(frame):
    layers = make_layers('model 1')
    with np.errstate(all='raise'):
        fit = fit_point(frame, ARRAY, layers)
        assert np.isnan(covariance(fit)).all()
    assert not fit.converged
    assert np.isinf(fit.last_step)
    assert np.isnan(parameters(fit)).all()


@pytest.mark.parametrize('shape', ((1, 1), (2, 2), (1, 26), (26, 1), (3, 3)))
def test_tiny_arrays(shape):
    array = TactelArray(*shape, 1e-3, 1e-3)
    layers = make_layers('model 1')
    fit = fit_point(np.ones((1, *shape)), array, layers)
    assert not fit.converged or np.isfinite(parameters(fit)).all()
    if 1 in shape or shape == (2, 2):
        assert not fit.converged


def test_random_garbage_never_gives_nan_in_a_converged_fit():
    rng = np.random.default_rng(11)
    frames = rng.normal(size=(300, 3, 9, 7)) * 10.0 ** rng.uniform(-300, 300, (300, 1, 1, 1))
    bad = rng.random(frames.shape) < rng.random((300, 1, 1, 1))
    frames[bad] = rng.choice([np.nan, np.inf, -np.inf, 0.0, 1e308], bad.sum())
    fit = fit_points(frames, TactelArray(9, 7, 1e-3, 2e-3), make_layers('both shears'))
    good = fit.converged
    for name in FIT.names:
        assert np.isfinite(fit[name][good]).all()
    assert np.isnan(parameters(fit)[np.isinf(fit.last_step)]).all()
    empty = fit_points(np.empty((0, 3, 9, 7)), TactelArray(9, 7, 1e-3, 2e-3),
                       make_layers('both shears'))
    assert empty.a.shape == (0,)


def test_wrong_arguments_are_named():
    layers = make_layers('model 1')
    frame = np.zeros((1, 26, 26))
    for call, word in (
            (lambda: fit_point(frame[0], ARRAY, layers), 'shape'),
            (lambda: fit_points(frame, ARRAY, layers), 'shape'),
            (lambda: fit_point(frame, ARRAY, layers, window=0.5), 'window'),
            (lambda: fit_point(frame, ARRAY, layers, tactel_points=4), 'tactel_points'),
            (lambda: fit_point(frame, ARRAY, [Layer('xz', 2e-3, 1.0)]), 'zz'),
            (lambda: Layer('zx', 2e-3, 1.0), 'component'),
            (lambda: Layer('zz', -1.0, 1.0), 'depth'),
            (lambda: Layer('zz', 2e-3, float('nan')), 'noise_std')):
        with pytest.raises(ConfigurationError, match=word):
            call()


LINE_ARRAY = TactelArray(16, 16, 0.0254 / 16, 0.0254 / 16)


@pytest.mark.parametrize('shear', (True, False))
def test_batch_of_lines_is_the_same_as_one_at_a_time(shear):
    rng = np.random.default_rng(6)
    frames = np.stack([
        line.pressure(LINE_ARRAY.x, LINE_ARRAY.y[:, None], rho, yaw, 200.0, 2e-3)
        for rho, yaw in rng.uniform((-8e-3, -1.7), (8e-3, 1.7), (60, 2))])[:, None]
    frames += rng.normal(0.0, 600.0, frames.shape)
    frames[3, 0, 2:5] = np.nan
    layers = [Layer('zz', 2e-3, 600.0)]
    batch = fit_loads(ContactType.LINE, frames, LINE_ARRAY, layers, shear=shear)
    assert batch['converged'].mean() > 0.9
    for i in range(len(frames)):
        fit = fit_loads(
            ContactType.LINE, frames[i:i + 1], LINE_ARRAY, layers, shear=shear)[0]
        for name in FIT.names:
            np.testing.assert_array_equal(fit[name], batch[name][i])


def test_noise_free_lines_with_shear_are_exact():
    rng = np.random.default_rng(12)
    loads = rng.uniform((-8e-3, -1.5, 50.0, -60.0), (8e-3, 1.5, 300.0, 60.0), (200, 4))
    frames = np.stack([line.stress_with_shear(
        LINE_ARRAY.x, LINE_ARRAY.y[:, None], *load, 2e-3) for load in loads])[:, None]
    fit = fit_loads(ContactType.LINE, frames, LINE_ARRAY, [Layer('zz', 2e-3, 100.0)])
    assert fit['converged'].all()
    for name, values, tolerance in zip(
            ('rho', 'yaw', 'force', 'shear'), loads.T, (1e-7, 1e-5, 1e-2, 1e-2), strict=True):
        np.testing.assert_allclose(fit[name], values, atol=tolerance)
