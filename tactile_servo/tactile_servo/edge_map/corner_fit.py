"""A corner under the pad, fitted to the picture itself: vertex, two legs and fillet."""

import math

import numpy as np

from tactile_common.kernels import njit
from tactile_sensing.half_space.kernels import add_point, add_segment

PARAMETERS = 8  # vertex x, y, directions of the legs, radius, curvatures of the legs, load
NEAR = 8.0e-3  # m from the vertex within which tactels count
LEG = 15.0e-3  # m of each leg that presses
CHORDS = 5  # of a leg
ARC_CHORDS = 6  # of a fillet; even, so that a node is at its middle
ROUNDS = 4
RADIUS_PRIOR = 3.0e-3  # m, standard deviation of the radius before anything is seen
CURVATURE_PRIOR = 15.0  # 1/m, that of the legs' curvature
STEPS = np.array([2e-5, 2e-5, 2e-3, 2e-3, 5e-5, 0.5])  # of the differences; last curvature


@njit(cache=True)
def corner_points(p):
    """
    Polyline of a corner in the order of travel, and the index of its fillet's middle.

    Parameters
    ----------
    p : ndarray, shape (>= 7,)
        Vertex x, y [m], direction of travel on the first and on the second leg [rad], radius
        of the fillet [m], curvatures of the legs [1/m], left positive.

    Returns
    -------
    ndarray, shape (2 CHORDS + ARC_CHORDS + 1, 2)
    """
    turn = math.atan2(math.sin(p[3] - p[2]), math.cos(p[3] - p[2]))
    radius = max(p[4], 0.0)
    setback = radius * math.tan(0.5 * min(abs(turn), 2.9))
    points = np.empty((2 * CHORDS + ARC_CHORDS + 1, 2))
    spacing = LEG / CHORDS
    # First leg, backwards from where the fillet begins.
    x, y = p[0] - setback * math.cos(p[2]), p[1] - setback * math.sin(p[2])
    points[CHORDS, 0], points[CHORDS, 1] = x, y
    for k in range(CHORDS):
        angle = p[2] - p[5] * spacing * (k + 0.5)
        x, y = x - spacing * math.cos(angle), y - spacing * math.sin(angle)
        points[CHORDS - 1 - k, 0], points[CHORDS - 1 - k, 1] = x, y
    x, y = points[CHORDS, 0], points[CHORDS, 1]
    chord = 2.0 * radius * math.sin(0.5 * abs(turn) / ARC_CHORDS)
    for k in range(ARC_CHORDS):
        angle = p[2] + turn * (k + 0.5) / ARC_CHORDS
        x, y = x + chord * math.cos(angle), y + chord * math.sin(angle)
        points[CHORDS + 1 + k, 0], points[CHORDS + 1 + k, 1] = x, y
    for k in range(CHORDS):
        angle = p[3] + p[6] * spacing * (k + 0.5)
        x, y = x + spacing * math.cos(angle), y + spacing * math.sin(angle)
        points[CHORDS + ARC_CHORDS + 1 + k, 0] = x
        points[CHORDS + ARC_CHORDS + 1 + k, 1] = y
    return points


@njit(cache=True)
def corner_pressure(p, x, y, depth):
    """Pressure of a corner of unit load per length at tactels x, y [m] (rows, columns)."""
    points = corner_points(p)
    pressure = np.zeros((len(y), len(x)))
    for k in range(len(points) - 1):
        x0, y0, x1, y1 = points[k, 0], points[k, 1], points[k + 1, 0], points[k + 1, 1]
        length = math.hypot(x1 - x0, y1 - y0)
        if length > 0.125 * depth:
            add_segment(pressure, x, y, depth, x0, y0, x1, y1, 1.0, 1.0)
        elif length > 0.0:
            add_point(pressure, x, y, depth, 0.5 * (x0 + x1), 0.5 * (y0 + y1), length)
    return pressure


@njit(cache=True)
def fit_corner(pressure, x, y, depth, noise, model_error, start):
    """
    Fit a corner to a picture by Gauss-Newton, the load eliminated in closed form.

    Parameters
    ----------
    pressure : ndarray, shape (rows, columns)
        [Pa], all finite.
    x, y : ndarray
        Tactels [m].
    depth, noise, model_error : float
        Depth of the tactels [m], noise of one [Pa], what the model may leave out as a
        fraction of the pressure.
    start : ndarray, shape (7,)
        First guess, see `corner_points`; the sensor frame.

    Returns
    -------
    p : ndarray, shape (7,)
    information : ndarray, shape (7, 7)
        Inverse covariance of the fit without its priors.
    chi_square : float
        Per tactel.
    load : float
        Force per length [N/m].
    """
    p = start.copy()
    information = np.zeros((7, 7))
    chi_square, load = np.inf, 0.0
    prior = np.array([0.0, 0.0, 0.0, 0.0, RADIUS_PRIOR**-2, CURVATURE_PRIOR**-2,
                      CURVATURE_PRIOR**-2])
    rows, columns = pressure.shape
    weight = np.zeros((rows, columns))
    count = 0
    for r in range(rows):
        for c in range(columns):
            if (x[c] - start[0])**2 + (y[r] - start[1])**2 < NEAR * NEAR:
                weight[r, c] = 1.0 / (noise**2 + (model_error * pressure[r, c])**2)
                count += 1
    if count < 20:
        return p, information, chi_square, load
    jacobian = np.empty((7, rows, columns))
    for step in range(ROUNDS + 1):
        shape = corner_pressure(p, x, y, depth)
        own = (weight * shape * shape).sum()
        load = (weight * shape * pressure).sum() / own
        error = pressure - load * shape
        chi_square = (weight * error * error).sum() / count
        if step == ROUNDS or not load > 0.0:
            break
        for k in range(7):
            h = STEPS[min(k, 5)]
            other = p.copy()
            other[k] += h
            slope = (corner_pressure(other, x, y, depth) - shape) / h
            # What a change of the load would do as well is not the parameter's doing.
            slope -= shape * ((weight * shape * slope).sum() / own)
            jacobian[k] = load * slope
        gradient = np.empty(7)
        for k in range(7):
            gradient[k] = (weight * jacobian[k] * error).sum() - prior[k] * p[k]
            for m in range(k + 1):
                information[k, m] = (weight * jacobian[k] * jacobian[m]).sum()
                information[m, k] = information[k, m]
        normal = information.copy()
        for k in range(7):
            normal[k, k] += prior[k] + 1e-9 * information[k, k] + 1e-12
        change = np.linalg.solve(normal, gradient)
        largest = max(math.hypot(change[0], change[1]) / 1.5e-3, abs(change[4]) / 1.5e-3,
                      max(abs(change[2]), abs(change[3])) / 0.3, 1.0)
        p += change / largest
        p[4] = max(p[4], 1e-4)
    return p, information, chi_square, load
