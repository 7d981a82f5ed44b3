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


@njit(cache=True)
def committed(window: Window, elapsed: float, ahead: float) -> Window:
    """
    Return the part of a window from now, `elapsed` after its stamp, to `ahead` from now [s].

    It begins now, or at the window's first point if this is later. It ends `ahead` from now (or at
    a point that nearly coincides, which would otherwise be lost), or at the first point if this is
    later.
    """
    left = window.times - elapsed
    for time in left:
        if abs(time - ahead) <= APART:
            ahead = time
    ahead, begin, now = max(ahead, left[0]), max(left[0], 0.0), left[0] < ahead
    between = (left > begin + APART) & (left < ahead - APART)
    count = 1 + now + (between.sum() if now else 0)
    joints = window.positions.shape[1]
    kept = Window(np.empty(count), np.empty((count, joints)), np.empty((count, joints)))
    if now:
        kept.times[0], kept.times[1:-1] = begin, left[between]
        kept.positions[0], kept.velocities[0] = sample(window, elapsed + begin)
        kept.positions[1:-1] = window.positions[between]
        kept.velocities[1:-1] = window.velocities[between]
    kept.times[-1] = ahead
    kept.positions[-1], kept.velocities[-1] = sample(window, elapsed + ahead)
    return kept


@njit(cache=True)
def extended(window: Window, target: np.ndarray, coasted: np.ndarray, period: float,
             coast: float, acceleration: np.ndarray) -> Window:
    """
    Extend the committed part by a change of velocity, a coast and a stop.

    In one `period` [s] the velocities change to `target` (n,), in the time `coast` [s] to
    `coasted` (n,), each at constant acceleration. Then all joints brake at constant deceleration,
    in the time that the slowest of them needs within its acceleration (n,).
    """
    stop = max(MIN_STOP, (np.abs(coasted) / acceleration).max())
    count, joints = window.positions.shape
    longer = Window(np.empty(count + 3), np.empty((count + 3, joints)),
                    np.empty((count + 3, joints)))
    longer.times[:count] = window.times
    longer.positions[:count] = window.positions
    longer.velocities[:count] = window.velocities
    k = count
    for following, span in ((target, period), (coasted, coast), (0.0 * target, stop)):
        before = longer.velocities[k - 1]
        longer.times[k] = longer.times[k - 1] + span
        longer.positions[k] = longer.positions[k - 1] + 0.5 * span * (before + following)
        longer.velocities[k] = following
        k += 1
    return longer


@njit(cache=True)
def sample(window: Window, time: float) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and velocities (n,) of a window at a time [s]."""
    times, positions, velocities = window
    k = np.searchsorted(times, time, side='right') - 1
    if k < 0 or k == len(times) - 1:
        return positions[max(k, 0)], velocities[max(k, 0)]
    since, span = time - times[k], times[k + 1] - times[k]
    gain = (velocities[k + 1] - velocities[k]) / span
    return (positions[k] + since * (velocities[k] + 0.5 * since * gain),
            velocities[k] + since * gain)
