"""Simulated tactile sensor node that sends a device's bytes on a pseudo-terminal."""
from collections.abc import Iterable
from dataclasses import dataclass, field
import itertools
import sys
import threading
import time

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped
import numpy as np
from rclpy.qos import qos_profile_sensor_data

from tactile_common.config import bounded, one_of
from tactile_common.errors import ConfigurationError, TactileError
from tactile_common.ros.conversions import pose_from_msg, stamp_to_ns
from tactile_common.ros.node import TactileNode
from tactile_common.ros.parameters import declare_from, follow_changes
from tactile_common.ros.runner import run
from tactile_common.state_buffer import NS, pose_between, StateBuffer
from tactile_sensing.devices.calibration_file import load_calibration
from tactile_sensing.devices.recording import BYTES, load_recording
from tactile_sensing.devices.registry import options_of, protocol_named, PROTOCOLS
from tactile_simulation.line_faults import LineFaults
from tactile_simulation.pseudo_terminal import PseudoTerminal
from tactile_simulation.scene import load_scene

_LISTENER_CHECK = 0.002  # s between checks for the first listener; nothing is sent before
_LATE = 2  # periods; a later frame of a scene is not sent, because its stamp would be too new
_STALLED, _UNPLUGGED = 0.05, 0.3  # s, pause within a frame; time without the port
_KEPT_POSES = 2000  # enough for one second at any rate of the robot


@dataclass(frozen=True)
class MockSensorConfig:
    """Parameters of the mock sensor; `port` and either `scene` or `recording` are required."""

    port: str = field(default='', metadata={
        'doc': 'path of the link to the pseudo-terminal, which the driver opens'})
    protocol: str = one_of(next(iter(PROTOCOLS)), 'byte protocol to speak', PROTOCOLS)
    options: str = field(default='', metadata={
        'doc': 'options of the protocol, as for the driver'})
    faults: str = field(default='', metadata={
        'doc': 'how often faults of the line happen, for instance `flip=0.001 drop=0.01`: shares '
        'of bytes for flip and lose, of frames for garbage, cut, drop, stall and hang_up',
        'live': True})
    scene: str = field(default='', metadata={
        'doc': 'YAML file of the scene that the sensor touches'})
    recording: str = field(default='', metadata={
        'doc': '.npz file to play instead, from the moment the port is opened, at its own rate'})
    calibration: str = field(default='', metadata={
        'doc': "file that says which counts a recording's sensor sends; empty = bytes"})
    loop: bool = field(default=False, metadata={
        'doc': 'whether a recording starts again at its end'})
    rate: float = bounded(200.0, 'frames per second of a scene', 'Hz', 0.1, 2000.0)
    latency: float = bounded(
        0.0025, 'from the instant that a frame shows to its last byte', 's', 0.0, 1.0)
    max_pose_age: float = bounded(
        0.01, 'a frame is not sent where no pose is known so close to its instant',
        's', 0.001, 10.0)
    seed: int = bounded(0, 'seed of the noise', '', 0, 2**31 - 1)

    def __post_init__(self):
        LineFaults.from_text(self.faults)


