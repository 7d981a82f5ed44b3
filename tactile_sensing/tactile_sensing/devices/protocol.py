"""Byte protocols of sensors: bytes in, frames and events out; no input or output."""
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike

from tactile_common.errors import ConfigurationError


@dataclass(frozen=True, eq=False)
class Frame:
    """One image, as raw counts."""

    counts: np.ndarray  # shape (rows, columns), integers, read-only
    sequence: int  # frames before this one, with an estimate of the lost ones
    first_byte: int  # position of its first byte among all that the decoder has received
    end: int  # position behind its last byte
    device_ns: int | None = None  # time of the device's own clock, without its wrapping [ns]


@dataclass(frozen=True)
class Reply:
    """Answer of the device to a command."""

    command: int
    payload: bytes


class Piece(NamedTuple):
    """What a codec finds at the head of its buffer."""

    size: int  # [bytes]
    counts: np.ndarray | None = None  # of a frame, shape (rows, columns)
    ticks: int | None = None  # of the device's clock, see `Decoder.tick_ns`
    reply: Reply | None = None
    good: bool = True  # False: bytes that belong to nothing
    failed: bool = False  # a checksum was wrong


class Decoder:
    """
    Turn received bytes into frames: base of the codecs, which say what a `Piece` is.

    `receive_data` only buffers and `next_event` parses; call it until it returns None. Then at
    most `buffer_bound` bytes are held, whatever was received. Raises a ConfigurationError where a
    size is not a positive integer, or the counts are to be of no integer type.

    `frames`, `lost_frames`, `resyncs`, `dropped_bytes` and `check_errors` are counted since the
    start; lost frames by the device's clock, or by the dropped bytes.
    """

    buffer_bound = 0
    announced = 0  # bytes of a frame that come with the one before
    tick_ns, wrap = 1, 1 << 32  # of the device's clock: unit, and where it starts again
    temperature: float | None = None  # where the device reports one [degrees Celsius]
    locked = False  # whether the byte stream is understood at the moment

    def __init__(self, rows: int, columns: int, kind: DTypeLike = np.uint8):
        for name, value in (('rows', rows), ('columns', columns)):
            if not isinstance(value, int) or value < 1:
                raise ConfigurationError(f'{name} is {value!r}, must be an integer of at least 1')
        self.shape, self._kind = (rows, columns), np.dtype(kind)
        if self._kind.kind not in 'iu':
            raise ConfigurationError(f'kind is {self._kind}, must be a type of integers')
        self.frames = self.lost_frames = self.resyncs = 0
        self.dropped_bytes = self.check_errors = 0
        self._buffer = bytearray()
        self._origin = 0  # position of the buffer in the stream
        self._device_ns, self._step = 0, 0.0  # its clock; usual ticks from frame to frame
        self._mismatch = ''
        self._begin()

    @property
    def buffered(self) -> int:
        """Bytes that are held at the moment."""
        return len(self._buffer)

    def receive_data(self, data: bytes) -> None:
        """Append what came from the port; parsing is left to `next_event`."""
        self._buffer += data

    def reset(self) -> None:
        """Forget the buffer and the lock, as after the port was opened anew; counters stay."""
        self._drop(len(self._buffer))
        self._begin()

    def next_event(self) -> Frame | Reply | None:
        """Return the next event; None: all that was received has been seen."""
        while (piece := self._scan()) is not None:
            if not piece.good:
                self.locked = False
                self.check_errors += piece.failed
                self._drop(piece.size)
                continue
            self._take(piece.size)
            if piece.counts is not None:
                return self._frame(piece.counts, piece)
            if piece.reply is not None:
                return piece.reply
        return None

    def explain(self) -> str:
        """Say what is wrong with bytes that make no frame; empty if that does not show."""
        return self._mismatch

    def start(self, rate: float) -> bytes:
        """Return the command that makes the device send frames at a rate [Hz]."""
        return b''

    def stop(self) -> bytes:
        """Return the command that ends the frames."""
        return b''

    def _scan(self) -> Piece | None:
        """Return what is at the head of the buffer; None: more bytes are needed."""
        raise NotImplementedError

    def _begin(self) -> None:
        """Start as with a port that was just opened."""
        self._gap = 0  # bytes passed over since the last frame
        self._ticks: int | None = None  # of the last frame
        self.locked = False

    def _image(self, values: np.ndarray, size: int, ticks: int | None = None) -> Piece:
        """Piece of a frame's values, if they are as many as tactels and fit their type."""
        (rows, columns), bounds = self.shape, np.iinfo(self._kind)
        low, high = (values.min(), values.max()) if values.size else (0, 0)
        if values.size != rows * columns:
            self._mismatch = (f'the sensor sends {values.size} values a frame, {rows}x{columns} = '
                              f'{rows * columns} are expected')
        elif not bounds.min <= low <= high <= bounds.max:
            self._mismatch = (f'a value of {low if low < bounds.min else high:g} is no '
                              f'{self._kind}: see `bits` and `signed` of the calibration')
        else:
            return Piece(size, np.rint(values).astype(self._kind).reshape(self.shape), ticks)
        return Piece(size, good=False)

    def _tick(self, ticks: int) -> int | None:
        """Follow the device's clock; returns how many frames it skipped, None: not known."""
        step = 0 if self._ticks is None else (ticks - self._ticks) % self.wrap
        self._ticks = ticks
        if not 0 < step * self.tick_ns <= 10_000_000_000:  # else its clock has begun anew
            return None
        self._device_ns += step * self.tick_ns
        # Fewer than four ticks a frame do not show whether one is missing.
        missed = round(step / self._step) - 1 if self._step >= 4 else 0
        if missed <= 0:
            self._step += (step - self._step) * (0.1 if self._step else 1.0)
        return max(missed, 0)

    def _frame(self, counts: np.ndarray, piece: Piece) -> Frame:
        missed = None if piece.ticks is None else self._tick(piece.ticks)
        if self._gap:
            # Nothing is lost before the first frame; afterwards, where no clock tells, at least
            # the one that broke the lock.
            if self.frames and missed is None:
                missed = max(round(self._gap / piece.size), 1)
            self.resyncs += 1
            self._gap = 0
        self.lost_frames += missed or 0
        counts.flags.writeable = False
        frame = Frame(counts, self.frames + self.lost_frames,
                      self._origin - piece.size + self.announced, self._origin,
                      None if piece.ticks is None else self._device_ns)
        self.frames += 1
        self.locked = True
        return frame

    def _drop(self, count: int) -> None:
        """Pass over bytes that belong to no frame."""
        self._take(count)
        self._gap += count
        self.dropped_bytes += count

    def _take(self, count: int) -> None:
        del self._buffer[:count]
        self._origin += count


