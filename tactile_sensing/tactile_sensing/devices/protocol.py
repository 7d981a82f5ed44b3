"""Byte protocols of sensors: bytes in, frames and events out; no input or output."""
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
import enum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike

from tactile_common.errors import ConfigurationError


class Signal(enum.Enum):
    """What `Decoder.next_event` returns beside events."""

    NEED_DATA = 'need data'


LEAST_STEP = 4  # ticks from frame to frame that show whether one is missing
LONGEST_STEP_NS = 10_000_000_000  # beyond which the device's clock has begun anew

#: Returned by `Decoder.next_event` when it has seen all that was received.
NEED_DATA = Signal.NEED_DATA


@dataclass(frozen=True, eq=False)
class Frame:
    """One image, as raw counts."""

    counts: np.ndarray  # shape (rows, columns), integers, read-only
    sequence: int  # frames before this one, with an estimate of the lost ones
    first_byte: int  # position of its first byte among all that the decoder has received
    end: int  # position behind its last byte
    device_ns: int | None = None  # time of the device's own clock, without its wrapping [ns]


@dataclass(frozen=True)
class Resync:
    """The decoder is in lock again after bytes that belong to no frame."""

    dropped_bytes: int  # passed over since the last frame


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

    `receive_data` only buffers and `next_event` parses; call it until it returns `NEED_DATA`.
    Then at most `buffer_bound` bytes are held, whatever was received. Raises a
    ConfigurationError where a size is not a positive integer.

    Attributes
    ----------
    frames, lost_frames, resyncs, dropped_bytes, check_errors : int
        Counted since the start; lost frames by the device's clock, or by the dropped bytes.
    locked : bool
        Whether the byte stream is understood at the moment.
    shape : (int, int)
        Rows and columns.
    temperature : float or None
        Where the device reports one [degrees Celsius].
    """

    buffer_bound = 0
    tick_ns, wrap = 1, 1 << 32  # of the device's clock: unit, and where it starts again
    temperature: float | None = None

    def __init__(self, rows: int, columns: int, kind: DTypeLike = np.uint8):
        for name, value in (('rows', rows), ('columns', columns)):
            if not isinstance(value, int) or value < 1:
                raise ConfigurationError(f'{name} is {value!r}, must be an integer of at least 1')
        self.shape, self._kind = (rows, columns), np.dtype(kind)
        self.frames = self.lost_frames = self.resyncs = 0
        self.dropped_bytes = self.check_errors = 0
        self.locked = False
        self._buffer = bytearray()
        self._origin = 0  # position of the buffer in the stream
        self._device_ns, self._step = 0, 0.0  # its clock; usual ticks from frame to frame
        self._mismatch = ''
        self._waiting: Frame | None = None  # behind the event that was returned before it
        self._ticks: int | None = None  # of the last frame
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
        self.dropped_bytes += len(self._buffer)
        self._take(len(self._buffer))
        self._begin()

    def next_event(self) -> Frame | Resync | Reply | Signal:
        """Return the next event, or `NEED_DATA`."""
        if self._waiting is not None:
            frame = self._waiting
            self._waiting = None
            return frame
        while (piece := self._scan()) is not None:
            if not piece.good:
                self.locked = False
                self.check_errors += piece.failed
                self._drop(piece.size)
                continue
            self._take(piece.size)
            if piece.counts is not None:
                missed = None if piece.ticks is None else self._tick(piece.ticks)
                resync = self._resync(piece.size, missed) if self._gap else None
                if missed and resync is None:
                    self.lost_frames += missed
                frame = self._frame(piece.counts, self._origin - piece.size,
                                    None if piece.ticks is None else self._device_ns)
                if resync is None:
                    return frame
                self._waiting = frame
                return resync
            if piece.reply is not None:
                return piece.reply
        return NEED_DATA

    def explain(self) -> str:
        """Say what is wrong with bytes that make no frame; empty if that does not show."""
        return self._mismatch

    def _scan(self) -> Piece | None:
        """Return what is at the head of the buffer; None: more bytes are needed."""
        raise NotImplementedError

    def _begin(self):
        """Start as with a port that was just opened."""
        self._gap = 0  # bytes passed over since the last frame
        self._waiting = self._ticks = None
        self.locked = False

    def _refuse(self, count, most):
        """Keep why values make no frame: how many, and the largest one."""
        rows, columns = self.shape
        if count != rows * columns:
            self._mismatch = (f'the sensor sends {count} values a frame, {rows}x{columns} = '
                              f'{rows * columns} are expected')
        else:
            self._mismatch = f'a value of {most:g} is no {self._kind}: see `bits` and `signed`'

    def _tick(self, ticks):
        """Follow the device's clock; returns how many frames it skipped, None: not known."""
        step = 0 if self._ticks is None else (ticks - self._ticks) % self.wrap
        self._ticks = ticks
        if not 0 < step * self.tick_ns <= LONGEST_STEP_NS:
            return None
        self._device_ns += step * self.tick_ns
        missed = round(step / self._step) - 1 if self._step >= LEAST_STEP else 0
        if missed <= 0:
            self._step += (step - self._step) * (0.1 if self._step else 1.0)
        return max(missed, 0)

    def _frame(self, counts, first, device_ns=None):
        counts.flags.writeable = False
        frame = Frame(
            counts, self.frames + self.lost_frames, first, self._origin, device_ns)
        self.frames += 1
        self.locked = True
        return frame

    def _resync(self, period, missed=None):
        # Nothing is lost before the first frame; afterwards, where no clock tells, at least the
        # one that broke the lock.
        if self.frames:
            self.lost_frames += max(round(self._gap / period), 1) if missed is None else missed
        self.resyncs += 1
        event = Resync(self._gap)
        self._gap = 0
        return event

    def _drop(self, count):
        """Pass over bytes that belong to no frame."""
        if count > 0:
            self._take(count)
            self._gap += count
            self.dropped_bytes += count

    def _take(self, count):
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

    def _scan(self):
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


def no_command(rate: float, **_: Any) -> bytes:
    """Return the command of a device that needs none."""
    return b''


@dataclass(frozen=True)
class SensorProtocol:
    """One row of the table of protocols; `options` are keyword arguments of its callables."""

    decoder: Callable[..., Decoder]  # of rows, columns, type of the counts
    device: Callable[..., Device]
    baud_rate: int  # [bit/s]
    highest: int = 255  # count that it can carry
    lowest: int = 0
    kind: DTypeLike = np.uint8  # type of counts where nothing else is known
    shape: tuple[int, int] | None = None  # rows and columns where only one array speaks it
    start: Callable[..., bytes] = no_command  # of a rate [Hz]: makes the device send
    stop: Callable[..., bytes] = no_command
    options: Mapping[str, Any] = field(default_factory=dict)  # name -> default
    calibration: str = ''  # file in `config/` that a driver takes where none is given
