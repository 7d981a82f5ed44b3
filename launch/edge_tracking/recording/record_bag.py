"""
Record all topics of a sensor, its servo and its robot into a new bag, until interrupted.

The recording stays readable if the process is killed or the disk is full. Exit status 1 if the
recording ended early; the last line says why.
"""
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
import sys
import threading
from time import time_ns
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.qos import QoSProfile
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

from edge_tracking.recording.topics import NEEDED, short_name, topics_to_record
from edge_tracking.resources import NAMESPACE
from tactile_common.command_line import Parser, refusing
from tactile_common.errors import ConfigurationError
from tactile_common.ros.message_definitions import definition_of
from tactile_common.ros.node import TactileNode
from tactile_common.ros.runner import run, split_ros_args

# Period of the writer [s]: long, so that it rarely disturbs callbacks with deadlines, and short,
# so that little is lost if the process dies.
WRITE_PERIOD = 0.1
# Messages that may wait: at 5000 messages per second, six seconds of a stalled disk.
MAX_WAITING = 30_000
# Time after which a written message is readable even if the process is killed [s].
CHUNK_PERIOD = 1.0
_INFINITE = QosTime(9223372036, 854775807)


class BagWriter:
    """
    A new bag; its contents stay readable if the process dies or the disk fails.

    `topics` are full name, message class and quality of service for players, of each topic. The
    last part of a name, too, means the first topic with it. Raises a ConfigurationError if
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
        elif abs(time_ns - self._begun) > 1e9 * CHUNK_PERIOD:
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
    """Return the quality of service for players; rosbags has the same numbers as rclpy."""
    return Qos(QosHistory.KEEP_LAST, qos.depth, QosReliability(int(qos.reliability)),
               QosDurability(int(qos.durability)), _INFINITE, _INFINITE,
               QosLiveliness.AUTOMATIC, _INFINITE, False)


class RecorderNode(TactileNode):
    """
    Records topics as raw bytes, without deserialisation, into a new folder.

    The callbacks only append to a queue; a thread writes. At most `MAX_WAITING` messages wait;
    any more are dropped and counted. The diagnostics name the topics that were received. `failed`
    says why the recording ended early; it is empty while it continues.
    """

    def __init__(self, path: str | Path, topics: Sequence[tuple[str, Any, QoSProfile]],
                 **kwargs: Any):
        self._closed, self._heard = threading.Event(), set[str]()
        self._waiting = deque[tuple[str, int, bytes]]()
        self.written = self.dropped = 0
        self.failed = ''
        self._needed = NEEDED & {short_name(name) for name, _, _ in topics}
        self._thread = threading.Thread(target=self._write_forever, name='bag writer')
        super().__init__('recorder', **kwargs)
        self._writer = BagWriter(path, topics)  # not before the node's name has been accepted
        for name, kind, qos in topics:
            self.create_subscription(kind, name, partial(self._take, name), qos, raw=True)
        self._thread.start()

    def _take(self, name: str, data: bytes) -> None:
        # The events executor cannot pass the message info with raw bytes, so the time of reception
        # is taken here. It is the system time, as in `ros2 bag record`; to make an rclpy Time
        # takes longer than everything else here.
        if len(self._waiting) < MAX_WAITING and not self.failed:
            self._waiting.append((name, time_ns(), data))
        else:
            self.dropped += 1

    def destroy_node(self) -> None:
        """Write the waiting messages and finish the bag, then destroy the node."""
        self._closed.set()
        if self._thread.ident:
            self._thread.join()
        super().destroy_node()

    def _write_forever(self) -> None:
        try:
            while not self._closed.wait(WRITE_PERIOD):
                self._write_waiting()
            self._write_waiting()
            self._writer.close()
        except OSError as error:
            self.failed = f'recording ended early: {error.strerror or error}'
            self._writer.abort()
            self.get_logger().error(self.failed)
        if self.dropped:
            self.get_logger().warning(f'{self.dropped} messages were not recorded')
        silent = self._needed - self._heard
        if silent and not self.failed:
            self.get_logger().warning(
                f'no message was received on {", ".join(sorted(silent))}: a replay needs them')

    def _write_waiting(self) -> None:
        while self._waiting:
            name, time, data = self._waiting.popleft()
            self._writer.write(name, time, data)
            self.written += 1
            self._heard.add(short_name(name))

    def _on_diagnose(self) -> None:
        heard = ' '.join(sorted(self._heard.copy()))
        level = DiagnosticStatus.WARN if self.dropped else DiagnosticStatus.OK
        self.diagnose(
            DiagnosticStatus.ERROR if self.failed else level, self.failed or 'recording',
            {'written': self.written, 'dropped': self.dropped, 'heard': heard}, name='recorder')


def main(args: list[str] | None = None) -> int:
    """Record; return the exit status, see above."""
    given, ros = split_ros_args(sys.argv[1:] if args is None else args)
    parser = Parser(prog='record_bag', description=(__doc__ or '').strip())
    parser.add_argument('bag', type=Path, metavar='BAG', help='new folder to write')
    parser.add_argument('--namespace', default=NAMESPACE, help='of the sensor')
    with refusing('record_bag') as command:
        options = parser.parse_args(given)
        namespace = options.namespace.strip('/')

        def record_bag(context: Any) -> RecorderNode:
            return RecorderNode(
                options.bag, topics_to_record(namespace), context=context, namespace=namespace)

        def status_of(node: RecorderNode) -> int:
            if node.failed:
                print(f'record_bag: {node.failed}', file=sys.stderr)
            return int(bool(node.failed))

        command.status = run(record_bag, ros, lambda node: bool(node.failed), status_of=status_of)
    return command.status
