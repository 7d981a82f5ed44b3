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

from edge_tracking.graph import Graph
from edge_tracking.recording.topics import GraphBag
from edge_tracking.replay import play_bag
from edge_tracking.replay.play_bag import Playback, PlayerNode, SETTLE
from tactile_common.errors import ConfigurationError
from tactile_common.ros.bag_reader import Bag, Recorded
from tactile_common.ros.conversions import NS, stamp_to_ns, stamp_to_seconds
from tactile_msgs.msg import Contact, ServoStatus, SurfacePatch, TactileImage
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
        self.graph.spin(until, DEADLINE)
        assert until()

    def pause(self, paused):
        done = self.listener.create_client(SetBool, 'play_bag/pause').call_async(
            SetBool.Request(data=paused))
        self.spin(done.done)
        return done.result().success


def in_time(contact):
    """Whether a latency is of one image: a clock that jumps is a recording, 1 s, off."""
    return -0.2 < stamp_to_seconds(contact.latency) < 0.8


@pytest.fixture
def playing():
    """Give a function that plays a recording to both estimators."""
    with GraphBag(CORNER) as bag, Graph() as graph:
        def begin(**options):
            own = {'bag': bag, **options}
            listener = graph.add(ListenerNode)
            for kind in (ContactEstimatorNode, ShapeEstimatorNode):
                graph.add(kind, use_sim_time=True)
            return Played(graph, graph.add(PlayerNode, own=own), listener)
        yield begin


@pytest.mark.graph
@pytest.mark.parametrize('rate', [0.3, 5.0])
def test_contacts_are_those_of_the_recording_at_any_rate(playing, rate):
    it = playing(rate=rate)
    begun = time.monotonic()
    it.spin(lambda: it.player.playback.finished)
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
        assert in_time(anew)
    assert heard.patches and heard.statuses


@pytest.mark.graph
def test_nothing_is_played_while_it_is_paused(playing):
    it = playing(paused=True)
    it.spin(lambda: len(it.listener.clocks) > 700)  # beyond the second from the first listener
    begin = it.player.playback.now_ns
    assert it.pause(False)
    it.spin(lambda: len(it.listener.contacts) > 20)
    assert it.pause(True)
    there, ticks = it.player.playback.now_ns, len(it.listener.clocks)
    it.spin(lambda: len(it.listener.clocks) > ticks + 100)
    assert it.player.playback.now_ns == there > begin and not it.player.playback.finished
    assert it.pause(False)
    it.spin(lambda: it.player.playback.finished)


@pytest.mark.graph
def test_a_loop_begins_anew(playing):
    it = playing(rate=5.0, loop=True)

    def stamps():
        return [stamp_to_ns(msg.header.stamp) for msg in it.listener.patches]
    it.spin(lambda: sum(b < a for a, b in zip(stamps(), stamps()[1:], strict=False)) >= 2)
    assert all(map(in_time, it.listener.contacts))
    second = stamps()
    again = max(k for k in range(1, len(second)) if second[k] < second[k - 1])
    it.spin(lambda: len(it.listener.patches) > again + 50)
    assert not it.player.playback.finished


class Rows:
    """A bag of three messages, at 0, 1 and 2 s; the last cannot be read if it is damaged."""

    span = (0, 2 * NS)
    readable = GraphBag.readable

    def __init__(self, damaged=False):
        self._damaged = damaged

    def messages(self, topics):
        yield from (Recorded(topic, k * NS, b'', self) for topic in topics for k in (0, 1))
        if self._damaged:
            raise ConfigurationError('damaged')
        yield from (Recorded(topic, 2 * NS, b'', self) for topic in topics)


