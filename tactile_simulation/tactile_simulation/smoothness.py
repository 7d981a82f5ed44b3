"""Smoothness of a motion: accelerations of the joints, scatter of the pad's speed."""
import numpy as np

TREND = 0.1  # s over which a speed is averaged; the departure from this mean is scatter


def speeds(time: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """
    Return the speed [m/s] since the previous sample, (N,); NaN if unknown.

    `time` (N,) is in s, `positions` (N, 3) in m.
    """
    if not len(time):
        return np.empty(0)
    spans = np.diff(time, prepend=np.nan)
    return np.linalg.norm(np.diff(positions, axis=0, prepend=np.nan), axis=1) / np.where(
        spans > 0.0, spans, np.nan)


def accelerations(time: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """Return the second difference (N - 2, n) [1/s^2] of positions (N, n) at N times [s]."""
    if len(time) < 3:
        return np.empty((0, positions.shape[1] if positions.ndim == 2 else 0))
    steps = np.diff(time)[:, None]
    velocities = np.diff(positions, axis=0) / np.where(steps > 0.0, steps, np.nan)
    return np.diff(velocities, axis=0) / (0.5 * (steps[1:] + steps[:-1]))


def scatter(time: np.ndarray, speed: np.ndarray, chosen: np.ndarray) -> float:
    """
    Return the standard deviation [m/s] of a speed (N,) about its mean over `TREND`.

    Only windows in which all samples are `chosen` and finite count.
    """
    known = chosen & np.isfinite(speed)
    if np.count_nonzero(known) < 3:
        return float('nan')
    half = max(1, round(0.5 * TREND / float(np.median(np.diff(time[known])))))
    window = np.ones(2 * half + 1)
    whole = np.convolve(known, window, 'same') > 2 * half + 0.5
    trend = np.convolve(np.where(known, speed, 0.0), window, 'same') / len(window)
    return float(np.std((speed - trend)[whole])) if whole.any() else float('nan')
