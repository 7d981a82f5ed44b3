"""The mock sensor through its pseudo-terminal, without any other node of the stack."""
import os
from pathlib import Path
import select
import threading
import time

from geometry_msgs.msg import PoseStamped
import numpy as np
import pytest
import rclpy
from rclpy.parameter import Parameter
from rclpy.qos import qos_profile_sensor_data

from tactile_common.errors import ConfigurationError
from tactile_common.ros.conversions import pose_from_msg, stamp_from_ns
from tactile_common.ros.runner import make_executor
from tactile_sensing import open_sensor
from tactile_sensing.devices.calibration import Calibration
from tactile_sensing.devices.calibration_file import save_calibration
from tactile_sensing.devices.flexitac import FlexiTacDecoder, MARKER
from tactile_sensing.devices.registry import options_of, PROTOCOLS
from tactile_simulation.nodes.mock_sensor import MockSensorNode
from tactile_simulation.pseudo_terminal import PseudoTerminal
from tactile_simulation.scene import load_scene

DEADLINE = 10.0  # of every wait [s]
SCENE = """
name: test
description: An edge along base y.
edge: {start: [0.3, -0.1, 0.12], heading: 90, path: [{straight: 0.2}]}
skin: {depth: 0.002, stiffness: 200000.0}
sensor: {noise_std: 630.0, baseline: 10, pa_per_count: 627.45}
start: {s: 0.1, offset: 0.003, height: -0.001, yaw: 0}
"""


@pytest.fixture
def context():
    context = rclpy.Context()
    rclpy.init(context=context)
    yield context
    context.try_shutdown()


@pytest.fixture
def mock(context, tmp_path):
    """Start mock sensors by parameters; all of them are gone after the test."""
    nodes = []

    def start(**parameters):
        parameters = {'port': str(tmp_path / 'sensor'), **parameters}
        node = MockSensorNode(context=context, parameter_overrides=[
            Parameter(name, value=value) for name, value in parameters.items()])
        nodes.append(node)
        return node

    yield start
    for node in nodes:
        node.destroy_node()


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / 'scene.yaml'
    path.write_text(SCENE)
    return str(path)


@pytest.fixture
def recording(tmp_path):
    frames = np.random.default_rng(0).integers(0, 256, (30, 5, 7)).astype(np.float32)
    path = tmp_path / 'recording.npz'
    np.savez(path, frames=frames, rate_hz=200.0)
    return str(path), frames


class Listener:
    """Reads the raw bytes of a port."""

    def __init__(self, port):
        self._file = os.open(port, os.O_RDONLY | os.O_NOCTTY)
        self.data = b''

    def read(self):
        """Return what comes next, None once the other end has hung up."""
        ready, _, _ = select.select([self._file], [], [], DEADLINE)
        assert ready, 'nothing was sent'
        try:
            data = os.read(self._file, 4096)
        except OSError:
            return None
        self.data += data
        return data or None

    def read_bytes(self, count):
        while len(self.data) < count:
            assert self.read() is not None, f'hung up after {len(self.data)} bytes'
        return self.data

    def close(self):
        if self._file is not None:
            os.close(self._file)
            self._file = None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


def decoded(data, shape, kind=np.uint8):
    decoder = FlexiTacDecoder(*shape, kind)
    decoder.receive_data(data)
    events = list(iter(decoder.next_event, None))
    assert decoder.dropped_bytes == 0
    return np.stack([event.counts for event in events])


def world_of(scene):
    return load_scene(scene).world()


def looking_down():
    """Pose of a pad with x = base -x, half a turn about base y, pressed on the edge."""
    message = PoseStamped()
    message.pose.position.x, message.pose.position.z = 0.297, 0.119
    message.pose.orientation.y, message.pose.orientation.w = 1.0, 0.0
    return message


