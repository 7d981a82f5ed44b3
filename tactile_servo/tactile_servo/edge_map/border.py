"""Detection of a load just beyond the border of the pad, before it reaches the pad."""

import numpy as np

from tactile_common.kernels import njit
from tactile_servo.edge_map.records import Records

FAINT, PLAIN = 0.02, 0.06  # shares of the ridge's pressure, for a leg 2 and 1.25 depths away
LEAST_RUN = 4  # least number of loaded tactels along the border that show a leg
RIDGE_ZONE = 2.5  # depths from the ridge's line, within which border tactels see the ridge itself
SIGNIFICANT = 2.0  # standard deviations of the noise that a loaded border tactel exceeds


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
