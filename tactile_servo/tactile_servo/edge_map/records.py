"""Records of the edge map: points of the cloud, nodes of the path, and arrays of them."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

# Both kinds of record begin with a place in the plane, its height along the normal [m] and a
# unit direction.
_COMMON = ('x', 'y', 'z', 'tx', 'ty')


def _record(*names: str) -> np.dtype:
    """Return a type of named numbers; place, point, way and row are views of several of them."""
    names = (*_COMMON, *names)
    at = {name: 8 * k for k, name in enumerate(names)}
    views = {'place': ('x', 2), 'point': ('x', 3), 'way': ('tx', 2), 'row': ('x', len(names))}
    return np.dtype({
        'names': [*names, *views],
        'formats': [np.float64] * len(names) + [(np.float64, n) for _, n in views.values()],
        'offsets': [*at.values(), *(at[first] for first, _ in views.values())]})


# Ridge point of an image. Its direction may have either sense; weight: quality of the ridge, 0-1.
CLOUD_POINT = _record('weight')
# Node of a path. Its direction is that of travel; station: distance along the path [m]; material:
# 1 if there is an edge between the previous node and this one, otherwise 0.
NODE = _record('station', 'material')
# Arrays (np.ndarray) of records, for kernels that access fields as attributes: numba supports
# this, but the types of numpy do not.
Records = Any


class LocalLine(NamedTuple):
    """Mean place (x, y, z) [m] and direction (tx, ty) of the ridge near a place."""

    support: float  # sum of the weights of the points; 0 if there is no ridge
    x: float
    y: float
    z: float
    tx: float
    ty: float


def joined(parts: Sequence[np.ndarray], kind: np.dtype = NODE) -> np.ndarray:
    """Return the concatenation of arrays of records of one kind."""
    # Join bytes: numpy's join compares the record types field by field, which takes 0.1 ms. The
    # result has the identical type object, because numba dispatches an equal copy more slowly.
    whole = bytearray().join(parts)  # type: ignore[arg-type]  # typed as buffers in 3.12
    return np.ndarray(len(whole) // kind.itemsize, kind, whole)


def nodes_of(place: ArrayLike, z: ArrayLike, way: ArrayLike, material: float = 1.0) -> np.ndarray:
    """Return nodes at places (N, 2) with directions (N, 2), without stations (see `measure`)."""
    place = np.atleast_2d(place)
    nodes = np.zeros(len(place), NODE)
    nodes['place'], nodes['z'], nodes['way'], nodes['material'] = place, z, way, material
    return nodes
