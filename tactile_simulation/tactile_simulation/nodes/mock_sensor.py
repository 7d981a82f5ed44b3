"""Node that stands in for a tactile sensor and speaks its bytes on a pseudo-terminal."""
from collections import deque
from dataclasses import dataclass, field
import os
from pathlib import Path
import select
import sys
import threading
import time
import tty

from geometry_msgs.msg import PoseStamped
import numpy as np
from rclpy.qos import qos_profile_sensor_data

from tactile_common.config import bounded, one_of
from tactile_common.errors import ConfigurationError, TactileError
from tactile_common.ros.conversions import pose_from_msg
from tactile_common.ros.node import TactileNode
from tactile_common.ros.parameters import declare_from
from tactile_common.ros.runner import run
from tactile_sensing.devices.recording import load_recording
from tactile_sensing.devices.registry import protocol_named, PROTOCOLS
from tactile_simulation.renderer import EdgeRenderer
from tactile_simulation.scene import load_scene

_LISTENER_CHECK = 0.002  # s between looks for the first listener; nothing is sent before
_CATCH_UP = 0.1  # s that a scene may be late, its rate held on average, before frames go
_TERMINALS = '/dev/pts/'


@dataclass(frozen=True)
class MockSensorConfig:
    """Parameters of the mock sensor; `port` and one of `scene` and `recording` are demanded."""

    port: str = field(default='', metadata={
        'doc': 'path of the link to the pseudo-terminal, which the driver opens'})
    protocol: str = one_of(next(iter(PROTOCOLS)), 'byte protocol to speak', PROTOCOLS)
    scene: str = field(default='', metadata={
        'doc': 'YAML file of the scene that the sensor touches'})
    recording: str = field(default='', metadata={
        'doc': '.npz file to play instead, from the moment the port is opened, at its own rate'})
    loop: bool = field(default=False, metadata={
        'doc': 'whether a recording starts again at its end'})
    rate: float = bounded(200.0, 'frames per second of a scene', 'Hz', 0.1, 2000.0)
    latency: float = bounded(
        0.0025, 'from the instant that a frame shows to its last byte', 's', 0.0, 1.0)
    seed: int = bounded(0, 'seed of the noise', '', 0, 2**31 - 1)


class PseudoTerminal:
    """
    Sending end of a pseudo-terminal with a link to its other end; never blocks.

    The other end is left to the listener alone, so that this one sees whether somebody
    listens, and the listener sees a hang-up as soon as this one closes or dies. A link that an
    earlier pseudo-terminal left behind is replaced.

    Raises
    ------
    ConfigurationError
        The link cannot be made, or something else stands in its place.
    """

    def __init__(self, link: str):
        if not link:
            raise ConfigurationError("parameter 'port' is '', must be the path of a link to make")
        self._link = Path(link)
        if self._link.is_symlink():
            target = os.readlink(self._link)
            if not target.startswith(_TERMINALS):
                raise ConfigurationError(
                    f"parameter 'port': {link} is a link to {target}, must be free")
        elif self._link.exists():
            raise ConfigurationError(
                f"parameter 'port': {link} exists and is not a mock sensor's, must be free")
        self._master, slave = os.openpty()
        self._target = os.ttyname(slave)
        tty.setraw(slave)
        os.close(slave)
        os.set_blocking(self._master, False)
        self._poll = select.poll()
        self._poll.register(self._master, 0)
        self._unsent = b''
        fresh = self._link.with_name(f'{self._link.name}.{os.getpid()}')
        try:
            os.symlink(self._target, fresh)
            os.replace(fresh, self._link)
        except OSError as error:
            fresh.unlink(missing_ok=True)
            os.close(self._master)
            raise ConfigurationError(
                f"parameter 'port': {link} cannot be made: {error.strerror}") from error

    @property
    def listened(self) -> bool:
        """Whether somebody has the other end open."""
        return not any(event & select.POLLHUP for _, event in self._poll.poll(0))

    def write(self, data: bytes) -> bool:
        """Send all of `data`, now or before the next; False: no room, nothing was taken."""
        if self._unsent:
            self._unsent = self._unsent[self._put(self._unsent):]
            if self._unsent:
                return False
        sent = self._put(data)
        self._unsent = data[sent:] if sent else b''
        return sent > 0

    def forget(self) -> None:
        """Drop the rest of a half-sent write, for the next listener."""
        self._unsent = b''

    def close(self) -> None:
        """Remove the link, unless it is another's by now, and hang up."""
        try:
            if os.readlink(self._link) == self._target:
                self._link.unlink()
        except OSError:  # gone, or something else stands there
            pass
        os.close(self._master)

    def _put(self, data):
        try:
            return os.write(self._master, data)
        except BlockingIOError:
            return 0


