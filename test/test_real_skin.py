"""The contact estimator on a skin on bone, judged by finite elements that share nothing."""

import numpy as np
import pytest

from benchmarks.calibration.__main__ import ball, Converter, estimated, pad, scaled
from benchmarks.contact.fe_frames import Object, profiles, RADII, solve
from benchmarks.contact.real_skin import (
    ARRAYS,
    drawn,
    estimates,
    judge,
    pictures,
    rendered,
)
from tactile_sensing.skin.pressure import SkinPressure
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.image import Layer
from tactile_sensing.types.skin import Skin

DEPTH = 2e-3
FRAMES = 8  # of every profile and array
PUNCHES = 'round punch', 'strip'
PITCH = 25.4e-3 / 16


@pytest.fixture(scope='module')
def judged():
    """Estimates of every stored profile: profile, Judged, and share told as a patch or refused."""
    rng = np.random.default_rng(5)
    rows = []
    for profile in profiles():
        for array in ARRAYS.values():
            frames, places, noise = pictures(profile, array, FRAMES, rng)
            found = estimates(profile, array, frames, noise)
            rows.append((profile, judge(profile, places, found),
                         np.mean(~found['valid'] | (found['patch'] > 0.0))))
    return rows


@pytest.mark.parametrize('seed', [0, *(pytest.param(it, marks=pytest.mark.long) for it in (1, 2))])
@pytest.mark.parametrize('backing', [4e-3, np.inf])
def test_few_tactels_under_a_press_are_no_reason_for_doubt(backing, seed):
    """Each press has about a dozen loaded tactels, and five unknowns of its own."""
    made = pad(ball(backing), TactelArray(8, 8, 3.2e-3, 3.2e-3), Converter(),
               np.random.default_rng(seed), least=0.6)
    assert made.doubts == [] and made.skin.scatter < 0.02


def mean(judged, name, kinds):
    """Mean of a share over the profiles of some kinds of objects."""
    return np.mean([getattr(share, name) for profile, share, _ in judged
                    if str(profile['kind']) in kinds])


@pytest.mark.parametrize('shape, backing, poisson', [
    (Object('ball', 1e-3), 4e-3, 0.45), (Object('wedge', 1e-3), 6e-3, 0.49)])
def test_layer_agrees_with_finite_elements(shape, backing, poisson):
    pytest.importorskip('skfem')
    found = solve(shape, backing, poisson)
    skin = SkinPressure(Skin(DEPTH, backing, poisson))
    load = skin.point if shape.round else skin.line
    width = 'radius' if shape.round else 'half_width'
    # What touches is known to an element, the force as well as the elements are fine.
    least = min(np.abs(load(RADII, 0.0, 0.0, 0.0, float(found['force']), **{width: size})
                       - found['pressure']).max()
                for size in np.linspace(0.8, 1.3, 26) * found['touching'])
    assert least < 0.005 * found['pressure'].max()
    [stored] = [profile for profile in profiles() if all(
        profile[name] == found[name] for name in ('kind', 'radius', 'backing', 'poisson'))]
    np.testing.assert_allclose(
        stored['pressure'], found['pressure'], atol=1e-3 * found['pressure'].max())


@pytest.mark.parametrize('kind', ['ball', 'wedge'])
def test_balls_and_wedges_are_told(judged, kind):
    assert mean(judged, 'right', [kind]) >= 0.95
    assert mean(judged, 'wrong', [kind]) <= 0.02
    force = [share.force for profile, share, _ in judged if profile['kind'] == kind]
    assert np.nanmean(np.abs(force)) < 0.01 and np.nanmax(np.abs(force)) < 0.03


def test_flat_punches_are_patches_or_refused(judged):
    assert np.mean([told for profile, _, told in judged
                    if profile['kind'] in PUNCHES]) >= 0.7  # others: a place without a force
    assert mean(judged, 'wrong', PUNCHES) <= 0.02


@pytest.mark.parametrize('kind', ['ball', 'wedge'])
def test_claims_hold(judged, kind):
    for name in ('claims', 'force_claims'):
        squares = [getattr(share, name)**2 for profile, share, _ in judged
                   if profile['kind'] == kind and share.right > 0.0]
        assert np.sqrt(np.mean(squares)) < 1.3, name


