"""
Record all topics of a sensor, its servo and its robot into a new bag, until interrupted.

The recording stays readable if the process is killed or the disk is full. Exit status 1 if the
recording ended early; the last line says why.
"""
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
import sys
import threading
from time import time_ns
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.qos import QoSProfile

from edge_tracking.recording.topics import NEEDED, short_name, topics_to_record
from edge_tracking.recording.writer import BagWriter
from edge_tracking.resources import NAMESPACE
from tactile_common.command_line import Parser, refusing
from tactile_common.ros.node import TactileNode
from tactile_common.ros.runner import run, split_ros_args

# Period of the writer [s]: long, so that it rarely disturbs callbacks with deadlines, and short,
# so that little is lost if the process dies.
WRITE_PERIOD = 0.1
# Messages that may wait: at 5000 messages per second, six seconds of a stalled disk.
MAX_WAITING = 30_000


class RecorderNode(TactileNode):
    """
    Records topics as raw bytes, without deserialisation, into a new folder; see `BagWriter`.

    The callbacks only append to a queue; a thread writes. At most `max_waiting` messages wait;
    any more are dropped and counted. The diagnostics name the topics that were received. `failed`
    says why the recording ended early; it is empty while it continues.
    """

    def __init__(self, path: str | Path, topics: Sequence[tuple[str, Any, QoSProfile]], *,
                 max_waiting: int = MAX_WAITING, **kwargs: Any):
        self._closed, self._heard = threading.Event(), set[str]()
        self._waiting, self._max_waiting = deque[tuple[str, int, bytes]](), max_waiting
        self.written = self.dropped = 0
        self.failed = ''
        self._writer = BagWriter(path, topics)
        self._needed = NEEDED & {short_name(name) for name, _, _ in topics}
        self._thread = threading.Thread(target=self._write_forever, name='bag writer')
        super().__init__('recorder', **kwargs)
        for name, kind, qos in topics:
            self.create_subscription(kind, name, self._callback(name), qos, raw=True)
        self._thread.start()

    def _callback(self, name: str) -> Callable[[bytes], None]:
        waiting = self._waiting

        # One argument only: the events executor cannot pass the message info with raw bytes, so
        # the time of reception is taken here. It is the system time, as in `ros2 bag record`;
        # to make an rclpy Time takes longer than everything else here.
        def take(data: bytes) -> None:
            if len(waiting) < self._max_waiting:
                waiting.append((name, time_ns(), data))
            else:
                self.dropped += 1
        return take

    def close(self) -> None:
        """Write the waiting messages and finish the bag; recording stops."""
        self._closed.set()
        if self._thread.ident and threading.current_thread() is not self._thread:
            self._thread.join()

    def destroy_node(self) -> None:
        """Finish the bag, then destroy the node."""
        self.close()
        super().destroy_node()

    def _write_forever(self) -> None:
        try:
            while not self._closed.wait(WRITE_PERIOD):
                self._write_waiting()
            self._write_waiting()
            self._writer.close()
        except OSError as error:
            self._max_waiting = 0  # drop all further messages
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


def parser() -> Parser:
    """Return the command-line parser; it does not cover arguments after --ros-args."""
    arguments = Parser(prog='record_bag', description=(__doc__ or '').strip())
    arguments.add_argument('bag', type=Path, metavar='BAG', help='new folder to write')
    arguments.add_argument('--namespace', default=NAMESPACE, help='of the sensor')
    return arguments


def main(args: list[str] | None = None) -> int:
    """Record; return the exit status, see above."""
    given, ros = split_ros_args(sys.argv[1:] if args is None else args)
    with refusing('record_bag') as command:
        options = parser().parse_args(given)
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
