"""Division of a plane contour into as few lines and arcs as explain it."""
import numpy as np

FEW = 6  # smallest number of points of a line or arc
# A line must reduce the sum of squares by this much, in variances of the points; an arc, which has
# one more parameter, by `ARC` more.
LINE, ARC = 40.0, 15.0


def joints(points: np.ndarray, std: float) -> list[int]:
    """
    Return the indices of points at which lines and arcs meet, with both ends.

    The division has the least sum of squared distances of the points (N, 2) [m] from their line or
    arc, in units of std^2, plus `LINE` or `LINE` + `ARC` for each. It is found by dynamic
    programming over the last joint.
    """
    sums = _cumulated(points - points.mean(axis=0))
    best = np.full(len(points), np.inf)
    best[0] = 0.0
    before = np.zeros(len(points), int)
    for last in range(1, len(points)):
        firsts = np.arange(max(last - FEW + 2, 1))  # always one that begins at the first point
        line, arc = _squares(sums[last + 1] - sums[firsts])
        costs = best[firsts] + LINE + np.minimum(line, arc + ARC * std**2) / std**2
        before[last] = costs.argmin()
        best[last] = costs[before[last]]
    found = [len(points) - 1]
    while found[-1] > 0:
        found.append(int(before[found[-1]]))
    return found[::-1]


def _cumulated(points: np.ndarray) -> np.ndarray:
    """Return sums over the points before each of 1, x, y, xx, xy, yy, xq, yq, qq; q = xx + yy."""
    x, y = points.T
    q = x * x + y * y
    terms = np.stack([np.ones(len(x)), x, y, x * x, x * y, y * y, x * q, y * q, q * q], axis=1)
    return np.vstack([np.zeros(9), np.cumsum(terms, axis=0)])


def _squares(sums: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """
    Return sums of squared distances from the best line and circle, from sums (M, 9) over points.

    The circle minimises the sum of (q - 2 a x - 2 b y - d)^2, about 4 r^2 times that of squared
    distances.
    """
    n, x, y, xx, xy, yy, xq, yq, qq = sums.T
    x, y, q = x / n, y / n, xx + yy
    cxx, cxy, cyy = xx - n * x * x, xy - n * x * y, yy - n * y * y  # about the mean
    line = 0.5 * (cxx + cyy - np.hypot(cxx - cyy, 2.0 * cxy))
    fx, fy = xq - x * q, yq - y * q
    px = fx - 2.0 * (x * cxx + y * cxy)
    py = fy - 2.0 * (x * cxy + y * cyy)
    square = (qq - q * q / n - 4.0 * (x * fx + y * fy)
              + 4.0 * (x * x * cxx + 2.0 * x * y * cxy + y * y * cyy))
    with np.errstate(divide='ignore', invalid='ignore'):
        determinant = cxx * cyy - cxy * cxy
        a, b = (px * cyy - py * cxy) / determinant, (py * cxx - px * cxy) / determinant
        radius_squared = 0.25 * (a * a + b * b) + (cxx + cyy) / n
        arc = (square - a * px - b * py) / (4.0 * radius_squared)
    arc[~np.isfinite(arc) | (n < FEW)] = np.inf
    return np.maximum(line, 0.0), np.maximum(arc, 0.0)
