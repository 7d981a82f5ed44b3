"""The contact estimator on a skin on bone, judged by finite elements that share nothing."""

import numpy as np
import pytest

from benchmarks.calibration.__main__ import ball, Converter, estimated, pad, scaled
from benchmarks.contact.cases.real_skin import (
    ARRAYS,
    drawn,
    estimates,
    judge,
    pictures,
    rendered,
)
from benchmarks.contact.fe_frames import Object, profiles, RADII, solve
from tactile_sensing.skin.pressure import SkinPressure
from tactile_sensing.types.skin import Skin

DEPTH = 2e-3
FRAMES = 8  # of every profile and array
PUNCHES = 'round punch', 'strip'


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
                    if profile['kind'] in PUNCHES]) >= 0.97
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
    for skin in ((np.inf, 0.45), (10e-3, 0.3), (8e-3, 0.49), (6e-3, 0.45), (4e-3, 0.3)):
        found = pad(ball(*skin), array, Converter(), rng)
        for profile in profiles():
            if profile['kind'] == 'wedge' and (profile['backing'], profile['poisson']) == skin:
                places = drawn(profile, FRAMES, rng)
                frames = rendered(profile, array, places)
                told = estimated(found, Converter()(frames / frames.max(), rng))
                squares.append(judge(
                    profile, places, scaled(told, frames.max(), skin)).force_claims**2)
    assert np.sqrt(np.mean(squares)) < 1.3
