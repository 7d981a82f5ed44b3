"""Read frames of an array from `.npz`, `.npy` and `.csv` files."""

from collections.abc import Iterator
import math
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_common.npz_stream import ArrayReader, MAX_WHOLE
from tactile_common.table_reader import TableReader

CHUNK = 1024  # frames
Shape = tuple[int, int]


class _Unfolded:
    """Reader that converts flat frames (N, rows * columns) to (N, rows, columns)."""

    def __init__(self, reader: Any, shape: Shape):
        self._reader, self.dtype = reader, reader.dtype
        self.shape = reader.shape[0], *shape

    def chunks(self, rows: int) -> Iterator[np.ndarray]:
        """Yield the frames in order, `rows` at a time; the last chunk may be smaller."""
        for part in self._reader.chunks(rows):
            yield part.reshape(len(part), *self.shape[1:])


def frame_reader(path: str | PathLike, shape: Shape | None = None,
                 source: str = '--shape') -> Any:
    """
    Return a reader of the frames in a file; it has the `shape` and `chunks` of an ArrayReader.

    The file is an `.npz` archive with `frames`, an `.npy` array, or a `.csv` file with one frame
    per row. If `shape` (rows, columns) is given, flat frames (N, rows * columns) are converted to
    (N, rows, columns). `source` names the origin of the shape in messages. Raises a
    ConfigurationError if the file cannot be read or has another shape.
    """
    table = Path(path).suffix == '.csv'
    reader: Any = TableReader(path) if table else ArrayReader(path, 'frames')
    there = reader.shape
    if shape is None:
        if table:
            raise ConfigurationError(
                f'{path}: a row of {there[1]} numbers is a frame: --shape R C says of how many '
                'rows and columns')
        return reader
    if len(there) == 2 and there[1] == math.prod(shape):
        return _Unfolded(reader, shape)
    if len(there) == 2 or there[-2:] != shape:
        raise ConfigurationError(
            f'{path}: frames has shape {there}, {source} says {shape[0]} x {shape[1]} = '
            f'{math.prod(shape)} tactels')
    return reader


def read_whole(path: str | PathLike, reader: Any) -> np.ndarray:
    """Return all frames of a reader; raise a ConfigurationError if they are too large."""
    size = math.prod(reader.shape) * reader.dtype.itemsize
    if size > MAX_WHOLE:
        raise ConfigurationError(f'{path}: frames {reader.shape} would take {size / 1e6:.0f} MB, '
                                 f'at most {MAX_WHOLE / 1e6:.0f} MB are read')
    parts = [np.array(part) for part in reader.chunks(CHUNK)]
    return np.concatenate(parts) if parts else np.empty(reader.shape, reader.dtype)
