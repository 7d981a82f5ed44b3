"""Frames of an array in `.npz`, `.npy` and text files, and their conversion to counts."""
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
import math
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_common.npz_stream import (
    ArrayReader,
    chunks_of,
    MAX_WHOLE,
    read_arrays,
    read_table,
    refuse_above,
    scalar,
)
from tactile_sensing.devices.counts import Counts
from tactile_sensing.devices.frame_clock import MAX_RATE

BYTES = Counts(8)
CHUNK = 1024  # frames
TABLES = ('.csv', '.txt')  # endings of text files: a row of numbers is a frame
Shape = tuple[int, int]


class FrameReader:
    """
    Frames in a file; their `shape` is (N, rows, columns) or (N, layers, rows, columns).

    The file is an `.npz` archive with `frames`, an `.npy` array, or a text file with one frame
    per row (see TABLES). If `shape` (rows, columns) is given, flat frames (N, rows * columns) are
    converted to (N, rows, columns). `source` names the origin of the shape in messages. Frames
    are divided by `unit`. Raises a ConfigurationError if the file cannot be read, or has other
    frames.
    """

    def __init__(self, path: str | PathLike, shape: Shape | None = None, source: str = '--shape',
                 unit: float = 1.0):
        self._unit = unit
        table = Path(path).suffix.lower() in TABLES
        reader: Any = read_table(path) if table else ArrayReader(path, 'frames')
        self._chunks = partial(chunks_of, reader) if table else reader.chunks
        there, self.dtype = reader.shape, reader.dtype
        self.shape = there
        if shape and len(there) == 2 and there[1] == math.prod(shape):
            self.shape = there[0], *shape
        elif shape and (len(there) == 2 or there[-2:] != shape):
            raise ConfigurationError(
                f'{path}: frames has shape {there}, {source} says {shape[0]} x {shape[1]} = '
                f'{math.prod(shape)} tactels'
                + '; a single frame is (1, rows, columns)' * (there == shape))
        elif table:
            raise ConfigurationError(
                f'{path}: a row of {there[1]} numbers is a frame: --shape R C says of how many '
                'rows and columns')
        if len(self.shape) not in (3, 4) or 0 in there:
            raise ConfigurationError(
                f'{path}: frames has shape {there}, must be (N, rows, columns) or (N, layers, '
                'rows, columns), none of them 0' + (len(there) == 2) * (
                    '; a single frame is (1, rows, columns); of flat frames, (N, rows*columns), '
                    '--shape R C says rows and columns'))
        if self.dtype.kind not in 'uif':
            raise ConfigurationError(
                f'{path}: frames is of type {self.dtype}, must be of real numbers')

    def chunks(self, rows: int) -> Iterator[np.ndarray]:
        """Yield the frames in order, `rows` at a time; the last chunk may be smaller."""
        for part in self._chunks(rows):
            part = part.reshape(len(part), *self.shape[1:])
            yield part if self._unit == 1.0 else part.astype(np.float64) / self._unit


def read_whole(path: str | PathLike, reader: Any) -> np.ndarray:
    """Return all frames of a reader; raise a ConfigurationError if they are too large."""
    refuse_above(MAX_WHOLE, math.prod(reader.shape) * reader.dtype.itemsize,
                 f'{path}: frames {reader.shape}')
    return np.concatenate([np.array(part) for part in reader.chunks(CHUNK)])


@dataclass(frozen=True, eq=False)
class Recording:
    """
    Frames of one sensor, evenly spaced in time.

    Raises a ConfigurationError if the shape, rate or pitch is impossible.
    """

    frames: np.ndarray  # in the recorder's unit, shape (N, rows, columns); NaN = no tactel
    rate_hz: float  # frames per second [Hz]
    pitch: float | None = None  # distance between tactels [m]; None = unknown

    def __post_init__(self) -> None:
        if self.frames.ndim != 3:
            raise ConfigurationError(
                f'frames has shape {self.frames.shape}, must be (N, rows, columns)')
        if not 0.0 < self.rate_hz <= MAX_RATE:  # NaN fails as well
            raise ConfigurationError(
                f'rate_hz is {self.rate_hz}, must be above 0 and at most {MAX_RATE:g} Hz')
        if self.pitch is not None and not 0.0 < self.pitch < 1.0:
            raise ConfigurationError(f'pitch_m is {self.pitch}, must be between 0 and 1 m')

    @property
    def shape(self) -> tuple[int, int]:
        """Shape of one frame, `(rows, columns)`."""
        return self.frames.shape[1], self.frames.shape[2]

    @property
    def absent(self) -> list[int]:
        """Row-major indices of tactels that do not exist, i.e. are NaN in every frame."""
        return np.flatnonzero(np.isnan(self.frames).all(axis=0)).tolist()

    def counts(self, limits: Counts = BYTES, resolution: float = 1.0) -> tuple[np.ndarray, int]:
        """
        Convert the frames to counts of a sensor with a given range.

        Frames are divided by the resolution, rounded and clipped to the range; NaN becomes 0. The
        second return value is the number of values that were clipped.
        """
        with np.errstate(invalid='ignore'):
            values = np.where(np.isnan(self.frames), 0, np.rint(self.frames / resolution))
        clipped = int(np.count_nonzero(limits.outside(values)))
        return np.clip(values, limits.lowest, limits.highest).astype(limits.dtype), clipped


def stored_scalars(path: str | PathLike, *names: str) -> dict[str, float]:
    """Return the numbers that an `.npz` archive has of these names; other files have none."""
    if Path(path).suffix.lower() in ('.npy', *TABLES):
        return {}
    return {name: scalar(f'{path}: {name}', value)
            for name, value in read_arrays(path, (), names).items()}


def load_recording(path: str | PathLike, rate_hz: float | None = None,
                   shape: Shape | None = None) -> Recording:
    """
    Read an `.npz` archive with `frames` `(N, rows, columns)`, `rate_hz` and optional `pitch_m`.

    An `.npy` array, a text file or an archive without a rate needs `rate_hz` [Hz]; flat frames
    need `shape`. Raises a ConfigurationError if the file cannot be read, or an array in it is
    missing or impossible.
    """
    try:
        frames = read_whole(path, FrameReader(path, shape))
        stored = stored_scalars(path, 'rate_hz', 'pitch_m')
        if rate_hz is None and 'rate_hz' not in stored:
            raise ConfigurationError("array 'rate_hz' is missing: --rate HZ says it")
        return Recording(frames, stored['rate_hz'] if rate_hz is None else rate_hz,
                         stored.get('pitch_m'))
    except ConfigurationError as error:
        where = '' if str(error).startswith(str(path)) else f'{path}: '
        raise ConfigurationError(f'recording {where}{error}') from error
