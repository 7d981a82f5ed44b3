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


@njit(cache=True)
def at_rest(positions, time):
    """Window that has robot and command at rest at positions (n,), from a time on [s]."""
    places = np.empty((2, len(positions)))
    places[:] = positions
    return Window(np.array([time, time + MIN_STOP]), places, np.zeros_like(places))


@njit(cache=True)
def _sample(window, time, position, velocity):
    """Write the state at a time [s] into position and velocity (n,)."""
    times, last = window.times, len(window.times) - 1
    if time <= times[0] or time >= times[last]:
        k = 0 if time <= times[0] else last
        position[:], velocity[:] = window.positions[k], window.velocities[k]
        return
    k = 0
    while times[k + 1] <= time:
        k += 1
    span = times[k + 1] - times[k]
    s = (time - times[k]) / span
    for j in range(len(position)):
        way = window.positions[k + 1, j] - window.positions[k, j]
        v0, v1 = window.velocities[k, j], window.velocities[k + 1, j]
        a, b = span * v0 - way, way - span * v1
        bend = (1.0 - s) * a + s * b
        position[j] = window.positions[k, j] + s * way + s * (1.0 - s) * bend
        velocity[j] = (way + (1.0 - 2.0 * s) * bend + s * (1.0 - s) * (b - a)) / span


@njit(cache=True)
def committed(window, elapsed, ahead):
    """
    What of a window, `elapsed` after its stamp, is left until `ahead` from now [s].

    Begins now, or at the window's first point if that is still to come, and ends `ahead` from
    now (or at a point that nearly coincides, which would be lost else), or at that first point.
    """
    count, joints = window.positions.shape
    times = np.empty(count + 2)
    positions, velocities = np.empty((count + 2, joints)), np.empty((count + 2, joints))
    first, k = window.times[0] - elapsed, 0
    for i in range(count):
        if abs(window.times[i] - elapsed - ahead) <= APART:
            ahead = window.times[i] - elapsed
    ahead = max(ahead, first)
    if first < ahead:
        times[0] = max(first, 0.0)
        _sample(window, elapsed + times[0], positions[0], velocities[0])
        k = 1
        for i in range(count):
            time = window.times[i] - elapsed
            if times[k - 1] + APART < time < ahead - APART:
                times[k] = time
                positions[k], velocities[k] = window.positions[i], window.velocities[i]
                k += 1
    times[k] = ahead
    _sample(window, elapsed + ahead, positions[k], velocities[k])
    return Window(times[:k + 1], positions[:k + 1], velocities[:k + 1])


@njit(cache=True)
def begin(times, positions, velocities, elapsed, ahead, *into):
    """Write what of a window is committed into arrays like its own; how many points these are."""
    kept = committed(Window(times, positions, velocities), elapsed, ahead)
    count = len(kept.times)
    into[0][:count], into[1][:count], into[2][:count] = kept
    return count


@njit(cache=True)
def extended(window, target, coasted, period, coast, acceleration):
    """
    Add to what is committed: evenly to the velocities `target` (n,) within a period, then a rest.

    After the period the motion coasts [s], evenly to the velocities `coasted` (n,), then all
    joints brake evenly over the time that the slowest of them needs for it within its
    acceleration (n,).
    """
    count, joints = window.positions.shape
    times = np.empty(count + 3)
    positions, velocities = np.empty((count + 3, joints)), np.empty((count + 3, joints))
    times[:count] = window.times
    positions[:count], velocities[:count] = window.positions, window.velocities
    stop = MIN_STOP
    for j in range(joints):
        stop = max(stop, abs(coasted[j]) / acceleration[j])
    for k, duration, end in ((count, period, target), (count + 1, coast, coasted),
                             (count + 2, stop, np.zeros(joints))):
        times[k] = times[k - 1] + duration
        for j in range(joints):
            velocities[k, j] = end[j]
            positions[k, j] = positions[k - 1, j] + 0.5 * duration * (
                velocities[k - 1, j] + velocities[k, j])
    return Window(times, positions, velocities)