class MockSensorNode(TactileNode):
    """
    Simulated sensor that renders a scene at the robot's pose, or plays a recording, as bytes.

    Frames are sent as a device sends them, with the bytes that separate them. Commands are
    answered, and faults of the line are simulated on request. The first frame waits for the first
    listener. Before the first `sensor_pose` the sensor touches nothing. A frame that has no pose
    for its own instant is not sent: an old pose in a frame with a new stamp would make a servo
    press further. A `recording` and a `calibration` that are given replace those of the files.
    Most of the attributes are ROS entities.

    Attributes
    ----------
    finished : threading.Event
        Set when a recording has been sent to its end.
    sent, dropped, late, blind : int
        Number of frames that were written; lost because the listener did not read; not sent
        because the machine was too slow; not sent because no pose was known at their instant.
        The last two apply to scenes only. Without a listener, `sent` and `dropped` do not count.
    """

    def __init__(self, recording=None, calibration=None, **kwargs):
        super().__init__('mock_sensor', **kwargs)
        self.finished = threading.Event()
        self.sent = self.dropped = self.late = self.blind = 0
        self._reported = 0
        self._in_step = False  # True if the listener has the next frame's preamble
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        try:
            self._config = declare_from(self, MockSensorConfig)
            self._device = protocol_named(self._config.protocol).device(
                **options_of(self._config.protocol, self._config.options))
            self._set_faults(self._config)
            follow_changes(self, MockSensorConfig, self._set_faults)
            self._fault_rng = np.random.default_rng(self._config.seed)
            self._lock = threading.Lock()  # protects the poses, which a callback writes
            self._open_source(recording, calibration)
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
        if thread is not None:  # otherwise the port was never opened, or is already closed
            thread.join()
            self._port.close()
        super().destroy_node()

    def _open_source(self, recording, calibration):
        config = self._config
        if bool(config.scene) == bool(config.recording):
            raise ConfigurationError(
                f"parameters 'scene' and 'recording' are {config.scene!r} and "
                f'{config.recording!r}, must be exactly one')
        if config.scene:
            scene = load_scene(config.scene)
            self._world = scene.world()
            self._rng = np.random.default_rng(config.seed)
            # Compile kernels now, not at the first contact.
            self._world.render(scene.start_pose())
            self._recorded = None
            self._period = 1.0 / config.rate
            age = round(config.max_pose_age * NS)
            self._poses = StateBuffer(pose_between, size=_KEPT_POSES, max_gap_ns=2 * age,
                                      max_ahead_ns=age, restart_ns=NS)
            self.create_subscription(
                PoseStamped, 'sensor_pose', self._on_pose, qos_profile_sensor_data)
        else:
            recording = recording or load_recording(config.recording)
            if config.calibration:
                calibration = calibration or load_calibration(config.calibration)
            limits = calibration.counts if calibration else BYTES
            self._recorded, clipped = recording.counts(
                limits, calibration.resolution if calibration else 1.0)
            self._period = 1.0 / recording.rate_hz
            if clipped:
                self.get_logger().warning(
                    f'{clipped} values of {config.recording} were clipped to {limits.lowest}..'
                    f'{limits.highest}: a calibration says what the sensor sends')

    def _set_faults(self, config):
        self._faults = LineFaults.from_text(config.faults)

    def _on_pose(self, message):
        try:
            pose = pose_from_msg(message.pose)
            with self._lock:
                self._poses.add(stamp_to_ns(message.header.stamp), pose)
        except TactileError as error:
            self.get_logger().warning(
                f'sensor_pose is ignored: {error}', throttle_duration_sec=5.0)

    def _frame(self, number, instant):
        """Return the counts of a frame at an instant of the steady clock; None: do not send it."""
        if self._recorded is not None:
            return self._recorded[number % len(self._recorded)]
        behind = time.monotonic() - instant
        stamp_ns = self.get_clock().now().nanoseconds - round(behind * NS)
        with self._lock:
            touched, pose = len(self._poses) > 0, self._poses.at(stamp_ns)
        if touched and pose is None:
            self.blind += 1
            return None
        counts = self._world.counts(pose, self._rng, instant)
        if time.monotonic() - instant - self._config.latency > _LATE * self._period:
            self.late += 1
            return None
        return counts

    def _run(self):
        while not self._port.listened:
            if self._stop.wait(_LISTENER_CHECK):
                return
        begin = time.monotonic()
        numbers: Iterable[int] = itertools.count()
        if self._recorded is not None and not self._config.loop:
            numbers = range(len(self._recorded))
        for number in numbers:
            instant = begin + number * self._period
            if self._stop.wait(max(instant + self._config.latency - time.monotonic(), 0.0)):
                return
            self._answer()
            counts = self._frame(number, instant)
            if counts is not None:
                self._send(self._device.encode(counts, round(instant * NS)))
        self.get_logger().info('recording ended')
        self.finished.set()

    def _answer(self):
        answer = self._device.answer(self._port.read())
        if answer:
            self._port.write(answer)

    def _send(self, frame):
        if not self._port.listened or not self._device.running:
            self._in_step = False
            self._port.forget()
            return
        head = b'' if self._in_step else self._device.preamble
        data, faults, rng = head + frame, self._faults, self._fault_rng
        if faults != LineFaults():
            data = faults.spoil(data, rng)
            if rng.random() < faults.stall:
                self._port.write(data[:len(data) // 2])
                self._stop.wait(_STALLED)
                data = data[len(data) // 2:]
        if self._port.write(data):
            self._in_step = True
            self.sent += 1
        else:
            self.dropped += 1
        if rng.random() < faults.hang_up:
            self._port.close()
            self._stop.wait(_UNPLUGGED)
            self._port, self._in_step = PseudoTerminal(self._config.port), False

    def _on_diagnose(self):
        counts = {'sent': self.sent, 'dropped': self.dropped, 'late': self.late,
                  'blind': self.blind}
        lost, self._reported = self.late + self.blind - self._reported, self.late + self.blind
        self.diagnose(
            DiagnosticStatus.WARN if lost else DiagnosticStatus.OK,
            f'{lost} frames were not sent: late, or without a pose of their instant'
            if lost else 'frames are sent', counts, name='mock sensor',
            hardware_id=self._config.port)


def main(args=None) -> int:
    """Run the mock sensor node."""
    return run(MockSensorNode, args)


if __name__ == '__main__':
    sys.exit(main())
