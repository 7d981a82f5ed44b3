"""What a byte protocol of a sensor has to offer: bytes in, frames out, no input or output."""
from collections.abc import Callable
from dataclasses import dataclass
import enum
from typing import Protocol

import numpy as np


class Signal(enum.Enum):
    """What `Decoder.next_event` returns beside events."""

    NEED_DATA = 'need data'


#: Returned by `Decoder.next_event` when it has seen all that was received.
NEED_DATA = Signal.NEED_DATA


@dataclass(frozen=True, eq=False)
class Frame:
    """One picture."""

    counts: np.ndarray  # raw values, shape (rows, columns), integers, read-only
    sequence: int  # frames before this one, with an estimate of the lost ones
    first_byte: int  # position of its first byte among all that the decoder has received
    end: int  # position behind its last byte


@dataclass(frozen=True)
class Resync:
    """The decoder is in lock again after bytes that belong to no frame."""

    dropped_bytes: int  # passed over since the last frame


class Decoder(Protocol):
    """
    Turns received bytes into frames.

    `receive_data` only buffers and `next_event` parses; call it until it returns `NEED_DATA`.
    Then at most `buffer_bound` bytes are held, whatever was received.
    """

    frames: int  # this and the next three: counted since the start
    lost_frames: int  # may be an estimate
    resyncs: int
    dropped_bytes: int
    locked: bool  # whether the byte stream is understood at the moment
    buffer_bound: int

    @property
    def buffered(self) -> int:
        """Bytes that are held at the moment."""
        ...

    def receive_data(self, data: bytes) -> None:
        """Append what came from the port."""
        ...

    def next_event(self) -> Frame | Resync | Signal:
        """Return the next event, or `NEED_DATA`."""
        ...

    def reset(self) -> None:
        """Forget the buffer and the lock, as after the port was opened anew; counters stay."""
        ...

    def explain(self, sample: bytes) -> str:
        """Say what is wrong with bytes that make no frame; empty if that does not show."""
        ...


@dataclass(frozen=True)
class SensorProtocol:
    """One row of `registry.PROTOCOLS`."""

    # Of an array of so many rows and columns, and the type of its counts (default np.uint8).
    decoder: Callable[..., Decoder]
    encode: Callable[[np.ndarray], bytes]  # counts (rows, columns): what a device sends for them
    preamble: bytes  # what a device sends before its first picture
    baud_rate: int  # [bit/s]
    calibration: str  # name of the file in `config/` that a driver takes where none is given
