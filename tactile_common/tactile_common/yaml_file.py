"""YAML files of strangers: bounded before anything in them is expanded."""
from collections.abc import Iterable
import os
from typing import Any

import yaml

from tactile_common.errors import ConfigurationError

MAX_BYTES = 1 << 20  # of a file; a table of 256 x 256 numbers has half of it
MAX_NODES = 70_000  # keys, values, lists and mappings of a file
MAX_DEPTH = 32  # of lists and mappings in each other
MAX_SCALAR = 10_000  # characters of one key or value
# The parser in C, where PyYAML has it, is ten times as fast; both refuse the same files.
_Loader: Any = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)


def read_yaml(path: str | os.PathLike) -> Any:
    """
    Return what a YAML file holds: plain Python values.

    Refused are aliases, by which some hundred bytes name more values than a memory holds, and
    files beyond the bounds of this module.

    Raises
    ------
    ConfigurationError
        The file cannot be read, is no YAML or is out of bounds: one line without its name.
    """
    try:
        with open(path, 'rb') as stream:
            raw = stream.read(MAX_BYTES + 1)
    except OSError as error:
        raise ConfigurationError(f'cannot be read: {error.strerror or error}') from error
    if len(raw) > MAX_BYTES:
        raise ConfigurationError(f'has more than {MAX_BYTES} bytes, which is no such file')
    try:
        text = raw.decode('utf-8')
    except UnicodeDecodeError as error:
        raise ConfigurationError('cannot be read: not a text in UTF-8') from error
    try:
        _check(yaml.parse(text, Loader=_Loader))
        return yaml.load(text, Loader=_Loader)
    except ConfigurationError:
        raise
    except (yaml.YAMLError, ValueError, OverflowError, RecursionError) as error:
        reason = ' '.join(str(error).split())
        raise ConfigurationError(f'is not YAML: {reason:.300}') from error


def _check(events: Iterable[yaml.Event]) -> None:
    """Refuse a stream of events before a value is made of it."""
    nodes = depth = 0
    for event in events:
        line = event.start_mark.line + 1
        if isinstance(event, yaml.AliasEvent):
            raise ConfigurationError(
                f'line {line}: alias *{event.anchor}: aliases are refused, write the value out')
        if isinstance(event, yaml.NodeEvent):
            nodes += 1
            if nodes > MAX_NODES:
                raise ConfigurationError(
                    f'line {line}: more than {MAX_NODES} values, which is no such file')
        if isinstance(event, yaml.ScalarEvent) and len(event.value) > MAX_SCALAR:
            raise ConfigurationError(
                f'line {line}: a value of {len(event.value)} characters, at most {MAX_SCALAR} '
                'are allowed')
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        if depth > MAX_DEPTH:
            raise ConfigurationError(
                f'line {line}: more than {MAX_DEPTH} lists or mappings in each other')
