"""What presses just beyond the border of the pad, before it comes under it."""

import numpy as np

from tactile_common.kernels import njit
from tactile_servo.edge_map.records import Records

FAINT, PLAIN = 0.02, 0.06  # of the ridge's pressure: a leg 2 and 1.25 depths away


@njit(cache=True)
def coming_length(pressure: np.ndarray, x: np.ndarray, y: np.ndarray, points: np.ndarray,
                  noise: float, depth: float) -> float:
    """
    Length of a leg of the edge that is about to come under the pad [m].

    A leg that lies along the border comes under the pad at once, with half of the load again;
    the skin shows it on the tactels of the border some 1.5 depths before.

    0 where there is none, less than the whole while it is still far. The pressure (rows, columns)
    [Pa] is finite; `points` (N,) are RIDGE_POINT, the picture's ridge; places x, y [m], `noise`
    [Pa] and `depth` [m] are those of the tactels.
    """
    if not len(points):
        return 0.0
    clear = 2.5 * depth  # from the line of a ridge: within that the border sees it
    count, share = _longest_run(pressure, x, y, points, clear, noise)
    if count < 4:
        return 0.0
    near = min(max((share - FAINT) / (PLAIN - FAINT), 0.0), 1.0)
    # The tactels beside the ridge do not tell: the leg reaches as far as to it.
    return near * (count * min(x[1] - x[0], y[1] - y[0]) + clear)


@njit(cache=True)
def _longest_run(pressure: np.ndarray, x: np.ndarray, y: np.ndarray, points: Records, clear: float,
                 noise: float) -> tuple[int, float]:
    """Tactels of the longest loaded run of the border off the ridge; their share of its load."""
    rows, columns = pressure.shape
    ridge = np.median(points.pressure)
    level = max(FAINT * ridge, 2.0 * noise)
    around = 2 * (rows + columns) - 4
    best, best_sum, run, total = 0, 0.0, 0, 0.0
    for step in range(2 * around):  # twice around: a run may pass over the beginning
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
            # Beyond the pad the ridge goes on as it points.
            point = points[n]
            aside = (x[c] - point.x) * point.ty - (y[r] - point.y) * point.tx
            own = abs(aside) < clear
        run, total = (0, 0.0) if own else (run + 1, total + pressure[r, c])
        if run > best and run <= around:
            best, best_sum = run, total
    return best, best_sum / (max(best, 1) * ridge)
