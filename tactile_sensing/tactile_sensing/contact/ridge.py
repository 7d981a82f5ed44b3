"""Find the ridge of an image, i.e. points of the edge under the pad, by minima of p^(-1/2)."""

import math

import numpy as np

from tactile_common.kernels import njit
from tactile_sensing.image import moments_of
from tactile_sensing.types.array import TactelArray

DETECTION = 5.0  # lowest pressure of a ridge [standard deviations of one tactel]
FAINT = 0.12  # lowest pressure of a ridge, as share of the highest pressure
OFFSET = 0.6  # largest distance of a ridge point from the centre of its tactel [pitches]
NOISY = 0.05  # the image is smoothed first if the noise is above this share of the peak
WIDEST = 3.0  # largest apparent width d of (3.1), where two edges merge [depths or pitches]
_DIRECTIONS = ((0, 1), (1, 0), (1, 1), (1, -1))  # steps to a neighbour: row, column
# Place [m] and direction (its sign is arbitrary) in the sensor frame, pressure on the ridge [Pa],
# and quality: 1 for a straight ridge, 0 for a round spot.
RIDGE_POINT = np.dtype([(name, np.float64) for name in (
    'x', 'y', 'tx', 'ty', 'pressure', 'quality')])


def ridge_points(pressure: np.ndarray, array: TactelArray, noise: float,
                 depth: float) -> np.ndarray:
    """
    Find the ridge points of a pressure image.

    Across a straight line load, p^(-1/2) is an exact parabola (3.1). Its minimum is therefore
    found without bias from 3 x 3 tactels, for any direction of the line. A quadratic surface is
    fitted around every tactel, with weights for the noise variance of p^(-1/2), which is
    proportional to p^(-3). Each point has the direction of the ridge.

    Parameters
    ----------
    pressure : ndarray, shape (rows, columns)
        Pressure [Pa]; NaN: invalid tactel.
    array : TactelArray
    noise : float
        Standard deviation of one tactel [Pa].
    depth : float
        Depth of the tactels below the surface [m]; a much wider ridge is not that of an edge.

    Returns
    -------
    ndarray of RIDGE_POINT, shape (N,)
    """
    mended = mend(np.ascontiguousarray(pressure, dtype=np.float64), noise)
    return ridge_of(mended, array.x, array.y, noise, depth)


@njit(cache=True)
def ridge_of(mended: np.ndarray, x: np.ndarray, y: np.ndarray, noise: float,
             depth: float) -> np.ndarray:
    """Find the ridge points of a mended image, tactels at x, y [m]; kernel of `ridge_points`."""
    peak = mended.max()
    if not peak > DETECTION * noise or min(mended.shape) < 3:
        return np.empty(0, RIDGE_POINT)
    smooth = mended
    if noise > NOISY * peak:
        smooth, noise = _smoothed(mended), 0.375 * noise
    floor = max(DETECTION * noise, FAINT * peak)
    return _ridge(smooth, mended, x, y, floor, noise, depth)


@njit(cache=True)
def mend(pressure: np.ndarray, noise: float) -> np.ndarray:
    """
    Fill invalid tactels, and tactels that report too little between loaded ones.

    A tactel that is much lower than both neighbours in every direction is broken, because no line
    load makes such a pit. It gets the mean of the two opposite neighbours that agree best, i.e.
    those along the ridge.
    """
    mended = pressure.copy()
    rows, columns = pressure.shape
    for r in range(rows):
        for c in range(columns):
            here = pressure[r, c]
            valid = math.isfinite(here)
            pit, known, best, value = True, 0, np.inf, 0.0
            for dr, dc in _DIRECTIONS:
                if not (0 <= r - dr and r + dr < rows
                        and 0 <= min(c - dc, c + dc) and max(c - dc, c + dc) < columns):
                    continue
                one, other = pressure[r - dr, c - dc], pressure[r + dr, c + dc]
                low, high = min(one, other), max(one, other)
                if not math.isfinite(one + other):
                    continue
                known += 1
                if not here < 0.7 * low - 3.0 * noise:
                    pit = False
                    if valid:  # keep the reading; the other directions do not matter
                        break
                if high - low < best * max(high, noise):
                    best, value = (high - low) / max(high, noise), 0.5 * (low + high)
            if not valid or (pit and known >= 2):
                mended[r, c] = value
    return mended


@njit(cache=True)
def centre_of_load(pressure: np.ndarray, x: np.ndarray, y: np.ndarray,
                   share: float) -> tuple[float, float]:
    """Return the centre of pressure (x, y) [m] of tactels above a share of the peak, or (0, 0)."""
    total, mx, my = moments_of(pressure, x, y, share * pressure.max())[:3]
    return (mx / total, my / total) if total > 0.0 else (0.0, 0.0)


@njit(cache=True)
def _smoothed(p: np.ndarray) -> np.ndarray:
    """Return the binomial mean over 3 x 3 tactels; the border is repeated."""
    rows, columns = p.shape
    out = np.zeros_like(p)
    for r in range(rows):
        for c in range(columns):
            for dr in range(-1, 2):
                for dc in range(-1, 2):
                    weight = (2 - abs(dr)) * (2 - abs(dc)) / 16.0
                    rr = min(max(r + dr, 0), rows - 1)
                    cc = min(max(c + dc, 0), columns - 1)
                    out[r, c] += weight * p[rr, cc]
    return out


