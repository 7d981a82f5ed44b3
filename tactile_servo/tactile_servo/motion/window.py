"""
Windows of motion: trajectories from now on that end at rest.

Like a joint_trajectory_controller, a window uses cubics through positions and velocities. Between
two points the acceleration is constant, so the controller plays the same motion for any sampling.
The next window begins on the last one and leaves it only after the committed part. The controller
can change between them at any time within this part, without an effect on the motion.
"""

from typing import NamedTuple

import numpy as np

from tactile_common.kernels import njit

MIN_STOP = 0.01  # least braking time [s], so that the times of a window at rest increase
APART = 1e-6  # least time between points [s]; a joint_trajectory_controller counts nanoseconds


class Window(NamedTuple):
    """Points of a window, the last at rest; positions hold before the first and after the last."""

    times: np.ndarray  # (K,) since the window's stamp [s]
    positions: np.ndarray  # (K, n) [rad]
    velocities: np.ndarray  # (K, n) [rad/s]


def at_rest(positions: np.ndarray, time: float) -> Window:
    """Return a window at rest at positions (n,), from a time on [s]."""
    places = np.array([positions, positions])
    return Window(np.array([time, time + MIN_STOP]), places, np.zeros_like(places))


def committed(window: Window, elapsed: float, ahead: float) -> Window:
    """
    Return the part of a window from now, `elapsed` after its stamp, to `ahead` from now [s].

    It begins now, or at the window's first point if this is later. It ends `ahead` from now (or at
    a point that nearly coincides, which would otherwise be lost), or at the first point if this is
    later.
    """
    return Window(*_committed(*window, elapsed, ahead))


def extended(window: Window, target: np.ndarray, coasted: np.ndarray, period: float,
             coast: float, acceleration: np.ndarray) -> Window:
    """
    Extend the committed part by a change of velocity, a coast and a stop.

    In one `period` [s] the velocities change to `target` (n,), in the time `coast` [s] to
    `coasted` (n,), each at constant acceleration. Then all joints brake at constant deceleration,
    in the time that the slowest of them needs within its acceleration (n,).
    """
    stop = max(MIN_STOP, float((np.abs(coasted) / acceleration).max()))
    return Window(*_extended(*window, np.array([target, coasted, 0.0 * target]),
                             (period, coast, stop)))


@njit(cache=True)
def _sample(times: np.ndarray, positions: np.ndarray, velocities: np.ndarray,
            time: float) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and velocities (n,) of a window at a time [s]."""
    k = np.searchsorted(times, time, side='right') - 1
    if k < 0 or k == len(times) - 1:
        return positions[max(k, 0)], velocities[max(k, 0)]
    since, span = time - times[k], times[k + 1] - times[k]
    gain = (velocities[k + 1] - velocities[k]) / span
    return (positions[k] + since * (velocities[k] + 0.5 * since * gain),
            velocities[k] + since * gain)


@njit(cache=True)
def _committed(times: np.ndarray, positions: np.ndarray, velocities: np.ndarray, elapsed: float,
               ahead: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the points of `committed`."""
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
              targets: np.ndarray, spans: tuple[float, float, float]
              ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Add points that lead evenly to velocities (3, n), each in its span [s], to a window's."""
    count = len(times)
    points = (np.append(times, np.zeros(3)), np.concatenate((positions, targets)),
              np.concatenate((velocities, targets)))
    for k in range(3):
        at = count + k
        points[0][at] = points[0][at - 1] + spans[k]
        points[1][at] = points[1][at - 1] + 0.5 * spans[k] * (
            points[2][at - 1] + points[2][at])
    return points
