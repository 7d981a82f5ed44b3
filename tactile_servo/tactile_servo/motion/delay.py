"""Delay of windows on their way to the robot's controller, from the controller's state."""

from collections import deque

import numpy as np

from tactile_servo.motion.window import sample, Window

SAME = 1e-6  # largest difference of two equal positions [rad]
KEPT = 32  # number of stored windows
DELAY_MARGIN = 4e-3  # added to a delay [s]: a period of the controller and one of its states
LATEST = 0.03  # largest delay that windows are committed for [s]
PROBE_TIME = 0.1  # time without a played window after which probing ends [s]
PROBE = 5e-4  # joint velocity that causes no jolt, however late a window comes [rad/s]


class WindowDelay:
    """
    Measures how late the robot's controller plays the windows of a motion.

    A window is still on its way while the controller's reference differs from it. Once it is
    played, its delay is known; the longest delay is kept for all later windows, because equal
    windows do not show theirs. The first motion of a goal is not faster than `PROBE` until the
    controller plays one of its windows.
    """

    def __init__(self) -> None:
        self._heard = False
        self.forget()

    def forget(self) -> None:
        """Begin a goal, with unknown delay."""
        self.longest, self._proved = 0.0, False  # largest delay of a window that was played [s]
        self.begin()

    def begin(self) -> None:
        """Begin a motion, from rest."""
        self._sent: deque[tuple[int, Window]] = deque(maxlen=KEPT)
        self._rest: np.ndarray | None = None
        self._moved_ns: int | None = None
        # Time for which the oldest window that is not yet played has been on its way [s].
        self.overdue, self.probing = 0.0, self._heard and not self._proved

    def send(self, window: Window, stamp_ns: int) -> None:
        """Register a window that is sent; one with stamp 0 is played when it arrives."""
        if not stamp_ns:
            self.probing = False
            return
        self._sent.append((stamp_ns, window))
        if self._rest is None:
            self._rest = window.positions[-1]
        elif self._moved_ns is None:
            self._moved_ns = stamp_ns
        elif stamp_ns - self._moved_ns > 1e9 * PROBE_TIME:
            self.probing = False

    def unsend(self) -> None:
        """Remove the newest window, which was not sent after all."""
        if self._sent:
            self._sent.pop()

    def see(self, reference: np.ndarray, stamp_ns: int) -> None:
        """Process the positions (n,) [rad] that the controller commands for a time [ns]."""
        self._heard, awaited = True, 0.0
        for sent_ns, window in reversed(self._sent):
            since = 1e-9 * (stamp_ns - sent_ns)
            if since < 0.0:
                continue
            if since < window.times[0]:
                return  # until a window's first point, the controller moves by its own spline
            there, _ = sample(window, since)
            if np.abs(there - reference).max() <= SAME:
                break
            awaited = since
        else:
            self.overdue = 0.0  # the controller plays none of them: its state is unknown
            return
        if np.abs(reference - self._rest).max() > SAME:
            self.probing, self._proved = False, True
        if awaited < self.overdue:  # the oldest has been played
            self.longest = max(self.longest, self.overdue)
        self.overdue = awaited

    @property
    def learnt(self) -> tuple[float, float, bool, bool, bool]:
        """Values learnt from the controller's state; a replay restores them."""
        return self.overdue, self.longest, self.probing, self._heard, self._proved

    @learnt.setter
    def learnt(self, state: tuple[float, float, bool, bool, bool]) -> None:
        self.overdue, self.longest, self.probing, self._heard, self._proved = state

    @property
    def needed(self) -> float:
        """Time that a window must leave to the previous one; 0 if no window was late [s]."""
        return min(self.longest + DELAY_MARGIN, LATEST) if self.longest else 0.0
