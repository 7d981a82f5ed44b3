"""One picture of the edge: checked, mended, placed where it was taken; the lengths of its pad."""

from dataclasses import dataclass
from enum import Enum
from functools import cached_property
import math
from typing import NamedTuple

import numpy as np

from tactile_common.kernels import njit
from tactile_sensing.contact.ridge import centre_of_load, mend, ridge_points
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.image import TactileImage
from tactile_servo.edge_map.border import coming_length

IMPOSSIBLE = 1e9  # Pa
MOST_INVALID = 0.5  # share of the tactels
LOADED = 0.3  # of the highest pressure, from which a tactel tells where the load is
COARSE = 1.25  # pitches from which the tactels, no longer the skin, limit what is told apart
UNKNOWN_NOISE = 1e-2  # of the highest pressure, where the sensor does not know its noise


class PadScale(NamedTuple):
    """
    Lengths of a pad [m]: depth of its tactels, its pitches and half of its size.

    A *grain* is the length that a picture resolves: the skin blurs an edge to a width of its
    depth, and tactels that are coarser than that sample it no finer than their pitch.
    """

    depth: float
    pitch_x: float
    pitch_y: float
    half_x: float
    half_y: float

    @classmethod
    def of(cls, array: TactelArray, depth: float) -> 'PadScale':
        """Scale of an array whose tactels lie at a depth [m]."""
        return cls(depth, array.pitch_x, array.pitch_y, array.half_width_x, array.half_width_y)

    @property
    def grain(self) -> float:
        """Length that a picture resolves [m]."""
        return max(self.depth, COARSE * max(self.pitch_x, self.pitch_y))

    @property
    def half(self) -> float:
        """Half of the pad's longer side [m]."""
        return max(self.half_x, self.half_y)


class Problem(Enum):
    """Why a picture does not show the edge."""

    NO_PRESSURE = 'picture without pressure'
    NOT_TARED = 'picture without tared pressure'
    INVALID_TACTELS = 'picture with too many invalid tactels'
    NO_RIDGE = 'no ridge in the picture'
    ELSEWHERE = 'the picture shows no ridge along the path'


@dataclass(frozen=True, eq=False)
class Picture:
    """A pressure picture and the pose at which it was taken."""

    pressure: np.ndarray  # (rows, columns) [Pa], all finite
    array: TactelArray
    depth: float  # of the tactels [m]
    noise: float  # of one tactel [Pa]
    pose: np.ndarray  # (4, 4) of the sensor in the plane's frame
    stamp_ns: int = 0

    @cached_property
    def scale(self) -> PadScale:
        """Lengths of the pad."""
        return PadScale.of(self.array, self.depth)

    @cached_property
    def force(self) -> float:
        """Force of the pressure on the pad [N]."""
        return float(self.pressure.sum()) * self.array.pitch_x * self.array.pitch_y

    @cached_property
    def ridge(self) -> np.ndarray:
        """Points of the ridge: RIDGE_POINT (N,)."""
        return ridge_points(self.pressure, self.array, self.noise, self.depth)

    @cached_property
    def coming(self) -> float:
        """Length of a leg of the edge that is about to come under the pad [m]."""
        return coming_length(self.pressure, self.array, self.ridge, self.noise, self.depth)

    @cached_property
    def pull(self) -> np.ndarray | None:
        """Unit vector in the plane (2,) from the pad's centre to where the pressure is."""
        way = self.pose[:2, :2] @ centre_of_load(self.pressure, self.array.x, self.array.y,
                                                 LOADED)
        size = np.hypot(*way)
        return way / size if size > 0.0 else None

    @property
    def place(self) -> np.ndarray:
        """Centre of the pad in the plane (2,) [m]."""
        return self.pose[:2, 3]

    @property
    def height(self) -> float:
        """Of the pad's surface along the plane's normal [m]."""
        return float(self.pose[2, 3])

    @cached_property
    def yaw(self) -> float:
        """Angle of the pad in the plane [rad]."""
        return math.atan2(self.pose[1, 0], self.pose[0, 0])

    def covers(self, points: np.ndarray, margin: float = 0.0) -> bool:
        """Whether every point (M, 2) of the plane lies on the pad, off its border [m]."""
        return _inside(points, *self.place.tolist(), math.cos(self.yaw), math.sin(self.yaw),
                       self.scale.half_x - margin, self.scale.half_y - margin)


def read_picture(image: TactileImage, pose: np.ndarray) -> Picture | Problem:
    """Check and mend the pressure of an image taken at a pose (4, 4) in the plane."""
    layer = next((one for one in image.layers if one.component == 'zz'), None)
    if (layer is None or layer.unit != 'Pa' or not layer.depth > 0.0
            or layer.stress.shape != image.array.shape):
        return Problem.NO_PRESSURE
    if not image.tared:
        return Problem.NOT_TARED
    pressure = np.array(layer.stress, dtype=np.float64)
    pressure[~(np.abs(pressure) < IMPOSSIBLE)] = np.nan
    noise = float(layer.noise_std)
    if not 0.0 < noise < IMPOSSIBLE:
        noise = UNKNOWN_NOISE * float(np.nanmax(pressure, initial=1.0))
    # What is mended of more than that would be made up.
    if np.count_nonzero(np.isnan(pressure)) > MOST_INVALID * pressure.size:
        return Problem.INVALID_TACTELS
    return Picture(mend(pressure, noise), image.array, layer.depth, noise, pose, image.stamp_ns)


@njit(cache=True)
def _inside(points, x, y, cos, sin, half_x, half_y):
    for n in range(len(points)):
        dx, dy = points[n, 0] - x, points[n, 1] - y
        if not (abs(cos * dx + sin * dy) <= half_x and abs(cos * dy - sin * dx) <= half_y):
            return False
    return True
