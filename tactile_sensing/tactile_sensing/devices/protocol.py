"""Byte protocols of sensors: convert bytes to frames and back, without input or output."""
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike

from tactile_common.errors import ConfigurationError

LEAST_STEP = 4  # fewest ticks per frame with which a missing frame is detected
LONGEST_STEP_NS = 10_000_000_000  # after a longer step, the device's clock has restarted [ns]


@dataclass(frozen=True, eq=False)
class Frame:
    """One image, as raw counts."""

    counts: np.ndarray  # shape (rows, columns), integers, read-only
    sequence: int  # number of frames before this one, including an estimate of lost ones
    first_byte: int  # position of its first byte in the received stream
    end: int  # position after its last byte
    device_ns: int | None = None  # time of the device's own clock, unwrapped [ns]


class Piece(NamedTuple):
    """Result of parsing the head of a decoder's buffer."""

    size: int  # [bytes]
    counts: np.ndarray | None = None  # shape (rows, columns); None: it is no frame
    ticks: int | None = None  # of the device's clock, see `Decoder.tick_ns`
    good: bool = True  # False: bytes to discard
    failed: bool = False  # a checksum, or the form of a packet, was wrong


class Decoder:
    """
    Convert received bytes to frames; base class of the decoders, which implement `_scan`.

    `receive_data` only buffers, `next_frame` parses. Call `next_frame` until it returns None;
    then the buffer holds at most `buffer_bound` bytes, whatever was received. Raises a
    ConfigurationError if a size is not a positive integer or `kind` is not an integer type.

    `frames`, `lost_frames`, `dropped_bytes` and `check_errors` are counted since the start. Lost
    frames are estimated from the device's clock, or from the dropped bytes.
    """

    buffer_bound = 0
    announced = 0  # bytes of a frame that the device sends with the frame before
    tick_ns, wrap = 1, 1 << 32  # of the device's clock: unit [ns], and the ticks where it wraps
    locked = False  # whether the decoder is in sync with the byte stream

    def __init__(self, rows: int, columns: int, kind: DTypeLike = np.uint8):
        for name, value in (('rows', rows), ('columns', columns)):
            if not isinstance(value, int) or value < 1:
                raise ConfigurationError(f'{name} is {value!r}, must be an integer of at least 1')
        self.shape, self._kind = (rows, columns), np.dtype(kind)
        if self._kind.kind not in 'iu':
            raise ConfigurationError(f'kind is {self._kind}, must be a type of integers')
        self.frames = self.lost_frames = self.dropped_bytes = self.check_errors = 0
        self._buffer = bytearray()
        self._origin = 0  # position of the buffer in the stream
        self._device_ns, self._step = 0, 0.0  # device time; usual ticks from frame to frame
        self._mismatch = ''
        self._begin()

    @property
    def buffered(self) -> int:
        """Number of bytes in the buffer."""
        return len(self._buffer)

    def receive_data(self, data: bytes) -> None:
        """Append received bytes to the buffer; `next_frame` parses them."""
        self._buffer += data

    def reset(self) -> None:
        """Forget buffer and lock, e.g. after the port was reopened; keep the counters."""
        self._drop(len(self._buffer))
        self._begin()

    def next_frame(self) -> Frame | None:
        """Return the next frame; None: more bytes are needed."""
        while (piece := self._scan()) is not None:
            if piece.good:
                self._take(piece.size)
                if piece.counts is not None:
                    return self._frame(piece.counts, piece)
            else:
                self.locked = False
                self.check_errors += piece.failed
                self._drop(piece.size)
        return None

    def explain(self) -> str:
        """Return why the bytes since the last frame make none; empty if unknown."""
        return self._mismatch

    def start(self, rate: float) -> bytes:
        """Return the command that makes the device send frames at a rate [Hz]."""
        return b''

    def stop(self) -> bytes:
        """Return the command that makes the device stop sending frames."""
        return b''

    def _scan(self) -> Piece | None:
        """Parse the head of the buffer; None: more bytes are needed."""
        raise NotImplementedError

    def _begin(self) -> None:
        """Reset the state to that of a newly opened port."""
        self._gap = 0  # bytes discarded since the last frame
        self._ticks: int | None = None  # of the last frame
        self.locked = False

    def _refuse(self, size: int, why: str, failed: bool = False) -> Piece:
        """Return bytes to discard; `explain` then says why."""
        self._mismatch = why
        return Piece(size, good=False, failed=failed)

    def _image(self, values: np.ndarray, size: int, ticks: int | None = None) -> Piece:
        """Return the Piece of a frame; it is not good if number or range of values is wrong."""
        (rows, columns), bounds = self.shape, np.iinfo(self._kind)
        if values.size != rows * columns:
            return self._refuse(size, f'the sensor sends {values.size} values a frame, '
                                f'{rows}x{columns} = {rows * columns} are expected')
        low, high = values.min(), values.max()
        if not bounds.min <= low <= high <= bounds.max:
            return self._refuse(size, f'a value of {low if low < bounds.min else high:g} is no '
                                f'{self._kind}: see `bits` and `signed` of the calibration')
        return Piece(size, np.rint(values).astype(self._kind).reshape(self.shape), ticks)

    def _tick(self, ticks: int) -> int | None:
        """Follow the device's clock; return how many frames were skipped, None: unknown."""
        step = 0 if self._ticks is None else (ticks - self._ticks) % self.wrap
        self._ticks = ticks
        if not 0 < step * self.tick_ns <= LONGEST_STEP_NS:
            return None
        self._device_ns += step * self.tick_ns
        missed = round(step / self._step) - 1 if self._step >= LEAST_STEP else 0
        if missed <= 0:
            self._step += (step - self._step) * (0.1 if self._step else 1.0)
        return max(missed, 0)

    def _frame(self, counts: np.ndarray, piece: Piece) -> Frame:
        missed = None if piece.ticks is None else self._tick(piece.ticks)
        if self._gap:
            # Nothing is lost before the first frame. Later, without a device clock, at least the
            # frame that broke the lock is lost.
            if self.frames and missed is None:
                missed = max(round(self._gap / piece.size), 1)
            self._gap = 0
        self.lost_frames += missed or 0
        counts.flags.writeable = False
        frame = Frame(counts, self.frames + self.lost_frames,
                      self._origin - piece.size + self.announced, self._origin,
                      None if piece.ticks is None else self._device_ns)
        self.frames += 1
        self.locked, self._mismatch = True, ''
        return frame

    def _drop(self, count: int) -> None:
        """Discard bytes that belong to no frame."""
        self._take(count)
        self._gap += count
        self.dropped_bytes += count

    def _take(self, count: int) -> None:
        del self._buffer[:count]
        self._origin += count


