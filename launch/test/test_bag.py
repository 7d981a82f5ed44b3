"""Recorder and reader of bags: every message comes back, and other tools can open them."""

import json
from pathlib import Path
import time

from ament_index_python.packages import get_package_share_directory
from geometry_msgs.msg import PoseStamped
import pytest
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from recorded_run import LATCHED, TOPICS
from rosbags.interfaces import QosDurability, QosReliability
from rosbags.rosbag2 import Reader
from rosbags.typesys import get_types_from_msg, get_typestore, Stores

from edge_tracking.recording import record_bag
from edge_tracking.recording.record_bag import RecorderNode
from tactile_common.errors import ConfigurationError
from tactile_common.ros.bag_reader import Bag
from tactile_common.ros.message_definitions import definition_of
from tactile_common.ros.runner import make_executor, spin
from tactile_msgs.msg import SensorInfo


def record(context, path, topics, publish, make=make_executor):
    """Record what `publish(node)`, a generator, publishes with its topics matched."""
    executor = make(context=context)
    recorder = RecorderNode(path, topics, context=context)
    publisher = Node('publisher', context=context)
    executor.add_node(recorder)
    executor.add_node(publisher)
    published = []
    for message in publish(publisher):
        published.append(message)
        spin(executor, context, lambda: recorder.written + len(recorder._waiting)
             + recorder.dropped >= len(published))
    recorder.destroy_node()
    publisher.destroy_node()
    executor.shutdown()
    return recorder


def numbered(count, qos=10):
    """Publish numbered poses, once the recorder listens."""
    def publish(node):
        publisher = node.create_publisher(PoseStamped, '/pose', qos)
        deadline = time.monotonic() + 10.0
        while not publisher.get_subscription_count():
            assert time.monotonic() < deadline
            node.executor.spin_once(timeout_sec=0.05)
        for number in range(count):
            message = PoseStamped()
            message.pose.position.x = float(number)
            publisher.publish(message)
            yield
    return publish


POSE = [('/pose', PoseStamped, QoSProfile(depth=100))]


@pytest.mark.parametrize('make', [make_executor, SingleThreadedExecutor])
def test_recorder_writes_every_message_in_order(context, tmp_path, make):
    recorder = record(context, tmp_path / 'bag', POSE, numbered(50), make=make)
    assert (recorder.written, recorder.dropped) == (50, 0)
    with Bag(tmp_path / 'bag') as bag:
        assert bag.topics == {'/pose': 'geometry_msgs/msg/PoseStamped'}
        rows = list(bag.messages(['/pose']))
    assert [row.message.pose.position.x for row in rows] == list(range(50))
    times = [row.received_ns for row in rows]
    assert times == sorted(times)


def test_recorder_bounds_its_memory_and_counts_what_it_drops(context, tmp_path, monkeypatch):
    monkeypatch.setattr(record_bag, 'MAX_WAITING', 0)
    recorder = record(context, tmp_path / 'bag', POSE, numbered(20))
    assert (recorder.written, recorder.dropped) == (0, 20)


@pytest.mark.parametrize('place, why', [('', 'exists already'), ('file/bag', 'cannot be made')])
def test_recorder_says_why_a_folder_cannot_be_made(context, tmp_path, place, why):
    (tmp_path / 'file').touch()
    with pytest.raises(ConfigurationError, match=why):
        RecorderNode(tmp_path / place, POSE, context=context)


def test_recorder_takes_parameters_and_can_be_destroyed_twice(context, tmp_path):
    node = RecorderNode(
        tmp_path / 'bag', POSE, context=context, namespace='left',
        parameter_overrides=[Parameter('use_sim_time', value=True)])
    assert node.get_fully_qualified_name() == '/left/recorder'
    node.destroy_node()
    node.destroy_node()


def test_metadata_is_what_rosbag2_expects(context, tmp_path):
    topics = [*TOPICS[1:3], *POSE]
    record(context, tmp_path / 'bag', topics, numbered(3))
    with Reader(tmp_path / 'bag') as reader:
        by_topic = {connection.topic: connection for connection in reader.connections}
        assert reader.message_count == 3
    text = (tmp_path / 'bag' / 'metadata.yaml').read_text()
    assert 'storage_identifier: mcap' in text and 'version: 9' in text
    info = by_topic['/tactile/sensor_info']
    offered, = info.ext.offered_qos_profiles
    assert offered.durability == QosDurability.TRANSIENT_LOCAL
    assert offered.reliability == QosReliability.RELIABLE
    offered, = by_topic['/tactile/contact'].ext.offered_qos_profiles
    assert offered.reliability == QosReliability.BEST_EFFORT
    assert 'full scale and noise; stress is empty' in info.msgdef.data  # comments are kept


def test_latched_messages_of_before_are_recorded(context, tmp_path):
    def publish(node):
        node.create_publisher(SensorInfo, '/tactile/sensor_info', LATCHED).publish(
            SensorInfo(sensor='pad'))
        yield
    record(context, tmp_path / 'bag', TOPICS[1:2], publish)
    with Bag(tmp_path / 'bag') as bag:
        (row,) = bag.messages(bag.topics)
    assert row.message.sensor == 'pad'


@pytest.mark.parametrize('message_class', [row[1] for row in TOPICS])
def test_definitions_and_hashes_are_those_of_the_installed_types(message_class):
    name, definition, digest = definition_of(message_class)
    types = get_typestore(Stores.EMPTY)
    types.register(get_types_from_msg(definition, name))
    assert types.hash_rihs01(name) == digest
    package, folder, stem = name.split('/')
    path = Path(get_package_share_directory(package), folder, f'{stem}.json')
    assert digest in json.loads(path.read_text())['type_hashes'][0]['hash_string']


def test_types_that_are_not_installed_are_refused():
    with pytest.raises(ConfigurationError, match='is not installed'):
        definition_of(type('Missing', (), {'__module__': 'geometry_msgs.msg._missing'}))
