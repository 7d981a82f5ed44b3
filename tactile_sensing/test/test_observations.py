"""Recorded observations: all kinds are read in the order of reception, or refused."""
from geometry_msgs.msg import PoseStamped
import numpy as np
import pytest
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

from tactile_common.errors import ConfigurationError
from tactile_common.ros.conversions import pose_to_msg, stamp_from_ns
from tactile_common.ros.message_definitions import definition_of
from tactile_sensing.conversions import contact_to_msg, image_to_msg, sensor_info_to_msg
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import Contact, ContactType, Reason
from tactile_sensing.types.image import Layer, SensorInfo, TactileImage

rosbag2 = pytest.importorskip('rosbags.rosbag2')
from tactile_common.ros.bag_reader import Bag  # noqa: E402
from tactile_sensing.observations import observations, TYPES  # noqa: E402

ARRAY = TactelArray(3, 4, 1e-3, 2e-3)
STRESS = np.arange(12.0, dtype=np.float32).reshape(3, 4)
IMAGE = TactileImage(100, 7, (Layer('zz', 1e-3, STRESS),), ARRAY, tared=True)
CONTACT = Contact(ContactType.POINT, True, Reason(0), 'fit', x=1e-3, y=-2e-3)
INFO = SensorInfo(50, 'pad', 'left', 'flexitac', '', ARRAY, 200.0, 0.0025, 2e5, 12.0, (), (), '',
                  40)
POSE = np.array([[0.0, -1.0, 0.0, 0.1], [1.0, 0.0, 0.0, 0.2], [0.0, 0.0, 1.0, 0.3],
                 [0.0, 0.0, 0.0, 1.0]])


def messages():
    """Return one message of each kind, by topic, in the order of reception."""
    image = image_to_msg(IMAGE)
    pose = PoseStamped(pose=pose_to_msg(POSE))
    pose.header.stamp = stamp_from_ns(99)
    joints = JointState(name=['a', 'b'], position=[0.5, -0.25])
    joints.header.stamp = stamp_from_ns(98)
    return {'/joint_states': joints, '/left/sensor_pose': pose, '/left/image': image,
            '/left/contact': contact_to_msg(CONTACT, image, 500),
            '/left/sensor_info': sensor_info_to_msg(INFO)}


@pytest.fixture
def write(tmp_path):
    """Write messages on topics, received at 1000, 2000, ... ns, into a bag."""
    def write(rows):
        with rosbag2.Writer(tmp_path / 'run', version=9) as writer:
            for k, (topic, message) in enumerate(rows.items()):
                known = definition_of(type(message))
                writer.write(writer.add_connection(
                    topic, known.name, msgdef=known.text, rihs01=known.digest),
                    1000 * (k + 1), serialize_message(message))
        return tmp_path / 'run'
    return write


def kind_of(topic):
    return topic.rpartition('/')[2]


def test_every_kind_comes_back_in_the_order_of_its_reception(write):
    rows = messages()
    with Bag(write(rows)) as bag:
        assert set(TYPES.items()) == {(kind_of(topic), kind) for topic, kind in bag.topics.items()}
        seen = list(observations(bag, {topic: kind_of(topic) for topic in rows
                                       if topic.startswith('/left/') and 'info' not in topic}))
    assert [item.kind for item in seen] == ['sensor_pose', 'image', 'contact']
    assert [item.stamp_ns for item in seen] == [99, 100, 100]
    pose, image, contact = (item.value() for item in seen)
    np.testing.assert_allclose(pose, POSE, atol=1e-12)
    np.testing.assert_array_equal(image.layers[0].stress, STRESS)
    assert (image.sequence, image.tared, image.array.shape) == (7, True, (3, 4))
    assert image.array.pitch_y == pytest.approx(2e-3)  # single precision
    assert (contact.type, contact.x, contact.y) == (ContactType.POINT, 1e-3, -2e-3)


def bad_pose(message):
    message.pose.orientation.w = 7.0


def bad_contact(message):
    message.type = 9


def bad_image(message):
    message.rows = 5


@pytest.mark.parametrize('topic, change, why', [
    ('/left/sensor_pose', bad_pose, 'quaternion'), ('/left/image', bad_image, '5 x 4'),
    ('/left/contact', bad_contact, 'contact type is 9')])
def test_an_impossible_message_is_refused_when_its_value_is_asked_for(write, topic, change, why):
    message = messages()[topic]
    change(message)
    path = write({topic: message})
    with Bag(path) as bag:
        (seen,) = observations(bag, {topic: kind_of(topic)})
        with pytest.raises(ConfigurationError, match=why) as caught:
            seen.value()
    assert f'bag {path}: the message on {topic} at 0.000001 s' in str(caught.value)


def test_a_message_of_an_older_definition_is_refused_with_what_it_lacks(tmp_path):
    text = 'std_msgs/Header header\nuint8 type\n' + '=' * 80 + (
        '\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n') + '=' * 80 + (
        '\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n')
    with rosbag2.Writer(tmp_path / 'run', version=9) as writer:
        connection = writer.add_connection(
            '/left/contact', TYPES['contact'], msgdef=text, rihs01='RIHS01_' + 64 * '0')
        writer.write(connection, 1000, b'\x00\x01\x00\x00' + 8 * b'\x00'
                     + b'\x01\x00\x00\x00\x00\x01')
    with Bag(tmp_path / 'run') as bag:
        (seen,) = observations(bag, {'/left/contact': 'contact'})
        with pytest.raises(ConfigurationError, match="messages on /left/contact are of another "
                           "version of tactile_msgs/msg/Contact: they have no field 'valid'"):
            seen.value()