class PacketDecoder(Decoder):
    """Decoder of packets that start with a preamble and contain their length."""

    PREAMBLE = b''
    HEAD = 0  # bytes up to the end of the length field

    def _scan(self) -> Piece | None:
        at = self._buffer.find(self.PREAMBLE)
        if at != 0:
            # The last bytes may be the begin of a preamble.
            rest = at if at > 0 else len(self._buffer) - len(self.PREAMBLE) + 1
            return Piece(rest, good=False) if rest > 0 else None
        if len(self._buffer) < self.HEAD:
            return None
        size = self._size()
        if not size:
            return Piece(1, good=False)
        if len(self._buffer) < size:
            return None
        return self._parse(bytes(self._buffer[:size])) or Piece(1, good=False, failed=True)

    def _size(self) -> int:
        """Return the length of the packet at the head of the buffer; 0: invalid."""
        raise NotImplementedError

    def _parse(self, packet: bytes) -> Piece | None:
        """Parse a complete packet; None: its checksum or form is wrong."""
        raise NotImplementedError


class Device:
    """The sensor side of a protocol, for the mock sensor; by default it sends without commands."""

    preamble = b''  # sent before the first frame
    running = True  # whether it sends frames

    def encode(self, counts: np.ndarray, time_ns: int = 0) -> bytes:
        """Return the bytes of a frame of counts (rows, columns) at a device time [ns]."""
        raise NotImplementedError

    def answer(self, commands: bytes) -> bytes:
        """Return the device's answer to received bytes."""
        return b''


@dataclass(frozen=True)
class SensorProtocol:
    """Entry of the protocol table; `options` are keyword arguments of decoder and device."""

    decoder: Callable[..., Decoder]  # takes rows, columns, type of the counts
    device: Callable[..., Device]
    baud_rate: int  # [bit/s]
    kind: DTypeLike = np.uint8  # default type of the counts
    shape: tuple[int, int] | None = None  # rows and columns, if the protocol has only one shape
    options: Mapping[str, Any] = field(default_factory=dict)  # name -> default
    calibration: str = ''  # default calibration file of the driver, in `config/`
