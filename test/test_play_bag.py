"""A recording played to the nodes with simulated time gives what was recorded."""
import dataclasses
from itertools import islice
from pathlib import Path
import time

import pytest
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data, QoSProfile
from rosgraph_msgs.msg import Clock
from std_srvs.srv import SetBool

from edge_tracking import play_bag
from edge_tracking.graph import Graph
from edge_tracking.play_bag import PlayerNode
from edge_tracking.replay.names import Names
from tactile_common.errors import ConfigurationError
from tactile_common.ros.bag_reader import Bag
from tactile_common.ros.conversions import stamp_to_ns
from tactile_msgs.msg import Contact, ServoStatus, SurfacePatch
from tactile_sensing.nodes.contact_estimator import ContactEstimatorNode
from tactile_sensing.types.contact import REALS
from tactile_shape.nodes.shape_estimator import ShapeEstimatorNode

CORNER = Path(__file__).parent / 'golden/corner'
DEADLINE = 60.0  # s
SENSOR = QoSProfile(depth=1000, reliability=qos_profile_sensor_data.reliability)


class ListenerNode(Node):
    """Keeps what is recomputed and what was recorded."""

    def __init__(self, **kwargs):
        super().__init__('listener', **kwargs)
        self.clocks, self.contacts, self.recorded, self.patches, self.statuses = lists = [
            [], [], [], [], []]
        for (kind, topic, qos), kept in zip((
                (Clock, '/clock', 10), (Contact, 'contact', SENSOR),
                (Contact, 'recorded/contact', SENSOR), (SurfacePatch, 'surface_patch', 1000),
                (ServoStatus, 'servo_status', 1000)), lists, strict=True):
            self.create_subscription(kind, topic, kept.append, qos)


@dataclasses.dataclass
class Played:
    """A graph that hears a recording."""

    graph: Graph
    player: PlayerNode
    listener: ListenerNode

    def spin(self, until):
        end = time.monotonic() + DEADLINE
        self.graph.spin(lambda: until() or time.monotonic() > end)
        assert until()

    def pause(self, paused):
        done = self.listener.create_client(SetBool, 'play_bag/pause').call_async(
            SetBool.Request(data=paused))
        self.spin(done.done)
        return done.result().success


@pytest.fixture
def playing():
    """Give a function that plays a recording to both estimators."""
    with Bag(CORNER) as bag, Graph() as graph:
        def begin(**options):
            own = {'bag': bag, 'names': Names(bag, None), **options}
            listener = graph.add(ListenerNode)
            for kind in (ContactEstimatorNode, ShapeEstimatorNode):
                graph.add(kind, use_sim_time=True)
            return Played(graph, graph.add(PlayerNode, own=own), listener)
        yield begin


@pytest.mark.graph
@pytest.mark.parametrize('rate', [0.3, 1.0, 5.0])
def test_contacts_are_those_of_the_recording_at_any_rate(playing, rate):
    it = playing(rate=rate)
    begun = time.monotonic()
    it.spin(lambda: it.player.finished)
    assert time.monotonic() - begun > 0.9 / rate  # s that it lasts
    heard = it.listener
    it.spin(lambda: len(heard.contacts) > 20)  # a busy machine leaves many out
    recorded = {stamp_to_ns(msg.header.stamp): msg for msg in heard.recorded}
    both = [(msg, recorded[stamp]) for msg in heard.contacts
            if (stamp := stamp_to_ns(msg.header.stamp)) in recorded]
    assert len(both) > 20
    for anew, before in both:
        assert (anew.type, anew.valid, anew.reasons) == (before.type, before.valid, before.reasons)
        for name in REALS:
            assert getattr(anew, name) == pytest.approx(
                getattr(before, name), rel=1e-6, abs=1e-6, nan_ok=True)
        assert -1 <= anew.latency.sec < 1  # of the recording's time
    assert heard.patches and heard.statuses


@pytest.mark.graph
def test_nothing_is_played_while_it_is_paused(playing):
    it = playing(paused=True)
    it.spin(lambda: len(it.listener.clocks) > 700)  # beyond the second from the first listener
    begin = it.player.now_ns
    assert it.pause(False)
    it.spin(lambda: len(it.listener.contacts) > 20)
    assert it.pause(True)
    there, ticks = it.player.now_ns, len(it.listener.clocks)
    it.spin(lambda: len(it.listener.clocks) > ticks + 100)
    assert it.player.now_ns == there > begin and not it.player.finished
    assert it.pause(False)
    it.spin(lambda: it.player.finished)


@pytest.mark.graph
def test_a_loop_begins_anew(playing):
    it = playing(rate=3.0, loop=True)

    def stamps():
        return [stamp_to_ns(msg.header.stamp) for msg in it.listener.patches]
    it.spin(lambda: sum(b < a for a, b in zip(stamps(), stamps()[1:], strict=False)) >= 2)
    second = stamps()
    again = max(k for k in range(1, len(second)) if second[k] < second[k - 1])
    it.spin(lambda: len(it.listener.patches) > again + 50)
    assert not it.player.finished


@pytest.mark.graph
def test_a_bag_that_cannot_be_read_on_is_played_up_to_there(playing, monkeypatch):
    messages = Bag.messages

    def cut(*arguments, **options):
        yield from islice(messages(*arguments, **options), 500)
        raise ConfigurationError('it ends here')
    monkeypatch.setattr(Bag, 'messages', cut)
    it = playing(loop=True)
    it.spin(lambda: it.player.finished)
    assert it.player.fault == 'it ends here'
    it.spin(lambda: it.listener.contacts)


@pytest.mark.parametrize('arguments, said', [
    (['nothing'], 'nothing: there is no such bag'),
    ([str(CORNER), '--rate', '0'], '--rate: value is 0.0, must be between 0.01 and 100'),
    ([str(CORNER), '--namespace', 'left'], 'has no /left/image')])
def test_what_cannot_be_played_is_refused(arguments, said, capsys):
    assert play_bag.main(arguments) == 2
    assert said in capsys.readouterr().err
