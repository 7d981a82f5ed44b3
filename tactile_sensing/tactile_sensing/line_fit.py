"""Least-squares fit of a line load to a tactile image, as one compiled kernel."""

from dataclasses import dataclass

from numba import njit
import numpy as np

STEPS = 3  # Gauss-Newton steps; from the principal axis they reach the Cramer-Rao bound
START_LEVEL = 0.25  # tactels above this fraction of the peak give the principal axis


@dataclass(frozen=True)
class LineFit:
    """
    Fitted line load.

    Attributes
    ----------
    rho, yaw, line_force : float
        Normal form of the line [m, rad] and force per length [N/m], see `line.pressure`.
    information : ndarray, shape (3, 3)
        J'J of (rho, yaw, line_force); times 1/noise^2 it is the Fisher information.
    squared_error : float
        Sum of the squared residuals [Pa^2].
    chi_square : float
        Sum of residual^2 / (noise^2 + (model_error * model)^2).
    used : int
        Tactels used.
    last_step : float
        Movement of the line at the pad's border in the last step [m].
    """

    rho: float
    yaw: float
    line_force: float
    information: np.ndarray
    squared_error: float
    chi_square: float
    used: int
    last_step: float


@njit(cache=True)
def _start(image, x, y):
    """Principal axis of the tactels above START_LEVEL of the peak: (rho, yaw)."""
    peak = 0.0
    for value in image.flat:
        if value > peak:  # false for NaN
            peak = value
    level = START_LEVEL * peak
    m = mx = my = mxx = myy = mxy = 0.0
    for r in range(image.shape[0]):
        for c in range(image.shape[1]):
            w = image[r, c] - level
            if w > 0.0:
                m += w
                mx += w * x[c]
                my += w * y[r]
                mxx += w * x[c] * x[c]
                myy += w * y[r] * y[r]
                mxy += w * x[c] * y[r]
    if m <= 0.0:
        return 0.0, 0.0
    mx /= m
    my /= m
    alpha = 0.5 * np.arctan2(2.0 * (mxy / m - mx * my), (myy / m - my * my) - (mxx / m - mx * mx))
    yaw = -alpha
    return mx * np.cos(yaw) + my * np.sin(yaw), yaw


@njit(cache=True)
def _fit(image, x, y, depth, noise, model_error, steps):
    """Variable-projection start, then Gauss-Newton on (rho, yaw, force); NaN tactels skipped."""
    rho, yaw = _start(image, x, y)
    reach = 0.5 * np.hypot(x[-1] - x[0], y[-1] - y[0])
    scale = 2.0 * depth**3 / np.pi
    force = 0.0
    last_step = 0.0
    normal = np.zeros((3, 3))
    squared_error = chi_square = 0.0
    used = 0
    for step in range(-1, steps + 1):  # -1: force alone; steps: evaluation alone
        cos, sin = np.cos(yaw), np.sin(yaw)
        a00 = a01 = a02 = a11 = a12 = a22 = g0 = g1 = g2 = 0.0
        squared_error = chi_square = 0.0
        used = 0
        for r in range(image.shape[0]):
            for c in range(image.shape[1]):
                value = image[r, c]
                if np.isnan(value):
                    continue
                v = x[c] * cos + y[r] * sin - rho
                q = 1.0 / (v * v + depth * depth)
                j2 = scale * q * q
                model = force * j2
                j0 = 4.0 * model * v * q
                j1 = -j0 * (y[r] * cos - x[c] * sin)
                error = value - model
                a00 += j0 * j0
                a01 += j0 * j1
                a02 += j0 * j2
                a11 += j1 * j1
                a12 += j1 * j2
                a22 += j2 * j2
                g0 += j0 * error
                g1 += j1 * error
                g2 += j2 * error
                squared_error += error * error
                chi_square += error * error / (noise * noise + (model_error * model) ** 2)
                used += 1
        if step == -1:
            force = g2 / a22 if a22 > 0.0 else 0.0
            continue
        normal = np.array([[a00, a01, a02], [a01, a11, a12], [a02, a12, a22]])
        if step == steps:
            break
        # Scaled to a unit diagonal: m, rad and N/m differ by many orders of magnitude.
        s0, s1, s2 = np.sqrt(a00), np.sqrt(a11), np.sqrt(a22)
        if not (s0 > 0.0 and s1 > 0.0 and s2 > 0.0):
            last_step = np.inf
            break
        c01, c02, c12 = a01 / (s0 * s1), a02 / (s0 * s2), a12 / (s1 * s2)
        det = 1.0 + 2.0 * c01 * c02 * c12 - c01 * c01 - c02 * c02 - c12 * c12
        if det < 1e-9:
            last_step = np.inf
            break
        b0, b1, b2 = g0 / s0, g1 / s1, g2 / s2
        d0 = ((1 - c12 * c12) * b0 + (c02 * c12 - c01) * b1 + (c01 * c12 - c02) * b2) / (det * s0)
        d1 = ((c02 * c12 - c01) * b0 + (1 - c02 * c02) * b1 + (c01 * c02 - c12) * b2) / (det * s1)
        d2 = ((c01 * c12 - c02) * b0 + (c01 * c02 - c12) * b1 + (1 - c01 * c01) * b2) / (det * s2)
        d0 = min(max(d0, -depth), depth)
        d1 = min(max(d1, -depth / reach), depth / reach)
        rho += d0
        yaw += d1
        force += d2
        last_step = abs(d0) + reach * abs(d1)
    return rho, yaw, force, normal, squared_error, chi_square, used, last_step


def fit_line(pressure, array, depth, noise_std, *, model_error=0.07, steps=STEPS):
    """
    Fit a line load to every valid tactel by Gauss-Newton.

    Parameters
    ----------
    pressure : ndarray, shape (rows, columns)
        Pressure [Pa]; NaN tactels have weight 0.
    array : TactelArray
        Geometry of the tactels.
    depth : float
        Depth of the tactels [m].
    noise_std : float
        Standard deviation of one tactel [Pa], > 0.
    model_error : float
        Allowance for what the model leaves out, as a fraction of the modelled pressure.
    steps : int
        Gauss-Newton steps.

    Returns
    -------
    LineFit
        With yaw in (-pi/2, pi/2].
    """
    image = np.ascontiguousarray(pressure, dtype=np.float64)
    rho, yaw, force, information, squared, chi, used, last = _fit(
        image, array.x, array.y, float(depth), float(noise_std), float(model_error), steps)
    if np.isfinite(yaw):
        turns = np.ceil(yaw / np.pi - 0.5)
        yaw -= turns * np.pi
        if turns % 2:  # the other normal of the same line
            rho = -rho
            flip = np.array([-1.0, 1.0, 1.0])
            information = information * np.outer(flip, flip)
    return LineFit(rho, yaw, force, information, squared, chi, used, last)
