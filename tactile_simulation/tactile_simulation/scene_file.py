"""Reader of scene files: checks mappings and numbers, and names the wrong ones in errors."""
from collections.abc import Collection, Mapping
from dataclasses import fields, MISSING
import math
from pathlib import Path
from typing import Any

from tactile_common.config import checked, types_of
from tactile_common.errors import ConfigurationError
from tactile_simulation.sensor import Sensor
from tactile_simulation.world import Plant

MAX_LENGTH = 10.0  # m


def section(tree: Any, name: str, keys: Collection[str],
            optional: Collection[str] = ()) -> dict[str, Any]:
    """Return a mapping after a check: it has all `keys` and no others except `optional` ones."""
    where = f'{name}: ' if name else ''
    if not isinstance(tree, dict):
        raise ConfigurationError(f'{where}is {tree!r:.60}, must be a mapping of {", ".join(keys)}')
    for key in tree:
        if key not in keys and key not in optional:
            raise ConfigurationError(
                f'{where}unknown key {key!r:.60}, must be one of '
                f'{", ".join([*keys, *optional])}')
    for key in keys:
        if key not in tree:
            raise ConfigurationError(f'{where}key {key!r} is missing')
    return tree


def one_of(tree: Any, name: str, kinds: Collection[str]) -> tuple[str, dict[str, Any]]:
    """Return the one key of `kinds` that a mapping has, and the mapping without it."""
    if not isinstance(tree, dict):
        raise ConfigurationError(f'{name}: is {tree!r:.60}, must be a mapping')
    found = [kind for kind in kinds if kind in tree]
    if len(found) != 1:
        raise ConfigurationError(
            f'{name} has {len(found)} of {", ".join(kinds)}, must have exactly one')
    return found[0], {key: value for key, value in tree.items() if key != found[0]}


def number(name: str, value: Any) -> float | int:
    """Return a number of a file; infinite if it is too large."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        # YAML 1.1 reads 2e5 as a text.
        hint = ' (write an exponent like 2.0e+5)' if _isnumber(value) else ''
        raise ConfigurationError(f'{name} is {value!r:.60}, must be a number{hint}')
    return math.inf if abs(value) >= 1e300 else value


def _isnumber(value):
    try:
        return isinstance(value, str) and math.isfinite(float(value))
    except ValueError:
        return False


def within(name: str, value: Any, low: float, high: float, unit: str = 'm') -> float:
    """Return a number of a file after a check of its bounds, both allowed."""
    return checked(name, float(number(name, value)), float, {'range': (low, high), 'unit': unit})


def place(name: str, value: Any) -> tuple[float, float, float]:
    """Return a list [x, y, z] of a file [m]."""
    if not isinstance(value, list) or len(value) != 3:
        raise ConfigurationError(f'{name} is {value!r}, must be a list [x, y, z] [m]')
    x, y, z = (within(f'{name}.{axis}', item, -MAX_LENGTH, MAX_LENGTH)
               for axis, item in zip('xyz', value, strict=True))
    return x, y, z


def numbers(tree: Any, name: str, kind: type) -> dict[str, Any]:
    """Return the numbers of a section; those with a default in the dataclass may be missing."""
    needed = {item.name for item in fields(kind) if item.default is MISSING}
    keys = [item.name for item in fields(kind)]
    values = section(tree, name, [key for key in keys if key in needed],
                     [key for key in keys if key not in needed])
    return {key: float(number(f'{name}.{key}', value)) if types_of(kind)[key] is float
            else number(f'{name}.{key}', value) for key, value in values.items()}


def part(values: Mapping[str, Any], name: str, kind: type) -> Any:
    """Return the dataclass of a section that may be missing."""
    return kind(**numbers(values.get(name, {}), name, kind))


def common(values: Mapping[str, Any], path: Path, sensor: Sensor) -> dict[str, Any]:
    """Return the fields of a scene that do not depend on the touched object."""
    for key in ('name', 'description'):
        if not isinstance(values[key], str) or not values[key].strip():
            raise ConfigurationError(f'{key} is {values[key]!r}, must be a text')
    calibration = values.get('calibration')
    if calibration is not None:
        if not isinstance(calibration, str) or not (path.parent / calibration).is_file():
            raise ConfigurationError(f'calibration is {calibration!r:.60}, must be a file, named '
                                     'from the folder of the scene')
        calibration = path.parent / calibration
    return {'name': values['name'], 'description': ' '.join(values['description'].split()),
            'sensor': sensor, 'plant': part(values, 'plant', Plant), 'calibration': calibration}
