"""
Fields of configuration dataclasses with description, unit and bounds, and their checks.

A field's default is in the dataclass, its bounds are in the field's metadata: `doc`, `unit`,
`range` (smallest and largest value, both allowed), `choices`, `live`, and `name` if users know it
by another name than the field's. A tuple may also have `one_for_all`: a single value is then
accepted in place of a list. `check_fields`, called in `__post_init__`, and the declaration of ROS
parameters both read this metadata.
"""
from collections.abc import Iterable, Iterator, Mapping
import dataclasses
import difflib
from functools import lru_cache
import math
from numbers import Integral, Real
import types
from typing import Any, get_args, get_origin, get_type_hints, NoReturn, Union

import numpy as np

from tactile_common.errors import ConfigurationError

_KINDS = {bool: (bool, 'a boolean'), int: (Integral, 'an integer'), float: (Real, 'a number'),
          str: (str, 'a text')}


def bounded(default: Any, doc: str = '', unit: str = '', low: float = -math.inf,
            high: float = math.inf, *, live: bool = False, **metadata: Any) -> Any:
    """
    Return a dataclass field for numbers between two bounds, both allowed.

    A `live` field can be changed while a node runs: a gain or a speed, never a limit.
    """
    return documented(default, doc, unit, range=(low, high), live=live, **metadata)


def documented(default: Any, doc: str, unit: str = '', **metadata: Any) -> Any:
    """Return a dataclass field without bounds, with more `metadata` if needed."""
    return dataclasses.field(default=default, metadata={'doc': doc, 'unit': unit, **metadata})


def one_of(default: str, doc: str, choices: Iterable[str]) -> Any:
    """Return a dataclass field for one of several texts."""
    return dataclasses.field(default=default, metadata={'doc': doc, 'choices': tuple(choices)})


def check_fields(config: Any, prefix: str = '') -> None:
    """
    Check type and bounds of every field of a dataclass; messages put a prefix before its name.

    The check covers booleans, numbers (an integer is accepted as a number), texts, tuples of
    these, and the type of nested dataclasses. Fields of other types are not checked.

    Raises
    ------
    ConfigurationError
        A field has the wrong type, is outside its `range`, has a `range` but is not finite, or is
        not one of its `choices`. The message contains name, value, bounds and unit, and asks
        whether a length or speed was given in millimetres.
    """
    config_class: Any = type(config)
    kinds = types_of(config_class)
    for field in dataclasses.fields(config_class):
        checked(prefix + field.name, getattr(config, field.name), kinds[field.name],
                field.metadata)


def leaves(config_class: type, prefix: str = '', defaults: Any = None
           ) -> Iterator[tuple[str, Any, Any, Mapping]]:
    """
    Yield name, default, type and metadata of every field, also of nested dataclasses.

    The name is that in the field's metadata, if any. In a nested dataclass it includes the outer
    field's name and a dot, such as `force.max_load`. The values in `defaults`, if given, replace
    the defaults of the fields.
    """
    for field in dataclasses.fields(config_class):
        name = prefix + field.metadata.get('name', field.name)
        kind = types_of(config_class)[field.name]
        default = field.default if defaults is None else getattr(defaults, field.name)
        if callable(field.default_factory) and default is dataclasses.MISSING:
            default = field.default_factory()
        if dataclasses.is_dataclass(kind):
            yield from leaves(kind, f'{name}.', default)  # type: ignore[arg-type]
        else:
            yield name, default, kind, field.metadata


def built(config_class: type, values: Mapping[str, Any], prefix: str = '', defaults: Any = None,
          called: str = '{}') -> Any:
    """
    Make a dataclass from values by the names of its `leaves`; the others have their defaults.

    Every value is `checked`. `called` is the format of its name in messages.
    """
    found = {name: checked(called.format(name), values.get(name, default), kind, metadata)
             for name, default, kind, metadata in leaves(config_class, prefix, defaults)}

    def make(kind: Any, prefix: str) -> Any:
        parts, kinds = {}, types_of(kind)
        for field in dataclasses.fields(kind):
            name, part = prefix + field.metadata.get('name', field.name), kinds[field.name]
            parts[field.name] = make(part, f'{name}.') if dataclasses.is_dataclass(part) else (
                found[name])
        return kind(**parts)
    return make(config_class, prefix)


@lru_cache
def types_of(config_class: type) -> dict[str, Any]:
    """Return the types of the fields of a dataclass by their names."""
    return get_type_hints(config_class)


def checked(name: str, value: Any, kind: Any,
            metadata: Mapping = types.MappingProxyType({})) -> Any:
    """
    Check one value as `check_fields` does, and return it converted to its type.

    `kind` is `bool`, `int`, `float`, `str`, a `tuple` or union of these, or a dataclass. The
    metadata of a tuple apply to its items.
    """
    value = value.item() if isinstance(value, np.generic) else value
    origin = get_origin(kind)
    if origin in (Union, types.UnionType):
        if value is None and type(None) in get_args(kind):
            return None
        kind = next(item for item in get_args(kind) if item is not type(None))
        return checked(name, value, kind, metadata)
    if origin is tuple:
        if metadata.get('one_for_all') and not hasattr(value, '__iter__'):
            value = (value,)
        if isinstance(value, (str, bytes)) or not hasattr(value, '__iter__'):
            _refuse(name, value, 'a list')
        item_kind = get_args(kind)[0]
        return tuple(checked(f'{name}[{k}]', item, item_kind, metadata)
                     for k, item in enumerate(value))
    if kind in _KINDS:
        accepted, expected = _KINDS[kind]
        if not isinstance(value, accepted) or (isinstance(value, bool) and kind is not bool):
            _refuse(name, value, expected)
        try:
            value = kind(value)
        except OverflowError:  # an integer of hundreds of digits
            _refuse(name, value, expected)
    elif dataclasses.is_dataclass(kind) and type(value) is not kind:
        _refuse(name, value, f'a {getattr(kind, "__name__", kind)}')
    low, high = metadata.get('range', (-math.inf, math.inf))
    if 'range' in metadata and not (abs(value) < math.inf and low <= value <= high):
        unit = metadata.get('unit', '')
        _refuse(name, value, _bounds(low, high, unit) + _thousandth(value, low, high, unit))
    if 'choices' in metadata and value not in metadata['choices']:
        _refuse(name, value, f'one of {", ".join(map(str, metadata["choices"]))}')
    return value


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return a question about the known name nearest to a name; empty if none is near."""
    found = difflib.get_close_matches(name, list(known), 1)
    return f'; did you mean {found[0]}?' if found else ''


def _bounds(low: float, high: float, unit: str) -> str:
    if math.isinf(low) and math.isinf(high):
        return 'finite'
    if math.isinf(high):
        return f'finite and at least {low:g} {unit}'.rstrip()
    lowest = f'between {low:g} and' if math.isfinite(low) else 'at most'
    return f'{lowest} {high:g} {unit}'.rstrip()


def _thousandth(value: float, low: float, high: float, unit: str) -> str:
    """Return the question whether a length or speed was given in millimetres."""
    asked = unit.startswith('m') and not low <= value <= high and (
        1e3 * low <= value <= 1e3 * high)
    return f'; did you mean {value / 1e3:g}?' if asked else ''


def _refuse(name: str, value: Any, expected: str) -> NoReturn:
    raise ConfigurationError(f'{name} is {value!r:.60}, must be {expected}')