def test_unloaded_frames_before_the_first_pose(mock, scene, tmp_path):
    mock(scene=scene, seed=7)
    with Listener(tmp_path / 'sensor') as listener:
        data = listener.read_bytes(2 + 20 * 258)
    assert data.startswith(MARKER) and data.endswith(MARKER) and (len(data) - 2) % 258 == 0
    frames = decoded(data, (16, 16))[:20]
    rng = np.random.default_rng(7)
    renderer = world_of(scene)
    # In this order; a machine that is too slow for one leaves it out.
    drawn = (renderer.counts(None, rng) for _ in range(1000))
    assert all(any(np.array_equal(frame, one) for one in drawn) for frame in frames)


def test_picture_follows_the_pose(mock, scene, context, tmp_path):
    node = mock(scene=scene, rate=100.0)
    robot = rclpy.create_node('robot', context=context)
    publisher = robot.create_publisher(PoseStamped, 'sensor_pose', qos_profile_sensor_data)
    executor = make_executor(context)
    executor.add_node(node)
    message = looking_down()
    picture = world_of(scene).render(pose_from_msg(message.pose))
    try:
        end = time.monotonic() + DEADLINE
        with Listener(tmp_path / 'sensor') as listener:
            frame = np.zeros((16, 16))
            while frame.max() < 50 and time.monotonic() < end:
                message.header.stamp = robot.get_clock().now().to_msg()
                publisher.publish(message)
                executor.spin_once(timeout_sec=0.01)
                data = listener.read_bytes(len(listener.data) + 1)
                whole = (len(data) - 2) // 258
                if whole:
                    last = data[whole * 258 - 256:whole * 258]
                    frame = np.frombuffer(last, np.uint8).reshape(16, 16).astype(float)
    finally:
        executor.shutdown()
        robot.destroy_node()
    difference = (frame - 10) * 627.45 - picture
    assert abs(difference.mean()) < 5 * 700 / 16
    assert difference.std() < 1.2 * 660
    assert frame.mean(axis=0).argmax() in (5, 6)  # 3 mm to the side of the pad's centre


def test_a_frame_without_a_pose_of_its_instant_is_not_sent(mock, scene, context, tmp_path):
    node = mock(scene=scene, max_pose_age=0.05)
    message = looking_down()

    def place(age):
        message.header.stamp = stamp_from_ns(node.get_clock().now().nanoseconds - age)
        node._on_pose(message)

    with Listener(tmp_path / 'sensor') as listener:
        listener.read_bytes(300)  # free air: no robot has been heard
        place(age=1_000_000_000)
        end = time.monotonic() + DEADLINE
        while node.blind < 10:
            assert time.monotonic() < end
            node._stop.wait(0.005)
        sent = node.sent
        assert not node._stop.wait(0.05) and node.sent == sent  # nothing while the pose is old
        while node.sent < sent + 5:
            assert time.monotonic() < end
            place(age=0)
            node._stop.wait(0.005)


def test_a_frame_shows_the_pose_at_its_own_instant(mock, scene, tmp_path):
    """Of a pad that sinks steadily, known at every 10 ms, each frame shows where it was then."""
    node = mock(scene=scene, latency=0.03, max_pose_age=0.05)
    asked = []
    render = node._world.counts
    node._world.counts = lambda pose, rng, now: asked.append(
        (time.time(), pose)) or render(pose, rng)
    message = looking_down()
    begin = time.time()
    with Listener(tmp_path / 'sensor') as listener:
        end = time.monotonic() + DEADLINE
        while sum(pose is not None for _, pose in asked) < 20:
            assert time.monotonic() < end
            now = time.time()
            message.header.stamp = stamp_from_ns(round(now * 1e9))
            message.pose.position.z = 0.15 - 0.01 * (now - begin)
            node._on_pose(message)
            node._stop.wait(0.01)
        listener.read_bytes(300)
    for at, pose in asked:
        if pose is not None:
            shown_at = begin + (0.15 - pose[2, 3]) / 0.01
            assert shown_at <= at - 0.029  # the latency before it was rendered, or earlier if late


