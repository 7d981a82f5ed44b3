"""Image of the edge: checked, repaired and located by its pose; lengths of its pad."""

from functools import cached_property
import math
from typing import NamedTuple

import numpy as np

from tactile_common.kernels import njit
from tactile_sensing.contact.ridge import centre_of_load, mend, ridge_of
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.image import Layer, TactileImage
from tactile_servo.edge_map.records import Records
from tactile_servo.edge_map.tracing import into_plane
from tactile_servo.reasons import Reason, ReasonCode
from tactile_servo.types import IMPOSSIBLE, pressure_layer

MOST_INVALID = 0.5  # share of invalid tactels above which an image is refused
LOADED = 0.3  # share of the highest pressure above which a tactel counts for the load's place
COARSE = 1.25  # pitches, grain of tactels that are coarser than the skin
UNKNOWN_NOISE = 1e-2  # share of the highest pressure, for a sensor that does not know its noise
# A ridge shows how the pad is pressed if it is central, long and straight. In half pads: largest
# distance of its centre, least standard deviation along it; in depths: largest misfit.
CENTRAL, LONG, ROUGH = 0.3, 0.4, 0.2
# A load just beyond the border of the pad, which the pad feels before it reaches it:
FAINT, PLAIN = 0.02, 0.06  # shares of the ridge's pressure, for a leg 2 and 1.25 depths away
LEAST_RUN = 4  # least number of loaded tactels along the border that show a leg
RIDGE_ZONE = 2.5  # depths from the ridge's line, within which border tactels see the ridge itself
SIGNIFICANT = 2.0  # standard deviations of the noise that a loaded border tactel exceeds
LIFTED = 0.5  # share of the mean indentation below which a ridge ends because the pad is tilted


class PadScale(NamedTuple):
    """
    Lengths of a pad [m].

    A *grain* is the resolution of an image: the skin blurs an edge to a width of its depth, and
    tactels that are coarser than that limit the resolution by their pitch.
    """

    depth: float  # of the tactels
    half_x: float  # half sides, and the longer of them
    half_y: float
    half: float
    grain: float

    @classmethod
    def of(cls, array: TactelArray, depth: float) -> 'PadScale':
        """Return the scale of an array whose tactels lie at a depth [m]."""
        half_x, half_y = array.half_width_x, array.half_width_y
        return cls(depth, half_x, half_y, max(half_x, half_y),
                   max(depth, COARSE * max(array.pitch_x, array.pitch_y)))


class Picture:
    """
    Pressure image in Pa of a tared layer, with the pose (4, 4) in the plane at which it was taken.

    The constructor evaluates the whole image, because single queries would cost more.
    """

    def __init__(self, layer: Layer, array: TactelArray, pose: np.ndarray, stamp_ns: int = 0,
                 skin_stiffness: float = math.inf):
        self.array, self.pose, self.stamp_ns, self.skin = array, pose, stamp_ns, layer.skin
        self.scale, self.depth = PadScale.of(array, layer.depth), layer.depth
        # The peak of (3.1), 2 q / (pi d), gives the line force q, and q gives the indentation.
        indentation = 0.5 * math.pi * layer.depth / skin_stiffness
        # `pressure`: repaired, all finite [Pa]; `noise`: of one tactel [Pa], 1 % of the peak if
        # unknown; `points`: ridge in the plane, CLOUD_POINT (N,); `coming`: see `coming_length`
        self.pressure, self.noise, self.invalid, total, self.points, self.coming = _look(
            np.asarray(layer.stress, np.float64, order='C'), float(layer.noise_std), array.x,
            array.y, layer.depth, pose, indentation)
        self.force = total * array.pitch_x * array.pitch_y
        # Position of the pad's centre [m] and angle of its x axis [rad], in the plane.
        (cos, _, _, self.x), (sin, _, _, self.y), (_, _, _, self.height), _ = pose.tolist()
        self.yaw = math.atan2(sin, cos)

    @property
    def place(self) -> np.ndarray:
        """Position (2,) of the pad's centre in the plane [m]."""
        return np.array([self.x, self.y])

    @cached_property
    def pull(self) -> np.ndarray | None:
        """Unit vector (2,) in the plane from the pad's centre to the load; None if centred."""
        way = self.pose[:2, :2] @ centre_of_load(
            self.pressure, self.array.x, self.array.y, LOADED)
        size = np.hypot(*way)
        return way / size if size > 0.0 else None

    def covers(self, x: float, y: float, margin: float = 0.0) -> bool:
        """Return True if a point of the plane is on the pad, at least `margin` inside [m]."""
        cos, sin, dx, dy = math.cos(self.yaw), math.sin(self.yaw), x - self.x, y - self.y
        return (abs(cos * dx + sin * dy) <= self.scale.half_x - margin
                and abs(cos * dy - sin * dx) <= self.scale.half_y - margin)