@njit(cache=True)
def _ridge(p: np.ndarray, mended: np.ndarray, x: np.ndarray, y: np.ndarray, floor: float,
           noise: float, depth: float) -> np.ndarray:
    rows, columns = p.shape
    found = np.empty(rows * columns, RIDGE_POINT)
    count = 0
    pitch_x, pitch_y = x[1] - x[0], y[1] - y[0]
    widest = WIDEST * max(depth, pitch_x, pitch_y)
    for r in range(1, rows - 1):
        for c in range(1, columns - 1):
            if p[r, c] < floor or not _high(p, r, c):
                continue
            f0, gx, gy, hxx, hxy, hyy = _quadratic(p, r, c, pitch_x, pitch_y, noise)
            middle, half = 0.5 * (hxx + hyy), 0.5 * (hxx - hyy)
            root = math.hypot(half, hxy)
            steep, flat = middle + root, middle - root
            if not steep > 0.0:
                continue
            angle = 0.5 * math.atan2(hxy, half)  # of the direction across the ridge
            nx, ny = math.cos(angle), math.sin(angle)
            across = -(gx * nx + gy * ny) / steep
            dx, dy = across * nx, across * ny
            if abs(dx) > OFFSET * pitch_x or abs(dy) > OFFSET * pitch_y:
                continue
            # Across a line load, p^(-1/2) is proportional to v^2 + d^2.
            width2 = 2.0 * f0 / steep - across * across
            if not (f0 > 0.0 and width2 < widest**2):
                continue
            step_x, step_y = pitch_x * nx, pitch_y * ny
            total = (mended[r, c - 1:c + 2] if abs(step_x) > abs(step_y) else
                     mended[r - 1:r + 2, c]).sum()
            if not total > 0.0:  # before it was smoothed, it was noise
                continue
            point = found[count]
            point.x, point.y, point.tx, point.ty = x[c] + dx, y[r] + dy, -ny, nx
            point.pressure = _on_ridge(total, max(abs(step_x), abs(step_y)),
                                       math.hypot(step_x, step_y), across, depth)
            point.quality = max(1.0 - abs(flat) / steep, 0.0)
            count += 1
    return found[:count].copy()


@njit(error_model='numpy')
def _on_ridge(total: float, step: float, width: float, across: float, depth: float) -> float:
    """
    Return the pressure on the ridge of a line load, from the total of three tactels across it.

    Unlike the highest tactel, the total hardly depends on where between tactels the line lies. It
    is compared with that of the profile (3.1), averaged over the width of a tactel [m]. The line
    is at a distance `across` from the middle tactel, the others at one `step` either way [m].
    """
    share = 0.0
    for k in range(-1, 2):
        v = k * step - abs(across)
        share += _integral((v + 0.5 * width) / depth) - _integral((v - 0.5 * width) / depth)
    return total * width / (share * depth)


@njit(error_model='numpy')
def _integral(u: float) -> float:
    """Integrate the profile (3.1), (1 + u^2)^(-2), from 0."""
    return 0.5 * (u / (1.0 + u * u) + math.atan(u))


@njit(cache=True)
def _high(p: np.ndarray, r: int, c: int) -> bool:
    """Return whether a tactel is at least as high as both neighbours in some direction."""
    here = p[r, c]
    return ((here >= p[r, c - 1] and here >= p[r, c + 1])
            or (here >= p[r - 1, c] and here >= p[r + 1, c])
            or (here >= p[r - 1, c - 1] and here >= p[r + 1, c + 1])
            or (here >= p[r - 1, c + 1] and here >= p[r + 1, c - 1]))


@njit(cache=True)
def _quadratic(p: np.ndarray, r: int, c: int, pitch_x: float, pitch_y: float,
               noise: float) -> tuple[float, float, float, float, float, float]:
    """Return value, gradient (2) and Hessian (3) of the quadratic surface fitted to p^(-1/2)."""
    normal = np.zeros((6, 7))
    row = np.empty(7)
    low = max(0.02 * p[r, c], 0.5 * noise)
    for dr in range(-1, 2):
        for dc in range(-1, 2):
            value = max(p[r + dr, c + dc], low)
            weight = (value / p[r, c])**3
            row[0], row[1], row[2] = 1.0, dc, dr
            row[3], row[4], row[5] = 0.5 * dc * dc, dc * dr, 0.5 * dr * dr
            row[6] = 1.0 / math.sqrt(value)
            for i in range(6):
                for j in range(7):
                    normal[i, j] += weight * row[i] * row[j]
    for i in range(6):  # elimination; the normal matrix is positive definite
        for k in range(6):
            if k != i:
                factor = normal[k, i] / normal[i, i]
                for j in range(i, 7):
                    normal[k, j] -= factor * normal[i, j]
    s = [normal[i, 6] / normal[i, i] for i in range(6)]
    return (s[0], s[1] / pitch_x, s[2] / pitch_y,
            s[3] / pitch_x**2, s[4] / (pitch_x * pitch_y), s[5] / pitch_y**2)