def test_a_frame_that_is_newer_than_every_pose_shows_the_motion_go_on(mock, scene, tmp_path):
    """Of a pad that sinks steadily, known 8 ms late, a frame shows where it is by now."""
    node = mock(scene=scene, latency=0.001, max_pose_age=0.05)
    ahead = []
    render = node._world.counts
    message = looking_down()
    begin, begin_steady = time.time(), time.monotonic()

    def counts(pose, rng, instant):
        if pose is not None and len(node._poses) > 1:
            shown_at = (0.15 - pose[2, 3]) / 0.01
            ahead.append(instant - begin_steady - shown_at)
        return render(pose, rng)

    node._world.counts = counts
    with Listener(tmp_path / 'sensor') as listener:
        end = time.monotonic() + DEADLINE
        while len(ahead) < 20:
            assert time.monotonic() < end
            at = time.time() - 0.008
            message.header.stamp = stamp_from_ns(round(at * 1e9))
            message.pose.position.z = 0.15 - 0.01 * (at - begin)
            node._on_pose(message)
            node._stop.wait(0.002)
        listener.read_bytes(300)
    assert abs(np.median(ahead)) < 0.002  # s; of the newest pose it would be more than 7 ms


def test_recording_streams_exactly(mock, recording, tmp_path):
    path, frames = recording
    node = mock(recording=path)
    with Listener(tmp_path / 'sensor') as listener:
        data = listener.read_bytes(2 + 30 * 37)
        assert node.finished.wait(DEADLINE)
        np.testing.assert_array_equal(decoded(data, (5, 7)), frames)
    assert (node.sent, node.dropped) == (30, 0)


def test_recording_streams_the_words_of_its_calibration(mock, tmp_path):
    frames = np.random.default_rng(0).integers(0, 1024, (10, 5, 7))
    np.savez(tmp_path / 'recording.npz', frames=frames, rate_hz=200.0)
    save_calibration(Calibration.uncalibrated(5, 7, 0.001, bits=10), tmp_path / 'pad.yaml')
    node = mock(recording=str(tmp_path / 'recording.npz'), calibration=str(tmp_path / 'pad.yaml'))
    with Listener(tmp_path / 'sensor') as listener:
        data = listener.read_bytes(2 + 10 * 72)
        assert node.finished.wait(DEADLINE)
        np.testing.assert_array_equal(decoded(data, (5, 7), np.uint16), frames)


@pytest.mark.parametrize('protocol', PROTOCOLS)
def test_every_protocol_is_spoken_and_its_commands_are_heard(mock, tmp_path, protocol):
    frames = np.random.default_rng(0).integers(0, 200, (400, 7, 4))
    np.savez(tmp_path / 'recording.npz', frames=frames, rate_hz=100.0)
    options = 'stamp=us checksum=true' if protocol == 'csv_lines' else ''
    node = mock(recording=str(tmp_path / 'recording.npz'), protocol=protocol, options=options,
                loop=True)
    with open_sensor(str(tmp_path / 'sensor'), protocol, 7, 4, 100.0,
                     **options_of(protocol, options)) as sensor:
        images = [image for image, _ in zip(sensor, range(50), strict=False)]
        first = [image.tolist() for image in frames].index(images[0].counts.tolist())
        np.testing.assert_array_equal(
            [image.counts for image in images], frames[first:first + 50])
        answer = node.set_parameters([Parameter('faults', value='hang_up=1.0')])
        assert answer[0].successful
        end = time.monotonic() + DEADLINE
        while not sensor.fault:
            assert time.monotonic() < end
            sensor.read()
        node.set_parameters([Parameter('faults', value='')])
        while not sensor.read() or sensor.connections < 2:
            assert time.monotonic() < end
    assert not node.set_parameters([Parameter('faults', value='flip=7')])[0].successful


