"""Pictures of a tactile array that touches the edge of a scene."""
import math

from numba import njit
import numpy as np

# Step of the quadrature and reach of a load beyond the pad, in depths of the skin. What lies
# beyond the reach adds less than 1e-4 of the peak.
STEP = 0.125
REACH = 8.0
COUNTS_MAX = 255


def render(points, array, skin):
    """
    Pressure under a rigid edge that indents the skin.

    The edge presses with `stiffness` times its indentation per length; each piece is a point
    load on a half-space, (2.2) without shear, compression positive.

    Parameters
    ----------
    points : np.ndarray
        Polyline of the edge in the sensor frame [m], shape `(M, 3)`; it indents where z < 0.
    array : TactelArray
        Geometry of the array; the tactels sample the pressure at their centres.
    skin : Skin
        Depth and stiffness.

    Returns
    -------
    pressure : np.ndarray
        Pressure at the tactels [Pa], shape `(rows, columns)`, compression positive.
    force : float
        Normal force on the rectangle of the array [N], of the loads within it.
    """
    points = np.ascontiguousarray(points, dtype=np.float64)
    return _render(
        points, array.x, array.y, array.half_width_x, array.half_width_y,
        skin.depth, skin.stiffness)


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


@njit(cache=True, nogil=True, error_model='numpy')
def _render(points, x, y, half_x, half_y, depth, stiffness):
    pressure = np.zeros((len(y), len(x)))
    from_column = np.empty(len(x))
    margin = REACH * depth
    force = 0.0
    for n in range(len(points) - 1):
        start, end = points[n], points[n + 1]
        length = math.sqrt(
            (end[0] - start[0])**2 + (end[1] - start[1])**2 + (end[2] - start[2])**2)

        first, last = _loaded_part(start, end, half_x, half_y)
        if last > first:
            middle = 0.5 * (first + last)
            indentation = -(start[2] + middle * (end[2] - start[2]))
            force += stiffness * indentation * (last - first) * length

        first, last = _loaded_part(start, end, half_x + margin, half_y + margin)
        if last <= first:
            continue
        count = int(math.ceil((last - first) * length / (STEP * depth) - 1e-6))
        count = max(count, 1)
        for k in range(count):
            share = first + (last - first) * (k + 0.5) / count
            px = start[0] + share * (end[0] - start[0])
            py = start[1] + share * (end[1] - start[1])
            indentation = -(start[2] + share * (end[2] - start[2]))
            load = stiffness * indentation * (last - first) * length / count
            factor = 1.5 / math.pi * depth**3 * load
            for c in range(len(x)):
                from_column[c] = (x[c] - px)**2 + depth * depth
            for r in range(len(y)):
                from_row = (y[r] - py)**2
                for c in range(len(x)):
                    squared = from_column[c] + from_row
                    pressure[r, c] += factor / (squared * squared * math.sqrt(squared))
    return pressure, force


class EdgeRenderer:
    """
    What a sensor measures at a pose, given a scene.

    Parameters
    ----------
    scene : Scene
    array : TactelArray
    """

    def __init__(self, scene, array):
        self._scene = scene
        self._array = array

    def render(self, pose):
        """
        Return the pressure at the tactels, free of noise.

        Parameters
        ----------
        pose : np.ndarray
            Homogeneous transform sensor -> base, shape `(4, 4)`.

        Returns
        -------
        np.ndarray
            Pressure [Pa], shape `(rows, columns)`.
        """
        return self._touch(pose)[0]

    def force(self, pose) -> float:
        """Return the normal force on the rectangle of the array at a pose [N]."""
        return self._touch(pose)[1]

    def counts(self, pose, rng) -> np.ndarray:
        """
        Return one frame of raw counts: noise, baseline, quantisation and saturation.

        Parameters
        ----------
        pose : np.ndarray or None
            As for `render`; None for a sensor that touches nothing.
        rng : np.random.Generator
            Source of the noise.

        Returns
        -------
        np.ndarray
            Counts, shape `(rows, columns)`, uint8.
        """
        sensor = self._scene.sensor
        pressure = np.zeros(self._array.shape) if pose is None else self.render(pose)
        noise = sensor.noise_std * rng.standard_normal(self._array.shape)
        counts = np.rint((pressure + noise) / sensor.pa_per_count + sensor.baseline)
        return np.clip(counts, 0, COUNTS_MAX).astype(np.uint8)

    def _touch(self, pose):
        # Rows are points, hence the transpose of base -> sensor: the rotation itself.
        points = (self._scene.edge.points - pose[:3, 3]) @ pose[:3, :3]
        return render(points, self._array, self._scene.skin)
