"""Simulated contacts of known parameters, and the least error that any estimator can have."""

from dataclasses import dataclass

import numpy as np

from tactile_sensing.half_space import line
from tactile_sensing.half_space.forward_model import LineModel, PointModel
from tactile_sensing.half_space.layers import Layer
from tactile_sensing.types.array import TactelArray

POINT_ARRAY = TactelArray(26, 26, 1e-3, 1e-3)
LINE_ARRAY = TactelArray(16, 16, 25.4e-3 / 16, 25.4e-3 / 16)
DEPTH = 2e-3  # of the tactels [m]
SECOND_DEPTH = 4e-3  # of model 2's second layer [m]
STRUCTURES = {1: (('zz', DEPTH),), 2: (('zz', DEPTH), ('zz', SECOND_DEPTH)),
              3: (('zz', DEPTH), ('xz', DEPTH))}
POINT_NAMES = 'x', 'y', 'normal_force', 'shear_force_x', 'shear_force_y'
LINE_NAMES = 'offset', 'yaw', 'line_force'
POINT_PEAK = 1.5 / (np.pi * DEPTH**2)  # pressure above a normal load of 1 N [Pa]


@dataclass(frozen=True)
class Contacts:
    """
    Noise-free frames with their parameters and bounds.

    Attributes
    ----------
    names : tuple of str
        Of the parameters: POINT_NAMES [m, N] or LINE_NAMES [m, rad, N/m].
    truth : ndarray, shape (N, K)
    clean : ndarray, shape (N, layers, rows, columns) or (N, rows, columns)
        Stress [Pa].
    bound : ndarray, shape (N, K)
        Cramer-Rao bound of each parameter's standard deviation for noise of 1 Pa.
    peak : ndarray, shape (N,)
        Pressure above the same load without shear [Pa]; the signal of the peak SNR.
    """

    names: tuple[str, ...]
    truth: np.ndarray
    clean: np.ndarray
    bound: np.ndarray
    peak: np.ndarray

    def told(self, values):
        """Numbers of the parameters by their names."""
        return dict(zip(self.names, values, strict=True))

    def noise(self, decibels):
        """Standard deviation of one tactel [Pa], shape (N,)."""
        return self.peak * 10.0 ** (-decibels / 20.0)

    def noisy(self, decibels, rng):
        """Frames with Gaussian noise of the same strength in every layer."""
        std = self.noise(decibels).reshape(-1, *[1] * (self.clean.ndim - 1))
        return self.clean + std * rng.standard_normal(self.clean.shape)


def layers_of(model, noise_std):
    """Layers of model 1, 2 or 3 with the same noise in each."""
    return tuple(Layer(component, depth, noise_std) for component, depth in STRUCTURES[model])


def point_contacts(truth, model):
    """Contacts of a model from their parameters (N, 5)."""
    truth = np.atleast_2d(truth)
    forward = PointModel(POINT_ARRAY, layers_of(model, 1.0))
    clean = np.array([forward.image(state) for state in truth])
    bound = np.array([_bound(forward.jacobian(state).reshape(-1, 5)) for state in truth])
    _, _, force, _, _ = truth.T
    return Contacts(POINT_NAMES, truth, clean, bound, POINT_PEAK * force)


def random_points(count, model, rng, *, reach=8e-3, shear=0.5):
    """Loads of 1 N with |x|, |y| <= reach and shear of any direction up to shear * P."""
    size, direction = shear * rng.random(count), 2.0 * np.pi * rng.random(count)
    truth = np.column_stack([
        rng.uniform(-reach, reach, count), rng.uniform(-reach, reach, count), np.ones(count),
        size * np.cos(direction), size * np.sin(direction)])
    return point_contacts(truth, model)


def line_contacts(truth):
    """Contacts of lines from (offset, yaw, line_force), shape (N, 3)."""
    truth = np.atleast_2d(truth)
    x, y = np.meshgrid(LINE_ARRAY.x, LINE_ARRAY.y)
    clean = np.empty((len(truth), *LINE_ARRAY.shape))
    bound = np.empty_like(truth)
    forward = LineModel(LINE_ARRAY, (DEPTH,))
    for i, (offset, yaw, force) in enumerate(truth):
        clean[i] = line.pressure(x, y, offset, yaw, force, DEPTH)
        jacobian = forward.jacobian(np.array([offset, yaw, force, 0.0])).reshape(-1, 4)
        bound[i] = _bound(jacobian[:, :3])
    _, _, force = truth.T
    return Contacts(LINE_NAMES, truth, clean, bound, line.peak_pressure(force, DEPTH))


def random_lines(count, rng):
    """Lines of 200 N/m with |yaw| <= 40 degrees and |offset| <= 8 mm."""
    return line_contacts(np.column_stack([
        rng.uniform(-8e-3, 8e-3, count), np.radians(rng.uniform(-40.0, 40.0, count)),
        np.full(count, 200.0)]))


def _bound(jacobian):
    scale = np.linalg.norm(jacobian, axis=0)
    unit = jacobian / scale
    return np.sqrt(np.diagonal(np.linalg.inv(unit.T @ unit))) / scale
