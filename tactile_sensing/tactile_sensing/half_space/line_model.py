"""Line load with shear across it for the fit: start, tactels and derivatives (3.1)."""

import numpy as np

from tactile_common.kernels import FAST, njit
from tactile_sensing.half_space.point_model import peak

START_LEVEL = 0.25  # tactels above this fraction of the peak give the principal axis


@njit(error_model='numpy')
def start(stress, x, y, component, noise):
    """Principal axis of the tactels above START_LEVEL of the peak: (rho, yaw)."""
    layer, row, column = peak(stress, component, noise)
    if layer < 0:
        return np.nan, np.nan
    image = stress[layer]
    highest = image[row, column]
    level = START_LEVEL * highest
    m = mx = my = mxx = myy = mxy = 0.0
    for r in range(image.shape[0]):
        for c in range(image.shape[1]):
            w = min(image[r, c], highest) - level  # a stuck tactel pulls no more than others
            if 0.0 < w < np.inf:
                m += w
                mx += w * x[c]
                my += w * y[r]
                mxx += w * x[c] * x[c]
                myy += w * y[r] * y[r]
                mxy += w * x[c] * y[r]
    mx /= m
    my /= m
    yaw = -0.5 * np.arctan2(
        2.0 * (mxy / m - mx * my), (myy / m - my * my) - (mxx / m - mx * mx))
    return mx * np.cos(yaw) + my * np.sin(yaw), yaw


@njit(error_model='numpy')
def gather(stress, x, y, noise, component, points, ends):
    """Finite tactels of the pressure layers into points (x, y, value / noise)."""
    n = 0
    for k in range(stress.shape[0]):
        if component[k] == 0:
            for r in range(stress.shape[1]):
                for c in range(stress.shape[2]):
                    value = stress[k, r, c]
                    if np.isfinite(value):
                        points[0, n] = x[c]
                        points[1, n] = y[r]
                        points[2, n] = value / noise[k]
                        n += 1
        ends[k] = n
    return n


@njit(error_model='numpy', fastmath=FAST)
def add_forces(x, y, cos, sin, rho, depth, scale, shape, q, by_force, by_shear):
    """Add one layer's derivatives by force and shear per length; shape and q are kept."""
    dd = depth * depth
    scale *= 2.0 / np.pi * dd
    for i in range(x.size):
        v = x[i] * cos + y[i] * sin - rho
        q[i] = 1.0 / (v * v + dd)
        shape[i] = scale * q[i] * q[i]
        by_force[i] += shape[i] * depth
        by_shear[i] += shape[i] * v


@njit(error_model='numpy', fastmath=FAST)
def add_place(x, y, cos, sin, rho, along, force, shear, depth, shape, q, by_rho, by_yaw):
    """
    Add one layer's derivatives by (rho, yaw).

    A part of a tactel that lies `along` the line from its centre has that much more lever.
    """
    for i in range(x.size):
        v = x[i] * cos + y[i] * sin - rho
        by = shape[i] * (4.0 * v * (force * depth + shear * v) * q[i] - shear)
        by_rho[i] += by
        by_yaw[i] -= by * (y[i] * cos - x[i] * sin + along)


@njit(error_model='numpy')
def stress_at(x, y, cos, sin, theta, depth):
    """Pressure at one place [Pa]; cos and sin are those of theta[1]."""
    v = x * cos + y * sin - theta[0]
    q = 1.0 / (v * v + depth * depth)
    return 2.0 / np.pi * depth * depth * q * q * (theta[2] * depth + theta[3] * v)
