"""Reader of untrusted YAML files, checked against limits before anything is expanded."""
from collections.abc import Collection, Iterable
import os
import re
from typing import Any

import yaml

from tactile_common.errors import ConfigurationError

MAX_BYTES = 1 << 20  # of a file; a table of 256 x 256 numbers takes half of it
MAX_NODES = 70_000  # keys, values, lists and mappings of a file
MAX_DEPTH = 32  # nested lists and mappings
# The C parser, if PyYAML has it, is ten times as fast; both refuse the same files.
_Base: Any = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)


class _Loader(_Base):
    """Loader that reads 2e5 as a number, as ROS does; YAML 1.1 reads it as a text."""


_Loader.add_implicit_resolver('tag:yaml.org,2002:float', re.compile(
    r'[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d+$'), list('-+.0123456789'))


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
        if len(raw) > MAX_BYTES:
            raise ConfigurationError(f'has more than {MAX_BYTES} bytes, which is no such file')
        return parse_yaml(raw.decode('utf-8'))
    except OSError as error:
        raise ConfigurationError(f'cannot be read: {error.strerror or error}') from error
    except UnicodeDecodeError as error:
        raise ConfigurationError('cannot be read: not a text in UTF-8') from error


def parse_yaml(text: str) -> Any:
    """Return the values of a YAML text, as `read_yaml` does; raises a ConfigurationError."""
    try:
        _check(yaml.parse(text, Loader=_Loader))
        return yaml.load(text, Loader=_Loader)
    except ConfigurationError:
        raise
    except (yaml.YAMLError, ValueError, OverflowError, RecursionError, LookupError,
            AttributeError) as error:
        reason = ' '.join(str(error).split())
        raise ConfigurationError(f'is not YAML: {reason:.300}') from error


def _check(events: Iterable[yaml.Event]) -> None:
    """Refuse a stream of events before any value is made from it."""
    nodes = depth = 0
    for event in events:
        nodes += isinstance(event, yaml.NodeEvent)
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        if isinstance(event, yaml.AliasEvent):
            reason = f'alias *{event.anchor}: aliases are refused, write the value out'
        elif nodes > MAX_NODES:
            reason = f'more than {MAX_NODES} values, which is no such file'
        elif depth > MAX_DEPTH:
            reason = f'more than {MAX_DEPTH} lists or mappings in each other'
        else:
            continue
        raise ConfigurationError(f'line {event.start_mark.line + 1}: {reason}')


def mapping_of(tree: Any, name: str, keys: Collection[str],
               optional: Collection[str] = ()) -> dict[str, Any]:
    """
    Return a mapping after a check: it has all `keys` and no others except `optional` ones.

    Raises a ConfigurationError that begins with the name of the mapping, if it has one.
    """
    where = f'{name}: ' if name else ''
    if not isinstance(tree, dict):
        raise ConfigurationError(f'{where}is {tree!r:.60}, must be a mapping of {", ".join(keys)}')
    for key in tree:
        if key not in keys and key not in optional:
            raise ConfigurationError(
                f'{where}unknown key {key!r:.60}, must be one of {", ".join([*keys, *optional])}')
    for key in keys:
        if key not in tree:
            raise ConfigurationError(f'{where}key {key!r} is missing')
    return tree
