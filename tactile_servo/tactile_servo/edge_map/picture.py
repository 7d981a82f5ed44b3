"""One picture of the edge: checked, mended, and placed where it was taken."""

from dataclasses import dataclass
from enum import Enum
from functools import cached_property
import math

import numpy as np

from tactile_common.kernels import njit
from tactile_sensing.contact.ridge import centre_of_load, mend, ridge_points
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.image import TactileImage
from tactile_servo.edge_map.border import coming_length
from tactile_servo.edge_map.scale import PadScale

IMPOSSIBLE = 1e9  # Pa
MOST_INVALID = 0.5  # share of the tactels
LOADED = 0.3  # of the highest pressure, from which a tactel tells where the load is
UNKNOWN_NOISE = 1e-2  # of the highest pressure, where the sensor does not know its noise


class Problem(Enum):
    """Why a picture does not show the edge."""

    NO_PRESSURE = 'picture without pressure'
    NOT_TARED = 'picture without tared pressure'
    INVALID_TACTELS = 'picture with too many invalid tactels'
    NO_RIDGE = 'no ridge in the picture'
    ELSEWHERE = 'the picture shows no ridge along the path'


@dataclass(frozen=True, eq=False)
class Picture:
    """
    A pressure picture and the pose at which it was taken.

    Parameters
    ----------
    pressure : ndarray, shape (rows, columns)
        [Pa], all finite.
    array : TactelArray
    depth, noise : float
        Of the tactels [m], of one tactel [Pa].
    pose : ndarray, shape (4, 4)
        Of the sensor in the plane's frame.
    stamp_ns : int
    """

    pressure: np.ndarray
    array: TactelArray
    depth: float
    noise: float
    pose: np.ndarray
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
    if np.isnan(pressure).mean() > MOST_INVALID:  # what is mended would be made up
        return Problem.INVALID_TACTELS
    return Picture(mend(pressure, noise), image.array, layer.depth, noise, pose, image.stamp_ns)


@njit(cache=True)
def _inside(points, x, y, cos, sin, half_x, half_y):
    for n in range(len(points)):
        dx, dy = points[n, 0] - x, points[n, 1] - y
        if not (abs(cos * dx + sin * dy) <= half_x and abs(cos * dy - sin * dx) <= half_y):
            return False
    return True
