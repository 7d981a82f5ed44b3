"""Reader of rosbag2 recordings by topic; needs rosbags, but no running ROS."""
from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from rosbags.interfaces import MessageDefinitionFormat
from rosbags.rosbag2 import ReaderError
from rosbags.typesys import (
    get_types_from_idl,
    get_types_from_msg,
    get_typestore,
    Stores,
    TypesysError,
)

from tactile_common.errors import ConfigurationError, TactileError
from tactile_common.ros.bag_storage import check_types, MAX_DEFINITION, WholeReader
from tactile_common.ros.cdr import DAMAGE, deserialised, register, stamp_of
from tactile_common.ros.message_definitions import definition, definition_of, SEPARATOR
from tactile_common.yaml_file import read_yaml

AnyBag = TypeVar('AnyBag', bound='Bag')


class DamagedMessageError(ConfigurationError):
    """A recorded message cannot be read; the text names bag, topic and time."""


class Recorded(NamedTuple):
    """A message of a recording; the properties raise a DamagedMessageError if it is damaged."""

    topic: str
    received_ns: int  # time of reception
    data: bytes  # serialised
    bag: 'Bag'

    @property
    def message(self) -> Any:
        """Fields of its type, decoded now; sequences of numbers are numpy arrays."""
        with self.reading():
            return deserialised(self.bag.types, self.bag.topics[self.topic], self.data)

    @property
    def stamp_ns(self) -> int:
        """Stamp of its header."""
        with self.reading():
            return stamp_of(self.data)

    @contextmanager
    def reading(self) -> Iterator[None]:
        """Name this message in the errors of a block that reads it."""
        try:
            yield
        except DamagedMessageError:  # of a block within this one
            raise
        except (TactileError, *DAMAGE) as error:
            path, topic, at = self.bag.path, self.topic, 1e-9 * self.received_ns
            if isinstance(error, AttributeError):
                raise DamagedMessageError(
                    f'bag {path}: messages on {topic} are of another version of '
                    f'{self.bag.topics[topic]}: they have no field {error.name!r}') from error
            raise DamagedMessageError(
                f'bag {path}: the message on {topic} at {at:.6f} s is damaged or of another '
                f'kind: {_one_line(error)}') from error


