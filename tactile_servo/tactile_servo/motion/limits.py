"""Limits that no command can pass, whatever the servo wants."""

from dataclasses import dataclass
from functools import cached_property
import math

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_common.kernels import njit

# What bounds a motion most; those that end with a space are of one joint.
KINDS = ('', 'velocity of ', 'position of ', 'acceleration of ', 'velocity not finite')
NEGLIGIBLE = 1e-6  # of a joint's velocity limit; what it is asked beyond a limit by rounding
FREE, VELOCITY, POSITION, ACCELERATION, NOT_FINITE = range(len(KINDS))


@dataclass(frozen=True)
class JointLimits:
    """Limits of each joint (n,), and the time within which the arm can always stop."""

    names: tuple[str, ...]
    lower: np.ndarray  # positions that are kept to, margin included [rad]; may be infinite
    upper: np.ndarray
    velocity: np.ndarray  # largest magnitudes, above 0 [rad/s]
    acceleration: np.ndarray  # [rad/s^2]

    def __post_init__(self):
        for name in ('lower', 'upper', 'velocity', 'acceleration'):
            values = np.asarray(getattr(self, name), dtype=float)
            if values.shape != (len(self.names),):
                raise ConfigurationError(
                    f'{name}: {values.shape} values for {len(self.names)} joints')
            object.__setattr__(self, name, values)
        for joint, low, high, fast, hard in zip(
                self.names, self.lower, self.upper, self.velocity, self.acceleration,
                strict=True):
            if not low < high:
                raise ConfigurationError(f'{joint}: lower limit {low} is not below upper {high}')
            if not (0.0 < fast < np.inf and 0.0 < hard < np.inf):
                raise ConfigurationError(
                    f'{joint}: velocity {fast} and acceleration {hard} must be above 0')

    @cached_property
    def stopping_time(self) -> float:
        """Time to stop any joint from its velocity limit [s]."""
        return float(np.max(self.velocity / self.acceleration))

    @cached_property
    def bounds(self) -> tuple:
        """What `nearest` takes of the limits."""
        return self.lower, self.upper, self.velocity, self.acceleration, self.stopping_time

    def name_of(self, kind: int, joint: int) -> str:
        """Name of a limit, by the indices of its kind and joint."""
        name = KINDS[kind]
        return name + self.names[joint] if name.endswith(' ') else name


@njit(cache=True)
def room(lower, upper, stopping_time, positions, dt):
    """
    Joint velocities (n,) <= 0 and (n,) >= 0 that position limits leave room for [rad/s].

    They fall with the distance left, a velocity damper (Faverjon and Tournassoud, 1987): at
    distance / (dt + stopping_time) the joints can always stop together in time.
    """
    down, up, horizon = np.empty(len(lower)), np.empty(len(lower)), dt + stopping_time
    for k in range(len(lower)):
        up[k] = max((upper[k] - positions[k]) / horizon, 0.0)
        down[k] = min((lower[k] - positions[k]) / horizon, 0.0)
    return down, up


@njit(cache=True)
def reach(lower, upper, fastest, acceleration, stopping_time, positions, previous, dt, coast):
    """
    Least and largest joint velocities (3, n) [rad/s], each row within those above it.

    What position limits leave room for, velocities too, and accelerations too: a joint that is
    too close to its limit brakes as hard as it may, no harder.
    """
    least, most = np.empty((3, len(lower))), np.empty((3, len(lower)))
    least[0], most[0] = room(lower, upper, stopping_time, positions, dt + coast)
    for k in range(len(lower)):
        least[1, k], most[1, k] = max(least[0, k], -fastest[k]), min(most[0, k], fastest[k])
        change = acceleration[k] * dt
        slowest, quickest = previous[k] - change, previous[k] + change
        least[2, k] = min(max(least[1, k], slowest), quickest)
        most[2, k] = min(max(most[1, k], slowest), quickest)
    return least, most


@njit(cache=True)
def within(velocities, least, most, fastest):
    """Whether joint velocities (n,) pass no bound by more than rounding does."""
    for k in range(len(velocities)):
        slack = NEGLIGIBLE * fastest[k]
        if not least[k] - slack <= velocities[k] <= most[k] + slack:
            return False
    return True


