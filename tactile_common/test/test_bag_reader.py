"""Bags of one topic: as written, and every way to be damaged, each told in one line."""
from geometry_msgs.msg import Pose, PoseStamped
import pytest
from rclpy.serialization import serialize_message

from tactile_common.errors import ConfigurationError
from tactile_common.ros.message_definitions import definition_of

rosbag2 = pytest.importorskip('rosbags.rosbag2')
from tactile_common.ros.bag_reader import Bag  # noqa: E402

TYPE = 'geometry_msgs/msg/PoseStamped'


def pose(number):
    message = PoseStamped()
    message.header.frame_id, message.pose.position.x = 'base', float(number)
    return serialize_message(message)


@pytest.fixture
def write(tmp_path):
    """Write bytes on topics, a second apart, into a bag."""
    def write(rows, storage=rosbag2.StoragePlugin.MCAP):
        known = definition_of(PoseStamped)
        with rosbag2.Writer(tmp_path / 'run', version=9, storage_plugin=storage) as writer:
            topics = {topic: writer.add_connection(
                topic, known.name, msgdef=known.text, rihs01=known.digest)
                for topic in dict(rows)}
            for second, (topic, data) in enumerate(rows):
                writer.write(topics[topic], second * 1_000_000_000, data)
        return tmp_path / 'run'
    return write


@pytest.mark.parametrize('storage', list(rosbag2.StoragePlugin))
def test_messages_come_in_order_from_the_topics_that_are_asked_for(write, storage):
    rows = [('/a/pose', pose(0)), ('/b/pose', pose(1)), ('/c', pose(2)), ('/a/pose', pose(3))]
    with Bag(write(rows, storage)) as bag:
        assert bag.topics == dict.fromkeys(('/a/pose', '/b/pose', '/c'), TYPE)
        found = list(bag.messages({'/a/pose', '/b/pose', '/none'}))
        (other,) = bag.messages(['/c'])
        assert list(bag.messages(['/none'])) == []
    assert [(row.topic, row.received_ns, row.message.pose.position.x) for row in found] == [
        ('/a/pose', 0, 0.0), ('/b/pose', 1_000_000_000, 1.0), ('/a/pose', 3_000_000_000, 3.0)]
    assert found[0].message.header.frame_id == 'base'
    assert bytes(other.data) == rows[2][1]


def test_the_damage_of_a_message_is_met_when_it_is_read(write):
    with Bag(write([('/pose', pose(0)), ('/pose', b'junk')])) as bag:
        first, second = bag.messages(['/pose'])
        assert first.message.pose.position.x == 0.0
        with pytest.raises(ConfigurationError, match='/pose at 1.0') as caught:
            with second.reading():  # an outer block does not name it again
                second.message  # noqa: B018
        assert str(caught.value).count('/pose at') == 1


@pytest.mark.parametrize('old, new, same', [
    ('', '', True), ('float64 x', 'float32 x', False),
    ('float64 x', '# of the tip\nuint8 KIND=1\nfloat64 x', True)])
def test_bytes_are_sent_on_where_the_fields_are_those_installed(tmp_path, old, new, same):
    known = definition_of(PoseStamped)
    with rosbag2.Writer(tmp_path / 'run', version=9) as writer:
        connection = writer.add_connection(
            '/pose', TYPE, rihs01=known.digest,
            msgdef=known.text.replace(old, new) if old else known.text)
        writer.write(connection, 0, pose(0))
    with Bag(tmp_path / 'run') as bag:
        assert bag.is_of_type('/pose', PoseStamped) == same
        assert not bag.is_of_type('/pose', Pose)


def test_namespaces_hold_names_of_their_types(write):
    with Bag(write([(topic, pose(0)) for topic in (
            '/right/pose', '/left/pose', '/left/tip', '/pose')])) as bag:
        assert bag.namespaces({'pose': TYPE}) == {
            '': {'pose'}, '/left': {'pose'}, '/right': {'pose'}}
        assert bag.namespaces({'pose': TYPE, 'tip': TYPE})['/left'] == {'pose', 'tip'}
        assert bag.namespaces({'pose': 'std_msgs/msg/Header'}) == {}


def test_the_namespace_of_one_sensor_need_not_be_named(write):
    with Bag(write([('/right/pose', pose(0)), ('/left/tip', pose(1)),
                    ('/right/pose', pose(2))])) as bag:
        assert bag.namespace_of({'pose': TYPE}) == bag.namespace_of({'pose': TYPE}, 'right/')
        assert bag.namespace_of({'pose': TYPE}) == '/right' and bag.count('/right/pose') == 2
        with pytest.raises(ConfigurationError, match='has no /left/pose, there are'):
            bag.namespace_of({'pose': TYPE}, 'left')
        with pytest.raises(ConfigurationError, match='has 0 pairs of pose and tip; name one by'):
            bag.namespace_of({'pose': TYPE, 'tip': TYPE})


def test_bytes_after_the_last_value_are_passed_over(write):
    with Bag(write([('/pose', pose(5) + b'\x00\x00\x00\x00')])) as bag:
        (row,) = bag.messages(['/pose'])
    assert row.message.pose.position.x == 5.0


@pytest.mark.parametrize('data, why', [
    (b'', ''), (b'\x00', ''), (b'\x07\x07\x00\x00' + bytes(80), '07070000'),
    (pose(0)[:40], 'buffer'), (pose(0)[:5], '')], ids=['empty', 'byte', 'kind', 'cut', 'head'])
def test_a_damaged_message_is_told_with_its_topic_and_time(write, data, why):
    path = write([('/pose', pose(0)), ('/pose', data)])
    with Bag(path) as bag, pytest.raises(ConfigurationError) as caught:
        for row in bag.messages(['/pose']):
            assert row.message.pose.position.x == 0.0
    text = str(caught.value)
    assert text.startswith(f'bag {path}: the message on /pose at 1.000000 s is damaged')
    assert '\n' not in text and why in text


@pytest.mark.parametrize('name', ['none', 'empty'])
def test_what_is_no_bag(tmp_path, name):
    (tmp_path / 'empty').mkdir()
    with pytest.raises(ConfigurationError, match=f'bag .*{name}: (there is|has) no'):
        Bag(tmp_path / name)


def test_every_length_of_a_cut_file_is_read_or_refused(write):
    path = write([('/pose', pose(k)) for k in range(50)])
    (file,) = path.glob('*.mcap')
    whole = file.read_bytes()
    for length in range(0, len(whole), 97):
        file.write_bytes(whole[:length])
        with pytest.raises(ConfigurationError, match='is not a rosbag2 recording|ends at byte'):
            with Bag(path) as bag:
                list(bag.messages(['/pose']))