def test_claims_hold_with_skins_that_were_calibrated():
    """What gain and skin are off by is common to all edges: several calibrations, each its own."""
    rng, array, squares = np.random.default_rng(6), ARRAYS['16x16'], []
    for skin in ((np.inf, 0.45), (8e-3, 0.49), (4e-3, 0.3)):
        found = pad(ball(*skin), array, Converter(), rng).calibration
        for profile in profiles():
            if profile['kind'] == 'wedge' and (profile['backing'], profile['poisson']) == skin:
                places = drawn(profile, FRAMES, rng)
                frames = rendered(profile, array, places)
                told = estimated(found, Converter()(frames / frames.max(), rng))
                squares.append(judge(
                    profile, places, scaled(told, frames.max(), skin)).force_claims**2)
    assert np.sqrt(np.mean(squares)) < 1.3


@pytest.mark.parametrize('radius, backing, decibels', [
    (0.5e-3, np.inf, 50), (1e-3, np.inf, 40), (1e-3, np.inf, 50), (3e-3, np.inf, 40),
    (0.5e-3, 4e-3, 50), (1e-3, 4e-3, 40), (1e-3, 4e-3, 50)])
def test_noise_of_one_picture_of_a_small_pad(radius, backing, decibels):
    """What a sharp load leaves of a blunt one is no noise, even where no patch is kept for it."""
    rng, array, profile = np.random.default_rng(7), TactelArray(5, 5, PITCH, PITCH), ball(
        backing, radius=radius)
    frames = rendered(profile, array, rng.uniform(-1.5, 1.5, (200, 2)) * PITCH)
    frames /= frames.max(axis=(1, 2), keepdims=True)
    frames += 10.0 ** (-decibels / 20.0) * rng.standard_normal(frames.shape)
    found = estimates(profile, array, frames, 0.0)
    off = 10.0 ** ((decibels - np.nanmedian(found['snr'])) / 20.0)
    assert found['valid'].mean() > 0.95 and 1.0 / 1.8 < off < 1.8


@pytest.mark.parametrize('bits', [4, 6, 8])
@pytest.mark.parametrize('kind', ['ball', 'wedge'])
def test_rounding_that_is_coarser_than_the_noise_is_noise(kind, bits):
    """Whole counts with a noise of a tenth of one; neither the noise nor the skin is known."""
    rng, steps = np.random.default_rng(9), 2**bits - 1
    [profile] = [it for it in profiles() if it['kind'] == kind and it['radius'] == 1e-3
                 and it['backing'] == 6e-3 and it['poisson'] == 0.45]
    places = drawn(profile, 60, rng)
    frames = rendered(profile, ARRAYS['16x16'], places)
    frames *= steps / frames.max(axis=(1, 2), keepdims=True)
    frames = np.rint(frames + 0.1 * rng.standard_normal(frames.shape))
    share = judge(profile, places, estimates(
        profile, ARRAYS['16x16'], frames, 0.0, Layer('zz', 0.0, np.empty(0), unit='counts')))
    assert share.right > 0.9 and share.wrong == 0.0 and share.claims < 1.3


@pytest.mark.parametrize('decibels', [30, 40, 50])
def test_a_flat_punch_that_presses_all_of_a_pad_drifts_by_nothing(decibels):
    """What a sharp load leaves of it where it hardly presses is no drift of the baseline."""
    rng, array = np.random.default_rng(8), TactelArray(8, 8, 1e-3, 1e-3)
    [profile] = [it for it in profiles() if it['kind'] == 'round punch' and it['radius'] == 2e-3
                 and it['backing'] == 4e-3 and it['poisson'] == 0.45]
    places = rng.uniform(-2.4e-3, 2.4e-3, (60, 2))
    frames = rendered(profile, array, places)
    noise = 10.0 ** (-decibels / 20.0) * frames.max()
    frames += noise * rng.standard_normal(frames.shape)
    for told in (0.0, noise):
        share = judge(profile, places, estimates(profile, array, frames, told))
        assert share.wrong <= 0.03 and share.refused < 0.35


def test_claims_allow_for_a_poisson_ratio_that_is_assumed():
    """Thin skins of .3, assumed to be .45; and claims are narrow where it is told."""
    assumed, told = (
        pad(ball(2e-3, 0.3), ARRAYS['16x16'], Converter(), np.random.default_rng(2),
            poisson=poisson).calibration for poisson in (None, 0.3))
    for it in (assumed, told):
        assert abs(it.depth - DEPTH) < 1.3 * it.found['skin']['depth_std']
    assert told.found['skin']['depth_std'] < 2.0 * assumed.found['skin']['depth_std']
