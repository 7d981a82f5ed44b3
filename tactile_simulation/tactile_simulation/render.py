"""Pressure on a tactile array that is indented by a rigid edge."""
from functools import lru_cache

import numpy as np

from tactile_common.kernels import FAST, njit
from tactile_sensing.skin.bumps import coefficients_of, sharp_point, value_of
from tactile_sensing.skin.kernel import CENTRE, polynomials
from tactile_sensing.skin.pressure import split_tactel
from tactile_sensing.types.array import TactelArray
from tactile_simulation.sensor import SceneSkin

# Chords up to this length are replaced by a point load at their middle [depths of the skin].
SHORT = 0.125
# Loads farther from the pad than this add less than 1e-4 of the peak [depths].
REACH = 8.0
PANEL = 0.8  # length of edge represented by three Gauss points [depths]
GAUSS, WEIGHTS = np.polynomial.legendre.leggauss(3)
WEIGHTS /= 2.0  # their sum is 1


def render(points: np.ndarray, array: TactelArray, skin: SceneSkin,
           solid: np.ndarray | None = None, area: float = 0.0) -> np.ndarray:
    """
    Return the pressure (rows, columns) under a rigid edge that indents the skin [Pa].

    The load per length is `stiffness` times the indentation; the pressure is the sum over point
    loads at Gauss points along the edge, see `skin.kernel`.

    Parameters
    ----------
    points : np.ndarray
        Polyline of the edge in the sensor frame [m], shape `(M, 3)`; it indents where z < 0.
    array : TactelArray
    skin : Skin
    solid : np.ndarray, optional
        Which chords have material, shape `(M - 1,)`; default all.
    area : float
        Side of the square over which a tactel averages [pitches]; 0: it samples its centre.
    """
    reach = REACH * skin.depth
    starts, chords = _loaded(points, solid, abs(array.x[0]) + reach, abs(array.y[0]) + reach)
    shape, nodes = _point_shape(skin, area * array.pitch_x, area * array.pitch_y)
    pressure = np.zeros(array.shape)
    places, loads = _point_loads(starts, chords, skin)
    _add_points(pressure, array.x, array.y, nodes, shape, skin.depth, places, loads)
    return pressure


def force_on(points: np.ndarray, array: TactelArray, skin: SceneSkin,
             solid: np.ndarray | None = None) -> float:
    """Return the force of an edge on the rectangle of an array [N]; arguments as of `render`."""
    starts, chords = _loaded(points, solid, array.half_width_x, array.half_width_y)
    indentation = -(starts[:, 2] + 0.5 * chords[:, 2])
    return float(skin.stiffness * indentation @ np.linalg.norm(chords, axis=1))


def _loaded(points: np.ndarray, solid: np.ndarray | None, half_x: float,
            half_y: float) -> tuple[np.ndarray, np.ndarray]:
    """Return starts and chords (K, 3) of the parts in a rectangle and below the surface."""
    points = np.asarray(points, dtype=float)
    starts, chords = points[:-1], np.diff(points, axis=0)
    if solid is not None:
        starts, chords = starts[solid], chords[solid]
    # In each row a place on a chord, begin + share * slope, must not be positive.
    begin = np.stack([starts[:, 0] - half_x, -starts[:, 0] - half_x,
                      starts[:, 1] - half_y, -starts[:, 1] - half_y, starts[:, 2]])
    slope = np.stack([chords[:, 0], -chords[:, 0], chords[:, 1], -chords[:, 1], chords[:, 2]])
    with np.errstate(divide='ignore', invalid='ignore'):
        share = -begin / slope
    first = np.where(slope < 0.0, share, 0.0).max(axis=0).clip(min=0.0)
    last = np.where(slope > 0.0, share, 1.0).min(axis=0).clip(max=1.0)
    last[((slope == 0.0) & (begin > 0.0)).any(axis=0)] = 0.0
    part = last > first
    first, last, chords = first[part, None], last[part, None], chords[part]
    return starts[part] + first * chords, (last - first) * chords


def _point_loads(starts: np.ndarray, chords: np.ndarray,
                 skin: SceneSkin) -> tuple[np.ndarray, np.ndarray]:
    """Return the places (L, 2) [m] and loads (L,) [N] of the Gauss points of chords."""
    length = np.linalg.norm(chords, axis=1)
    count = np.maximum(np.ceil(length / (PANEL * skin.depth)), 1).astype(int)
    chord = np.repeat(np.arange(len(chords)), count)  # of each panel
    number = np.arange(len(chord)) - np.repeat(count.cumsum() - count, count)
    share = (number[:, None] + 0.5 + 0.5 * GAUSS) / count[chord, None]
    places = starts[chord, None] + share[..., None] * chords[chord, None]
    weights = np.where((length <= SHORT * skin.depth)[chord, None], [0.0, 1.0, 0.0], WEIGHTS)
    loads = -skin.stiffness * places[..., 2] * weights * (length / count)[chord, None]
    loaded = loads > 0.0
    return places[loaded][:, :2], loads[loaded]


@lru_cache(maxsize=16)
def _point_shape(skin: SceneSkin, size_x: float, size_y: float) -> tuple[np.ndarray, np.ndarray]:
    """Return a point load's shape (see `skin.kernel`) and a tactel's sample points (N, 2)."""
    side, nodes = 0.0, np.zeros((1, 2))
    if size_x > 0.0 and size_y > 0.0:
        side, nodes = split_tactel(size_x, size_y, skin.depth)
    return sharp_point(polynomials(skin.layer, side), skin.depth), nodes


@njit(cache=True, nogil=True, error_model='numpy', fastmath=FAST)
def _add_points(pressure: np.ndarray, x: np.ndarray, y: np.ndarray, nodes: np.ndarray,
                shape: np.ndarray, depth: float, places: np.ndarray, loads: np.ndarray) -> None:
    """Add the pressure of point loads [N] at places (L, 2) [m]."""
    of_f, centre = coefficients_of(shape), (CENTRE * depth) ** 2
    for k in range(len(loads)):
        load = loads[k] / nodes.shape[0]
        for j in range(nodes.shape[0]):
            dx, dy = nodes[j, 0] - places[k, 0], nodes[j, 1] - places[k, 1]
            for r in range(y.size):
                row, v = pressure[r], y[r] + dy
                for c in range(x.size):
                    u = x[c] + dx
                    row[c] += load * value_of(of_f, centre / (u * u + v * v + centre))
