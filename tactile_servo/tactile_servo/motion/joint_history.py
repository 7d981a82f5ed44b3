"""History of plausible measured joint states, with interpolation."""

import numpy as np
from numpy.typing import ArrayLike

from tactile_common.state_buffer import StateBuffer
from tactile_servo.motion.limits import JointLimits

BEYOND_LIMITS = 0.5  # rad; a larger excess is a fault of the sensor or of the joint names
# A leap is a motion between two states by more than LEAP plus twice the joint's largest motion.
# It is accepted if a second state confirms it, or after a silence.
LEAP = 0.02  # rad
SILENCE = 0.5  # s
STORED = 256  # joint states for the interpolation at an image's stamp
# ns by which an image may be newer than the newest joint state, and a state that is repeated or
# overtaken may be older: then it is not stored
MAX_AHEAD_NS = 20_000_000

Stamped = tuple[int, np.ndarray]  # joint positions and their stamp [ns]


class JointHistory:
    """History of plausible measured joint states, with interpolation."""

    def __init__(self, limits: JointLimits):
        self._limits = limits
        self._states: StateBuffer[np.ndarray] = StateBuffer(
            lambda one, other, share: one + share * (other - one), size=STORED,
            max_ahead_ns=MAX_AHEAD_NS, restart_ns=MAX_AHEAD_NS)
        self._last: Stamped | None = None
        self._doubted: Stamped | None = None

    def add(self, positions: ArrayLike, stamp_ns: int) -> np.ndarray:
        """
        Add a joint state (n,) [rad] with its stamp [ns]; return it as an ndarray.

        Raises a ValueError and does not use the state if its length is wrong, if a position is
        not finite or far beyond the joint's limits, or if it is the first state after a leap.
        """
        positions, limits = np.asarray(positions, dtype=float), self._limits
        if positions.shape != limits.lower.shape or not np.isfinite(positions).all():
            raise ValueError(f'joint state {positions} is not {len(limits.names)} angles')
        beyond = np.maximum(limits.lower - positions, positions - limits.upper)
        if beyond.max() > BEYOND_LIMITS:
            joint = int(beyond.argmax())
            raise ValueError(
                f'joint state has {limits.names[joint]} at {positions[joint]:g}, which is '
                f'{beyond[joint]:g} beyond its limits')
        state = stamp_ns, positions
        leaping = self._leaping(self._last, state)
        if leaping.any() and (
                self._doubted is None or self._leaping(self._doubted, state).any()):
            self._doubted = state
            raise ValueError(
                f'joint state has {limits.names[leaping.argmax()]} leap within one state')
        self._last, self._doubted = state, None
        self._states.add(stamp_ns, positions)
        return positions

    def _leaping(self, before: Stamped | None, state: Stamped) -> np.ndarray:
        """Return which joints (n,) leap between two states."""
        span = np.inf if before is None else 1e-9 * abs(state[0] - before[0])
        if before is None or span > SILENCE:
            return np.zeros(len(state[1]), bool)
        return np.abs(state[1] - before[1]) > LEAP + 2.0 * span * self._limits.velocity

    def at(self, stamp_ns: int) -> np.ndarray | None:
        """Return the joint positions (n,) at a stamp [ns], or None if they are unknown."""
        return self._states.at(stamp_ns)