def test_recording_waits_for_its_listener_and_loops(mock, recording, tmp_path):
    path, frames = recording
    node = mock(recording=path, loop=True)
    assert not node.finished.wait(0.2)  # longer than the recording
    assert node.sent == 0
    with Listener(tmp_path / 'sensor') as listener:
        data = listener.read_bytes(2 + 70 * 37)
    np.testing.assert_array_equal(
        decoded(data, (5, 7))[:70], np.concatenate([frames, frames, frames[:10]]))
    assert not node.finished.is_set()


def test_a_link_left_behind_is_replaced_and_shutdown_hangs_up_and_removes_it(
        mock, scene, tmp_path):
    (tmp_path / 'sensor').symlink_to('/dev/pts/999999')
    node = mock(scene=scene)
    with Listener(tmp_path / 'sensor') as listener:
        listener.read_bytes(600)
        stopping = threading.Thread(target=node.destroy_node)
        stopping.start()
        end = time.monotonic() + DEADLINE
        while listener.read() is not None:
            assert time.monotonic() < end
        stopping.join(DEADLINE)
    assert not os.path.lexists(tmp_path / 'sensor')


def test_shutdown_is_quick_at_a_low_rate(mock, scene, tmp_path):
    node = mock(scene=scene, rate=0.1)
    with Listener(tmp_path / 'sensor') as listener:
        listener.read_bytes(200)
        begin = time.monotonic()
        node.destroy_node()
        assert time.monotonic() - begin < 2.0


def test_next_listener_starts_with_a_whole_frame(mock, scene, tmp_path):
    node = mock(scene=scene)
    for _ in range(3):
        with Listener(tmp_path / 'sensor') as listener:
            data = listener.read_bytes(2 + 4 * 258)
            assert len(decoded(data, (16, 16))) >= 4
        end = time.monotonic() + DEADLINE
        while node._in_step and time.monotonic() < end:
            node._stop.wait(0.001)


def test_frames_are_dropped_whole_when_nobody_reads(mock, scene, tmp_path):
    node = mock(scene=scene, rate=2000.0)
    with Listener(tmp_path / 'sensor') as listener:
        end = time.monotonic() + DEADLINE
        while node.dropped < 5:
            assert time.monotonic() < end
            node._stop.wait(0.005)
        dropped = node.dropped
        data = listener.read_bytes(2 + 200 * 258)
    assert dropped >= 5
    assert len(decoded(data, (16, 16))) >= 200


def test_later_link_is_left_alone(tmp_path):
    first = PseudoTerminal(tmp_path / 'sensor')
    second = PseudoTerminal(tmp_path / 'sensor')
    first.close()
    assert os.path.exists(tmp_path / 'sensor')
    second.close()
    assert not os.path.lexists(tmp_path / 'sensor')


@pytest.mark.parametrize('make', [
    lambda path: path.write_text('precious'), Path.mkdir,
    lambda path: path.symlink_to('/dev/null')])
def test_nothing_else_is_overwritten(mock, scene, tmp_path, make):
    make(tmp_path / 'sensor')
    with pytest.raises(ConfigurationError, match='must be free'):
        mock(scene=scene)
    assert os.path.lexists(tmp_path / 'sensor')


@pytest.mark.parametrize('parameters, words', [
    ({}, 'must be exactly one'),
    ({'scene': 'a', 'recording': 'b'}, 'must be exactly one'),
    ({'scene': '/none/scene.yaml'}, 'No such file'),
    ({'recording': '/none/recording.npz'}, 'No such file'),
    ({'port': '', 'scene': True}, 'scene'),
    ({'rate': 0.0}, 'rate'),
    ({'protocol': 'morse'}, 'protocol'),
    ({'latency': -1.0}, 'latency'),
])
def test_wrong_parameters_are_named(mock, parameters, words):
    with pytest.raises(ConfigurationError, match=words):
        mock(**parameters)


def test_port_must_be_given_and_possible(mock, scene, tmp_path):
    with pytest.raises(ConfigurationError, match="'port' is ''"):
        mock(scene=scene, port='')
    with pytest.raises(ConfigurationError, match='cannot be made: No such file'):
        mock(scene=scene, port=str(tmp_path / 'none' / 'sensor'))
