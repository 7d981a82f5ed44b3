"""
Byte protocol of a FlexiTac reading circuit, without input or output.

The device sends continuously: the marker `AA 55`, then `rows * columns` unsigned bytes, row-major,
then the next marker. Converters of more than eight bits send words of two bytes, low byte first;
signed words are two's complements. Nothing is escaped and there is no checksum. The marker may
therefore occur in the payload, and a frame is accepted only if the next marker follows it.

In lock, a frame is delayed by no more than these two bytes. Without lock (at the start, after a
loss) three markers at the right distances are required. In random bytes, two of them occur by
chance once in 2^32 positions, which is 0.3 % in a minute at 2 Mbaud; three once in 2^48. The
frames that are held back meanwhile are genuine and are delivered late.

Tactels with constant counts equal to the marker mimic it; after a lost byte, several phases then
look alike. The decoder uses the frames before the loss: a place that held a marker within them is
not the start of a frame. If this is not sufficient, it waits for noise. A loss may also move such
a mimic to the place where a marker is expected, so that the decoder would stay in lock with the
wrong phase. Then the true marker appears at the mirrored place, and the lock ends.
"""
from collections import Counter, deque
from collections.abc import Iterator
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import DTypeLike

from tactile_sensing.devices.protocol import Decoder, Device, Piece

MARKER = b'\xaa\x55'
AMBIGUOUS_PERIODS = 8  # periods to wait while several places are possible
FIXED_FRAMES = 8  # a mimic at the same place in this number of frames counts as fixed
LOCK_PERIODS = 2  # confirmed periods required for lock: three markers
MAX_RIVALS = 8  # places to compare, those nearest to the expected one


def encode_payload(counts: np.ndarray) -> bytes:
    """Return the payload of one image; integers of one or two bytes are not converted."""
    if counts.dtype.itemsize > 2:
        counts = counts.astype(np.uint8)
    return counts.astype(counts.dtype.newbyteorder('<')).tobytes()


class FlexiTacDevice(Device):
    """A reading circuit: it sends the next frame's marker directly after a frame."""

    preamble = MARKER

    def encode(self, counts: np.ndarray, time_ns: int = 0) -> bytes:
        """Return the bytes of a frame after its marker, and the next marker."""
        return encode_payload(counts) + MARKER


class Run(NamedTuple):
    """Markers that are one period apart."""

    last: int  # position of the last marker in the stream
    periods: int  # confirmed periods, one less than the markers


