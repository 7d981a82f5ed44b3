"""How long windows are on their way to the robot's controller, by what that says it plays."""

from collections import deque

import numpy as np

from tactile_servo.motion.trajectory import Trajectory
from tactile_servo.motion.window import committed, Window

SAME = 1e-6  # rad; two motions that differ by less are one
LATEST = 0.03  # s of delay that windows may be committed for
PROBE = 5e-4  # rad/s: a window with no more is no jolt, however late it comes


class WindowDelay:
    """
    The windows of a motion that the robot's controller has yet to play.

    A window that differs from what is played is still on its way. The longest that one was holds
    for all that follow, for where windows agree nothing tells. The first motion of a goal begins
    no faster than `PROBE` until one of its windows is seen to be played.

    Attributes
    ----------
    overdue : float
        For how long the oldest window that is not played has been on its way [s].
    longest : float
        That this has ever been [s].
    """

    def __init__(self) -> None:
        self._heard = False
        self.forget()

    def forget(self) -> None:
        """Begin a goal: of the delay nothing is known."""
        self.longest, self._proved = 0.0, False
        self.begin()

    def begin(self) -> None:
        """Begin a motion, from rest."""
        self._sent: deque[Trajectory] = deque(maxlen=32)
        self._rest: np.ndarray | None = None
        self._moved_ns: int | None = None
        self.overdue, self.probing = 0.0, self._heard and not self._proved

    def send(self, window: Trajectory) -> None:
        """Take a window that is sent; one with stamp 0 is played whenever it comes."""
        if not window.stamp_ns:
            self.probing = False
            return
        self._sent.append(window)
        if self._rest is None:
            self._rest = window.positions[-1]
        elif self._moved_ns is None:
            self._moved_ns = window.stamp_ns
        elif window.stamp_ns - self._moved_ns > 1e8:
            self.probing = False  # for .1 s it has played something else

    def unsend(self) -> None:
        """Take that the newest window was not sent after all."""
        if self._sent:
            self._sent.pop()

    def see(self, reference: np.ndarray, stamp_ns: int) -> None:
        """Take the positions (n,) [rad] that the controller commands for a time [ns]."""
        self._heard, awaited = True, 0.0
        for window in reversed(self._sent):
            since = 1e-9 * (stamp_ns - window.stamp_ns)
            if since < 0.0:
                continue
            if since < window.times[0]:
                return  # on its way to the first point the controller is left alone
            assert window.velocities is not None
            there = committed(
                Window(window.times, window.positions, window.velocities), since, 0.0)
            if np.abs(there.positions[-1] - reference).max() <= SAME:
                break
            awaited = since
        else:
            self.overdue = 0.0  # it plays none of them: what it does is not known
            return
        if np.abs(reference - self._rest).max() > SAME:
            self.probing, self._proved = False, True
        self.overdue, self.longest = awaited, max(self.longest, awaited)

    @property
    def learnt(self) -> tuple[float, float, bool, bool, bool]:
        """What the controller's state has told, which a replay sets again."""
        return self.overdue, self.longest, self.probing, self._heard, self._proved

    @learnt.setter
    def learnt(self, state: tuple[float, float, bool, bool, bool]) -> None:
        self.overdue, self.longest, self.probing, self._heard, self._proved = state

    @property
    def needed(self) -> float:
        """How long a window must leave to the one before, if windows were late at all [s]."""
        # With a period of the controller and one of its states.
        return min(self.longest + 4e-3, LATEST) if self.longest else 0.0