def played(playback, seconds, step=0.25):
    """Let real time go by; gives when what was due, both in s."""
    return [(round(k * step, 2), row.received_ns // NS) for k in range(round(seconds / step))
            for row in playback.advance(step)]


@pytest.mark.parametrize('rate', [0.1, 1.0, 5.0])
def test_messages_are_due_at_their_times_by_the_rate(rate):
    step = 0.125 / rate
    playback = Playback(Rows(), ['/a'], rate)
    assert not played(playback, SETTLE, step=0.25) and playback.now_ns == 0
    due = played(playback, 2.0 / rate + step, step)
    assert [number for _, number in due] == [0, 1, 2]
    for when, number in due:
        assert when == pytest.approx(number / rate, abs=1.5 * step)
    assert not playback.finished  # what was sent last is still worked off
    assert not played(playback, SETTLE + 0.5) and playback.finished


def test_the_time_stops_at_both_ends_of_a_loop():
    playback = Playback(Rows(), ['/a'], loop=True)
    due = played(playback, 12.0)
    assert [number for _, number in due[:7]] == [0, 1, 2, 0, 1, 2, 0]
    assert due[3][0] - due[2][0] >= 2.0 and not playback.finished


def test_a_pause_stops_time_and_messages_and_nothing_is_lost():
    playback = Playback(Rows(), ['/a'], paused=True)
    assert not played(playback, 10.0) and playback.now_ns == 0
    playback.paused = False
    assert [number for _, number in played(playback, SETTLE + 1.5)] == [0, 1]
    playback.paused, there = True, playback.now_ns
    assert not played(playback, 10.0) and playback.now_ns == there
    playback.paused = False
    assert [number for _, number in played(playback, 5.0)] == [2] and playback.finished


@pytest.mark.parametrize('loop', [False, True])
def test_a_damaged_bag_ends_where_it_is_damaged(loop):
    playback = Playback(Rows(damaged=True), ['/a'], loop=loop)
    assert [number for _, number in played(playback, 10.0)] == [0, 1]
    assert playback.finished and playback.faults == ['damaged']


@pytest.mark.graph
def test_a_recording_begins_when_the_estimators_are_there_not_with_any_listener():
    with GraphBag(CORNER) as bag, Graph() as graph:
        listener = graph.add(ListenerNode)
        images = listener.create_subscription(TactileImage, 'image', lambda _: None, SENSOR)
        player = graph.add(PlayerNode, own={
            'bag': bag, 'rate': 5.0, 'wait_for': ('contact',)})
        it = Played(graph, player, listener)
        it.spin(lambda: len(listener.clocks) > 700)  # beyond the second that the time stops
        assert player.playback.now_ns == bag.span[0]
        assert player.count_subscribers('image') and images
        graph.add(ContactEstimatorNode, use_sim_time=True)
        it.spin(lambda: player.playback.finished)
        it.spin(lambda: listener.contacts)


@pytest.mark.graph
def test_contacts_of_a_recording_without_images_have_their_usual_name():
    with GraphBag(CORNER) as bag, Graph() as graph:
        del bag.topic['image']
        listener = graph.add(ListenerNode)
        graph.add(ShapeEstimatorNode, use_sim_time=True)
        it = Played(graph, graph.add(
            PlayerNode, own={'bag': bag, 'rate': 5.0}), listener)
        it.spin(lambda: it.player.playback.finished)
        it.spin(lambda: listener.patches)
        assert listener.contacts and not listener.recorded


@pytest.mark.graph
@pytest.mark.parametrize('topic, refused', [('/tactile/image', True), ('/joint_states', False)])
def test_a_topic_of_another_definition_is_not_sent_on(playing, monkeypatch, topic, refused):
    same = Bag.is_of_type
    monkeypatch.setattr(Bag, 'is_of_type', lambda bag, name, kind:
                        name != topic and same(bag, name, kind))
    if refused:
        with pytest.raises(ConfigurationError, match='has no image that can be played'):
            playing()
        return
    it = playing(rate=5.0)
    assert not it.listener.count_publishers('/joint_states')
    it.spin(lambda: it.listener.contacts)


@pytest.mark.parametrize('arguments, said', [
    (['nothing'], 'nothing: there is no such bag'),
    ([str(CORNER), '--rate', '0'], '--rate: value is 0.0, must be between 0.01 and 100'),
    ([str(CORNER), '--namespace', 'left'], 'no contact of a tactile sensor in /left')])
def test_what_cannot_be_played_is_refused(arguments, said, capsys):
    assert play_bag.main(arguments) == 2
    assert said in capsys.readouterr().err


@pytest.mark.graph
def test_a_bag_that_cannot_be_read_on_is_played_up_to_there(playing, monkeypatch):
    messages = Bag.messages

    def cut(*arguments):
        yield from islice(messages(*arguments), 500)
        raise ConfigurationError('it ends here')
    monkeypatch.setattr(Bag, 'messages', cut)
    it = playing(loop=True)
    it.spin(lambda: it.player.playback.finished)
    assert it.player.playback.faults == ['it ends here']
    it.spin(lambda: it.listener.contacts)