def read_picture(image: TactileImage, pose: np.ndarray,
                 skin_stiffness: float) -> Picture | Reason:
    """Check and repair an image taken at a pose (4, 4) in the plane; return why it is unusable."""
    layer = pressure_layer(image.layers)
    if (layer is None or layer.unit != 'Pa' or not 0.0 < layer.depth < math.inf
            or not layer.thickness >= layer.depth or not 0.0 <= layer.poisson <= 0.5
            or layer.stress.shape != image.array.shape):
        return Reason(ReasonCode.BAD_IMAGE, 'picture without pressure')
    if not image.tared:
        return Reason(ReasonCode.BAD_IMAGE, 'picture without tared pressure')
    picture = Picture(layer, image.array, pose, image.stamp_ns, skin_stiffness)
    # With more invalid tactels, the repaired image would be mostly invented.
    if picture.invalid > MOST_INVALID * picture.pressure.size:
        return Reason(ReasonCode.BAD_IMAGE, 'picture with too many invalid tactels')
    return picture


@njit(cache=True)
def indentation_of(points: np.ndarray, pose: np.ndarray,
                   half: float) -> tuple[bool, float, np.ndarray]:
    """
    Return the indentation at the pad's centre [m] and the direction (3,) in which it increases.

    `points` (N,) are the ridge of an image that was taken at `pose` (4, 4), `half` is the longer
    half side of the pad [m]. The first value is True if the ridge crosses the pad and is straight
    enough for a result. The indentation is fitted along the ridge: across it, it is constant.
    """
    to_own, count = np.ascontiguousarray(pose[:3, :3].T), len(points)
    own, weights = np.empty((3, count)), np.empty(count)
    for n in range(count):
        own[:, n] = to_own @ np.array([points[n].x - pose[0, 3], points[n].y - pose[1, 3],
                                       points[n].z - pose[2, 3]])
        weights[n] = points[n].weight
    weights /= max(weights.sum(), 1e-12)
    x, y, z = own @ weights
    dx, dy, dz = own[0] - x, own[1] - y, own[2] - z
    xx, xy, yy = weights @ dx**2, weights @ (dx * dy), weights @ dy**2
    turn = 0.5 * math.atan2(2.0 * xy, xx - yy)
    along = math.cos(turn), math.sin(turn)
    place = dx * along[0] + dy * along[1]
    rise = -(weights @ (place * dz)) / max(weights @ place**2, 1e-12)
    depth = -z - rise * (x * along[0] + y * along[1])
    misfit = math.sqrt(weights @ (dz + rise * place)**2)
    found = (math.hypot(x, y) < CENTRAL * half and math.sqrt(xx + yy) > LONG * half
             and misfit < ROUGH * depth)
    way = to_own.T @ np.array([rise * along[0], rise * along[1], 1.0])
    return found, depth, way / math.sqrt(way @ way)


