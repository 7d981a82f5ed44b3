"""The mock sensor through its pseudo-terminal, without any other node of the stack."""
from contextlib import closing
from functools import partial
from itertools import repeat
import os
from pathlib import Path
import select
import threading
import time

from geometry_msgs.msg import PoseStamped
import numpy as np
import pytest
from rclpy.parameter import Parameter

from tactile_common.errors import ConfigurationError
from tactile_common.ros.conversions import stamp_from_ns
from tactile_sensing import open_sensor
from tactile_sensing.devices.flexitac import FlexiTacDecoder, MARKER
from tactile_sensing.devices.registry import options_of, PROTOCOLS
from tactile_simulation.nodes import mock_sensor
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


class FramesNode(MockSensorNode):
    """A mock sensor that sends given frames once, in place of a scene's."""

    def __init__(self, frames, **kwargs):
        self._left, self.finished = iter(frames), threading.Event()
        super().__init__(**kwargs)

    def _frame(self, instant):
        frame = next(self._left, None)
        if frame is None:
            self.finished.set()
        return frame


@pytest.fixture
def mock(context, scene, tmp_path):
    """Start mock sensors by parameters; all of them are gone after the test."""
    nodes = []

    def start(frames=None, **parameters):
        parameters = {'port': str(tmp_path / 'sensor'), **parameters}
        kind = MockSensorNode
        if frames is not None:
            kind, parameters['scene'] = partial(FramesNode, frames), scene
        node = kind(context=context, parameter_overrides=[
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


FRAMES = np.random.default_rng(0).integers(0, 256, (30, 5, 7), np.uint8)


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
        os.close(self._file)


def decoded(data, shape, kind=np.uint8):
    decoder = FlexiTacDecoder(*shape, kind)
    decoder.receive_data(data)
    events = list(iter(decoder.next_frame, None))
    assert decoder.dropped_bytes == 0
    return np.stack([event.counts for event in events])


def looking_down():
    """Pose of a pad with x = base -x, half a turn about base y, pressed on the edge."""
    message = PoseStamped()
    message.pose.position.x, message.pose.position.z = 0.297, 0.119
    message.pose.orientation.y, message.pose.orientation.w = 1.0, 0.0
    return message


def test_unloaded_frames_before_the_first_pose(mock, scene, tmp_path):
    mock(scene=scene, seed=7)
    with closing(Listener(tmp_path / 'sensor')) as listener:
        data = listener.read_bytes(2 + 20 * 258)
    assert data.startswith(MARKER) and data.endswith(MARKER) and (len(data) - 2) % 258 == 0
    frames = decoded(data, (16, 16))[:20]
    rng = np.random.default_rng(7)
    renderer = load_scene(scene).world()
    # In this order; a machine that is too slow for one leaves it out.
    drawn = (renderer.counts(None, rng) for _ in range(1000))
    assert all(any(np.array_equal(frame, one) for one in drawn) for frame in frames)


@pytest.fixture
def slow_poses(monkeypatch):
    monkeypatch.setattr(mock_sensor, '_MAX_POSE_AGE', 0.05)


def test_a_frame_without_a_pose_of_its_instant_is_not_sent(mock, scene, slow_poses, tmp_path):
    node = mock(scene=scene)
    message = looking_down()

    def place(age):
        message.header.stamp = stamp_from_ns(node.get_clock().now().nanoseconds - age)
        node._on_pose(message)

    with closing(Listener(tmp_path / 'sensor')) as listener:
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


def test_a_slow_machine_gets_fewer_frames_but_never_none(mock, scene, tmp_path):
    """What a frame takes longer than its period is not carried on to all later frames."""
    node = mock(scene=scene)
    render = node._world.counts

    def slow(*args):
        time.sleep(1.5 * node._period)
        return render(*args)

    node._world.counts = slow
    with closing(Listener(tmp_path / 'sensor')) as listener:
        listener.read_bytes(40 * 258)
    assert node.late > 5


@pytest.mark.parametrize('delay, behind', [(0.03, 0.0), (0.0025, 0.008)])
def test_a_frame_shows_the_pose_at_its_own_instant(
        mock, scene, slow_poses, monkeypatch, tmp_path, delay, behind):
    """Of a pad that sinks steadily: sent so much later, of poses that are known so late [s]."""
    monkeypatch.setattr(mock_sensor, 'ACQUISITION_DELAY', delay)
    node = mock(scene=scene)
    ahead, render = [], node._world.counts
    message = looking_down()
    begin, begin_steady = time.time(), time.monotonic()

    def counts(pose, rng, instant):
        assert time.monotonic() >= instant + delay - 1e-3
        if pose is not None and len(node._poses) > 1:
            shown_at = (0.15 - pose[2, 3]) / 0.01
            ahead.append(instant - begin_steady - shown_at)
        return render(pose, rng)

    node._world.counts = counts
    with closing(Listener(tmp_path / 'sensor')) as listener:
        end = time.monotonic() + DEADLINE
        while len(ahead) < 20:
            assert time.monotonic() < end
            at = time.time() - behind
            message.header.stamp = stamp_from_ns(round(at * 1e9))
            message.pose.position.z = 0.15 - 0.01 * (at - begin)
            node._on_pose(message)
            node._stop.wait(0.002)
        listener.read_bytes(300)
    assert abs(np.median(ahead)) < 0.002  # s; of the newest pose it would be more than 7 ms


@pytest.mark.parametrize('frames', [FRAMES, np.uint16(5) * FRAMES])
def test_given_frames_are_sent_exactly_once_somebody_listens(mock, frames, tmp_path):
    node = mock(frames)
    assert not node.finished.wait(0.2) and node.sent == 0  # longer than they take
    with closing(Listener(tmp_path / 'sensor')) as listener:
        data = listener.read_bytes(2 + 30 * (2 + 35 * frames.itemsize))
        assert node.finished.wait(DEADLINE)
        np.testing.assert_array_equal(decoded(data, (5, 7), frames.dtype), frames)
    assert (node.sent, node.dropped) == (30, 0)


@pytest.mark.parametrize('protocol', PROTOCOLS)
def test_every_protocol_is_spoken_and_its_commands_are_heard(mock, tmp_path, protocol):
    frames = np.random.default_rng(0).integers(0, 200, (400, 7, 4), np.uint8)
    options = 'stamp=us checksum=true' if protocol == 'csv_lines' else ''
    mock(frames, protocol=protocol, options=options, rate=100.0)
    with open_sensor(str(tmp_path / 'sensor'), protocol, 7, 4, 100.0,
                     **options_of(protocol, options)) as sensor:
        images = [image for image, _ in zip(sensor, range(50), strict=False)]
        first = [image.tolist() for image in frames].index(images[0].counts.tolist())
        np.testing.assert_array_equal(
            [image.counts for image in images], frames[first:first + 50])


def test_a_link_left_behind_is_replaced_and_shutdown_hangs_up_and_removes_it(
        mock, scene, tmp_path):
    (tmp_path / 'sensor').symlink_to('/dev/pts/999999')
    node = mock(scene=scene)
    with closing(Listener(tmp_path / 'sensor')) as listener:
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
    with closing(Listener(tmp_path / 'sensor')) as listener:
        listener.read_bytes(200)
        begin = time.monotonic()
        node.destroy_node()
        assert time.monotonic() - begin < 2.0


def test_frames_are_dropped_whole_when_nobody_reads(mock, tmp_path):
    node = mock(frames=repeat(FRAMES[0]), rate=2000.0)
    with closing(Listener(tmp_path / 'sensor')) as listener:
        end = time.monotonic() + DEADLINE
        while node.dropped < 5:
            assert time.monotonic() < end
            node._stop.wait(0.005)
        dropped = node.dropped
        data = listener.read_bytes(2 + 200 * 37)
    assert dropped >= 5
    assert len(decoded(data, (5, 7))) >= 200


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
    ({'scene': ''}, "'scene' is ''"), ({'scene': '/none/scene.yaml'}, 'No such file'),
    ({'rate': 0.0}, 'rate'), ({'protocol': 'morse'}, 'protocol'), ({'port': ''}, "'port' is ''"),
    ({'port': '/none/sensor'}, 'cannot be made: No such file')])
def test_wrong_parameters_are_named(mock, scene, parameters, words):
    with pytest.raises(ConfigurationError, match=words):
        mock(**{'scene': scene, **parameters})