class MockSensorNode(TactileNode):
    """
    Sensor that exists only as bytes: renders a scene at the robot's pose, or plays a recording.

    A frame is sent as a device that runs free sends it behind the one before, with whatever
    announces the next. The first frame waits for the first listener; before the first
    `sensor_pose` the sensor touches nothing. Most of its attributes are ROS entities.

    Attributes
    ----------
    finished : threading.Event
        Set when a recording has been sent to its end.
    sent, dropped, late : int
        Frames written, frames lost because the listener did not read, and frames of a scene
        left out because the machine was too slow for them; without a listener, none of them.
    """

    def __init__(self, **kwargs):
        super().__init__('mock_sensor', **kwargs)
        self.finished = threading.Event()
        self.sent = self.dropped = self.late = 0
        self._in_step = False  # whether the listener has got what precedes the next frame
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        try:
            self._config = declare_from(self, MockSensorConfig)
            self._protocol = protocol_named(self._config.protocol)
            self._pose = None  # replaced as a whole by the callback, read by the thread
            self._open_source()
            self._port = PseudoTerminal(self._config.port)
        except BaseException:
            self.destroy_node()
            raise
        self._thread = threading.Thread(target=self._run, name='mock_sensor', daemon=True)
        self._thread.start()

    def destroy_node(self):
        """Stop sending, hang up, remove the link and destroy the node."""
        self._stop.set()
        thread, self._thread = self._thread, None
        if thread is not None:  # else the port was never opened, or is closed already
            thread.join()
            self._port.close()
        super().destroy_node()

    def _open_source(self):
        config = self._config
        if bool(config.scene) == bool(config.recording):
            raise ConfigurationError(
                f"parameters 'scene' and 'recording' are {config.scene!r} and "
                f'{config.recording!r}, must be exactly one')
        if config.scene:
            scene = load_scene(config.scene)
            self._renderer = EdgeRenderer(scene, scene.sensor.array)
            self._rng = np.random.default_rng(config.seed)
            # Compiled now rather than at the first touch.
            self._renderer.render(scene.start_pose())
            self._recorded = None
            self._period = 1.0 / config.rate
            self.create_subscription(
                PoseStamped, 'sensor_pose', self._on_pose, qos_profile_sensor_data)
        else:
            recording = load_recording(config.recording)
            self._recorded, clipped = recording.counts()
            self._period = 1.0 / recording.rate_hz
            if clipped:
                self.get_logger().warning(
                    f'{clipped} values of {config.recording} were clipped to 0..255')

    def _on_pose(self, message):
        try:
            self._pose = pose_from_msg(message.pose)
        except TactileError as error:
            self.get_logger().warning(
                f'sensor_pose is passed over: {error}', throttle_duration_sec=5.0)

    def _frame(self, number):
        """Return the counts of a frame, None behind the end of a recording."""
        if self._recorded is None:
            return self._renderer.counts(self._pose, self._rng)
        if self._config.loop:
            number %= len(self._recorded)
        return self._recorded[number] if number < len(self._recorded) else None

    def _run(self):
        while not self._port.listened:
            if self._stop.wait(_LISTENER_CHECK):
                return
        begin = time.monotonic()
        number = 0  # of the next frame to take
        ended = False
        waiting: deque[tuple[float, bytes]] = deque()  # instants to send at
        while waiting or not ended:
            take_at = np.inf if ended else begin + number * self._period
            send_at = waiting[0][0] if waiting else np.inf
            if self._stop.wait(max(min(take_at, send_at) - time.monotonic(), 0.0)):
                return
            if send_at <= take_at:
                self._send(waiting.popleft()[1])
                continue
            counts = self._frame(number)
            ended = counts is None
            if ended:
                continue
            waiting.append((take_at + self._config.latency, self._protocol.encode(counts)))
            number += 1
            behind = time.monotonic() - begin - number * self._period
            if self._recorded is None and behind > _CATCH_UP:
                left_out = int(behind / self._period)
                self.late += left_out
                number += left_out
        self.get_logger().info('recording ended')
        self.finished.set()

    def _send(self, frame):
        if not self._port.listened:
            self._in_step = False
            self._port.forget()
            return
        head = b'' if self._in_step else self._protocol.preamble
        if self._port.write(head + frame):
            self._in_step = True
            self.sent += 1
        else:
            self.dropped += 1


def main(args=None) -> int:
    """Run the mock sensor as a program."""
    return run(MockSensorNode, args)


if __name__ == '__main__':
    sys.exit(main())