class Bag:
    """
    A rosbag2 recording: a folder, or one .mcap or .db3 file; use in a `with` statement.

    Messages are decoded with the definitions in the bag, or with the installed ones if the bag has
    none. They are read one by one, so a bag may be larger than memory.

    Raises
    ------
    ConfigurationError
        The bag does not exist or is damaged.
    """

    def __init__(self, path: str | PathLike):
        self.path = Path(path)
        with self.clear_errors():
            if (self.path / 'metadata.yaml').exists():
                read_yaml(self.path / 'metadata.yaml')  # checks the limits before rosbags reads it
            self._reader = WholeReader(self.path)
            self.topics = {connection.topic: connection.msgtype  # message type by topic
                           for connection in self._reader.connections}
        self.types = get_typestore(Stores.EMPTY)

    def __enter__(self: AnyBag) -> AnyBag:
        return self

    def __exit__(self, *_: Any) -> None:
        self._reader.close()

    @property
    def span(self) -> tuple[int, int]:
        """Reception times of the first and last message [ns]; (0, 0) for an empty bag."""
        reader = self._reader
        return (reader.start_time, reader.end_time) if reader.message_count else (0, 0)

    def namespaces(self, types: Mapping[str, str]) -> dict[str, set[str]]:
        """Return for each namespace, in order, which of the given names and types it contains."""
        found = defaultdict(set)
        for topic, kind in sorted(self.topics.items()):
            prefix, _, name = topic.rpartition('/')
            if name in types and types[name] == kind:
                found[prefix].add(name)
        return dict(found)

    def namespace_of(self, types: Mapping[str, str], wanted: str | None = None) -> str:
        """
        Return the namespace that has all named topics with their types: '' or with a slash.

        Raises a ConfigurationError if the wanted namespace lacks a topic. Without a wanted
        namespace, exactly one must have all topics.
        """
        found = [prefix for prefix, names in self.namespaces(types).items()
                 if names == set(types)]
        there = f'there are {sorted(self.topics)}'
        if wanted is not None:
            prefix = f'/{wanted.strip("/")}'.rstrip('/')
            if prefix not in found:
                lacking = ' and '.join(f'{prefix}/{name}' for name in types)
                raise ConfigurationError(f'bag {self.path}: has no {lacking}, {there}')
            return prefix
        if len(found) != 1:
            what = f'{"topics" if len(types) == 1 else "pairs of"} {" and ".join(types)}'
            raise ConfigurationError(
                f'bag {self.path}: has {len(found)} {what}; name one by --namespace; {there}')
        return found[0]

    def count(self, topic: str) -> int:
        """Return the number of messages of a topic."""
        return sum(connection.msgcount for connection in self._reader.connections
                   if connection.topic == topic)

    def messages(self, topics: Collection[str]) -> Iterator[Recorded]:
        """
        Yield the messages of some topics in the order of their reception.

        Topics that the bag lacks are ignored. A damaged bag raises a ConfigurationError of one
        line with its path.
        """
        wanted = [connection for connection in self._reader.connections
                  if connection.topic in topics]
        with self.clear_errors():
            for connection in wanted:
                self._learn(connection)
            missing, time_ns = sum(connection.msgcount for connection in wanted), 0
            try:
                for connection, time_ns, data in (
                        self._reader.messages(wanted) if wanted else ()):
                    missing -= 1
                    yield Recorded(connection.topic, time_ns, data, self)
            except (OSError, ReaderError, *DAMAGE) as error:
                raise ConfigurationError(
                    f'cannot be read on from {1e-9 * time_ns:.3f} s: {_one_line(error)}'
                ) from error
            if self._reader.cut:
                raise ConfigurationError(self._reader.cut)
            if missing > 0:  # the reader skips records that it does not understand
                raise ConfigurationError(f'{missing} messages in it are lost')

    def is_of_type(self, topic: str, kind: type) -> bool:
        """Return True if a topic has the installed message class: its bytes can be forwarded."""
        known = definition_of(kind)
        if self.topics[topic] != known.name:
            return False
        with self.clear_errors():
            for connection in self._reader.connections:
                if connection.topic == topic:
                    self._learn(connection)
            return self.types.hash_rihs01(known.name) == known.digest

    def _learn(self, connection: Any) -> None:
        name, (kind, text) = connection.msgtype, connection.msgdef
        if len(text) > MAX_DEFINITION:
            raise ConfigurationError(f'the definition of {name} has {len(text)} characters, at '
                                     f'most {MAX_DEFINITION} are read')
        if kind == MessageDefinitionFormat.NONE:
            types = get_types_from_msg(definition(name).text, name)
        elif kind == MessageDefinitionFormat.MSG:
            types = get_types_from_msg(text, name)
        else:
            types = {}
            for part in text.split(f'{SEPARATOR}\n'):
                body = part.split('\n', 1)[1] if part.startswith('IDL: ') else part
                if body.strip():
                    types |= get_types_from_idl(body)
        check_types(types)
        register(self.types, types)

    @contextmanager
    def clear_errors(self) -> Iterator[None]:
        """Convert any error of a damaged recording into a ConfigurationError of one line."""
        try:
            yield
        except ConfigurationError as error:
            where = '' if str(error).startswith('bag ') else f'bag {self.path}: '
            raise ConfigurationError(f'{where}{error}') from error
        except FileNotFoundError as error:
            missing = 'has no metadata.yaml' if self.path.is_dir() else 'there is no such bag'
            raise ConfigurationError(f'bag {self.path}: {missing}') from error
        except (OSError, ReaderError, TypesysError, *DAMAGE) as error:
            raise ConfigurationError(
                f'bag {self.path}: is not a rosbag2 recording: {_one_line(error)}') from error


def _one_line(error: Exception) -> str:
    return f'{" ".join(str(error).split()) or type(error).__name__:.200}'
