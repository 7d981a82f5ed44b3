"""Writer of a rosbag2 folder with MCAP storage, compressed by zstd."""
from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosbags.interfaces import (
    Connection,
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

from edge_tracking.recording.topics import short_name
from tactile_common.errors import ConfigurationError
from tactile_common.ros.message_definitions import definition_of

# Time after which a written message is readable even if the process is killed [s].
CHUNK_PERIOD = 1.0

_INFINITE = QosTime(9223372036, 854775807)


class BagWriter:
    """
    A new bag; its contents stay readable if the process dies or the disk fails.

    `topics` are full name, message class and quality of service for players, of each topic. The
    last part of a name, too, stands for the first topic with it. Raises a ConfigurationError if
    the folder exists or cannot be made, or a message type is not installed.
    """

    def __init__(self, path: str | Path, topics: Sequence[tuple[str, Any, Any]]):
        described = [definition_of(message_class) for _, message_class, _ in topics]
        try:
            self._writer = Writer(path, version=9, storage_plugin=StoragePlugin.MCAP)
            self._writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
            self._writer.open()
            assert isinstance(self._writer.storage, McapWriter)
            self._storage = self._writer.storage
            self._storage.compressor = partial(zstd.compress, options={
                zstd.CompressionParameter.checksum_flag: 1})  # reveals damage
        except WriterError as error:
            raise ConfigurationError(
                f'recording {path}: exists already; give the name of a new folder') from error
        except OSError as error:
            raise ConfigurationError(
                f'recording {path}: cannot be made: {error.strerror or error}') from error
        self._connections: dict[str, Connection] = {}
        for (name, _, qos), known in zip(topics, described, strict=True):
            self._connections[name] = self._writer.add_connection(
                name, known.name, msgdef=known.text, rihs01=known.digest,
                offered_qos_profiles=[_offered(qos)])
            self._connections.setdefault(short_name(name), self._connections[name])
        self._begun: int | None = None  # time of the first message that is not yet on disk [ns]

    def write(self, name: str, time_ns: int, data: bytes) -> None:
        """Write a message of the topic with a name, short or full; OSError if the disk is full."""
        if self._begun is None:
            self._begun = time_ns
        elif time_ns - self._begun > 1e9 * CHUNK_PERIOD:
            self._storage.close_chunk()
            self._storage.bio.flush()
            self._begun = time_ns
        self._writer.write(self._connections[name], time_ns, data)

    def close(self) -> None:
        """Write the index; OSError if the disk is full, but the messages stay readable."""
        self._writer.close()

    def abort(self) -> None:
        """Leave the bag as it is, without an index."""
        with suppress(OSError):  # the same error again
            self._writer.abort()


def _offered(qos: QoSProfile) -> Qos:
    """Return the quality of service for players, in rosbags' format."""
    best_effort = qos.reliability == ReliabilityPolicy.BEST_EFFORT
    latched = qos.durability == DurabilityPolicy.TRANSIENT_LOCAL
    return Qos(QosHistory.KEEP_LAST, qos.depth,
               QosReliability.BEST_EFFORT if best_effort else QosReliability.RELIABLE,
               QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE,
               _INFINITE, _INFINITE, QosLiveliness.AUTOMATIC, _INFINITE, False)
