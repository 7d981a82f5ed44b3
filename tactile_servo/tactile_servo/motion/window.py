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
BRAKING = 4  # steps in which a window slows down to a rest
SLOWEST = 0.1  # of a joint's acceleration, what its way leaves for braking
ADDED = 2 + BRAKING  # points, to what is committed: the change of velocity, coasting, braking
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
def extended(window, target, coasted, period, coast, bounds):
    """
    Add to what is committed: evenly to the velocities `target` (n,) within a period, then a rest.

    After the period the motion coasts [s], evenly to the velocities `coasted` (n,), and comes to
    rest on the way that this begins; straight on where that way would pass one of the `bounds` of
    the joints, see `JointLimits`.
    """
    count, joints = window.positions.shape
    size = count + ADDED
    into = Window(np.empty(size), np.empty((size, joints)), np.empty((size, joints)))
    into.times[:count] = window.times
    into.positions[:count], into.velocities[:count] = window.positions, window.velocities
    _write(into, count, period, target)
    _write(into, count + 1, coast, coasted)
    if not _brake(into, count + 2, (coasted - target) / coast, bounds):
        _brake(into, count + 2, np.zeros(joints), bounds)
    return into


@njit(cache=True)
def _write(window, k, duration, end):
    """Write point k: velocities (n,) that are evenly reached a duration [s] after the last one."""
    window.times[k] = window.times[k - 1] + duration
    for j in range(len(end)):
        window.velocities[k, j] = end[j]
        window.positions[k, j] = window.positions[k - 1, j] + 0.5 * duration * (
            window.velocities[k - 1, j] + end[j])


@njit(cache=True)
def _brake(window, k, bend, bounds):
    """
    Write the points from k on that slow down to a rest; whether they keep to the bounds.

    With velocities v before them and w the way, in seconds at full speed, the joints follow
    v + `bend` w (n,) at speeds that fall by equal steps, each in the time that the joint that
    takes longest needs within its acceleration. As long as they keep to the bounds they can stop
    in time as well where something else is wanted on the way.
    """
    lower, upper, fastest, acceleration, stopping_time = bounds
    rates, end, way, keeps = window.velocities[k - 1], np.empty(len(bend)), 0.0, True
    for step in range(BRAKING):
        before, after = 1.0 - step / BRAKING, 1.0 - (step + 1) / BRAKING
        mean, duration = 0.5 * (before + after), MIN_STOP / BRAKING
        for j in range(len(bend)):
            less = (before - after) * (rates[j] + bend[j] * way)
            more = after * mean * bend[j]  # per second
            most = acceleration[j] + (more if less > 0.0 else -more)
            duration = max(duration, abs(less) / max(most, SLOWEST * acceleration[j]))
            keeps &= most >= SLOWEST * acceleration[j] and abs(more) <= acceleration[j]
        way += mean * duration
        for j in range(len(bend)):
            end[j] = after * (rates[j] + bend[j] * way)
        _write(window, k + step, duration, end)
        for j in range(len(bend)):
            place, first = window.positions[k + step - 1, j], window.velocities[k + step - 1, j]
            up, down = max(first, 0.0) + max(end[j], 0.0), min(first, 0.0) + min(end[j], 0.0)
            keeps &= (abs(end[j]) <= fastest[j]
                      and place + 0.5 * duration * up
                      + stopping_time * max(first, end[j], 0.0) <= upper[j]
                      and place + 0.5 * duration * down
                      + stopping_time * min(first, end[j], 0.0) >= lower[j])
    return keeps
