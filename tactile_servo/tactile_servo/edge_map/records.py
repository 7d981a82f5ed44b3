"""Records of the edge map: a point of the cloud, a node of the path, and arrays of them."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np


def _record(*names):
    return np.dtype([(name, np.float64) for name in names])


# Both begin with a place in the plane, its height along the normal [m] and a unit direction.
_PLACE = ('x', 'y', 'z', 'tx', 'ty')
# Ridge point of a picture, its direction of either sense; weight: quality of the ridge, 0 to 1.
CLOUD_POINT = _record(*_PLACE, 'weight')
# Node of a path, its direction that of travel; station: way along the path [m]; material: 1 if
# there is any between the node and the one before, else 0.
NODE = _record(*_PLACE, 'station', 'material')


class LocalLine(NamedTuple):
    """Mean place (x, y, z) [m] and direction of the ridge near a place, if one was found."""

    found: bool
    x: float
    y: float
    z: float
    tx: float
    ty: float


def places(records: np.ndarray) -> np.ndarray:
    """Places in the plane of contiguous records, a view of shape (N, 2)."""
    return _columns(records)[:, :2]


def points(records: np.ndarray) -> np.ndarray:
    """Places with their heights, a view of shape (N, 3)."""
    return _columns(records)[:, :3]


def ways(records: np.ndarray) -> np.ndarray:
    """Directions of contiguous records, a view of shape (N, 2)."""
    return _columns(records)[:, 3:5]


def _columns(records):
    return records.view(np.float64).reshape(-1, len(records.dtype))


def joined(parts: Sequence[np.ndarray], kind: np.dtype = NODE) -> np.ndarray:
    """Contiguous arrays of records of a kind, one after the other."""
    # As numbers: numpy compares record types field by field at every join, for 0.1 ms. And of
    # this very type: numba takes 0.4 us more to recognise an equal one, such as kernels return.
    return np.concatenate([part.view(np.float64) for part in parts]).view(kind)


def nodes_of(place, z, way, material=1.0) -> np.ndarray:
    """Nodes at places (N, 2) with directions (N, 2); stations are still to be measured."""
    place = np.atleast_2d(place)
    nodes = np.zeros(len(place), NODE)
    places(nodes)[:] = place
    ways(nodes)[:] = way
    nodes['z'], nodes['material'] = z, material
    return nodes
