"""Point load for the fit: where to start, which tactels to use, derivatives (2.2, 2.5)."""

import numpy as np

from tactile_common.kernels import FAST, njit

WINDOW = 4.5  # least half side of the fitted window [pitches]: 9x9 tactels
SPIKE = 0.05  # share of a tactel that one of those around it has, unless it is stuck
MIN_AROUND = 3  # live tactels around one that tell
WINDOW_DEPTHS = 1.9  # the same in mean depths of the layers: deeper ones see further


@njit(error_model='numpy')
def _is_spike(image, row, column):
    """Whether a tactel stands alone, as no load under a skin makes it."""
    highest = -np.inf
    around = 0
    for r in range(max(row - 1, 0), min(row + 2, image.shape[0])):
        for c in range(max(column - 1, 0), min(column + 2, image.shape[1])):
            if np.isfinite(image[r, c]) and (r != row or c != column):
                around += 1
                highest = max(highest, image[r, c])
    return around >= MIN_AROUND and highest < SPIKE * image[row, column]


@njit(error_model='numpy')
def peak(stress, component, noise):
    """Layer, row and column of the largest pressure over its noise; layer -1 if none."""
    best = 0.0
    layer = row = column = -1
    for k in range(stress.shape[0]):
        if component[k] != 0:
            continue
        level = best * noise[k]
        for r in range(stress.shape[1]):
            for c in range(stress.shape[2]):
                # False for NaN.
                if level < stress[k, r, c] < np.inf and not _is_spike(stress[k], r, c):
                    level = stress[k, r, c]
                    layer, row, column = k, r, c
        best = max(best, level / noise[k])
    return layer, row, column


@njit(error_model='numpy')
def _vertex(line, peak):
    """How far the vertex of a row of tactels is off its peak [pitches]; 0 where unknown."""
    if line.size < 3:
        return 0.0
    middle = min(max(peak, 1), line.size - 2)
    left, right = line[middle - 1], line[middle + 1]
    if not (left > 0.0 and line[middle] > 0.0 and right > 0.0):  # false for NaN
        return 0.0
    # Without shear pressure^(-2/5) is a parabola in x and in y, so its vertex is exact.
    f = (left / line[middle]) ** -0.4
    h = (right / line[middle]) ** -0.4
    curvature = f + h - 2.0
    if not 0.0 < curvature < np.inf:
        return 0.0
    return min(max(middle - peak + 0.5 * (f - h) / curvature, -0.5), 0.5)


@njit(error_model='numpy')
def start(stress, component, noise):
    """Row and column of the peak, and how far its vertex is off: (r, c, along y, along x)."""
    k, r, c = peak(stress, component, noise)
    if k < 0:
        return -1, -1, 0.0, 0.0
    return r, c, _vertex(stress[k, :, c], r), _vertex(stress[k, r], c)


@njit(error_model='numpy')
def gather(stress, x, y, noise, row, column, v, w, window, points, ends):
    """Finite tactels of the window into points (x, y, value / noise); ends per layer."""
    # Relative to the peak, so that whole-tactel shifts cannot change the window.
    r0 = max(row + int(np.ceil(v - window)), 0)
    r1 = min(row + int(np.floor(v + window)) + 1, stress.shape[1])
    c0 = max(column + int(np.ceil(w - window)), 0)
    c1 = min(column + int(np.floor(w + window)) + 1, stress.shape[2])
    n = 0
    for k in range(stress.shape[0]):
        for r in range(r0, r1):
            for c in range(c0, c1):
                value = stress[k, r, c]
                if np.isfinite(value):
                    points[0, n] = x[c]
                    points[1, n] = y[r]
                    points[2, n] = value / noise[k]
                    n += 1
        ends[k] = n
    return n


@njit(error_model='numpy', fastmath=FAST)
def add_forces(x, y, a, b, depth, gz, gx, gy, scale, shape, q, by_force, by_qx, by_qy):
    """Add one layer's derivatives by (P, Qx, Qy), see `add_place`; shape and q are kept for it."""
    dd = depth * depth
    scale *= 1.5 / np.pi * dd
    for i in range(x.size):
        u = x[i] - a
        v = y[i] - b
        q[i] = 1.0 / (u * u + v * v + dd)
        shape[i] = scale * q[i] * q[i] * np.sqrt(q[i])
        lever = shape[i] * (gz + gx * u + gy * v)
        by_force[i] += lever * depth
        by_qx[i] += lever * u
        by_qy[i] += lever * v


@njit(error_model='numpy', fastmath=FAST)
def add_place(x, y, a, b, force, qx, qy, depth, gz, gx, gy, shape, q, by_a, by_b):
    """
    Add one layer's derivatives by (a, b), from equations (2.2) and (2.5).

    The component is (gz + gx x' + gy y') times the pressure.
    """
    for i in range(x.size):
        u = x[i] - a
        v = y[i] - b
        load = force * depth + qx * u + qy * v
        lever = gz + gx * u + gy * v
        by = 5.0 * q[i] * load * lever
        by_a[i] += shape[i] * (by * u - qx * lever - gx * load)
        by_b[i] += shape[i] * (by * v - qy * lever - gy * load)


@njit(error_model='numpy')
def stress_at(x, y, theta, layer):
    """Stress at one place [Pa]; layer is (depth, noise, gz, gx, gy)."""
    u, v, depth = x - theta[0], y - theta[1], layer[0]
    q = 1.0 / (u * u + v * v + depth * depth)
    return 1.5 / np.pi * depth * depth * q * q * np.sqrt(q) * (
        theta[2] * depth + theta[3] * u + theta[4] * v) * (layer[2] + layer[3] * u + layer[4] * v)
