"""The last measured joint states that can be believed, and those in between."""

import numpy as np
from numpy.typing import ArrayLike

from tactile_common.state_buffer import StateBuffer
from tactile_servo.motion.limits import JointLimits

BEYOND_LIMITS = 0.5  # rad; a joint measured further out is a fault of its sensor or names
SIZE = 256  # joint states that the one at a picture's stamp is looked up in
MAX_AHEAD_NS = 20_000_000  # a picture may be this much newer than the newest joint state


class JointHistory:
    """The last measured joint states that can be believed, and those in between."""

    def __init__(self, limits: JointLimits):
        self._limits = limits
        self._believed = list(zip(
            (limits.lower - BEYOND_LIMITS).tolist(), (limits.upper + BEYOND_LIMITS).tolist(),
            strict=True))
        self._states = StateBuffer(lambda one, other, share: one + share * (other - one),
                                   size=SIZE, max_ahead_ns=MAX_AHEAD_NS)

    def add(self, positions: ArrayLike, stamp_ns: int) -> np.ndarray:
        """
        Take a joint state (n,) [rad] and its stamp [ns]; returns it as an ndarray.

        Raises ValueError, and the state is not used, where its length is wrong or a position
        is not finite or far beyond the joint's limits.
        """
        positions = np.asarray(positions, dtype=float)
        if positions.shape != self._limits.lower.shape or not all(
                low <= angle <= high for (low, high), angle in zip(
                    self._believed, positions.tolist(), strict=True)):
            raise ValueError(self._why_not(positions))
        self._states.add(stamp_ns, positions)
        return positions

    def _why_not(self, positions):
        """Why a joint state cannot be believed."""
        limits = self._limits
        if positions.shape != limits.lower.shape or not np.isfinite(positions).all():
            return f'joint state {positions} is not {len(limits.names)} angles'
        beyond = np.maximum(limits.lower - positions, positions - limits.upper)
        joint = int(np.argmax(beyond))
        return (f'joint state has {limits.names[joint]} at {positions[joint]:g}, which is '
                f'{beyond[joint]:g} beyond its limits')

    def at(self, stamp_ns: int) -> np.ndarray | None:
        """Joint positions (n,) at a stamp [ns]; None where they are not known."""
        return self._states.at(stamp_ns)
