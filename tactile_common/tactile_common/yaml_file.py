"""Reader of untrusted YAML files, checked against limits before anything is expanded."""
from collections.abc import Iterable
import os
from typing import Any

import yaml

from tactile_common.errors import ConfigurationError

MAX_BYTES = 1 << 20  # of a file; a table of 256 x 256 numbers takes half of it
MAX_NODES = 70_000  # keys, values, lists and mappings of a file
MAX_DEPTH = 32  # nested lists and mappings
MAX_SCALAR = 10_000  # characters of one key or value
# The C parser, if PyYAML has it, is ten times as fast; both refuse the same files.
_Loader: Any = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)


def read_yaml(path: str | os.PathLike) -> Any:
    """
    Return the contents of a YAML file as plain Python values.

    Aliases are refused, because a hundred bytes of them can expand to more values than memory
    holds. Files that exceed the limits of this module are refused too.

    Raises
    ------
    ConfigurationError
        The file cannot be read, is not YAML or exceeds a limit; one line without the file name.
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
    """Refuse a stream of events before any value is made from it."""
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
