"""Recording topics into a rosbag2 folder with MCAP storage, compressed by zstd."""
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
import threading
from time import time_ns
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.qos import DurabilityPolicy, HistoryPolicy, LivelinessPolicy, ReliabilityPolicy
from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.rosbag2.errors import WriterError
from rosbags.rosbag2.storage_mcap import McapWriter, zstd

from tactile_common.errors import ConfigurationError
from tactile_common.ros.message_definitions import definition_of
from tactile_common.ros.node import TactileNode

# Time after which what is written is readable, should the process be killed [s].
CHUNK_PERIOD = 1.0
# Time between two rounds of the writer [s]: long enough that it wakes seldom among callbacks
# that have deadlines, short enough that little is lost if the process dies.
WRITE_PERIOD = 0.1
# What may wait to be written: at 5000 messages per second, six seconds of a disk that stalls.
MAX_WAITING = 30_000

_INFINITE = QosTime(9223372036, 854775807)


class BagWriter:
    """
    A new bag; what is in it stays readable whatever becomes of the process or the disk.

    Parameters
    ----------
    topics : list of (str, type, QoSProfile)
        Name, message class and quality of service that a player offers, of each.

    Raises
    ------
    ConfigurationError
        The folder exists or cannot be made, or a message type is not installed.
    """

    def __init__(self, path: str | Path, topics: Sequence[tuple[str, Any, Any]]):
        described = [definition_of(message_class) for _, message_class, _ in topics]
        try:
            self._writer = Writer(path, version=9, storage_plugin=StoragePlugin.MCAP)
            self._writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
            self._writer.open()
            assert isinstance(self._writer.storage, McapWriter)
            self._writer.storage.compressor = _compressed
        except WriterError as error:
            raise ConfigurationError(
                f'recording {path}: exists already; give the name of a new folder') from error
        except OSError as error:
            raise ConfigurationError(
                f'recording {path}: cannot be made: {error.strerror or error}') from error
        self._connections = [self._writer.add_connection(
            name, known.name, msgdef=known.text, rihs01=known.digest,
            offered_qos_profiles=[_offered(qos)])
            for (name, _, qos), known in zip(topics, described, strict=True)]
        self._begun: int | None = None  # time of the first message that is not on the disk [ns]

    def write(self, index: int, time_ns: int, data: bytes) -> None:
        """Write the bytes of a message of the topic of an index; OSError of a full disk."""
        storage = self._writer.storage
        if self._begun is None:
            self._begun = time_ns
        elif time_ns - self._begun > 1e9 * CHUNK_PERIOD and isinstance(storage, McapWriter):
            storage.close_chunk()
            storage.bio.flush()
            self._begun = time_ns
        self._writer.write(self._connections[index], time_ns, data)

    def close(self) -> None:
        """Write the index; OSError of a full disk, what came before is readable without."""
        self._writer.close()

    def abort(self) -> None:
        """Leave what there is without an index."""
        with suppress(OSError):  # again, of what could not be written
            self._writer.abort()


class RecorderNode(TactileNode):
    """
    Record topics as they come over the wire, without deserialising them, into a new folder.

    The callbacks only append to a queue; a thread writes. `ros2 bag info` and `ros2 bag play`
    open the result. The diagnostics say which topics were heard.

    Parameters
    ----------
    topics : list of (str, type, QoSProfile)
        Name, message class and quality of service, also what a player will offer, of each.
    max_waiting : int
        Messages that may wait to be written; what comes on top is dropped and counted.

    Attributes
    ----------
    failed : str
        Why it has ended early; empty while it goes on.

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
        self.failed = ''
        self._topics = [name for name, _, _ in topics]
        self._heard = set()
        self._writer = BagWriter(path, topics)
        self._thread = threading.Thread(target=self._write_forever, name='bag writer')
        super().__init__('recorder', **kwargs)
        for index, (name, message_class, qos) in enumerate(topics):
            self.create_subscription(message_class, name, self._callback(index), qos, raw=True)
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
        except OSError as error:
            self._max_waiting = 0  # from here on everything is dropped
            self.failed = f'recording ended early: {error.strerror or error}'
            self._writer.abort()
            self.get_logger().error(self.failed)
        if self.dropped:
            self.get_logger().warning(f'{self.dropped} messages were not recorded')

    def _write_waiting(self):
        while self._waiting:
            index, time, data = self._waiting.popleft()
            self._writer.write(index, time, data)
            self.written += 1
            self._heard.add(index)

    def _on_diagnose(self):
        heard = ' '.join(sorted(self._topics[index] for index in list(self._heard)))
        level = DiagnosticStatus.WARN if self.dropped else DiagnosticStatus.OK
        self.diagnose(
            DiagnosticStatus.ERROR if self.failed else level, self.failed or 'recording',
            {'written': self.written, 'dropped': self.dropped, 'heard': heard}, name='recorder')


def _compressed(data: bytes) -> bytes:
    """As zstd does, with a checksum that tells of damage."""
    return zstd.compress(data, options={zstd.CompressionParameter.checksum_flag: 1})


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