class PacketDecoder(Decoder):
    """
    Packets that start with a preamble and hold their length.

    A packet that is incomplete while a sound one follows in the buffer is none: its length was
    garbage, and no frame waits for it.
    """

    PREAMBLE = b''
    HEAD = 0  # bytes up to the end of the length

    def _scan(self) -> Piece | None:
        at = self._buffer.find(self.PREAMBLE)
        if at != 0:
            # The last bytes may begin a preamble.
            rest = at if at > 0 else len(self._buffer) - len(self.PREAMBLE) + 1
            return Piece(rest, good=False) if rest > 0 else None
        first = None
        while at >= 0:
            size = self._size(at) if len(self._buffer) >= at + self.HEAD else self.HEAD
            if size <= len(self._buffer) - at:
                piece = self._parse(bytes(self._buffer[at:at + size])) if size else None
                if first is None:
                    return piece or Piece(1, good=False, failed=size > 0)
                if piece is not None and piece.counts is not None:
                    return Piece(at, good=False, failed=True)
            first = at if first is None else first
            at = self._buffer.find(self.PREAMBLE, at + 1)
        return None

    def _size(self, at: int) -> int:
        """Return the length of the packet at a place of the buffer; 0: there is none."""
        raise NotImplementedError

    def _parse(self, packet: bytes) -> Piece | None:
        """Return what a whole packet holds; None where its checksum is wrong."""
        raise NotImplementedError


class Device:
    """The sensor's end of a protocol, as the mock sensor plays it; this one runs free."""

    preamble = b''  # sent before the first frame
    running = True  # whether it sends frames

    def encode(self, counts: np.ndarray, time_ns: int = 0) -> bytes:
        """Return what the device sends for counts (rows, columns) at a time of its clock [ns]."""
        raise NotImplementedError

    def answer(self, commands: bytes) -> bytes:
        """Return what the device answers to received bytes."""
        return b''


@dataclass(frozen=True)
class SensorProtocol:
    """One row of the table of protocols; `options` are keyword arguments of its callables."""

    decoder: Callable[..., Decoder]  # of rows, columns, type of the counts
    device: Callable[..., Device]
    baud_rate: int  # [bit/s]
    kind: DTypeLike = np.uint8  # type of counts where nothing else is known
    shape: tuple[int, int] | None = None  # rows and columns where only one array speaks it
    options: Mapping[str, Any] = field(default_factory=dict)  # name -> default
    calibration: str = ''  # file in `config/` that a driver takes where none is given