def slope_where_lifted(picture: Picture, way: np.ndarray) -> float:
    """
    Return the slope along `way` (2,) in the plane of a ridge from which a tilted pad lifts off.

    NaN if the indentation does not fall to zero towards the end of the ridge: then the edge ends.
    """
    points, normal = picture.points, picture.pose[:3, 2]
    place = points['point']
    along, indentation = place[:, :2] @ way, (picture.pose[:3, 3] - place) @ normal
    weights = points['weight'] / points['weight'].sum()
    along -= weights @ along
    spread = weights @ along**2
    fall, slope = (weights * along) @ np.column_stack([indentation, place[:, 2]]) / spread
    mean, beyond = weights @ indentation, along.max() + picture.scale.grain
    return slope if mean + fall * beyond < LIFTED * mean else math.nan


@njit(cache=True)
def _look(pressure: np.ndarray, noise: float, x: np.ndarray, y: np.ndarray, depth: float,
          pose: np.ndarray,
          indentation: float) -> tuple[np.ndarray, float, int, float, np.ndarray, float]:
    """
    Evaluate an image (rows, columns); impossible values count as missing.

    Returns the repaired image, noise, number of impossible values, sum of the pressures, ridge in
    the plane and coming length.
    """
    possible = np.abs(pressure) < IMPOSSIBLE
    if not 0.0 < noise < IMPOSSIBLE:
        noise = UNKNOWN_NOISE * max(np.where(possible, pressure, 0.0).max(), 1.0)
    mended = mend(np.where(possible, pressure, np.nan), noise)
    ridge = ridge_of(mended, x, y, noise, depth)
    coming = coming_length(mended, x, y, ridge, noise, depth)
    return (mended, noise, pressure.size - possible.sum(), mended.sum(),
            into_plane(ridge, pose, indentation), coming)


@njit(cache=True)
def coming_length(pressure: np.ndarray, x: np.ndarray, y: np.ndarray, points: np.ndarray,
                  noise: float, depth: float) -> float:
    """
    Return the length of a leg of the edge that is about to reach the pad [m].

    A leg parallel to the border reaches the pad suddenly and adds half of the load again. The
    skin shows it on the border tactels about 1.5 depths earlier.

    The length is 0 without such a leg, and reduced while the leg is far. The pressure (rows,
    columns) [Pa] must be finite. `points` (N,) are RIDGE_POINT, the image's ridge; x, y [m],
    `noise` [Pa] and `depth` [m] are positions, noise and depth of the tactels.
    """
    if not len(points):
        return 0.0
    clear = RIDGE_ZONE * depth
    count, share = _longest_run(pressure, x, y, points, clear, noise)
    if count < LEAST_RUN:
        return 0.0
    near = min(max((share - FAINT) / (PLAIN - FAINT), 0.0), 1.0)
    # Tactels near the ridge were excluded: assume that the leg extends to the ridge.
    return near * (count * min(x[1] - x[0], y[1] - y[0]) + clear)


@njit(cache=True)
def _longest_run(pressure: np.ndarray, x: np.ndarray, y: np.ndarray, points: Records, clear: float,
                 noise: float) -> tuple[int, float]:
    """Find the longest loaded run of border tactels off the ridge: count, relative pressure."""
    rows, columns = pressure.shape
    ridge = np.median(points.pressure)
    level = max(FAINT * ridge, SIGNIFICANT * noise)
    around = 2 * (rows + columns) - 4
    best, best_sum, run, total = 0, 0.0, 0, 0.0
    for step in range(2 * around):  # twice around: a run may cross the starting point
        k = step % around
        if k < columns:
            r, c = 0, k
        elif k < columns + rows - 1:
            r, c = k - columns + 1, columns - 1
        elif k < 2 * columns + rows - 2:
            r, c = rows - 1, 2 * columns + rows - 3 - k
        else:
            r, c = around - k, 0
        own = pressure[r, c] < level
        for n in range(len(points)):
            if own:
                break
            # Beyond the pad, assume that the ridge continues straight.
            point = points[n]
            aside = (x[c] - point.x) * point.ty - (y[r] - point.y) * point.tx
            own = abs(aside) < clear
        run, total = (0, 0.0) if own else (run + 1, total + pressure[r, c])
        if run > best and run <= around:
            best, best_sum = run, total
    return best, best_sum / (max(best, 1) * ridge)
