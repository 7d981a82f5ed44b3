"""What a wrong skin does to the force of an edge, beside what it does to the presses' force."""

from dataclasses import replace

import numpy as np
import pytest

from tactile_sensing.calibration.force_scale import edge_force_std, SLANT
from tactile_sensing.calibration.presses import Presses
from tactile_sensing.calibration.skin_fit import fit_skin
from tactile_sensing.skin.pressure import SkinPressure
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.skin import Skin

ARRAY = TactelArray(16, 16, 1.5e-3, 1.5e-3)
X, Y = ARRAY.x[None, :], ARRAY.y[:, None]
SIZE, SHARP = (ARRAY.pitch_x, ARRAY.pitch_y), 1e-5  # m; a ball whose patch does nothing
STD, MOVED = 0.02, 0.01  # of the depth


@pytest.mark.parametrize('thickness', [np.inf, 5e-3])
def test_it_is_the_difference_of_what_fits_with_a_wrong_depth_find(thickness):
    skin, rng = Skin(2e-3, thickness, 0.45), np.random.default_rng(2)
    here = SkinPressure(skin, *SIZE)
    frames = np.array([here.point(X, Y, a, b, 1.0) for a, b in rng.uniform(-8e-3, 8e-3, (6, 2))])
    noise = np.full(frames.shape, 0.01 * frames.max())
    presses = Presses(ARRAY, frames, noise, np.full(ARRAY.shape, -np.inf), np.arange(6))
    edge, forces = here.line(X, Y, 0.0, SLANT, 1.0), []
    for depth in skin.depth * np.exp([-MOVED, MOVED]):
        wrong = replace(skin, depth=depth, thickness=thickness * depth / skin.depth)
        fit = fit_skin(presses, SHARP, known=wrong)
        line = SkinPressure(wrong, *SIZE).line(X, Y, 0.0, SLANT, 1.0)
        forces.append([np.log(np.vdot(line, edge) / np.vdot(line, line)),
                       np.log(fit.amplitudes[:, 0]).mean()])
    by_edge, by_presses = np.diff(forces, axis=0)[0] / (2.0 * MOVED)
    fit = replace(
        fit_skin(presses, SHARP, known=skin), uncertain=(0,), covariance=np.diag([STD**2, 0]))
    assert abs(by_edge - by_presses) > 0.02
    assert edge_force_std(presses, fit, SHARP, True) == pytest.approx(
        STD * abs(by_edge - by_presses), rel=0.05)
