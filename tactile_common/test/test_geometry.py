"""Cross products, compared with numpy's."""
import numpy as np

from tactile_common.geometry import cross


def test_cross_products_are_those_of_numpy():
    for a, b in np.random.default_rng(0).normal(size=(20, 2, 3)):
        assert (cross(a, b) == np.cross(a, b)).all()
    assert cross([1, 0, 0], np.array([0.0, 1.0, 0.0])).tolist() == [0.0, 0.0, 1.0]
