"""Corrupted inputs for every method: no exception, and nothing valid from garbage."""
import os

from hypothesis import given, HealthCheck, settings, target
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
import numpy as np
import point_load as point
import pytest

from tactile_common.errors import ConfigurationError
from tactile_sensing.contact.estimator import ContactEstimator, EstimatorConfig, METHODS, MODELS
from tactile_sensing.thesis import line
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import ContactType, INFORMATION
from tactile_sensing.types.image import COMPONENTS, Layer, TactileImage

ESTIMATORS = {(method, model): ContactEstimator(EstimatorConfig(method=method, model=model))
              for method in METHODS for model in MODELS}
MANY = settings(max_examples=1000 if os.environ.get('TACTILE_LONG_TESTS') else 300,
                derandomize=True, suppress_health_check=[HealthCheck.too_slow])
PARAMETERS = {
    ContactType.POINT: ('x', 'y', 'normal_force', 'shear_force_x', 'shear_force_y'),
    ContactType.LINE: ('x', 'y', 'yaw', 'normal_force', 'line_force')}

dtypes = st.one_of(npst.floating_dtypes(), npst.integer_dtypes(), npst.boolean_dtypes())
lengths = st.one_of(st.sampled_from([1e-3, 2e-3]), st.floats(1e-6, 0.1))
odd_numbers = st.one_of(st.floats(), st.sampled_from([0.0, -1.0, 1e300, np.inf, -np.inf, np.nan]))
noises = st.one_of(st.just(0.0), st.floats(0.0, 1e6), odd_numbers)


@st.composite
def garbage(draw):
    """Return an image in which every field has a random value of its type."""
    shape = draw(npst.array_shapes(min_dims=2, max_dims=2, max_side=20))
    array = TactelArray(*shape, draw(lengths), draw(lengths))
    layers = tuple(Layer(
        draw(st.sampled_from(COMPONENTS)), draw(st.one_of(lengths, odd_numbers)),
        draw(npst.arrays(draw(dtypes), draw(st.one_of(
            st.just(shape), npst.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=9))))),
        draw(noises), draw(noises)) for _ in range(draw(st.integers(0, 3))))
    return TactileImage(0, 0, layers, array, tared=True, saturated=draw(st.integers(0, 500)))


def check(contact):
    """Return whether a contact is valid; check that it has all values then, otherwise none."""
    names = PARAMETERS.get(contact.type, ())
    values = [getattr(contact, name) for name in names]
    if contact.valid:
        assert not contact.reasons & ~INFORMATION
        assert names and np.isfinite([*values, contact.snr, contact.residual]).all()
        assert contact.normal_force > 0.0
    else:
        assert contact.reasons & ~INFORMATION
        assert np.isnan([contact.x, contact.y, contact.normal_force]).all()
        assert np.isnan(contact.covariance).all()
    return contact.valid


@pytest.mark.parametrize('method', METHODS)
def test_no_image_is_too_corrupt(method):
    @MANY
    @given(garbage(), st.sampled_from(sorted(MODELS)))
    def run(image, model):
        with np.errstate(all='ignore'):
            check(ESTIMATORS[method, model].estimate(image))

    run()


@pytest.mark.parametrize('method', METHODS)
@pytest.mark.parametrize('model', MODELS)
def test_noise_of_any_kind_is_no_contact(method, model):
    """
    Images of noise are refused.

    Exceptions: with one-sided noise with a heavy tail, in half a per cent of the frames three
    neighbours of six standard deviations look like a press of 16 dB. In one to two per cent of
    the frames of Cauchy noise, a load a hundred times the noise hides that all else is not noise.
    """
    rng = np.random.default_rng(21)
    array = TactelArray(16, 16, 1.6e-3, 1.6e-3)
    x, y = np.meshgrid(np.linspace(-1.0, 1.0, 16), np.linspace(-1.0, 1.0, 16))
    kinds = [
        lambda: rng.exponential(1.0, (16, 16)),
        lambda: rng.normal(0.0, 1.0, (16, 16)), lambda: rng.uniform(0.0, 255.0, (16, 16)),
        lambda: rng.standard_cauchy((16, 16)), lambda: rng.normal(0.0, 1.0, (16, 16)) ** 5,
        lambda: rng.integers(0, 2, (16, 16)) * 1e4, lambda: np.full((16, 16), rng.uniform(1, 1e5)),
        lambda: 1e3 * x * rng.normal() + 1e3 * y * rng.normal() + 100.0,
        lambda: 1e4 * (np.indices((16, 16)).sum(0) % 2),
        lambda: np.cumsum(rng.normal(0.0, 1.0, (16, 16)), axis=1)]
    estimator, layer = ESTIMATORS[method, model], Layer('zz', 2e-3, None, 0.0, 1.0)
    frames = np.array([kinds[i % len(kinds)]() for i in range(1000)])
    records = estimator.estimate_batch(frames, array, [layer])
    wrong = np.flatnonzero(records['valid']) % len(kinds)
    assert np.isin(wrong, (0, 3)).all() and len(wrong) <= 4, wrong


@pytest.mark.parametrize('method', METHODS)
def test_a_corrupted_contact_is_close_or_refused(method):
    """A real contact with random faults: a valid estimate is at the contact."""
    array, depth = TactelArray(20, 20, 1e-3, 1e-3), 2e-3
    rng = np.random.default_rng(22)
    frames, truth = [], []
    for i in range(1000):
        a, b = rng.uniform(-5e-3, 5e-3, 2)
        clean = point.stress('zz', array.x, array.y[:, None], a, b, 1.0, 0.0, 0.0, depth) \
            if i % 2 else line.pressure(array.x, array.y[:, None], a, 0.0, 100.0, depth)
        frame = clean + rng.normal(0.0, 0.01 * clean.max(), clean.shape)
        share = rng.choice([0.0, 0.02, 0.3, 0.8])
        spoilt = rng.random(frame.shape) < share
        frame[spoilt] = rng.choice([np.nan, np.inf, -np.inf, 0.0, -1e9, 1e30, clean.max()])
        frames.append(frame)
        truth.append((a, clean.max()))
    truth = np.array(truth)
    with np.errstate(all='ignore'):
        found = np.array([ESTIMATORS[method, 'auto'].estimate_batch(
            frame[None], array, [Layer('zz', depth, None, 0.0, 0.01 * top)])[0]
            for frame, (_, top) in zip(frames, truth, strict=True)])
    valid = found['valid']
    assert valid.mean() > 0.2
    off = np.abs(found['x'] - truth[:, 0])[valid]
    claimed = np.sqrt(found['covariance'][valid, 0, 0])  # NaN without a claim
    surprising = off > (np.maximum(5.0 * claimed, 0.5e-3) if method == 'fit' else 2e-3)
    assert surprising.mean() <= 0.007, np.flatnonzero(valid)[surprising]


@MANY
@given(npst.arrays(dtypes, npst.array_shapes(min_dims=0, max_dims=5, min_side=0, max_side=6)))
def test_a_batch_is_estimated_or_refused_by_its_shape(frames):
    array = TactelArray(5, 4, 1e-3, 1e-3)
    fits = frames.ndim in (3, 4) and frames.shape[-2:] == (5, 4) and (
        frames.ndim == 3 or frames.shape[1] == 1)
    target(float(fits))
    try:
        with np.errstate(all='ignore'):
            records = ESTIMATORS['fit', 'auto'].estimate_batch(
                frames, array, [Layer('zz', 2e-3, None)])
    except ConfigurationError as error:
        assert not fits and 'shape' in str(error)
    else:
        assert fits and len(records) == len(frames)
