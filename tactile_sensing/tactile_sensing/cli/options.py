"""What commands on frames share: options with bounds, counts from files, errors of one line."""

from collections.abc import Callable, Sequence
import math
import sys

import numpy as np

from tactile_common.errors import ConfigurationError, TactileError
from tactile_common.npz_stream import ArrayReader

MAX_LENGTH = 0.1  # m; a larger pitch or depth was meant in millimetres
MAX_CHUNK = 1024  # frames


def number(name: str, text: str, low: float, high: float, unit: str) -> float:
    """Return the number in a text, at least `low` and below `high`."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not low <= value < high:
        raise ConfigurationError(
            f'{name} is {text!r}, must be a number of at least {low:g} and below {high:g} {unit}')
    return value


def length(name: str, text: str) -> float:
    """Return the length in a text [m]."""
    return number(name, text, 1e-9, MAX_LENGTH, 'm')


def whole(name: str, text: str, low: int, high: int) -> int:
    """Return the integer in a text, between two bounds, both allowed."""
    try:
        value = int(text)
    except ValueError:
        value = low - 1
    if not low <= value <= high:
        raise ConfigurationError(f'{name} is {text!r}, must be an integer from {low} to {high}')
    return value


def pitch_of(texts: Sequence[str]) -> tuple[float, float]:
    """Return the pitch along x and along y [m] of one text or two."""
    if len(texts) > 2:
        raise ConfigurationError(f'--pitch takes one length or two, not {len(texts)}')
    pitch = [length('--pitch', text) for text in texts]
    return pitch[0], pitch[-1]


def counts_reader(path: str, shape: tuple[int, int] | None = None) -> ArrayReader:
    """Return the reader of frames in counts, (N, rows, columns), of a shape if one is given."""
    reader = ArrayReader(path, 'frames')
    there = reader.shape
    if len(there) != 3 or 0 in there or (shape is not None and there[1:] != shape):
        wanted = f'{shape[0]}, {shape[1]}) as the calibration says' if shape else 'rows, columns)'
        raise ConfigurationError(
            f'{path}: frames has shape {there}, must be (N, {wanted}, none of them 0')
    if reader.dtype.kind not in 'uif':
        raise ConfigurationError(f'{path}: frames is of type {reader.dtype}, must be of counts')
    return reader


def read_all(reader: ArrayReader) -> np.ndarray:
    """Return all rows of an array."""
    return np.concatenate([np.array(part) for part in reader.chunks(MAX_CHUNK)])


def run_command(name: str, run: Callable[[], str]) -> int:
    """Say what a command did, or in one line what is wrong with what it was given."""
    try:
        print(run(), file=sys.stderr)
    except (TactileError, OSError) as error:
        print(f'{name}: {" ".join(str(error).split())}', file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print(f'{name}: interrupted, nothing written', file=sys.stderr)
        return 130
    return 0
