"""Batched fit of line loads: the same as one frame at a time."""

import numpy as np
import pytest

from tactile_common.errors import ConfigurationError
from tactile_sensing.contact.line_fit import fit_line, fit_lines
from tactile_sensing.half_space import line
from tactile_sensing.types.array import TactelArray

ARRAY = TactelArray(16, 16, 0.0254 / 16, 0.0254 / 16)


def test_batch_of_lines_is_the_same_as_one_at_a_time():
    rng = np.random.default_rng(6)
    frames = np.stack([
        line.pressure(ARRAY.x, ARRAY.y[:, None], rho, yaw, 200.0, 2e-3)
        for rho, yaw in rng.uniform((-8e-3, -1.7), (8e-3, 1.7), (60, 2))])
    frames += rng.normal(0.0, 600.0, frames.shape)
    frames[3, 2:5] = np.nan
    batch = fit_lines(frames, ARRAY, 2e-3, 600.0)
    for i, frame in enumerate(frames):
        fit = fit_line(frame, ARRAY, 2e-3, 600.0)
        for name in vars(fit):
            np.testing.assert_array_equal(getattr(fit, name), getattr(batch, name)[i])


def test_wrong_shape_of_a_batch_of_lines_is_named():
    with pytest.raises(ConfigurationError, match='shape'):
        fit_lines(np.zeros((16, 16)), ARRAY, 2e-3, 600.0)
