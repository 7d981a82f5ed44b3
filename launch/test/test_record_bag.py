"""The command `record_bag`: what it writes is complete and read back, and why it has ended."""
from contextlib import suppress
import signal
import subprocess
import sys
import time

import pytest
from rclpy.node import Node
from sensor_msgs.msg import JointState

from edge_tracking.graph import Graph
from edge_tracking.recording import record_bag
from edge_tracking.recording.record_bag import BagWriter
from edge_tracking.recording.settings import Settings
from edge_tracking.recording.topics import GraphBag, topics, topics_to_record
from tactile_common.errors import ConfigurationError
from tactile_common.ros.bag_reader import Bag
from tactile_common.ros.cdr import packed
from tactile_common.ros.conversions import set_stamp, stamp_to_ns


def recorded(path):
    """Parameters by node, as far as they are in a bag that is being written."""
    with suppress(ConfigurationError, OSError), GraphBag(path, 'left') as bag:
        return Settings(bag).recorded
    return {}


def recording(path):
    """Record in another process."""
    return subprocess.Popen(
        [sys.executable, '-c', 'from edge_tracking.recording.record_bag import main; exit(main())',
         str(path), '--namespace', '/left/'], stderr=subprocess.PIPE, text=True)


@pytest.mark.graph
def test_what_a_killed_recorder_has_heard_is_there_but_for_the_last_second(tmp_path):
    path, sent = tmp_path / 'bag', {}
    with recording(path) as process, Graph(namespace='left') as graph:
        node = graph.add(Node, own={'node_name': 'robot'})
        publisher = node.create_publisher(JointState, '/left/joint_states', 10)

        def send():
            message = JointState()
            set_stamp(message.header.stamp, len(sent) + 1)
            if publisher.get_subscription_count():
                sent[len(sent) + 1] = time.monotonic()
                publisher.publish(message)
        node.create_timer(0.01, send)
        graph.spin(lambda: len(sent) > 300, 60.0)
        process.kill()
        killed = time.monotonic()
    numbers = []
    with pytest.raises(ConfigurationError), Bag(path) as bag:
        for row in bag.messages(['/left/joint_states']):
            numbers.append(stamp_to_ns(row.message.header.stamp))
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
    assert numbers[0] < 10 and killed - sent[numbers[-1]] < 1.5


@pytest.mark.graph
def test_500_messages_that_wait_for_the_recorder_are_not_lost(tmp_path):
    path, count = tmp_path / 'bag', 500
    with Graph(namespace='left') as graph:
        recorder = graph.add(record_bag.RecorderNode, own={'path': path, 'topics': topics('left')})
        publisher = graph.add(Node, own={'node_name': 'robot'}).create_publisher(
            JointState, '/joint_states', count)
        graph.spin(publisher.get_subscription_count, 30.0)
        message = JointState()
        for number in range(count):
            set_stamp(message.header.stamp, number)
            publisher.publish(message)  # nothing is taken meanwhile
        graph.spin(lambda: recorder.written >= count, 30.0)
    with Bag(path) as bag:
        stamps = [stamp_to_ns(row.message.header.stamp) for row in bag.messages(['/joint_states'])]
    assert stamps == list(range(count))


@pytest.mark.graph
def test_an_interrupt_ends_a_bag_that_says_how_it_was_made(tmp_path):
    path = tmp_path / 'bag'
    with recording(path) as process:
        end = time.monotonic() + 60.0
        while 'recorder' not in recorded(path) and time.monotonic() < end:
            time.sleep(0.1)  # another process: the file is all that tells
        process.send_signal(signal.SIGINT)
        told = process.communicate(timeout=30.0)[1]
    assert process.returncode in (0, 130), told
    known = recorded(path)['recorder']
    with Bag(path) as bag:
        assert {'/left/servo_calls', '/joint_states', '/left/joint_states',
                '/left/joint_trajectory_controller/joint_trajectory'} <= bag.topics.keys()
    assert 'no message was received on image, joint_states, sensor_info, servo_calls' in told
    assert '--namespace' in known['command'] and 'numpy' in known['versions']
    assert record_bag.main([str(path)]) == 2  # nothing is overwritten


@pytest.mark.parametrize('robots, chosen', [
    (['/joint_states', '/left/joint_states'], '/left/joint_states'),
    (['/joint_states'], '/joint_states'), (['/left/joint_states'], '/left/joint_states')])
def test_of_several_robots_the_one_in_the_namespace_of_the_sensor_is_read(
        tmp_path, robots, chosen):
    writer = BagWriter(tmp_path / 'bag', topics_to_record('left'))
    for topic in ('image', *robots):
        writer.write(topic, 1, packed(JointState()))
    writer.close()
    with GraphBag(tmp_path / 'bag', 'left') as bag:
        assert bag.topic['joint_states'] == chosen
        assert set(bag.name.values()) == {'image', 'joint_states'}


def test_a_wrong_namespace_leaves_no_folder(tmp_path, capsys):
    assert record_bag.main([str(tmp_path / 'bag'), '--namespace', 'a-b']) == 2
    assert 'a-b' in capsys.readouterr().err and not (tmp_path / 'bag').exists()


def test_a_clock_that_is_set_back_does_not_stop_the_saving(tmp_path, monkeypatch):
    writer, saved = BagWriter(tmp_path / 'bag', topics('left')), []
    monkeypatch.setattr(writer._storage, 'close_chunk', lambda: saved.append(True))
    for seconds in (100, 50, 52):
        writer.write('image', seconds * 10**9, b'')
    assert len(saved) == 2


@pytest.mark.graph
def test_a_full_disk_is_the_last_line(tmp_path, monkeypatch, capfd):
    def write(*_):
        raise OSError(28, 'No space left on device')
    monkeypatch.setattr(BagWriter, 'write', write)
    assert record_bag.main([str(tmp_path / 'bag')]) == 1
    assert capfd.readouterr().err.splitlines()[-1] == (
        'record_bag: recording ended early: No space left on device')
