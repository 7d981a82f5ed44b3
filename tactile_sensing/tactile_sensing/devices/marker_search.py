"""
Finding the phase of frames of one length that start with a marker, without any input or output.

The marker is not escaped, so that it may stand anywhere in a frame. Where it has stood at one
place of several successive periods, a frame may start there; where that holds of several places,
they are compared with what was known of the stream before.
"""
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

LOCK_PERIODS = 2  # periods that must be confirmed by a marker behind them
AMBIGUOUS_PERIODS = 8  # periods to wait for while several places are confirmed
MAX_RIVALS = 8  # places that are compared, those nearest to where a frame was expected
OFTEN = AMBIGUOUS_PERIODS // 2  # so often must reads end at one place to tell a pause
CLIP = 32  # counts; a tactel that differs by more tells no more


class Run(NamedTuple):
    """Markers a period apart."""

    last: int  # position of the last one in the stream
    periods: int  # confirmed, one less than the markers


class Known(NamedTuple):
    """What the last good frame tells."""

    start: int  # position in the stream
    payload: bytes
    mimics: frozenset[int]  # distances from its marker at which its payload holds another


class MarkerSearch:
    """
    Search a stream for a phase, each byte once; the work per byte is bounded, whatever comes.

    Positions count all bytes of the stream. Per period at most one comparison is made, of at
    most `MAX_RIVALS` places, each with the work of one period.
    """

    def __init__(self, marker: bytes, period: int):
        self._marker, self._period = marker, period
        self.restart(0)

    def restart(self, position: int) -> None:
        """Search anew from a position on."""
        self._runs: deque[Run] = deque()  # by their last markers, all within one period
        self._next = position  # not looked at yet
        self._compare_at = position

    def find(self, buffer: bytearray, origin: int, known: Known | None,
             breaks: Sequence[int]) -> Run | None:
        """
        Return the run that frames start with, None until there is one.

        The buffer begins at the position `origin` and holds at least the last
        `AMBIGUOUS_PERIODS + 2` periods that were received. `breaks` are positions, modulo the
        period, at which a read of the port ended.
        """
        while (at := buffer.find(self._marker, max(self._next - origin, 0))) >= 0:
            self._next = origin + at + 1
            run = self._extend(origin + at)
            if run.periods < LOCK_PERIODS:
                continue
            if len(self._runs) == 1:
                return run
            if run.last >= self._compare_at:
                self._compare_at = run.last + self._period
                best = self._compare(buffer, origin, known, breaks)
                if best is not None:
                    return best
        # The last bytes may be the first ones of a marker.
        self._next = max(self._next, origin + len(buffer) - len(self._marker) + 1)
        return None

    def _extend(self, position):
        """Enter a marker; what had to be confirmed by now and was not is no run any more."""
        periods, before = 0, position - self._period
        while self._runs and self._runs[0].last <= before:
            run = self._runs.popleft()
            if run.last == before:
                periods = run.periods + 1
        self._runs.append(Run(position, periods))
        return self._runs[-1]

    def _compare(self, buffer, origin, known, breaks):
        """Return the likeliest run, None while waiting may tell more."""
        settled = max(run.periods for run in self._runs) >= AMBIGUOUS_PERIODS
        runs = [run for run in self._runs if run.periods]
        if known is None:
            if not settled:
                return None
            # A device pauses before or behind its marker, not within a picture.
            ends = np.bincount(breaks, minlength=self._period)
            score = {run: (ends[run.last % self._period]
                           + ends[(run.last + len(self._marker)) % self._period]) // OFTEN
                     for run in runs}
            return max(runs, key=lambda run: (score[run], -self._start(run)))
        # Bytes get lost rather than added: the place lies at or before the expected one.
        runs = sorted(runs, key=lambda run: (known.start - run.last) % self._period)[:MAX_RIVALS]
        strange = {run: self._strangers(run, known) for run in runs}
        least = min(strange.values())
        if not settled and (least or list(strange.values()).count(0) > 1):
            return None
        unlike = {run: self._unlike(run, buffer, origin, known)
                  for run in runs if strange[run] == least}
        # The nearest one of those that are about as like the last picture as the best.
        return next(run for run in unlike if unlike[run] <= 2 * min(unlike.values()))

    def _strangers(self, run, known):
        """Count the places that mimic a marker if frames start with a run, and did not before."""
        return sum((other.last - run.last) % self._period not in known.mimics
                   for other in self._runs if other is not run)

    def _unlike(self, run, buffer, origin, known):
        """How much the newest whole frame of a run differs from the last good one."""
        begin = run.last - self._period + len(self._marker) - origin
        new = np.frombuffer(bytes(buffer[begin:begin + len(known.payload)]), np.uint8)
        old = np.frombuffer(known.payload, np.uint8)
        return int(np.minimum(np.abs(new.astype(np.int16) - old), CLIP).sum())

    def _start(self, run):
        return run.last - run.periods * self._period
