"""Limits that no command can pass, whatever the servo wants."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tactile_servo.errors import ConfigurationError


@dataclass(frozen=True)
class JointLimits:
    """
    Limits of each joint and the time within which the arm can always stop.

    Parameters
    ----------
    names : tuple of str
    lower, upper : ndarray, shape (n,)
        Positions that the limiter keeps to, margin included [rad]; may be infinite.
    velocity, acceleration : ndarray, shape (n,)
        Largest magnitudes, > 0 [rad/s, rad/s^2].
    """

    names: tuple
    lower: np.ndarray
    upper: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray

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
    def stopping_time(self):
        """Time to stop any joint from its velocity limit [s]."""
        return float(np.max(self.velocity / self.acceleration))

    def stop_time(self, velocities):
        """Time to stop all joints together from these velocities [s]."""
        return float(np.max(np.abs(velocities) / self.acceleration))


def limit_velocities(limits, positions, previous, wanted, dt):
    """
    Nearest joint velocities to the wanted ones that keep every limit.

    The wanted velocities are first scaled as a whole, which keeps the direction of motion,
    then their change is, to what the accelerations allow. Towards a position limit the
    velocity falls with the distance left, a velocity damper (Faverjon and Tournassoud, 1987):
    with distance / (dt + stopping_time) the joints can always stop together in time.

    Parameters
    ----------
    limits : JointLimits
    positions, previous, wanted : ndarray, shape (n,)
        Commanded positions [rad], velocities of the last cycle and those wanted now [rad/s];
        a wanted velocity that is not finite counts as a stop.
    dt : float
        Time that the new velocities will be applied for [s], > 0.

    Returns
    -------
    velocities : ndarray, shape (n,)
        [rad/s]
    scale : float
        Fraction of the wanted motion that was let through, 0 to 1.
    limited_by : str
        The limit that bound most, for instance 'velocity of joint1'; empty if none did.
    """
    finite = bool(np.isfinite(wanted).all())
    if not finite:
        wanted = np.zeros_like(previous)
    horizon = dt + limits.stopping_time
    fastest = limits.velocity
    up = np.minimum(np.maximum((limits.upper - positions) / horizon, 0.0), fastest)
    down = np.maximum(np.minimum((limits.lower - positions) / horizon, 0.0), -fastest)
    room = np.where(wanted > 0.0, up, -down)
    asked = np.abs(wanted)
    # A joint that hardly moves needs no room, and may not divide by it.
    scale_each = np.where(asked > room, room / np.maximum(asked, 1e-12), 1.0)
    tightest = int(scale_each.argmin())
    scale = float(scale_each[tightest])
    limited_by = '' if finite else 'velocity not finite'
    if scale < 1.0:
        kind = 'velocity' if room[tightest] == fastest[tightest] else 'position'
        limited_by = f'{kind} of {limits.names[tightest]}'
    scaled = scale * wanted
    change = limits.acceleration * dt
    slowest, quickest = previous - change, previous + change
    # All joints change in proportion: one that lags behind would bend the motion.
    delta = scaled - previous
    share = min(1.0, float((change / np.maximum(np.abs(delta), 1e-12)).min()))
    velocities = np.minimum(np.maximum(previous + share * delta, slowest), quickest)
    # A joint that is too close to its limit brakes as hard as it may, no harder.
    velocities = np.where(velocities > up, np.maximum(up, slowest), velocities)
    velocities = np.where(velocities < down, np.minimum(down, quickest), velocities)
    if not limited_by:
        held_back = np.abs(velocities - scaled)
        worst = int(held_back.argmax())
        if held_back[worst] > 1e-9:
            limited_by = f'acceleration of {limits.names[worst]}'
    return velocities, (scale if finite else 0.0), limited_by


@dataclass(frozen=True)
class WorkspaceBox:
    """
    Box in the base frame that the sensor's origin must not leave [m].

    Parameters
    ----------
    lower, upper : ndarray, shape (3,)
    """

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

    def limit(self, position, velocity, horizon):
        """
        Clip a velocity so that it cannot leave the box within `horizon` [m, m/s, s].

        Returns the velocity (3,) and whether it was clipped.
        """
        up = np.maximum((self.upper - position) / horizon, 0.0)
        down = np.minimum((self.lower - position) / horizon, 0.0)
        clipped = np.clip(velocity, down, up)
        return clipped, bool((clipped != velocity).any())
