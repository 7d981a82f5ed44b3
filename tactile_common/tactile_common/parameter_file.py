"""Reader of ROS 2 parameter files without ROS: sections by node names, with wildcards."""
from collections.abc import Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, nullcontext
import os
import re
from typing import Any, NamedTuple

from tactile_common.config import built, did_you_mean, leaves
from tactile_common.errors import ConfigurationError, naming
from tactile_common.yaml_file import read_yaml

# Parameters that every node has.
OF_ROS = ('use_sim_time', 'qos_overrides', 'start_type_description_service')


class Parameter(NamedTuple):
    """A parameter with its default and the type and metadata of its dataclass field."""

    name: str
    default: Any
    kind: Any
    metadata: Mapping


def parameters_of(configs: Iterable[type]) -> list[Parameter]:
    """Return every parameter that a node declares from dataclasses."""
    return [Parameter(*leaf) for config in configs for leaf in leaves(config)]


class ParameterFile:
    """
    Sections of a parameter file, in their order.

    Parameters
    ----------
    path : path-like, optional
        Without a path there are no sections.

    Raises
    ------
    ConfigurationError
        The file cannot be read, is not YAML, or has another structure.
    """

    def __init__(self, path: str | os.PathLike | None = None):
        self.path = path
        with self._naming():
            self.sections = [] if path is None else list(_sections(read_yaml(path), ''))

    def _naming(self, *part: str) -> AbstractContextManager:
        """Name the file, if any, and a part of it in errors."""
        return nullcontext() if self.path is None else naming(
            ': '.join((f'parameter file {self.path}', *part)))

    def values(self, node: str) -> dict[str, Any]:
        """Return the parameters for a node by its full name, such as `/tactile/driver`."""
        return {key: value for section, values in self.sections if matches(section, node)
                for key, value in values.items()}

    def config(self, node: str, config: type, given: Mapping[str, Any] | None = None) -> Any:
        """Build a node's configuration; `given` overrides the file; raises ConfigurationError."""
        with self._naming(node):
            return built(config, {**self.values(node), **(given or {})})

    def refuse_unknown(self, section: str, values: Iterable[str], known: Iterable[str]) -> None:
        """Raise a ConfigurationError if a parameter of a section is unknown."""
        with self._naming(section):
            refuse_unknown(values, known)


def refuse_unknown(names: Iterable[str], known: Iterable[str]) -> None:
    """Raise a ConfigurationError, with the nearest known name, if a parameter is unknown."""
    known = set(known)
    for name in names:
        if name not in known and name.split('.')[0] not in OF_ROS:
            raise ConfigurationError(f'no parameter {name}{did_you_mean(name, known)}')


def _sections(tree: Any, name: str) -> Iterator[tuple[str, dict[str, Any]]]:
    if not isinstance(tree, dict) or not tree:
        raise ConfigurationError(f"{name or 'the whole'}: must be a mapping of names of nodes to "
                                 "'ros__parameters' and these to values")
    for key, value in tree.items():
        if key == 'ros__parameters' and name:
            if not isinstance(value, dict):
                raise ConfigurationError(f'{name}: ros__parameters must be a mapping')
            with naming(name):
                values = dict(_flat(value))
            yield name, values
        else:
            yield from _sections(value, '/'.join((name, str(key).strip('/'))))


def _flat(tree: Mapping, prefix: str = '') -> Iterator[tuple[str, Any]]:
    for key, value in tree.items():
        if isinstance(value, dict):
            yield from _flat(value, f'{prefix}{key}.')
        elif isinstance(value, list) and len({type(item) for item in value}) > 1:
            raise ConfigurationError(  # as ROS does
                f'{prefix}{key} is {value!r:.60}, must have items of one type: in a list of '
                'numbers, write 0.0 for 0')
        else:
            yield f'{prefix}{key}', value


def matches(section: str, node: str) -> bool:
    """Return True if a section name with wildcards * (one part) and ** (any) matches a node."""
    parts = {'**': '(/[^/]+)*', '*': '/[^/]+'}
    pattern = ''.join(parts.get(part, f'/{re.escape(part)}') for part in section[1:].split('/'))
    return re.fullmatch(pattern, node) is not None
