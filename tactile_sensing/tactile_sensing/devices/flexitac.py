"""
Byte protocol of a FlexiTac reading circuit, without input or output.

The device sends continuously: the marker `AA 55`, then `rows * columns` counts, row-major, then
the next marker. A count is a byte; converters of more than eight bits send words, low byte first,
and signed words are two's complements. Nothing is escaped and there is no checksum, so the marker
may occur in the payload.

In lock, a frame is accepted if the next marker follows it. Without lock (at the start, after a
loss), three markers one period apart are required: in random bytes they occur once in 2^48
positions. If several places of a period look like this, because tactels hold the values of the
marker, the decoder waits until one is left. The frames that are held back meanwhile are genuine
and are delivered late. A loss of bytes that moves such tactels to the place of the marker is not
noticed before one of them changes.
"""
from collections import Counter, deque
import math

import numpy as np
from numpy.typing import DTypeLike

from tactile_sensing.devices.protocol import Decoder, Device, Piece

MARKER = b'\xaa\x55'
MOST_PERIODS = 12  # longest stretch of the stream that is searched for the start of a frame


class FlexiTacDevice(Device):
    """A reading circuit: it sends the next frame's marker directly after a frame."""

    preamble = MARKER

    def encode(self, counts: np.ndarray, time_ns: int = 0) -> bytes:
        """Return the bytes of a frame after its marker, and the next marker."""
        kind = counts.dtype if counts.dtype.itemsize <= 2 else np.dtype(np.uint8)
        return counts.astype(kind.newbyteorder('<')).tobytes() + MARKER


class FlexiTacDecoder(Decoder):
    """Decoder of `flexitac`; `kind` is the type of the counts, an integer of one or two bytes."""

    announced = len(MARKER)

    def __init__(self, rows: int, columns: int, kind: DTypeLike = np.uint8):
        super().__init__(rows, columns, np.dtype(kind).newbyteorder('<'))

    def _begin(self) -> None:
        super()._begin()
        self._period = len(MARKER) + math.prod(self.shape) * self._kind.itemsize
        self.buffer_bound = MOST_PERIODS * self._period + len(MARKER)
        self._in_step = False  # whether a frame starts at the head of the buffer
        self._ambiguous = False  # whether the last search found several places
        self._markers: deque[int] = deque(maxlen=64)  # positions in the stream, without lock

    def explain(self) -> str:
        """Return a text if the frames have another length than those of this array."""
        if self.locked:
            return ''
        if self._ambiguous:
            return ('tactels hold the values 170, 85 of the marker, so the start of a frame is '
                    'not clear: change the load on the pad')
        distances = np.diff(self._markers).tolist()
        period, count = Counter(distances).most_common(1)[0] if distances else (0, 0)
        if count < max(0.8 * len(distances), 3) or period == self._period:
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
        if not self._in_step:
            piece = self._find_start()
            if piece is not None or not self._in_step:
                return piece
        if len(self._buffer) < self._period + len(MARKER):
            return None
        if not self._buffer.startswith(MARKER, self._period):
            self._in_step = False
            return Piece(1, good=False)
        payload = bytes(self._buffer[len(MARKER):self._period])
        return Piece(self._period, np.frombuffer(payload, self._kind).reshape(self.shape))

    def _find_start(self) -> Piece | None:
        """Search the start of a frame; return bytes before it, or None: more bytes are needed."""
        period = self._period
        known = np.frombuffer(bytes(self._buffer[:self.buffer_bound]), np.uint8)
        marker = (known[:-1] == MARKER[0]) & (known[1:] == MARKER[1])
        last = self._markers[-1] if self._markers else -1
        self._markers.extend(
            position for position in (self._origin + np.flatnonzero(marker)).tolist()
            if position > last)
        searched = max(len(marker) - 2 * period, 0)
        starts = np.flatnonzero(marker[:searched] & marker[period:period + searched]
                                & marker[2 * period:])
        useless = int(starts[0]) if starts.size else searched
        if useless:
            return Piece(useless, good=False)
        if searched < period:
            return None
        starts, later = starts[starts < period], 3
        while len(starts) > 1:  # follow them until one is left
            if later == MOST_PERIODS:
                self._ambiguous = True
                return Piece(period, good=False)
            if starts[-1] + later * period >= len(marker):
                return None
            again = starts[marker[starts + later * period]]
            if not again.size:  # bytes are missing here
                return Piece(int(starts[-1]) + 1, good=False)
            starts, later = again, later + 1
        self._in_step, self._ambiguous = True, False
        return Piece(int(starts[0]), good=False) if starts[0] else None
