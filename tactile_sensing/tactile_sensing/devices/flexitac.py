"""
Byte protocol of a FlexiTac reading circuit, without any input or output.

The device runs free: the marker `AA 55`, then `rows * columns` unsigned bytes, row-major, then
the next marker. Converters of more than eight bits send words of two bytes, the lower one first,
signed ones two's complements. Nothing is escaped and there is no checksum, so the marker may occur
in the payload, and a frame counts only if the next marker stands where it must.

In lock a frame costs no more latency than those two bytes. Without lock (at the start, after a
loss) three markers at the right distances are demanded: in random bytes two of them stand right
once in 2^32 positions, which is 0.3 % in a minute at 2 Mbaud, three once in 2^48. The frames that
were held back meanwhile are genuine and are delivered, late.

Tactels that stand still at the marker's values mimic it, and after a lost byte several phases
look alike. Then the frames before tell: a place that held a marker within them is no start of
another one, and the picture hardly changes. Where that does not tell, `MarkerSearch` waits for
noise. A loss that brings such a place to where a marker is expected would keep the decoder in
lock in the wrong phase; it shows by the true marker, now at the mirrored place, and ends the lock.
"""
from collections import deque
import math

import numpy as np
from numpy.typing import DTypeLike

from tactile_sensing.devices.marker_search import AMBIGUOUS_PERIODS, Known, MarkerSearch
from tactile_sensing.devices.protocol import Decoder, Device, NEED_DATA

MARKER = b'\xaa\x55'
BAUD_RATE = 2_000_000
SAMPLE_SIZE = 16384  # bytes
FIXED_FRAMES = 8  # in which a mimic has stood at one place, so that it counts as fixed


def encode_frame(counts: np.ndarray) -> bytes:
    """Return marker and payload of one picture, `counts` of shape `(rows, columns)`."""
    return MARKER + encode_payload(counts)


def encode_payload(counts: np.ndarray) -> bytes:
    """Return the payload of one picture alone: integers of one byte or two, as they are."""
    if counts.dtype.itemsize > 2:
        counts = counts.astype(np.uint8)
    return counts.astype(counts.dtype.newbyteorder('<')).tobytes()


def encode_next(counts: np.ndarray) -> bytes:
    """Return what a device sends once a marker is out: payload, and at once the next marker."""
    return encode_payload(counts) + MARKER


class FlexiTacDevice(Device):
    """A reading circuit: it announces a frame by its marker as soon as the last one is out."""

    preamble = MARKER

    def encode(self, counts: np.ndarray, time_ns: int = 0) -> bytes:
        """Return what a device sends once a marker is out."""
        return encode_next(counts)


class FlexiTacDecoder(Decoder):
    """
    Turn received bytes into frames, see `protocol.Decoder`.

    `buffer_bound` is without lock the `AMBIGUOUS_PERIODS` that may be needed to choose a phase,
    and the markers around them. Counts are of the type that is given, an integer of one byte or
    two.
    """

    def __init__(self, rows: int, columns: int, kind: DTypeLike = np.uint8):
        self._known: Known | None = None  # survives a reset: the pad is the same one
        self._fixed: dict[int, int] = {}  # places of mimics, and for how many frames by now
        super().__init__(rows, columns, np.dtype(kind).newbyteorder('<'))

    def _begin(self):
        super()._begin()
        self._period = len(MARKER) + math.prod(self.shape) * self._kind.itemsize
        self.buffer_bound = (AMBIGUOUS_PERIODS + 2) * self._period + len(MARKER)
        self._search = MarkerSearch(MARKER, self._period)
        self._search.restart(self._origin)
        self._breaks: deque[int] = deque(maxlen=4 * AMBIGUOUS_PERIODS)
        self._held = 0  # confirmed frames at the head of the buffer
        self._sample = bytearray()  # kept without lock, to see how long other frames are

    def receive_data(self, data: bytes) -> None:
        """Append what came from the port; parsing is left to `next_event`."""
        super().receive_data(data)
        self._breaks.append((self._origin + len(self._buffer)) % self._period)
        if self.locked:
            self._sample.clear()
        else:
            self._sample += data
            del self._sample[:-SAMPLE_SIZE]

    def next_event(self):
        """Return the next event, or `NEED_DATA`."""
        if self.locked and self._held == 0:
            if len(self._buffer) < self._period + len(MARKER):
                return NEED_DATA
            if self._buffer.startswith(MARKER, self._period) and not self._slipped():
                self._held = 1
            else:
                # The frame is broken; its own marker cannot start another one.
                self.locked = False
                self._search.restart(self._origin + 1)
        if not self.locked:
            if not self._find_lock():
                return NEED_DATA
            if self._gap:
                return self._resync(self._period)
        return self._head()

    def explain(self) -> str:
        """Say how long the frames of a stream are that makes none of this array."""
        size = payload_size(self._sample)
        if size is None or size == self._period - len(MARKER):
            return ''
        text, tactels = f'the sensor sends {size} bytes a frame', self.shape[0] * self.shape[1]
        if size == 2 * tactels:
            text += ', two a tactel: `bits` of the calibration must be above 8'
        elif size == tactels:
            text += ', one a tactel: `bits` of the calibration must be at most 8'
        return text

    def _head(self):
        """Take the frame at the head of the buffer."""
        payload = bytes(self._buffer[len(MARKER):self._period])
        mimics = frozenset(_places(payload))
        self._fixed = {place: self._fixed.get(place, 0) + 1 for place in mimics}
        self._known = Known(self._origin, payload, mimics)
        first = self._origin + len(MARKER)
        self._take(self._period)
        self._held -= 1
        return self._frame(np.frombuffer(payload, self._kind).reshape(self.shape), first)

    def _slipped(self):
        """Whether a marker stands where the true one is if a fixed mimic has taken its place."""
        fixed = [place for place, count in self._fixed.items() if count >= FIXED_FRAMES]
        return any(self._buffer.startswith(MARKER, self._period - place) for place in fixed
                   if self._period - place not in self._fixed)

    def _find_lock(self):
        """Put the start of a confirmed frame at the head of the buffer; False: not there yet."""
        run = self._search.find(self._buffer, self._origin, self._known, self._breaks)
        if run is None:
            self._drop(len(self._buffer) - self.buffer_bound)
            return False
        self._held = min(run.periods, (run.last - self._origin) // self._period)
        self._drop(run.last - self._held * self._period - self._origin)
        self.locked = True
        return True


def _places(payload):
    """Yield the distances from the frame's start at which a payload holds the marker."""
    at = payload.find(MARKER)
    while at >= 0:
        yield at + len(MARKER)
        at = payload.find(MARKER, at + 1)


def payload_size(sample: bytes | bytearray) -> int | None:
    """
    Guess from some periods of a byte stream how long its payload is: bytes between two markers.

    None unless at least four in five distances are the same.
    """
    raw = np.frombuffer(bytes(sample), np.uint8)
    distances = np.diff(np.flatnonzero((raw[:-1] == MARKER[0]) & (raw[1:] == MARKER[1])))
    if distances.size < 3:
        return None
    sizes, counts = np.unique(distances, return_counts=True)
    if counts.max() < 0.8 * distances.size:
        return None
    return int(sizes[counts.argmax()]) - len(MARKER)
