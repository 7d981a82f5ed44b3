"""Simulated tactile sensor node that sends a device's bytes on a pseudo-terminal."""
from dataclasses import dataclass
import math
import sys
import threading
import time
from typing import Any

from geometry_msgs.msg import PoseStamped
import numpy as np
from rclpy.qos import qos_profile_sensor_data

from tactile_common.config import bounded, documented, one_of
from tactile_common.errors import ConfigurationError, TactileError
from tactile_common.ros.conversions import pose_from_msg, stamp_to_ns
from tactile_common.ros.node import TactileNode
from tactile_common.ros.parameters import declare_from
from tactile_common.ros.runner import run
from tactile_common.state_buffer import NS, pose_between, StateBuffer
from tactile_sensing.devices.frame_clock import MAX_RATE
from tactile_sensing.devices.registry import options_of, protocol_named, PROTOCOLS
from tactile_simulation.pseudo_terminal import PseudoTerminal
from tactile_simulation.scene import load_scene
from tactile_simulation.world import ACQUISITION_DELAY

_LISTENER_CHECK = 0.002  # s between checks for the first listener; nothing is sent before
# A frame of a scene is left out if it is later than this, because its stamp would be too new [s].
_LATE = 0.01
# It is also left out if no pose is known so close to its instant [s]: two poses of the slowest
# robot, at 250 Hz.
_MAX_POSE_AGE = 0.01
_KEPT_POSES = 2000  # enough for one second at any rate of the robot


@dataclass(frozen=True)
class MockSensorConfig:
    """Parameters of the mock sensor; `port` and `scene` are required."""

    port: str = documented('', 'path of the link to the pseudo-terminal, which the driver opens')
    protocol: str = one_of(next(iter(PROTOCOLS)), 'byte protocol to speak', PROTOCOLS)
    options: str = documented('', 'options of the protocol, as for the driver')
    scene: str = documented('', 'YAML file of the scene that the sensor touches')
    rate: float = bounded(200.0, 'frames per second', 'Hz', 1e-3, MAX_RATE)
    seed: int = bounded(0, 'seed of the noise', '', 0, 2**31 - 1)


class MockSensorNode(TactileNode):
    """
    Simulated sensor that renders a scene at the robot's pose and sends it as a device's bytes.

    Frames are sent as a device sends them, with the bytes that separate them, and commands are
    answered. The first frame waits for the first listener. Before the first `sensor_pose` the
    sensor touches nothing. A frame that has no pose for its own instant is not sent: an old pose
    in a frame with a new stamp would make a servo press further.

    Attributes
    ----------
    sent, dropped, late, blind : int
        Number of frames that were written; lost because the listener did not read; not sent
        because the machine was too slow; not sent because no pose was known at their instant.
        Without a listener, `sent` and `dropped` do not count.
    """

    def __init__(self, **kwargs: Any):
        super().__init__('mock_sensor', **kwargs)
        self.sent = self.dropped = self.late = self.blind = 0
        self._in_step = False  # True if the listener has the next frame's preamble
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        config = declare_from(self, MockSensorConfig)
        self._device = protocol_named(config.protocol).device(
            **options_of(config.protocol, config.options))
        self._lock = threading.Lock()  # protects the poses, which a callback writes
        self._period = 1.0 / config.rate
        if not config.scene:
            raise ConfigurationError("parameter 'scene' is '', must name a scene or its file")
        scene = load_scene(config.scene)
        self._world, self._rng = scene.world(), np.random.default_rng(config.seed)
        self._world.render(scene.start_pose())  # compiles kernels now, not at the first contact
        age = round(_MAX_POSE_AGE * NS)
        self._poses = StateBuffer(pose_between, size=_KEPT_POSES, max_gap_ns=2 * age,
                                  max_ahead_ns=age, restart_ns=NS)
        self.create_subscription(
            PoseStamped, 'sensor_pose', self._on_pose, qos_profile_sensor_data)
        self._port = PseudoTerminal(config.port)
        self._thread = threading.Thread(target=self._run, name='mock_sensor', daemon=True)
        self._thread.start()

    def destroy_node(self) -> None:
        """Stop sending, hang up, remove the link and destroy the node."""
        self._stop.set()
        thread, self._thread = self._thread, None
        if thread is not None:  # otherwise the port was never opened, or is already closed
            thread.join()
            self._port.close()
        super().destroy_node()

    def _on_pose(self, message: PoseStamped) -> None:
        try:
            pose = pose_from_msg(message.pose)
            with self._lock:
                self._poses.add(stamp_to_ns(message.header.stamp), pose)
        except TactileError as error:
            self._warn(f'sensor_pose is ignored: {error}')

    def _frame(self, instant: float) -> np.ndarray | None:
        """Return the counts of a frame at an instant of the steady clock; None: do not send it."""
        behind = time.monotonic() - instant
        stamp_ns = self.get_clock().now().nanoseconds - round(behind * NS)
        with self._lock:
            touched, pose = len(self._poses) > 0, self._poses.at(stamp_ns)
        if touched and pose is None:
            self.blind += 1
        else:
            counts = self._world.counts(pose, self._rng, instant)
            if self._lateness(instant) <= _LATE:
                return counts
            self.late += 1
        self.get_logger().warning(
            f'frames were not sent: {self.late} late, {self.blind} without a pose of their '
            'instant', throttle_duration_sec=5.0)
        return None

    def _lateness(self, instant: float) -> float:
        return time.monotonic() - instant - ACQUISITION_DELAY

    def _run(self) -> None:
        while not self._port.listened:
            if self._stop.wait(_LISTENER_CHECK):
                return
        begin, number = time.monotonic(), 0
        while True:
            instant = begin + number * self._period
            if self._stop.wait(max(instant + ACQUISITION_DELAY - time.monotonic(), 0.0)):
                return
            answer = self._device.answer(self._port.read())
            if answer:
                self._port.write(answer)
            counts = self._frame(instant)
            if counts is not None:
                self._send(self._device.encode(counts, round(instant * NS)))
            number += 1
            late = self._lateness(begin + number * self._period)
            if late > _LATE:  # to render them all would make every later frame late as well
                passed = math.ceil(late / self._period)
                number, self.late = number + passed, self.late + passed

    def _send(self, frame: bytes) -> None:
        if not self._port.listened or not self._device.running:
            self._in_step = False
            self._port.forget()
            return
        head = b'' if self._in_step else self._device.preamble
        if self._port.write(head + frame):
            self._in_step = True
            self.sent += 1
        else:
            self.dropped += 1


def main(args: list[str] | None = None) -> int:
    """Run the mock sensor node."""
    return run(MockSensorNode, args)


if __name__ == '__main__':
    sys.exit(main())
