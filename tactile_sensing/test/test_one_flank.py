"""A saturating load near the rim shows only one flank; the claimed error must include that."""

import numpy as np
import pytest

from tactile_sensing.contact.estimator import ContactEstimator
from tactile_sensing.thesis import line
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.image import Layer

PITCH, DEPTH, NOISE = 1.5875e-3, 2e-3, 0.01
ARRAY = TactelArray(16, 16, PITCH, PITCH)
HALF = 2.5e-3  # m, of the patch of a cylinder (Hertz)


def cylinders(offset, along_x):
    """Return images of a cylinder on a half-space, full scale 1, peak 2; and their yaws."""
    across = HALF * np.linspace(-0.95, 0.95, 39)
    shares = np.sqrt(1.0 - (across / HALF)**2)
    yaws = np.radians(np.linspace(-2.0, 2.0, 9)) + 0.5 * np.pi * along_x
    images = np.array([sum(
        share * line.pressure(ARRAY.x[None, :], ARRAY.y[:, None], offset + aside, yaw, 1.0, DEPTH)
        for aside, share in zip(across, shares, strict=True)) for yaw in yaws])
    images *= 2.0 / images.max(axis=(1, 2), keepdims=True)
    noise = np.random.default_rng(0).normal(0.0, NOISE, images.shape)
    return np.minimum(images + noise, 1.0), yaws


def found(offset, along_x, depth):
    """Return errors and claims (N,) across the line [m], of valid estimates."""
    images, yaws = cylinders(offset, along_x)
    records = ContactEstimator().estimate_batch(images, ARRAY, [Layer(
        'zz', depth, np.empty(0), full_scale=1.0, noise_std=NOISE)])
    normal = np.stack([np.cos(yaws), np.sin(yaws)], axis=-1)
    error = records['x'] * normal[:, 0] + records['y'] * normal[:, 1] - offset
    variance = np.einsum('ni,nij,nj->n', normal, records['covariance'][:, :2, :2], normal)
    return error[records['valid']], np.sqrt(variance[records['valid']])


@pytest.mark.parametrize('depth', [0.0, DEPTH])
@pytest.mark.parametrize('along_x', [False, True])
@pytest.mark.parametrize('offset', [-11.6e-3, -10.9e-3, 10.9e-3, 11.6e-3])
def test_the_claim_for_a_load_beside_the_rim_holds(offset, along_x, depth):
    error, claimed = found(offset, along_x, depth)
    assert len(error) >= 5 and np.abs(error / claimed).max() < 3.0


@pytest.mark.parametrize('depth', [0.0, DEPTH])
@pytest.mark.parametrize('along_x', [False, True])
def test_two_flanks_are_accurate(along_x, depth):
    error, claimed = found(1e-3, along_x, depth)
    assert len(error) == 9 and np.abs(error).max() < 1e-4 and claimed.max() < 3e-4
