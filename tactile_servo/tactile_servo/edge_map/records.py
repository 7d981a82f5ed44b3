"""Records of the edge map: a point of the cloud, a node of the path, and arrays of them."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

# Both kinds of record begin with a place in the plane, its height along the normal [m] and a
# unit direction.
_COMMON = ('x', 'y', 'z', 'tx', 'ty')


def _record(*names: str) -> np.dtype:
    """Type of numbers with names; place, point, way and row are several of them at once."""
    names = (*_COMMON, *names)
    at = {name: 8 * k for k, name in enumerate(names)}
    views = {'place': ('x', 2), 'point': ('x', 3), 'way': ('tx', 2), 'row': ('x', len(names))}
    return np.dtype({
        'names': [*names, *views],
        'formats': [np.float64] * len(names) + [(np.float64, n) for _, n in views.values()],
        'offsets': [*at.values(), *(at[first] for first, _ in views.values())]})


# Ridge point of a picture, its direction of either sense; weight: quality of the ridge, 0 to 1.
CLOUD_POINT = _record('weight')
# Node of a path, its direction that of travel; station: way along the path [m]; material: 1 if
# there is any between the node and the one before, else 0.
NODE = _record('station', 'material')
# Arrays (np.ndarray) and elements (np.void) of them for kernels that read a field by its name:
# numba knows it, numpy's types do not.
Records = Any
Record = Any


class LocalLine(NamedTuple):
    """Mean place (x, y, z) [m] and direction of the ridge near a place, if one was found."""

    found: bool
    x: float
    y: float
    z: float
    tx: float
    ty: float


def joined(parts: Sequence[np.ndarray], kind: np.dtype = NODE) -> np.ndarray:
    """Records of one kind, one array after the other."""
    # As bytes: numpy compares record types field by field at every join, for 0.1 ms. And of
    # this very type: numba takes longer to recognise an equal one, such as kernels return.
    whole = bytearray().join(parts)  # type: ignore[arg-type]  # typed as buffers in 3.12
    return np.ndarray(len(whole) // kind.itemsize, kind, whole)


def retyped(records: np.ndarray, kind: np.dtype = NODE) -> np.ndarray:
    """Records of a kernel, of this very type: see `joined`."""
    return np.ndarray(len(records), kind, records)


def nodes_of(place: ArrayLike, z: ArrayLike, way: ArrayLike, material: float = 1.0) -> np.ndarray:
    """Nodes at places (N, 2) with directions (N, 2); stations are still to be measured."""
    place = np.atleast_2d(place)
    nodes = np.zeros(len(place), NODE)
    nodes['place'], nodes['z'], nodes['way'], nodes['material'] = place, z, way, material
    return nodes
