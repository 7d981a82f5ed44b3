"""A recorded run, replayed through the estimator, gives the recorded contacts again."""

import time

import pytest
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from tactile_tests.graph import half_rates

from edge_tracking.graph import add_mocks, add_sensing, add_servo, Graph, private_port
from edge_tracking.resources import share
from edge_tracking.track import TrackNode
from tactile_common.ros.bag_reader import Bag
from tactile_msgs.msg import Contact, TactileImage
from tactile_sensing.nodes.contact_estimator import ContactEstimatorNode
from tactile_simulation.scene import find_scene

SECONDS = 60.0  # generous, for a busy machine


class Player(Node):
    """Publishes recorded bytes one after the other, each when the last one has its answer."""

    def __init__(self, pictures, **kwargs):
        super().__init__('player', **kwargs)
        self.contacts = []
        self._pictures = iter(pictures)
        self._publisher = self.create_publisher(TactileImage, 'image', qos_profile_sensor_data)
        self.create_subscription(
            Contact, 'contact', self._on_contact, qos_profile_sensor_data)
        self.finished = False

    def _on_contact(self, contact):
        self.contacts.append(contact)
        self.send()

    def ready(self):
        return self._publisher.get_subscription_count() > 0 and self.count_publishers(
            self.resolve_topic_name('contact')) > 0

    def send(self):
        picture = next(self._pictures, None)
        if picture is None:
            self.finished = True
        else:
            self._publisher.publish(bytes(picture))


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    folder = tmp_path_factory.mktemp('run')
    robot = share('urdf', 'puma260.urdf')
    with private_port() as port, Graph(half_rates(folder)) as graph:
        add_servo(graph, robot)
        add_sensing(graph, port)
        add_mocks(graph, port, find_scene('straight'), robot)
        track = graph.add(
            TrackNode, length=0.02, retreat=False, record=str(folder / 'bag'), resumes=100)
        end = time.monotonic() + SECONDS
        graph.spin(lambda: track.finished or time.monotonic() > end)
        assert track.success, track.reason
    return folder / 'bag'


def test_replayed_pictures_give_the_recorded_contacts(bag):
    with Bag(bag) as recorded:
        before = {contact.sequence: contact
                  for _, _, contact in recorded.messages(['/tactile/contact'])}
        pictures = [data for _, _, data in recorded.messages(['/tactile/image'], raw=True)]
    assert len(pictures) > 100

    with Graph(namespace='replay') as graph:
        graph.add(ContactEstimatorNode)
        player = graph.add(Player, own={'pictures': pictures})
        end = time.monotonic() + SECONDS
        graph.spin(lambda: player.ready() or time.monotonic() > end)
        player.send()
        graph.spin(lambda: player.finished or time.monotonic() > end)
    after = {contact.sequence: contact for contact in player.contacts}
    assert len(after) == len(pictures)
    common = sorted(before.keys() & after.keys())
    assert len(common) > 0.6 * len(pictures)  # the first pass while nodes find each other
    assert sum(after[k].valid for k in common) > 30
    for k in common:
        one, other = before[k], after[k]
        assert (one.type, one.valid, one.reasons) == (other.type, other.valid, other.reasons)
        assert other.header.stamp.sec == one.header.stamp.sec
        if one.valid:
            assert (one.x, one.y, one.yaw, one.normal_force) == (
                other.x, other.y, other.yaw, other.normal_force)