class FlexiTacDecoder(Decoder):
    """
    Decoder of `flexitac`.

    `kind` is the type of the counts, an integer of one or two bytes. Without lock, each byte is
    searched once, and at most `MAX_RIVALS` places are compared per period.
    """

    announced = len(MARKER)

    def __init__(self, rows: int, columns: int, kind: DTypeLike = np.uint8):
        # These survive a reset, because the pad is the same: start of the last good frame; places
        # in it that mimic a marker, with the number of consecutive frames.
        self._start: int | None = None
        self._mimics: dict[int, int] = {}
        super().__init__(rows, columns, np.dtype(kind).newbyteorder('<'))

    def _begin(self) -> None:
        super()._begin()
        self._period = len(MARKER) + math.prod(self.shape) * self._kind.itemsize
        self.buffer_bound = (AMBIGUOUS_PERIODS + 2) * self._period + len(MARKER)
        self._held = 0  # confirmed frames at the head of the buffer
        self._breaks: deque[int] = deque(maxlen=4 * AMBIGUOUS_PERIODS)  # places where reads ended
        self._distances: deque[int] = deque(maxlen=64)  # between markers: the length of frames
        self._search_from(self._origin)

    def _search_from(self, position: int) -> None:
        self._next = self._compare_at = self._marker_at = position
        self._runs: deque[Run] = deque()  # by their last markers, all within one period

    def receive_data(self, data: bytes) -> None:
        """Append received bytes to the buffer; `next_event` parses them."""
        super().receive_data(data)
        self._breaks.append((self._origin + len(self._buffer)) % self._period)

    def explain(self) -> str:
        """Return a text if the frames have another length than those of this array."""
        period, count = max(Counter(self._distances).items(), key=lambda it: it[1], default=(0, 0))
        if self.locked or count < max(0.8 * len(self._distances), 3) or period == self._period:
            return ''
        size, tactels = period - len(MARKER), math.prod(self.shape)
        text = (f'the sensor sends {size} bytes a frame, '
                f'{self._period - len(MARKER)} are expected')
        if size == 2 * tactels:
            text += ': it sends two a tactel, `bits` of the calibration must be above 8'
        elif size == tactels:
            text += ': it sends one a tactel, `bits` of the calibration must be at most 8'
        return text

    def _scan(self) -> Piece | None:
        if self.locked and not self._held:
            if len(self._buffer) < self._period + len(MARKER):
                return None
            if self._buffer.startswith(MARKER, self._period) and not self._slipped():
                self._held = 1
            else:  # the frame is broken; search behind its marker
                self.locked = False
                self._search_from(self._origin + 1)
        if not self._held:
            run = self._find()
            if run is None:
                over = len(self._buffer) - self.buffer_bound
                return Piece(over, good=False) if over > 0 else None
            self._held = min(run.periods, (run.last - self._origin) // self._period)
            before = run.last - self._held * self._period - self._origin
            if before > 0:
                return Piece(before, good=False)
        self._held -= 1
        payload = bytes(self._buffer[len(MARKER):self._period])
        self._start = self._origin
        self._mimics = {place: self._mimics.get(place, 0) + 1 for place in _places(payload)}
        return Piece(self._period, np.frombuffer(payload, self._kind).reshape(self.shape))

    def _slipped(self) -> bool:
        """Return whether the true marker appears where it is if a mimic has taken its place."""
        fixed = [place for place, count in self._mimics.items() if count >= FIXED_FRAMES]
        return any(self._buffer.startswith(MARKER, self._period - place) for place in fixed
                   if self._period - place not in self._mimics)

    def _find(self) -> Run | None:
        """Return the run of the frame markers; None: more bytes are needed."""
        while (at := self._buffer.find(MARKER, max(self._next - self._origin, 0))) >= 0:
            run = self._extend(self._origin + at)
            if run.periods < LOCK_PERIODS:
                continue
            if len(self._runs) == 1:
                return run
            if run.last >= self._compare_at:
                self._compare_at = run.last + self._period
                best = self._likeliest()
                if best is not None:
                    return best
        # The last bytes may be the begin of a marker.
        self._next = max(self._next, self._origin + len(self._buffer) - len(MARKER) + 1)
        return None

    def _extend(self, position: int) -> Run:
        """Add a marker to its run; remove runs whose next marker is missing. Return its run."""
        self._distances.append(position - self._marker_at)
        self._marker_at, self._next = position, position + 1
        periods, before = 0, position - self._period
        while self._runs and self._runs[0].last <= before:
            run = self._runs.popleft()
            if run.last == before:
                periods = run.periods + 1
        self._runs.append(Run(position, periods))
        return self._runs[-1]

    def _likeliest(self) -> Run | None:
        """Return the likeliest run; None: wait for more bytes."""
        settled = max(run.periods for run in self._runs) >= AMBIGUOUS_PERIODS
        runs, start = [run for run in self._runs if run.periods], self._start
        if start is None:
            if not settled:
                return None
            # A device pauses before or after its marker, not within an image: reads end there in
            # at least half of the periods.
            ends = np.bincount(self._breaks, minlength=self._period)
            return max(runs, key=lambda run: (
                (ends[run.last % self._period]
                 + ends[(run.last + len(MARKER)) % self._period]) // (AMBIGUOUS_PERIODS // 2),
                run.periods * self._period - run.last))
        # Bytes are lost, not added: the true place is at or before the expected one.
        runs.sort(key=lambda run: (start - run.last) % self._period)
        strange = [self._strangers(run) for run in runs[:MAX_RIVALS]]
        if not settled and (min(strange) or strange.count(0) > 1):
            return None
        return runs[strange.index(min(strange))]

    def _strangers(self, run: Run) -> int:
        """Count the mimics that would be new if the frames started with this run."""
        return sum((other.last - run.last) % self._period not in self._mimics
                   for other in self._runs if other is not run)


def _places(payload: bytes) -> Iterator[int]:
    """Yield the distances from the start of the frame at which a payload contains the marker."""
    at = payload.find(MARKER)
    while at >= 0:
        yield at + len(MARKER)
        at = payload.find(MARKER, at + 1)
