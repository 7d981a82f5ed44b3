"""Reading rosbag2 recordings topic by topic; needs rosbags, and no running ROS."""
from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

from rosbags.interfaces import MessageDefinitionFormat
from rosbags.rosbag2 import ReaderError
from rosbags.typesys import (
    get_types_from_idl,
    get_types_from_msg,
    get_typestore,
    Stores,
    TypesysError,
)

from tactile_common.errors import ConfigurationError
from tactile_common.ros.bag_limits import bound_chunks, check_text, check_types
from tactile_common.ros.bag_salvage import open_whole
from tactile_common.ros.cdr import DAMAGE, deserialised, register, stamp_of
from tactile_common.ros.message_definitions import definition, definition_of, SEPARATOR
from tactile_common.yaml_file import read_yaml


class Recorded(NamedTuple):
    """A message of a recording."""

    topic: str
    received_ns: int  # time of its reception
    message: Any  # with the fields of its type; sequences of numbers are numpy arrays


class Bag:
    """
    A rosbag2 recording, a folder or one of its .mcap or .db3 files, open in a `with` statement.

    Messages are read by the definitions in the bag, where it has them, else by the installed
    ones, and one after the other: a bag may be larger than the memory.

    Raises
    ------
    ConfigurationError
        There is no such bag, or it is damaged.
    """

    def __init__(self, path: str | PathLike):
        self.path = Path(path)
        with self.clear_errors():
            bound_chunks()
            if (self.path / 'metadata.yaml').exists():
                read_yaml(self.path / 'metadata.yaml')  # refuses what must not be expanded
            self._reader = open_whole(self.path)
            self._topics = {connection.topic: connection.msgtype
                            for connection in self._reader.connections}
        self._types = get_typestore(Stores.EMPTY)

    def __enter__(self) -> 'Bag':
        return self

    def __exit__(self, *_: Any) -> None:
        self._reader.close()

    @property
    def topics(self) -> dict[str, str]:
        """Message type by topic."""
        return self._topics

    @property
    def span(self) -> tuple[int, int]:
        """When the first and the last message were received [ns]; 0, 0 without any."""
        reader = self._reader
        return (reader.start_time, reader.end_time) if reader.message_count else (0, 0)

    def namespaces(self, types: Mapping[str, str]) -> dict[str, set[str]]:
        """Return what each namespace holds, in order, of some names with their types."""
        found = defaultdict(set)
        for topic, kind in sorted(self.topics.items()):
            prefix, _, name = topic.rpartition('/')
            if name in types and types[name] == kind:
                found[prefix].add(name)
        return dict(found)

    def namespace_of(self, types: Mapping[str, str], wanted: str | None = None) -> str:
        """
        Return the namespace that has all of some names with their types, '' or with its slash.

        ConfigurationError where that wanted lacks one, or none is wanted and several have all.
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
        """Return how many messages of a topic there are."""
        return sum(connection.msgcount for connection in self._reader.connections
                   if connection.topic == topic)

    def messages(self, topics: Collection[str], *, raw: bool = False) -> Iterator[Recorded]:
        """
        Yield the messages of some topics in the order of their reception.

        Topics that the bag lacks are ignored. Of `raw` messages are the bytes, for who sends them
        on. ConfigurationError of a damaged bag: one line with its path and, of a damaged message,
        its topic and time.
        """
        wanted = [connection for connection in self._reader.connections
                  if connection.topic in topics]
        with self.clear_errors():
            for connection in wanted:
                self._learn(connection)
            missing = sum(connection.msgcount for connection in wanted)
            last, silence, where = 0, 0, 0  # of the widest silence, where something may be lost
            for connection, time_ns, data in self._rows(wanted):
                missing -= 1
                if last and time_ns - last > silence:
                    silence, where = time_ns - last, last
                last = time_ns
                row = Recorded(connection.topic, time_ns, data)
                yield row if raw else Recorded(*row[:2], self.unpacked(row))
            if self._reader.cut:
                raise ConfigurationError(self._reader.cut)
            if missing > 0:  # the reader skips what it does not understand
                raise ConfigurationError(
                    f'{missing} messages in it are lost, where it is silent longest from '
                    f'{1e-9 * where:.3f} s on')

    def _rows(self, wanted: list[Any]) -> Iterator[tuple[Any, int, Any]]:
        last = 0
        try:
            for row in self._reader.messages(wanted) if wanted else ():
                last = row[1]
                yield row
        except (OSError, ReaderError, *DAMAGE) as error:
            raise ConfigurationError(
                f'cannot be read on from {1e-9 * last:.3f} s: {_one_line(error)}') from error

    def damaged(self, topic: str, time_ns: int, error: Exception) -> ConfigurationError:
        """Return the error that says in one line which message cannot be read, and why."""
        if isinstance(error, AttributeError):
            return ConfigurationError(
                f'bag {self.path}: messages on {topic} are of another version of '
                f'{self.topics.get(topic)}: they have no field {error.name!r}')
        return ConfigurationError(
            f'bag {self.path}: the message on {topic} at {1e-9 * time_ns:.6f} s is damaged or of '
            f'another kind: {_one_line(error)}')

    def unpacked(self, row: Recorded) -> Any:
        """Return the message of one that was read raw; ConfigurationError where it is damaged."""
        try:
            return deserialised(self._types, self.topics[row.topic], row.message)
        except DAMAGE as error:
            raise self.damaged(row.topic, row.received_ns, error) from error

    def stamp_ns(self, row: Recorded) -> int:
        """Return the stamp of the header that one which was read raw begins with, likewise."""
        try:
            return stamp_of(row.message)
        except DAMAGE as error:
            raise self.damaged(row.topic, row.received_ns, error) from error

    def is_of_type(self, topic: str, kind: type) -> bool:
        """Whether the bytes of a topic are a message class as installed, so can be sent on."""
        name, text, _ = definition_of(kind)
        if self.topics[topic] != name:
            return False
        with self.clear_errors():
            for connection in self._reader.connections:
                if connection.topic == topic:
                    self._learn(connection)
        there = self._types.fielddefs  # constants, and fields, which alone are sent
        return all(part in there and there[part][1] == fields
                   for part, (_, fields) in get_types_from_msg(text, name).items())

    def _learn(self, connection: Any) -> None:
        name, (kind, text) = connection.msgtype, connection.msgdef
        check_text(name, text)
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
        check_types(types, self._types.fielddefs)
        register(self._types, types)

    @contextmanager
    def clear_errors(self) -> Iterator[None]:
        """Turn whatever a damaged recording raises into a ConfigurationError of one line."""
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
