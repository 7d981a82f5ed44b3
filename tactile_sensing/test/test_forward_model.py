"""Forward models: derivatives by differences, invariances, and the compiled formulas' oracle."""
from typing import NamedTuple

import numpy as np
import pytest

from tactile_common.kernels import njit
from tactile_sensing.contact.gauss_newton import FIT, LINE, POINT
from tactile_sensing.contact.goodness_of_fit import compare
from tactile_sensing.half_space.forward_model import LineModel, PointModel
from tactile_sensing.half_space.kernels import add_point, add_segment
from tactile_sensing.half_space.layers import Layer, sensor_of
from tactile_sensing.types.array import TactelArray

ARRAY = TactelArray(7, 9, 1.5e-3, 1e-3)
LAYERS = tuple(Layer(component, depth, 1.0) for component, depth in (
    ('zz', 2e-3), ('xz', 2e-3), ('yz', 3e-3)))
POINT_STATE = np.array([1.1e-3, -0.7e-3, 5.0, 1.2, -1.8])
LINE_STATE = np.array([1.2e-3, 0.4, 200.0, 50.0])
MODELS = [(PointModel(ARRAY, LAYERS), POINT_STATE),
          (LineModel(ARRAY, (2e-3, 4e-3)), LINE_STATE)]
IDS = ('point', 'line')


@pytest.mark.parametrize(('model', 'state'), MODELS, ids=IDS)
def test_jacobian_is_that_of_the_image(model, state):
    jacobian = model.jacobian(state)
    assert jacobian.shape == (*model.image(state).shape, len(model.parameters))
    for k, size in enumerate(np.abs(state)):
        step = 1e-5 * size * np.eye(len(state))[k]
        numeric = (model.image(state + step) - model.image(state - step)) / (2.0 * step[k])
        np.testing.assert_allclose(
            jacobian[..., k], numeric, rtol=1e-5, atol=1e-6 * np.abs(numeric).max())


@pytest.mark.parametrize(('model', 'state'), MODELS, ids=IDS)
def test_forces_enter_linearly(model, state):
    place = np.arange(len(state)) < 2
    twice = np.where(place, state, 2.0 * state)
    np.testing.assert_allclose(model.image(twice), 2.0 * model.image(state), rtol=1e-12)
    np.testing.assert_allclose(
        model.jacobian(state)[..., 2:] @ state[2:], model.image(state), rtol=1e-9,
        atol=1e-9 * np.abs(model.image(state)).max())


class Pictures(NamedTuple):
    stress: np.ndarray
    left: np.ndarray
    model: np.ndarray


@njit(cache=True)
def compare_first(kind, sensor, layers, loads, pictures):
    compare(kind, sensor, layers, loads[0], pictures)


@pytest.mark.parametrize('kind', (POINT, LINE))
def test_compiled_formulas_are_those_of_the_models(kind):
    model, state = MODELS[0] if kind == POINT else (LineModel(ARRAY, (2e-3,)), LINE_STATE)
    sensor, table = sensor_of(ARRAY, LAYERS)
    stress = np.random.default_rng(1).normal(size=(3, *ARRAY.shape))
    left, expected = np.empty_like(stress), np.empty_like(stress)
    loads = np.zeros(1, FIT)
    loads['vector'][0, :len(state)] = state
    compare_first(kind, sensor, table.copy(), loads, Pictures(stress, left, expected))
    shown = len(model.image(state))
    np.testing.assert_allclose(expected[:shown], model.image(state), rtol=1e-12)
    np.testing.assert_allclose(left[:shown], (stress - expected)[:shown])
    assert np.isnan(left[shown:]).all() and not expected[shown:].any()


def test_loads_added_into_a_picture_are_those_of_the_models():
    picture = np.zeros(ARRAY.shape)
    add_point(picture, ARRAY.x, ARRAY.y, 2e-3, *POINT_STATE[:3])
    model = PointModel(ARRAY, LAYERS[:1])
    without_shear = POINT_STATE * [1, 1, 1, 0, 0]
    np.testing.assert_allclose(picture, model.image(without_shear)[0], rtol=1e-12)
    # A segment from 1 to 3 N/mm is the integral of points.
    segment, points = np.zeros(ARRAY.shape), np.zeros(ARRAY.shape)
    ends = np.array([[-2e-3, 1e-3], [3e-3, -2e-3]])
    add_segment(segment, ARRAY.x, ARRAY.y, 2e-3, *ends[0], *ends[1], 1000.0, 3000.0)
    nodes, weights = np.polynomial.legendre.leggauss(40)
    length = np.hypot(*(ends[1] - ends[0]))
    for t, w in zip(0.5 * (nodes + 1.0), 0.5 * weights, strict=True):
        place = ends[0] + t * (ends[1] - ends[0])
        add_point(points, ARRAY.x, ARRAY.y, 2e-3, *place, w * length * (1000.0 + 2000.0 * t))
    np.testing.assert_allclose(segment, points, rtol=1e-9)
