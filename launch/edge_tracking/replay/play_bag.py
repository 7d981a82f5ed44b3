"""
Play a recording to a graph, and its time on /clock for nodes with `use_sim_time`.

Images, joint states and the servo's messages are published as recorded. Topics that the
estimators compute anew, or that would move a robot, are published below `recorded`. Playing
begins one second after somebody subscribes to the images (or to the contacts, if there are no
images) and somebody publishes each topic of `--wait-for`. ~/pause (SetBool) stops and continues
the time.
"""
import argparse
from collections.abc import Collection
from operator import attrgetter
from pathlib import Path
import sys
import time
from typing import Any

from rclpy.publisher import Publisher
from rosgraph_msgs.msg import Clock
from std_srvs.srv import SetBool

from edge_tracking.recording.topics import GraphBag, short_name, topics
from edge_tracking.replay.one import OF_IMAGES, OF_SHAPE
from tactile_common.command_line import between, Parser, refusing
from tactile_common.errors import ConfigurationError
from tactile_common.ros.bag_reader import Recorded
from tactile_common.ros.conversions import NS, set_stamp
from tactile_common.ros.node import TactileNode
from tactile_common.ros.runner import run, split_ros_args

TICK = 0.002  # s between two checks for messages that are due
LONGEST_TICK = 0.02  # s, largest step of the time; a slow machine plays more slowly
SETTLE = 1.0  # s without messages at both ends, so that nodes can connect, and finish
ASIDE = (*OF_SHAPE, 'joint_trajectory')  # and OF_IMAGES, if there are images
UNSAID = ('parameters', 'servo_calls', 'diagnostics')  # from nodes that do not run


class Playback:
    """
    Determines which messages of a bag are due; uses neither ROS nor a clock.

    The time `now_ns` of the recording stops while `paused`, and for `SETTLE` before the first
    message and after the last one. Nodes can then finish before a loop sets the time back, or the
    player ends. `finished` is True if all readable messages have been played; `faults` say why no
    more can be read.
    """

    def __init__(self, bag: GraphBag, topics: Collection[str], rate: float = 1.0,
                 loop: bool = False, paused: bool = False):
        self._bag, self._topics, self._rate, self._loop = bag, topics, rate, loop
        self.paused, self.finished, self.faults = paused, False, list[str]()
        self._begin()

    def _begin(self) -> None:
        self.now_ns, self._settling = self._bag.span[0], SETTLE
        self._rows = self._bag.readable(self._topics, self.faults.append)
        self._next = next(self._rows, None)

    def advance(self, elapsed: float) -> list[Recorded]:
        """Advance by an amount of real time [s]; return the messages that are due by then."""
        if self.paused or self.finished:
            return []
        if self._settling > 0.0:
            self._settling -= elapsed
            return []
        if self._next is None:
            self.finished = not self._loop or bool(self.faults)
            if not self.finished:
                self._begin()
            return []
        self.now_ns += round(NS * self._rate * elapsed)
        due = []
        while self._next is not None and self._next.received_ns <= self.now_ns:
            due.append(self._next)
            self._next = next(self._rows, None)
        self._settling = SETTLE if self._next is None else 0.0
        return due


class PlayerNode(TactileNode):
    """Publishes the messages of a bag when they are due, see above; `playback` decides which."""

    def __init__(self, bag: GraphBag, rate: float = 1.0, loop: bool = False,
                 paused: bool = False, wait_for: Collection[str] = (), **kwargs: Any):
        super().__init__('play_bag', **{'namespace': bag.prefix, **kwargs})
        self._wait_for, self._heard, self._last = wait_for, False, time.monotonic()
        self._clock_publisher = self.create_publisher(Clock, '/clock', 10)
        self._publishers_of: dict[str, Publisher] = {}
        first = 'image' if 'image' in bag.topic else 'contact'
        aside = (*ASIDE, *OF_IMAGES) if first == 'image' else ASIDE
        for name, kind, qos in topics(bag.prefix.strip('/')):
            short = short_name(name)
            topic = bag.topic.get(short)
            if topic is None or short in UNSAID:
                continue
            if not bag.is_of_type(topic, kind):
                self.get_logger().warning(f'{topic} is not played: it is recorded as another '
                                          f'{bag.topics[topic]} than is installed')
                continue
            name = f'{bag.prefix}/recorded/{short}' if short in aside else name
            self._publishers_of[topic] = self.create_publisher(kind, name, qos)
        if bag.topic.get(first) not in self._publishers_of:
            raise ConfigurationError(f'bag {bag.path}: has no {first} that can be played')
        self._first = self._publishers_of[bag.topic[first]]
        self.playback = Playback(bag, list(self._publishers_of), rate, loop, paused)
        self.create_service(SetBool, '~/pause', self._on_pause)
        self.create_timer(TICK, self._on_tick, clock=self.steady)

    def _on_pause(self, request: SetBool.Request, response: SetBool.Response) -> Any:
        self.playback.paused, response.success = request.data, True
        return response

    def _on_tick(self) -> None:
        now = time.monotonic()
        elapsed, self._last = min(now - self._last, LONGEST_TICK), now
        self._heard = self._heard or self._first.get_subscription_count() > 0 and all(
            map(self.count_publishers, self._wait_for))
        due = self.playback.advance(elapsed) if self._heard else []
        message = Clock()
        set_stamp(message.clock, self.playback.now_ns)
        self._clock_publisher.publish(message)
        for row in due:
            self._publishers_of[row.topic].publish(row.data)


def parser() -> argparse.ArgumentParser:
    """Return the command-line parser; it does not cover arguments after --ros-args."""
    arguments = Parser(prog='play_bag', description=(__doc__ or '').strip(),
                       formatter_class=argparse.RawDescriptionHelpFormatter)
    add = arguments.add_argument
    add('bag', type=Path, metavar='BAG', help='folder, .mcap or .db3 file of a recording')
    add('--rate', type=between(0.01, 100.0), default=1.0, metavar='R',
        help='times real time, 0.01 to 100; what the machine cannot do is played slower')
    add('--loop', action='store_true', help='begin anew at the end; the time goes back')
    add('--start-paused', action='store_true', help='wait for ~/pause false')
    add('--wait-for', nargs='+', default=(), metavar='TOPIC',
        help='begin once somebody publishes each of these')
    add('--namespace', help='of the sensor in a bag that has several; default: tactile')
    return arguments


def main(args: list[str] | None = None) -> int:
    """Play; exit status 2 if the bag cannot be read completely."""
    given, ros = split_ros_args(sys.argv[1:] if args is None else args)
    with refusing('play_bag') as command:
        options = parser().parse_args(given)
        with GraphBag(options.bag, options.namespace) as bag:
            bag.require_touch()

            def play_bag(context: Any) -> PlayerNode:
                return PlayerNode(bag, options.rate, options.loop, options.start_paused,
                                  options.wait_for, context=context)

            def status_of(node: PlayerNode) -> int:
                if node.playback.faults:
                    raise ConfigurationError(*node.playback.faults)
                return 0

            command.status = run(play_bag, ros, attrgetter('playback.finished'),
                                 status_of=status_of)
    return command.status
