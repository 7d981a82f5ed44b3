"""Pictures of a tactile array that touches the edge of a scene."""
import math

import numpy as np

from tactile_common.kernels import njit
from tactile_sensing.half_space.kernels import add_point, add_segment
from tactile_sensing.types.array import TactelArray
from tactile_simulation.scene import Scene, Skin

# Chords up to this length, in depths of the skin, press at their middle [depths]; longer ones
# are integrated in closed form.
SHORT = 0.125
# Loads further from the pad than this add less than 1e-4 of the peak [depths].
REACH = 8.0
COUNTS_MAX = 255


def render(points, array: TactelArray, skin: Skin,
           solid: np.ndarray | None = None) -> tuple[np.ndarray, float]:
    """
    Pressure under a rigid edge that indents the skin.

    The edge presses with `stiffness` times its indentation per length. Its pressure is the
    superposition of finite line loads: the point load (2.2) without shear, integrated along
    each chord in closed form.

    Parameters
    ----------
    points : np.ndarray
        Polyline of the edge in the sensor frame [m], shape `(M, 3)`; it indents where z < 0.
    array : TactelArray
    skin : Skin
    solid : np.ndarray, optional
        Which chords have material, shape `(M - 1,)`; default all.

    Returns
    -------
    pressure : np.ndarray
        At the centres of the tactels [Pa], shape `(rows, columns)`, compression positive.
    force : float
        Normal force on the rectangle of the array [N], of the loads within it.
    """
    points = np.ascontiguousarray(points, dtype=np.float64)
    if solid is None:
        solid = np.ones(len(points) - 1, np.bool_)
    pressure = _pressure(points, solid, array.x, array.y, skin.depth, skin.stiffness)
    return pressure, _force(
        points, solid, array.half_width_x, array.half_width_y, skin.stiffness)


@njit(cache=True)
def _loaded_part(start, end, half_x, half_y):
    """Shares of a chord between which it lies in a rectangle and behind the surface."""
    first, last = 0.0, 1.0
    # Each row demands position + share * slope <= 0.
    for axis, sign, bound in (
            (0, 1.0, half_x), (0, -1.0, half_x), (1, 1.0, half_y), (1, -1.0, half_y),
            (2, 1.0, 0.0)):
        position = sign * start[axis] - bound
        slope = sign * (end[axis] - start[axis])
        if slope > 0.0:
            last = min(last, -position / slope)
        elif slope < 0.0:
            first = max(first, -position / slope)
        elif position > 0.0:
            return 0.0, 0.0
    return first, last


@njit(cache=True)
def _length(start, end):
    return math.sqrt(
        (end[0] - start[0])**2 + (end[1] - start[1])**2 + (end[2] - start[2])**2)


@njit(cache=True, nogil=True)
def _force(points, solid, half_x, half_y, stiffness):
    force = 0.0
    for n in range(len(points) - 1):
        if not solid[n]:
            continue
        start, end = points[n], points[n + 1]
        first, last = _loaded_part(start, end, half_x, half_y)
        if last > first:
            middle = 0.5 * (first + last)
            indentation = -(start[2] + middle * (end[2] - start[2]))
            force += stiffness * indentation * (last - first) * _length(start, end)
    return force


@njit(cache=True, nogil=True, error_model='numpy')
def _pressure(points, solid, x, y, depth, stiffness):
    pressure = np.zeros((len(y), len(x)))
    far_x = abs(x[0]) + REACH * depth
    far_y = abs(y[0]) + REACH * depth
    for n in range(len(points) - 1):
        if not solid[n]:
            continue
        start, end = points[n], points[n + 1]
        first, last = _loaded_part(start, end, far_x, far_y)
        if last <= first:
            continue
        length = _length(start, end)
        x0, y0, z0 = start + first * (end - start)
        x1, y1, z1 = start + last * (end - start)
        plan = math.hypot(x1 - x0, y1 - y0)
        # Load per length seen from above, so that a slope carries all of its load.
        share = stiffness * length * (last - first)
        if plan <= SHORT * depth:
            add_point(pressure, x, y, depth, 0.5 * (x0 + x1), 0.5 * (y0 + y1),
                      -0.5 * (z0 + z1) * share)
        else:
            add_segment(pressure, x, y, depth, x0, y0, x1, y1,
                        -z0 * share / plan, -z1 * share / plan)
    return pressure


@njit(cache=True, nogil=True)
def _digitised(pressure, gain, noise, noise_std, pa_per_count, baseline):
    counts = np.empty(pressure.shape, np.uint8)
    for r in range(pressure.shape[0]):
        for c in range(pressure.shape[1]):
            measured = gain[r, c] * pressure[r, c] + noise_std * noise[r, c]
            count = np.rint(measured / pa_per_count + baseline)
            counts[r, c] = min(max(count, 0.0), COUNTS_MAX)
    return counts


class EdgeRenderer:
    """
    What a sensor measures at a pose (4, 4), sensor -> base, given a scene.

    Attributes
    ----------
    shift : ndarray, shape (3,)
        How far the object has slipped [m]; changes when any method sees the pad where the
        scene says that it slips.
    """

    def __init__(self, scene: Scene, array: TactelArray):
        self._scene, self._array = scene, array
        self.shift = np.zeros(3)
        # Flaws of this one sensor: the same at every run, whatever the seed of the noise.
        flaws = np.random.default_rng(1)
        self._gain = 1.0 + scene.sensor.gain_spread * flaws.standard_normal(array.shape)
        alive = np.ones(array.shape[0] * array.shape[1])
        alive[flaws.permutation(alive.size)[:int(scene.sensor.dead)]] = 0.0
        self._gain *= alive.reshape(array.shape)

    def render(self, pose: np.ndarray) -> np.ndarray:
        """Return the pressure at the tactels (rows, columns), free of noise [Pa]."""
        self._slip(pose)
        pressure, _ = render(
            self._points(pose), self._array, self._scene.skin, self._scene.edge.solid)
        return pressure

    def force(self, pose: np.ndarray) -> float:
        """Return the normal force on the rectangle of the array at a pose [N]."""
        self._slip(pose)
        return self._load(pose)

    def _load(self, pose):
        return _force(self._points(pose), self._scene.edge.solid, self._array.half_width_x,
                      self._array.half_width_y, self._scene.skin.stiffness)

    def counts(self, pose: np.ndarray | None, rng: np.random.Generator) -> np.ndarray:
        """
        Return one frame (rows, columns) of counts: noise, baseline, quantisation, saturation.

        Without a pose the sensor touches nothing.
        """
        sensor = self._scene.sensor
        pressure = np.zeros(self._array.shape) if pose is None else self.render(pose)
        return _digitised(pressure, self._gain, rng.standard_normal(self._array.shape),
                          sensor.noise_std, sensor.pa_per_count, sensor.baseline)

    def _points(self, pose):
        # Rows are points, hence the transpose of base -> sensor: the rotation itself.
        return (self._scene.edge.points + (self.shift - pose[:3, 3])) @ pose[:3, :3]

    def _slip(self, pose):
        slip, edge = self._scene.slip, self._scene.edge
        if slip is None or self.shift.any() or self._load(pose) <= 0.0:
            return
        _, s = edge.nearest(pose[None, :3, 3])
        if s[0] >= slip.s:
            along = edge.tangent_at(slip.s)
            self.shift = slip.offset * np.array([-along[1], along[0], 0.0])
