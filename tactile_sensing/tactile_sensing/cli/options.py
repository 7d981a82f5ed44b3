"""What commands on frames share: lengths, and frames of counts from files and bags."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tactile_common.command_line import between, reading_bags
from tactile_common.config import checked
from tactile_common.errors import ConfigurationError
from tactile_sensing.devices.frame_file import frame_reader, read_whole, Shape
from tactile_sensing.types.array import PITCH

MAX_SIDE = 1024  # rows or columns
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


def add_shape(arguments: argparse.ArgumentParser) -> None:
    """Add the option that says how flat frames lie."""
    arguments.add_argument(
        '--shape', nargs=2, metavar=('R', 'C'), type=between(1, MAX_SIDE, kind=int),
        help='rows and columns of frames that lie flat: (N, rows*columns), .csv')


def is_bag(path: str) -> bool:
    """Whether a path is that of a bag, and not of an archive of arrays."""
    return Path(path).suffix in BAGS or Path(path).is_dir()


def counts_reader(path: str, shape: Shape | None = None, namespace: str | None = None,
                  source: str = 'the calibration') -> Any:
    """
    Return the reader of frames in counts, (N, rows, columns), of a shape if a source gives one.

    It is a `frame_reader`, or a RecordedCounts of a bag, which has the same `shape` and `chunks`.
    """
    if is_bag(path):
        with reading_bags():
            from tactile_sensing.observations import RecordedCounts
        reader: Any = RecordedCounts(path, namespace)
    else:
        reader = frame_reader(path, shape, source)
    there = reader.shape
    if len(there) != 3 or 0 in there or (shape is not None and there[1:] != shape):
        wanted = f'{shape[0]}, {shape[1]}) as {source} says' if shape else 'rows, columns)'
        raise ConfigurationError(
            f'{path}: frames has shape {there}, must be (N, {wanted}, none of them 0')
    if reader.dtype.kind not in 'uif':
        raise ConfigurationError(f'{path}: frames is of type {reader.dtype}, must be of counts')
    return reader


def read_counts(path: str, shape: Shape | None = None, namespace: str | None = None,
                resolution: float = 1.0, source: str = 'the calibration') -> np.ndarray:
    """
    Return all frames of counts, (N, rows, columns); ConfigurationError if they are too many.

    Frames of a file are divided by the resolution (`Calibration.resolution`); a bag holds counts.
    """
    frames = read_whole(path, counts_reader(path, shape, namespace, source))
    return frames if resolution == 1.0 or is_bag(path) else frames / resolution
