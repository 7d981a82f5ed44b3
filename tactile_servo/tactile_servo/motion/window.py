"""
Windows of motion: what is commanded from now on, up to a rest.

A window is read as a joint_trajectory_controller reads it, cubics through positions and
velocities. Between any two of its points the acceleration is constant, so that it is what the
controller plays, however it samples. The next window begins on the last one and leaves it only
after what is committed: whoever changes from one to the other in between notices nothing.
"""

from typing import NamedTuple

import numpy as np

from tactile_common.kernels import njit

MIN_STOP = 0.01  # s, so that the times of a window at rest still increase
APART = 1e-6  # s between points; a joint_trajectory_controller counts nanoseconds


class Window(NamedTuple):
    """Points of a window, the last at rest; held before the first and after the last."""

    times: np.ndarray  # (K,) since the window's stamp [s]
    positions: np.ndarray  # (K, n) [rad]
    velocities: np.ndarray  # (K, n) [rad/s]


def at_rest(positions: np.ndarray, time: float) -> Window:
    """Window that has robot and command at rest at positions (n,), from a time on [s]."""
    places = np.array([positions, positions])
    return Window(np.array([time, time + MIN_STOP]), places, np.zeros_like(places))


def committed(window: Window, elapsed: float, ahead: float) -> Window:
    """
    What of a window, `elapsed` after its stamp, is left until `ahead` from now [s].

    Begins now, or at the window's first point if that is still to come, and ends `ahead` from
    now (or at a point that nearly coincides, which would be lost else), or at that first point.
    """
    return Window(*_committed(*window, elapsed, ahead))


def extended(window: Window, target: np.ndarray, coasted: np.ndarray, period: float,
             coast: float, acceleration: np.ndarray) -> Window:
    """
    Add to what is committed: evenly to the velocities `target` (n,) within a period, then a rest.

    After the period the motion coasts [s], evenly to the velocities `coasted` (n,), then all
    joints brake evenly over the time that the slowest of them needs for it within its
    acceleration (n,).
    """
    return Window(*_extended(*window, target, coasted, acceleration, period, coast))


@njit(cache=True)
def coasting(velocities: np.ndarray, change: np.ndarray, most: np.ndarray, least_room: np.ndarray,
             most_room: np.ndarray) -> np.ndarray:
    """
    Velocities (n,) that some come to by a change (n,), of no more than `most` (n,) [rad/s].

    What is beyond its room (n,) already, because it brakes no harder, goes no further out.
    """
    coasted = velocities.copy()
    if np.isfinite(change).all():
        for k in range(len(coasted)):
            now = velocities[k]
            then = now + min(max(change[k], -most[k]), most[k])
            coasted[k] = min(max(then, min(least_room[k], now)), max(most_room[k], now))
    return coasted


@njit(cache=True)
def _sample(times: np.ndarray, positions: np.ndarray, velocities: np.ndarray,
            time: float) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities (n,) of a window at a time [s]."""
    k = np.searchsorted(times, time, side='right') - 1
    if k < 0 or k == len(times) - 1:
        return positions[max(k, 0)], velocities[max(k, 0)]
    # The acceleration between two points is constant.
    since, span = time - times[k], times[k + 1] - times[k]
    gain = (velocities[k + 1] - velocities[k]) / span
    return (positions[k] + since * (velocities[k] + 0.5 * since * gain),
            velocities[k] + since * gain)


@njit(cache=True)
def _committed(times: np.ndarray, positions: np.ndarray, velocities: np.ndarray, elapsed: float,
               ahead: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points of `committed`."""
    left = times - elapsed
    for time in left:
        if abs(time - ahead) <= APART:
            ahead = time
    ahead, begin, now = max(ahead, left[0]), max(left[0], 0.0), left[0] < ahead
    between = (left > begin + APART) & (left < ahead - APART)
    count = 1 + now + (between.sum() if now else 0)
    points = (np.empty(count), np.empty((count, positions.shape[1])),
              np.empty((count, positions.shape[1])))
    if now:
        points[0][0], points[0][1:-1] = begin, left[between]
        points[1][0], points[2][0] = _sample(times, positions, velocities, elapsed + begin)
        points[1][1:-1], points[2][1:-1] = positions[between], velocities[between]
    points[0][-1] = ahead
    points[1][-1], points[2][-1] = _sample(times, positions, velocities, elapsed + ahead)
    return points


@njit(cache=True)
def _extended(times: np.ndarray, positions: np.ndarray, velocities: np.ndarray,
              target: np.ndarray, coasted: np.ndarray, acceleration: np.ndarray, period: float,
              coast: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points of `extended`: of a window, and three that lead evenly to velocities (n,)."""
    count, ways = len(times), np.zeros((3, len(target)))
    ways[0], ways[1] = target, coasted
    spans = (period, coast, max(MIN_STOP, (np.abs(coasted) / acceleration).max()))
    points = (np.append(times, np.zeros(3)), np.concatenate((positions, ways)),
              np.concatenate((velocities, ways)))
    for k in range(3):
        at = count + k
        points[0][at] = points[0][at - 1] + spans[k]
        points[1][at] = points[1][at - 1] + 0.5 * spans[k] * (
            points[2][at - 1] + points[2][at])
    return points
