"""What commands on frames share: lengths, and frames of counts from files and bags."""

import argparse
from collections.abc import Sequence
import math
from pathlib import Path
from typing import Any

import numpy as np

from tactile_common.command_line import reading_bags
from tactile_common.config import checked
from tactile_common.errors import ConfigurationError
from tactile_common.npz_stream import ArrayReader, MAX_WHOLE
from tactile_sensing.types.array import PITCH

MAX_CHUNK = 1024  # frames
BAGS = ('.mcap', '.db3')  # endings of files that are bags, which may be folders as well


def length(name: str, text: str) -> float:
    """Return the length in a text [m]; ConfigurationError by its name if there is none."""
    try:
        value = float(text)
    except ValueError:
        raise ConfigurationError(f'{name} is {text!r}, must be a number') from None
    return checked(name, value, float, {'range': PITCH, 'unit': 'm'})


def pitch_of(texts: Sequence[str]) -> tuple[float, float]:
    """Return the pitch along x and along y [m] of one text or two."""
    if len(texts) > 2:
        raise ConfigurationError(f'--pitch takes one length or two, not {len(texts)}')
    pitch = [length('--pitch', text) for text in texts]
    return pitch[0], pitch[-1]


def add_pitch(arguments: argparse.ArgumentParser, **kwargs) -> None:
    """Add the option that `pitch_of` reads."""
    arguments.add_argument('--pitch', nargs='+', metavar='M', **kwargs,
                           help='distance between tactels, or along x and along y [m]')


def is_bag(path: str) -> bool:
    """Whether a path is that of a bag, and not of an archive of arrays."""
    return Path(path).suffix in BAGS or Path(path).is_dir()


def counts_reader(path: str, shape: tuple[int, int] | None = None,
                  namespace: str | None = None) -> Any:
    """
    Return the reader of frames in counts, (N, rows, columns), of a shape if one is given.

    It is an ArrayReader, or a RecordedCounts of a bag, which has the same `shape` and `chunks`.
    """
    if is_bag(path):
        with reading_bags():
            from tactile_sensing.observations import RecordedCounts
        reader: Any = RecordedCounts(path, namespace)
    else:
        reader = ArrayReader(path, 'frames')
    there = reader.shape
    if len(there) != 3 or 0 in there or (shape is not None and there[1:] != shape):
        wanted = f'{shape[0]}, {shape[1]}) as the calibration says' if shape else 'rows, columns)'
        raise ConfigurationError(
            f'{path}: frames has shape {there}, must be (N, {wanted}, none of them 0')
    if reader.dtype.kind not in 'uif':
        raise ConfigurationError(f'{path}: frames is of type {reader.dtype}, must be of counts')
    return reader


def read_counts(path: str, shape: tuple[int, int] | None = None,
                namespace: str | None = None) -> np.ndarray:
    """Return all frames of counts, (N, rows, columns); ConfigurationError if they are too many."""
    reader = counts_reader(path, shape, namespace)
    size = math.prod(reader.shape) * reader.dtype.itemsize
    if size > MAX_WHOLE:
        raise ConfigurationError(f'{path}: frames {reader.shape} would take {size / 1e6:.0f} MB, '
                                 f'at most {MAX_WHOLE / 1e6:.0f} MB are read')
    return np.concatenate([np.array(part) for part in reader.chunks(MAX_CHUNK)])
