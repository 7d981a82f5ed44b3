"""
Byte protocol of a FlexiTac reading circuit, without any input or output.

The device runs free: the marker `AA 55`, then `rows * columns` unsigned bytes, row-major, then
the next marker. Nothing is escaped and there is no checksum, so the marker may occur in the
payload, and a frame counts only if the next marker stands where it must.

In lock a frame costs no more latency than those two bytes. Without lock (at the start, after a
loss) three markers at the right distances are demanded: in random bytes two of them stand right
once in 2^32 positions, which is 0.3 % in a minute at 2 Mbaud, three once in 2^48. The frames that
were held back meanwhile are genuine and are delivered, late.

A picture that does not change and holds the marker looks the same from two phases. Without lock
the decoder then waits up to `AMBIGUOUS_PERIODS` for noise to tell them apart before it takes the
earlier one. A wrong choice ends with the first change of the two tactels that mimic the marker.
"""
import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_sensing.devices.protocol import Frame, NEED_DATA, Resync, Signal

MARKER = b'\xaa\x55'
BAUD_RATE = 2_000_000
LOCK_PERIODS = 2  # frame periods that must be confirmed before the decoder is in lock
AMBIGUOUS_PERIODS = 8  # frame periods to wait for while several phases are confirmed


def encode_frame(counts: np.ndarray) -> bytes:
    """Return marker and payload of one picture, `counts` of shape `(rows, columns)`, uint8."""
    return MARKER + encode_payload(counts)


def encode_payload(counts: np.ndarray) -> bytes:
    """Return the payload of one picture alone."""
    return np.ascontiguousarray(counts, dtype=np.uint8).tobytes()


def encode_next(counts: np.ndarray) -> bytes:
    """Return what a device sends once a marker is out: payload, and at once the next marker."""
    return encode_payload(counts) + MARKER


class FlexiTacDecoder:
    """
    Turn received bytes into frames, see `protocol.Decoder`.

    `buffer_bound` is without lock the `AMBIGUOUS_PERIODS` that may be needed to choose a phase,
    the marker behind them and one period in which candidates start. `lost_frames` is estimated
    from the dropped bytes. Raises a ConfigurationError where a size is not a positive integer.
    """

    def __init__(self, rows: int, columns: int):
        for name, value in (('rows', rows), ('columns', columns)):
            if not isinstance(value, int) or value < 1:
                raise ConfigurationError(f'{name} is {value!r}, must be an integer of at least 1')
        self._shape = (rows, columns)
        self._period = len(MARKER) + rows * columns
        self.buffer_bound = (AMBIGUOUS_PERIODS + 1) * self._period + len(MARKER)
        self.frames = self.lost_frames = self.resyncs = self.dropped_bytes = 0
        self._buffer = bytearray()
        self.reset()

    def reset(self) -> None:
        """Forget the buffer and the lock, as after the port was opened anew; counters stay."""
        self.dropped_bytes += len(self._buffer)
        self._buffer.clear()
        self._checked = 0  # without lock: no frame starts before this position
        self._held = 0  # confirmed frames at the head of the buffer
        self._gap = 0  # bytes passed over since the last frame
        self.locked = False

    @property
    def buffered(self) -> int:
        """Bytes that are held at the moment."""
        return len(self._buffer)

    def receive_data(self, data: bytes) -> None:
        """Append what came from the port; parsing is left to `next_event`."""
        self._buffer += data

    def next_event(self) -> Frame | Resync | Signal:
        """Return the next `Frame` or `Resync`, or `NEED_DATA`."""
        if self.locked and self._held == 0:
            if len(self._buffer) < self._period + len(MARKER):
                return NEED_DATA
            if self._marker_at(self._period):
                self._held = 1
            else:
                # The frame is broken; its own marker cannot start another one.
                self.locked = False
                self._checked = 1
        if not self.locked:
            if not self._find_lock():
                return NEED_DATA
            if self._gap:
                return self._resync()
        return self._frame()

    def explain(self, sample: bytes) -> str:
        """Say how long the frames of a stream are that makes none of this array."""
        size = payload_size(sample)
        if size is None or size == self._period - len(MARKER):
            return ''
        return f'the sensor sends {size} bytes a frame'

    def _frame(self):
        payload = bytes(self._buffer[len(MARKER):self._period])
        del self._buffer[:self._period]
        self._held -= 1
        counts = np.frombuffer(payload, np.uint8).reshape(self._shape)
        frame = Frame(counts, self.frames + self.lost_frames)
        self.frames += 1
        return frame

    def _resync(self):
        # Nothing is lost before the first frame; afterwards at least the one that broke the lock.
        if self.frames:
            self.lost_frames += max(round(self._gap / self._period), 1)
        self.resyncs += 1
        event = Resync(self._gap)
        self._gap = 0
        return event

    def _find_lock(self):
        """Put the start of a confirmed frame at the head of the buffer; False: not there yet."""
        buffer = self._buffer
        while True:
            start = buffer.find(MARKER, self._checked)
            if start < 0:
                # The last byte may be the first of a marker.
                self._drop(max(len(buffer) - 1, 0))
                return False
            self._checked = start
            count, broken = self._run(start)
            waiting = not broken and count < LOCK_PERIODS
            if count >= LOCK_PERIODS:
                rival, rival_broken = self._longest_rival(start)
                waiting = not (broken or rival_broken) and count < AMBIGUOUS_PERIODS
                broken = broken and (not rival_broken or rival > count)
            if broken:
                self._checked = start + 1
                continue
            self._drop(start)
            if waiting:
                return False
            self._held = count
            self.locked = True
            return True

    def _run(self, start):
        """Count the periods after `start` that end with a marker, and tell whether one fails."""
        count = 0
        position = start + self._period
        while count < AMBIGUOUS_PERIODS and position + len(MARKER) <= len(self._buffer):
            if not self._marker_at(position):
                return count, True
            count += 1
            position += self._period
        return count, False

    def _longest_rival(self, start):
        """Return the longest run, best an unbroken one, from elsewhere in the period."""
        best = (0, True)
        other = start
        while (other := self._buffer.find(MARKER, other + 1, start + self._period)) >= 0:
            best = max(best, self._run(other), key=lambda run: (not run[1], run[0]))
        return best

    def _marker_at(self, position):
        return self._buffer.startswith(MARKER, position)

    def _drop(self, count):
        del self._buffer[:count]
        self._checked = max(self._checked - count, 0)
        self._gap += count
        self.dropped_bytes += count


def payload_size(sample: bytes) -> int | None:
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
