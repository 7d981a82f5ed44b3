"""Limits of joints and workspace, which no command exceeds."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_common.kernels import njit

KINDS = POSITION, VELOCITY, ACCELERATION = 'position', 'velocity', 'acceleration'
NOT_FINITE = 'velocity not finite'
NEGLIGIBLE = 1e-6  # rounding error of a joint velocity, as a share of its limit


class Joints(NamedTuple):
    """State of the joints: positions (n,) [rad] and velocities (n,) [rad/s]."""

    positions: np.ndarray
    velocities: np.ndarray


class Reach(NamedTuple):
    """
    Smallest and largest joint velocities (3, n) of a period [rad/s], rows as KINDS.

    The first row respects the position limits, the second also the velocity limits, the third
    also the acceleration limits: a joint too close to its position limit brakes with its full
    acceleration, not more. In a stop all joints slow down by the same factor, so that the sensor
    stays on its path.
    """

    least: np.ndarray
    most: np.ndarray
    stop: np.ndarray  # (n,), joint velocities after a period of braking [rad/s]


@dataclass(frozen=True)
class JointLimits:
    """Limits of each joint (n,), and the time in which the arm can always stop."""

    names: tuple[str, ...]
    lower: np.ndarray  # position limits including the margin [rad]; may be infinite
    upper: np.ndarray
    velocity: np.ndarray  # largest magnitudes, above 0 [rad/s]
    acceleration: np.ndarray  # [rad/s^2]

    def __post_init__(self) -> None:
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
    def _bounds(self) -> np.ndarray:
        """Lower, upper, velocity and acceleration (4, n), for kernels."""
        return np.array([self.lower, self.upper, self.velocity, self.acceleration])

    @cached_property
    def slack(self) -> np.ndarray:
        """Rounding errors of the joint velocities (n,) [rad/s]."""
        return NEGLIGIBLE * self.velocity

    def reach(self, joints: Joints, dt: float, coast: float = 0.0) -> Reach:
        """
        Return the velocities that joints may have for `dt` and `coast`, before they brake [s].

        Near a position limit the allowed velocity is proportional to the distance left, a
        velocity damper (Faverjon and Tournassoud, 1987): at
        distance / (dt + coast + stopping_time) the joints can always stop together in time.
        """
        return _reach(self._bounds, joints, dt, dt + coast + self.stopping_time)

    def keeps(self, velocities: np.ndarray, least: np.ndarray, most: np.ndarray) -> bool:
        """Return True if joint velocities (n,) are within bounds (n,), except for rounding."""
        return bool((np.maximum(least - velocities, velocities - most) <= self.slack).all())

    def guard(self, wanted: np.ndarray, reach: Reach) -> tuple[np.ndarray, str]:
        """
        Clip wanted joint velocities (n,) to all limits; return them and the violated limit.

        The limit is empty if the violation is within rounding. Wanted velocities that are not
        finite are replaced by a stop.
        """
        kept = np.minimum(np.maximum(wanted, reach.least[-1]), reach.most[-1])
        if self.keeps(wanted, reach.least[-1], reach.most[-1]):
            return kept, ''
        if not np.isfinite(wanted).all():
            return self.guard(reach.stop, reach)[0], NOT_FINITE
        joint = (np.abs(kept - wanted) - self.slack).argmax()
        outside = (wanted < reach.least - self.slack) | (wanted > reach.most + self.slack)
        return kept, self.name_of(outside[:, joint].argmax(), joint)

    def end_of(self, bound: str, positions: np.ndarray) -> str:
        """Return which end of its range a joint is at, for a position limit's name."""
        index = self.names.index(bound.rpartition(' of ')[2])
        side, end = min((('lower', self.lower[index]), ('upper', self.upper[index])),
                        key=lambda it: abs(positions[index] - it[1]))
        return f'{self.names[index]} is at its {side} limit, {end:g}'

    def name_of(self, kind: np.intp, joint: np.intp) -> str:
        """Return the name of a limit from the indices of its kind and joint."""
        return f'{KINDS[kind]} of {self.names[joint]}'


@njit(cache=True)
def _reach(bounds: np.ndarray, joints: Joints, dt: float, horizon: float) -> Reach:
    """Return the reach for a period, if joints brake from their limits within the horizon [s]."""
    lower, upper, fastest, acceleration = bounds
    positions, previous = joints
    periods = (np.abs(previous) / (dt * acceleration)).max()  # number of periods to brake
    least, most = np.empty((3, len(lower))), np.empty((3, len(lower)))
    for k in range(len(lower)):
        least[0, k] = min((lower[k] - positions[k]) / horizon, 0.0)
        most[0, k] = max((upper[k] - positions[k]) / horizon, 0.0)
        least[1, k], most[1, k] = max(least[0, k], -fastest[k]), min(most[0, k], fastest[k])
        low, high = (previous[k] - acceleration[k] * dt, previous[k] + acceleration[k] * dt)
        least[2, k] = min(max(least[1, k], low), high)
        most[2, k] = min(max(most[1, k], low), high)
    return Reach(least, most, previous * (1.0 - 1.0 / max(periods, 1.0)))


@dataclass(frozen=True)
class WorkspaceBox:
    """Box in the base frame that the sensor's origin must not leave: corners (3,) [m]."""

    lower: np.ndarray
    upper: np.ndarray

    def __post_init__(self) -> None:
        for name in ('lower', 'upper'):
            values = np.asarray(getattr(self, name), dtype=float)
            if values.shape != (3,) or np.isnan(values).any():
                raise ConfigurationError(f'workspace {name}: {values} is not three lengths')
            object.__setattr__(self, name, values)
        if not (self.lower < self.upper).all():
            raise ConfigurationError(
                f'workspace: lower {self.lower} is not below upper {self.upper}')

    def beyond(self, place: np.ndarray) -> np.ndarray:
        """Return how far each coordinate of a place (3,) is outside the box; 0 inside [m]."""
        return np.maximum(np.maximum(place - self.upper, self.lower - place), 0.0)

    def limit(self, pose: np.ndarray, twist: np.ndarray,
              horizon: float) -> tuple[np.ndarray, bool]:
        """
        Clip a twist (6,) that would leave the box within `horizon` [s].

        The twist is in the frame of the pose (4, 4) [m/s, rad/s]. Returns the twist, and True if
        it was clipped. A twist that is not finite is returned unchanged; `JointLimits.guard`
        replaces it by a stop.
        """
        rotation, place = pose[:3, :3], pose[:3, 3]
        velocity = rotation @ twist[:3]
        kept = np.maximum(np.minimum(velocity, np.maximum((self.upper - place) / horizon, 0.0)),
                          np.minimum((self.lower - place) / horizon, 0.0))
        if (kept == velocity).all() or np.isnan(velocity).any():
            return twist, False
        return np.concatenate([rotation.T @ kept, twist[3:]]), True
