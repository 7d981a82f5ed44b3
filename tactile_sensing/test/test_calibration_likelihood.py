"""Claimed errors of the fit of presses, on random skins and sensors; images by its own model."""
import numpy as np
import pytest

from tactile_sensing.calibration.presses import Presses
from tactile_sensing.calibration.report import doubts
from tactile_sensing.calibration.skin_fit import fit_presses
from tactile_sensing.skin.pressure import SkinPressure
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.skin import Skin

PITCH, BALL, NOISE = 1.5e-3, 1.5e-3, 0.01
ARRAY = TactelArray(14, 14, PITCH, PITCH)
X, Y = ARRAY.x, ARRAY.y[:, None]


def pressed(skin, rng, count=15, frames=1, patch=0.5):
    """Return presses of 1 N, each with rising frames; gains within 8 %; counts per newton."""
    pressure = SkinPressure(skin, PITCH, PITCH)
    gains = 1.0 + 0.08 * rng.standard_normal(ARRAY.shape)
    share = (1.0 + np.arange(frames)) / frames
    values = np.array([gains * pressure.point(
        X, Y, a, b, force, radius=patch * BALL * force**(1 / 3))
        for a, b in rng.uniform(-8e-3, 8e-3, (count, 2)) for force in share])
    scale = 400.0 / values.max()
    noise = np.full(values.shape, 400.0 * NOISE)
    values = scale * values + noise * rng.standard_normal(values.shape)
    floor = np.full(ARRAY.shape, -np.inf)
    known = np.arange(len(values)), np.zeros(len(values), int), np.tile(share, count)
    return Presses(ARRAY, values, noise, floor, *known), gains, scale


def rms(values):
    return np.sqrt(np.mean(np.square(values)))


@pytest.mark.parametrize('frames', [1, 4])
def test_claims_hold_with_gains_that_differ_and_frames_of_one_press(frames):
    depth, edges = [], []
    for seed in range(2 if frames == 1 else 1):
        rng = np.random.default_rng(seed)
        skin = Skin(rng.uniform(1.5e-3, 2.2e-3), rng.choice([np.inf, 5e-3]), 0.45)
        presses, gains, scale = pressed(
            skin, rng, frames=frames, patch=rng.uniform(0.35, 0.65))
        fit = fit_presses(presses, BALL)
        assert fit.groups[-1] + 1 == 15
        depth.append((fit.skin.depth - skin.depth) / fit.depth_std)
        here, found = SkinPressure(skin, PITCH, PITCH), SkinPressure(fit.skin, PITCH, PITCH)
        off = []
        for yaw in np.linspace(-0.7, 0.7, 5):
            seen = scale * gains * fit.gain * here.line(X, Y, 0.0, yaw, 1.0)
            model = found.line(X, Y, 0.0, yaw, 1.0)
            off.append(np.vdot(seen, model) / np.vdot(model, model) / fit.level[0] - 1.0)
        edges.append(np.mean(off) / np.hypot(fit.edge_force_std, fit.left / 30**0.5))
    assert rms(depth) < 1.8 and rms(edges) < 1.8


def test_gains_are_found_as_well_as_claimed_and_dead_rows_are_found():
    presses, gains, _ = pressed(Skin(2e-3, 5e-3, 0.45), np.random.default_rng(3), count=40)
    presses.values[:, 6] = presses.noise[:, 6] * np.random.default_rng(4).standard_normal(
        presses.values[:, 6].shape)
    fit = fit_presses(presses, BALL)
    assert fit.dead[6, 2:-2].all() and not np.delete(fit.dead, 6, axis=0).any()
    live = np.ones(ARRAY.shape, bool)
    live[6] = False
    left = np.log(fit.gain * gains)
    left -= left[live].mean()
    assert 0.6 < rms((left / fit.gain_std)[live]) < 1.4
    assert rms(left[live]) < 0.06 and fit.spread == pytest.approx(0.08, rel=0.3)
    assert abs(fit.skin.depth - 2e-3) < 3.0 * fit.depth_std < 0.2e-3


def test_a_ramp_of_one_press_is_one_press():
    presses, _, _ = pressed(Skin(2e-3), np.random.default_rng(5), count=1, frames=8)
    fit = fit_presses(presses, BALL, known=Skin(2e-3))
    assert fit.groups[-1] == 0
    assert any('only 1 presses' in text for text in doubts(fit, BALL, 0.0))
