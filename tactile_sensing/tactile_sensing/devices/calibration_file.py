"""Calibrations as YAML files."""
from dataclasses import fields
from os import PathLike
from typing import Any

import numpy as np
import yaml

from tactile_common.errors import ConfigurationError
from tactile_common.yaml_file import read_yaml
from tactile_sensing.devices.calibration import Calibration, pitch_pair
from tactile_sensing.types.array import TactelArray

_FIELDS = [item for item in fields(Calibration) if item.name not in ('array', 'source')]
_FILE_KEYS = {'rows', 'columns', 'pitch', *(item.name for item in _FIELDS)}


def load_calibration(path: str | PathLike) -> Calibration:
    """
    Read a calibration file.

    The keys of the YAML file are the fields of `Calibration`, with two exceptions: the array is
    given by `rows`, `columns` and `pitch` ([m], one value or x and y), and `dead_tactels` are
    `[row, column]` pairs. Raises a ConfigurationError that names the file if a key is missing,
    unknown or out of bounds.
    """
    try:
        return _from_mapping(read_yaml(path), str(path))
    except ConfigurationError as error:
        raise ConfigurationError(f'calibration {path}: {error}') from error


def save_calibration(calibration: Calibration, path: str | PathLike) -> None:
    """Write a file for `load_calibration`; raise a ConfigurationError if that fails."""
    array = calibration.array
    values: dict = {'rows': array.rows, 'columns': array.columns,
                    'pitch': [float(array.pitch_x), float(array.pitch_y)]}
    for item in _FIELDS:
        value, default = getattr(calibration, item.name), item.default
        if item.name not in ('gain', 'bits') and np.array_equal(value, default):  # type: ignore
            continue
        if isinstance(value, np.ndarray):
            value = _tidy(value)
        elif item.name == 'dead_tactels':
            value = [list(divmod(index, array.columns)) for index in value]
        values[item.name] = list(value) if isinstance(value, tuple) else value
    try:
        with open(path, 'w', encoding='utf-8') as stream:
            stream.write('# Calibration of one array; `found` says how, how well, and what was '
                         'assumed.\n')
            yaml.safe_dump(values, stream, sort_keys=False, width=99, default_flow_style=None)
    except OSError as error:
        raise ConfigurationError(f'calibration {path}: {error.strerror}') from error


def _tidy(values: np.ndarray) -> float | list[list[float]]:
    """Return one number if all are equal, else rows of numbers; rounded to five digits."""
    rows = [[float(f'{value:.5g}') for value in row] for row in values]
    return rows[0][0] if len({value for row in rows for value in row}) == 1 else rows


def _from_mapping(values: Any, source: str) -> Calibration:
    if not isinstance(values, dict):
        raise ConfigurationError('must be a mapping of keys to values')
    unknown = sorted(str(key) for key in set(values) - _FILE_KEYS)
    if unknown:
        raise ConfigurationError(
            f'unknown key {unknown[0]!r}, must be one of {", ".join(sorted(_FILE_KEYS))}')
    for key in ('rows', 'columns', 'pitch', 'gain'):
        if key not in values:
            raise ConfigurationError(f'key {key!r} is missing')
    values = dict(values)
    array = TactelArray(values.pop('rows'), values.pop('columns'),
                        *pitch_pair(values.pop('pitch')))
    dead = _indices(values.pop('dead_tactels', None) or [], array)
    return Calibration(array, dead_tactels=dead, source=source, **values)


def _indices(pairs: Any, array: TactelArray) -> tuple[int, ...]:
    indices = []
    for pair in pairs if isinstance(pairs, list) else [pairs]:
        if (not isinstance(pair, list) or [type(value) for value in pair] != [int, int]
                or not (0 <= pair[0] < array.rows and 0 <= pair[1] < array.columns)):
            raise ConfigurationError(
                f'dead_tactels holds {pair!r}, must be pairs [row, column] below '
                f'[{array.rows}, {array.columns}]')
        indices.append(pair[0] * array.columns + pair[1])
    return tuple(indices)