@njit(cache=True)
def nearest(lower, upper, fastest, acceleration, stopping_time, positions, previous, wanted, dt,
            coast):
    """
    Nearest joint velocities (n,) to the wanted ones that keep every limit [rad/s].

    Wanted ones that are not finite count as a stop. They are first scaled as a whole, which keeps
    the direction of motion, then their change from the previous ones is, to what accelerations
    allow within dt; for `coast` they go on then before the joints brake [s]. What a joint is asked
    beyond its limits by less than NEGLIGIBLE does not scale the others, it is cut off. Also
    returned are the fraction of the wanted motion that is let through, 0 to 1, and the indices
    of the kind of limit that binds most and of its joint.
    """
    count = len(wanted)
    least, most = reach(lower, upper, fastest, acceleration, stopping_time, positions, previous,
                        dt, coast)
    velocities = np.empty(count)
    scale, kind, joint = 1.0, FREE, 0
    for k in range(count):
        if not math.isfinite(wanted[k]):
            wanted, kind = np.zeros(count), NOT_FINITE
            break
    finite = kind == FREE
    for k in range(count):
        # What a joint cannot help, because it brakes no harder, does not slow down the others.
        let, asked = (max(most[1, k], most[2, k]) if wanted[k] > 0.0
                      else -min(least[1, k], least[2, k])), abs(wanted[k])
        if asked > let + NEGLIGIBLE * fastest[k] and let / asked < scale:
            scale, joint = let / asked, k
            kind = VELOCITY if let == fastest[k] else POSITION
    # All joints change in proportion: one that lags behind would bend the motion.
    share = 1.0
    for k in range(count):
        delta = abs(scale * wanted[k] - previous[k])
        share = min(share, acceleration[k] * dt / max(delta, 1e-12))
    worst = 0.0
    for k in range(count):
        scaled = scale * wanted[k]
        value = min(max(previous[k] + share * (scaled - previous[k]), least[2, k]), most[2, k])
        velocities[k] = value
        held = abs(value - scaled)
        if held > max(worst, NEGLIGIBLE * fastest[k]) and kind in (FREE, ACCELERATION):
            worst, kind, joint = held, ACCELERATION, k
    return velocities, (scale if finite else 0.0), kind, joint


@njit(cache=True)
def coasting_velocities(lower, upper, fastest, acceleration, stopping_time, positions, previous,
                        velocities, bend, coasting, horizon):
    """
    Joint velocities after `coasting` with the accelerations `bend` of the `previous` velocities.

    Both (n,); as much of that as the limits allow, and as is left of the motion.
    """
    down, up = room(lower, upper, stopping_time, positions, horizon)
    kept = square = 0.0
    for k in range(len(velocities)):
        kept += velocities[k] * previous[k]
        square += previous[k] * previous[k]
    share = coasting * min(max(kept / max(square, 1e-12), 0.0), 1.0) ** 2
    for k in range(len(velocities)):
        if not math.isfinite(bend[k]):
            return velocities
        most = min(up[k], fastest[k]) if bend[k] > 0.0 else min(-down[k], fastest[k])
        toward = velocities[k] if bend[k] > 0.0 else -velocities[k]
        by = max(abs(bend[k]), 1e-12)
        share = min(share, acceleration[k] / by * coasting, max(most - toward, 0.0) / by)
    return velocities + share * bend


@dataclass(frozen=True)
class WorkspaceBox:
    """Box in the base frame that the sensor's origin must not leave: corners (3,) [m]."""

    lower: np.ndarray
    upper: np.ndarray

    def __post_init__(self):
        for name in ('lower', 'upper'):
            values = np.asarray(getattr(self, name), dtype=float)
            if values.shape != (3,) or np.isnan(values).any():
                raise ConfigurationError(f'workspace {name}: {values} is not three lengths')
            object.__setattr__(self, name, values)
        if not (self.lower < self.upper).all():
            raise ConfigurationError(
                f'workspace: lower {self.lower} is not below upper {self.upper}')

    def beyond(self, place: np.ndarray) -> np.ndarray:
        """How far each coordinate of a place (3,) lies outside, 0 within [m]."""
        return np.maximum(np.maximum(place - self.upper, self.lower - place), 0.0)

    def limit(self, pose: np.ndarray, twist: np.ndarray,
              horizon: float) -> tuple[np.ndarray, bool]:
        """
        Clip a twist (6,) in the frame of a pose (4, 4) that would leave the box within `horizon`.

        Returns it and whether it was clipped [m, m/s and rad/s, s].
        """
        clipped = twist.copy()
        return clipped, _clip(self.lower, self.upper, pose, clipped, horizon)


@njit(cache=True)
def _clip(lower, upper, pose, twist, horizon):
    velocity, changed = np.zeros(3), False
    for k in range(3):
        for j in range(3):
            velocity[k] += pose[k, j] * twist[j]
        up = max((upper[k] - pose[k, 3]) / horizon, 0.0)
        down = min((lower[k] - pose[k, 3]) / horizon, 0.0)
        if velocity[k] > up or velocity[k] < down:  # not if it is NaN: that is stopped later
            velocity[k], changed = (up if velocity[k] > up else down), True
    if changed:
        twist[:3] = 0.0
        for k in range(3):
            for j in range(3):
                twist[j] += pose[k, j] * velocity[k]
    return changed
