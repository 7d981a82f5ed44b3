"""Recording topics into a rosbag2 folder with MCAP storage, and reading such bags."""

from collections import deque
from contextlib import contextmanager
from functools import cache
import json
from pathlib import Path
import struct
import threading
from time import time_ns

from ament_index_python.packages import get_package_share_directory
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, LivelinessPolicy, ReliabilityPolicy
from rosbags.interfaces import (
    MessageDefinitionFormat,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import Reader, ReaderError, StoragePlugin, Writer
from rosbags.rosbag2.errors import WriterError
from rosbags.serde import SerdeError
from rosbags.typesys import (
    get_types_from_idl,
    get_types_from_msg,
    get_typestore,
    Stores,
    TypesysError,
)

from tactile_common.errors import ConfigurationError

# Time between two rounds of the writer [s]: long enough that it wakes seldom among callbacks
# that have deadlines, short enough that little is lost if the process dies.
WRITE_PERIOD = 0.1
# What may wait to be written: at 5000 messages per second, six seconds of a disk that stalls.
MAX_WAITING = 30_000

_INFINITE = QosTime(9223372036, 854775807)
_SEPARATOR = '=' * 80


class RecorderNode(Node):
    """
    Record topics as they come over the wire, without deserialising them.

    The callbacks only append to a queue; a thread writes. `ros2 bag info` and `ros2 bag play`
    open the result.

    Parameters
    ----------
    path : str or os.PathLike
        Folder to make.
    topics : list of (str, type, QoSProfile)
        Name, message class and quality of service of each topic. The last is also what a
        player will offer.
    max_waiting : int
        Messages that may wait to be written; what comes on top is dropped and counted.
    **kwargs
        Passed to `rclpy.node.Node`.

    Raises
    ------
    ConfigurationError
        The folder exists or cannot be made, or a message type is not installed.
    """

    def __init__(self, path, topics, *, max_waiting=MAX_WAITING, **kwargs):
        self._closed = threading.Event()
        self._waiting = deque()
        self._max_waiting = max_waiting
        self.written = self.dropped = 0
        self._connections = []
        self._writer = _open_writer(path, topics, self._connections)
        self._thread = threading.Thread(target=self._write_forever, name='bag writer')
        super().__init__('recorder', **kwargs)
        for index, (name, message_class, qos) in enumerate(topics):
            self.create_subscription(
                message_class, name, self._callback(index), qos, raw=True)
        self._thread.start()

    def _callback(self, index):
        waiting = self._waiting

        # Of one argument: the events executor cannot pass the message's information along
        # with raw bytes, so the time of reception is taken here. By the system's clock, as
        # `ros2 bag record` does: a Time of rclpy's takes longer to make than all the rest.
        def take(data):
            if len(waiting) < self._max_waiting:
                waiting.append((index, time_ns(), data))
            else:
                self.dropped += 1
        return take

    def close(self):
        """Write what waits and finish the bag; nothing is recorded any more."""
        self._closed.set()
        if self._thread.ident and threading.current_thread() is not self._thread:
            self._thread.join()

    def destroy_node(self):
        """Finish the bag, then destroy the node."""
        self.close()
        super().destroy_node()

    def _write_forever(self):
        try:
            while not self._closed.wait(WRITE_PERIOD):
                self._write_waiting()
            self._write_waiting()
            self._writer.close()
        except (OSError, WriterError) as error:
            self._max_waiting = 0  # from here on everything is dropped
            self._writer.abort()
            self.get_logger().error(f'recording ended early: {error}')
        if self.dropped:
            self.get_logger().warning(f'{self.dropped} messages were not recorded')

    def _write_waiting(self):
        while self._waiting:
            index, time, data = self._waiting.popleft()
            self._writer.write(self._connections[index], time, data)
            self.written += 1


def _open_writer(path, topics, connections):
    path = Path(path)
    described = [describe_type(message_class) for _, message_class, _ in topics]
    try:
        writer = Writer(path, version=9, storage_plugin=StoragePlugin.MCAP)
        writer.open()
    except WriterError as error:
        raise ConfigurationError(
            f'recording {path}: exists already; give the name of a new folder') from error
    except OSError as error:
        raise ConfigurationError(
            f'recording {path}: cannot be made: {error.strerror or error}') from error
    for (name, _, qos), (message_type, definition, digest) in zip(
            topics, described, strict=True):
        connections.append(writer.add_connection(
            name, message_type, msgdef=definition, rihs01=digest,
            offered_qos_profiles=[_offered(qos)]))
    return writer


# --- message definitions ------------------------------------------------------------------------

def describe_type(message_class):
    """
    Return what a recording must say of a message class.

    Returns
    -------
    name : str
        Type, for instance 'std_msgs/msg/Header'.
    definition : str
        Its .msg file and those of all types in it, comments included.
    digest : str
        Hash of the type, RIHS01.

    Raises
    ------
    ConfigurationError
        The files of the type are not installed.
    """
    package = message_class.__module__.split('.')[0]
    return _describe_type(f'{package}/msg/{message_class.__name__}')


@cache
def _describe_type(name):
    try:
        description = json.loads(_interface_file(name, 'json').read_text(encoding='utf-8'))
        inner = [part['type_name'] for part in
                 description['type_description_msg']['referenced_type_descriptions']]
        digest = next(entry['hash_string'] for entry in description['type_hashes']
                      if entry['type_name'] == name)
        texts = [_interface_file(part, 'msg').read_text(encoding='utf-8')
                 for part in (name, *inner)]
    except (OSError, LookupError, ValueError, StopIteration) as error:
        raise ConfigurationError(f'message type {name}: is not installed: {error}') from error
    definition = texts[0] + ''.join(
        f'\n{_SEPARATOR}\nMSG: {part.replace("/msg/", "/")}\n{text}'
        for part, text in zip(inner, texts[1:], strict=True))
    return name, definition, digest


def _interface_file(name, suffix):
    package, folder, stem = name.split('/')
    return Path(get_package_share_directory(package), folder, f'{stem}.{suffix}')


def _offered(qos):
    """Return the quality of service that a player has to offer, as rosbags writes it."""
    keep_all = qos.history == HistoryPolicy.KEEP_ALL
    best_effort = qos.reliability == ReliabilityPolicy.BEST_EFFORT
    latched = qos.durability == DurabilityPolicy.TRANSIENT_LOCAL
    by_topic = qos.liveliness == LivelinessPolicy.MANUAL_BY_TOPIC
    return Qos(
        QosHistory.KEEP_ALL if keep_all else QosHistory.KEEP_LAST,
        qos.depth,
        QosReliability.BEST_EFFORT if best_effort else QosReliability.RELIABLE,
        QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE,
        _INFINITE, _INFINITE,
        QosLiveliness.MANUAL_BY_TOPIC if by_topic else QosLiveliness.AUTOMATIC,
        _INFINITE,
        qos.avoid_ros_namespace_conventions,
    )


# --- reading ------------------------------------------------------------------------------------

class Bag:
    """
    A rosbag2 recording, open for reading; made by `open_bag`, use it in a `with` statement.

    Messages are read by the definitions in the bag, where it has them, else by the installed
    ones.
    """

    def __init__(self, path):
        self.path = Path(path)
        with _clear_errors(self.path):
            self._reader = Reader(self.path)
            self._reader.open()
        self._types = get_typestore(Stores.EMPTY)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._reader.close()

    @property
    def topics(self) -> dict:
        """Message type by topic."""
        return {connection.topic: connection.msgtype for connection in self._reader.connections}

    def messages(self, topics):
        """
        Yield the messages of some topics in the order of their reception.

        Parameters
        ----------
        topics : collection of str
            Topics of the bag; others are ignored.

        Yields
        ------
        topic : str
        received_ns : int
            Time of reception [ns].
        message : object
            With the fields of the type; sequences of numbers are numpy arrays.

        Raises
        ------
        ConfigurationError
            The bag is damaged.
        """
        wanted = [connection for connection in self._reader.connections
                  if connection.topic in topics]
        if not wanted:
            return
        with _clear_errors(self.path):
            for connection in wanted:
                self._learn(connection)
            missing = sum(connection.msgcount for connection in wanted)
            for connection, time, data in self._reader.messages(wanted):
                missing -= 1
                yield connection.topic, time, self._deserialise(data, connection.msgtype)
            if missing > 0:  # the reader skips what it does not understand
                raise ReaderError(f'{missing} messages in it are lost')

    def _deserialise(self, data, name):
        # Not by deserialize_cdr, which refuses what middlewares do with empty sequences of
        # doubles at the end of a message: bytes without meaning after the last value.
        if len(data) < 4 or bytes(data[:2]) not in (b'\x00\x00', b'\x00\x01'):
            raise SerdeError(f'a message of {name} is not in CDR')
        definition = self._types.get_msgdef(name)
        read = definition.deserialize_cdr_le if data[1] else definition.deserialize_cdr_be
        return read(data[4:], 0, definition.cls, self._types)[0]

    def _learn(self, connection):
        name, (kind, text) = connection.msgtype, connection.msgdef
        if kind == MessageDefinitionFormat.NONE:
            types = get_types_from_msg(_describe_type(name)[1], name)
        elif kind == MessageDefinitionFormat.MSG:
            types = get_types_from_msg(text, name)
        else:
            types = {}
            for part in text.split(f'{_SEPARATOR}\n'):
                body = part.split('\n', 1)[1] if part.startswith('IDL: ') else part
                if body.strip():
                    types |= get_types_from_idl(body)
        self._types.register({name: fields for name, fields in types.items()
                              if name not in self._types.fielddefs})


@contextmanager
def _clear_errors(path):
    """Turn whatever a damaged recording raises into one line."""
    try:
        yield
    except ConfigurationError:
        raise
    except FileNotFoundError as error:
        missing = 'has no metadata.yaml' if Path(path).is_dir() else 'there is no such bag'
        raise ConfigurationError(f'bag {path}: {missing}') from error
    except (OSError, ReaderError, SerdeError, TypesysError, struct.error, LookupError,
            TypeError, ValueError, OverflowError) as error:
        text = ' '.join(str(error).split()) or type(error).__name__
        raise ConfigurationError(
            f'bag {path}: is not a rosbag2 recording: {text:.200}') from error


def open_bag(path) -> Bag:
    """
    Open a rosbag2 recording: a folder, or one of its .mcap or .db3 files.

    Raises
    ------
    ConfigurationError
        There is no such bag.
    """
    return Bag(path)
