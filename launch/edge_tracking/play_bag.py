"""
Play a recording to a graph, with its time on /clock for nodes that `use_sim_time`.

Images, joint states and what the servo said go out as they were recorded. What the estimators
make anew, and what would move a robot, goes out below `recorded`. Playing begins a second after
somebody listens to the images; ~/pause (SetBool) stops the time and lets it go on.
"""
import argparse
from collections.abc import Iterator
import math
from pathlib import Path
import sys
import time
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.publisher import Publisher
from rosgraph_msgs.msg import Clock as ClockMsg
from std_srvs.srv import SetBool

from edge_tracking.process_group import topics
from edge_tracking.replay.names import Names
from tactile_common.command_line import between, Parser, refusing
from tactile_common.errors import ConfigurationError
from tactile_common.ros.bag_reader import Bag, Recorded
from tactile_common.ros.conversions import NS, set_stamp
from tactile_common.ros.runner import run, split_ros_args

TICK = 0.002  # s between two looks at what is due
LONGEST_TICK = 0.02  # s that the time goes on at once: a machine that is too slow plays slower
HEARD = 1.0  # s from the first listener until the time begins
ASIDE = ('contact', 'wrench', 'surface_patch', 'contour', 'markers', 'joint_trajectory')
UNSAID = ('parameters', 'servo_calls', 'diagnostics')  # of nodes that do not run


class PlayerNode(Node):
    """
    Publish the messages of a bag when they are due, see above.

    Attributes
    ----------
    now_ns : int
        Time of the recording that it is [ns].
    finished : bool
        Whether all that can be read has been played.
    fault : str
        Why no more can be read.
    """

    def __init__(self, bag: Bag, names: Names, rate: float = 1.0, loop: bool = False,
                 paused: bool = False, **kwargs: Any):
        super().__init__('play_bag', **{'namespace': names.prefix, **kwargs})
        self._bag, self._rate, self._loop, self._paused = bag, rate, loop, paused
        self.finished, self._heard, self._last = False, math.inf, time.monotonic()
        self.fault = ''
        self._clock_publisher = self.create_publisher(ClockMsg, '/clock', 10)
        self._publishers_of: dict[str, Publisher] = {}
        for name, kind, qos in topics(names.prefix.strip('/')):
            short = name.rpartition('/')[2]
            if short in names.topic and short not in UNSAID:
                name = f'{names.prefix}/recorded/{short}' if short in ASIDE else name
                self._publishers_of[names.topic[short]] = self.create_publisher(kind, name, qos)
        first = 'image' if 'image' in names.topic else 'contact'
        self._first = self._publishers_of[names.topic[first]]
        self._begin()
        self.create_service(SetBool, '~/pause', self._on_pause)
        self.create_timer(TICK, self._on_tick, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _begin(self) -> None:
        self.now_ns = self._bag.span[0]
        self._rows: Iterator[Recorded] = self._bag.messages(list(self._publishers_of), raw=True)
        self._next = self._read()

    def _read(self) -> Recorded | None:
        try:
            return next(self._rows, None)
        except ConfigurationError as error:
            self.fault = str(error)
            return None

    def _on_pause(self, request: SetBool.Request, response: SetBool.Response) -> Any:
        self._paused, response.success = request.data, True
        return response

    def _on_tick(self) -> None:
        now = time.monotonic()
        elapsed, self._last = min(now - self._last, LONGEST_TICK), now
        if self._first.get_subscription_count():
            self._heard = min(self._heard, now)
        if not self._paused and now - self._heard > HEARD:
            self.now_ns += round(NS * self._rate * elapsed)
        message = ClockMsg()
        set_stamp(message.clock, self.now_ns)
        self._clock_publisher.publish(message)
        while self._next is not None and self._next.received_ns <= self.now_ns:
            self._publishers_of[self._next.topic].publish(self._next.message)
            self._next = self._read()
        if self._next is None:
            self.finished = not self._loop or bool(self.fault)
            if not self.finished:
                self._begin()


def parser() -> argparse.ArgumentParser:
    """Command line; what follows --ros-args is not of it."""
    arguments = Parser(prog='play_bag', description=(__doc__ or '').strip(),
                       formatter_class=argparse.RawDescriptionHelpFormatter)
    add = arguments.add_argument
    add('bag', type=Path, metavar='BAG', help='folder, .mcap or .db3 file of a recording')
    add('--rate', type=between(0.01, 100.0), default=1.0, metavar='R',
        help='times real time, 0.01 to 100; what the machine cannot do is played slower')
    add('--loop', action='store_true', help='begin anew at the end; the time goes back')
    add('--paused', action='store_true', help='wait for ~/pause false')
    add('--namespace', help='of the sensor in a bag that has several')
    return arguments


def main(args: list[str] | None = None) -> int:
    """Play; exit status 2 where the bag cannot be read whole."""
    given, ros = split_ros_args(sys.argv[1:] if args is None else args)
    with refusing('play_bag') as command:
        options = parser().parse_args(given)
        with Bag(options.bag) as bag:
            names, nodes = Names(bag, options.namespace), []

            def play_bag(context: Any) -> PlayerNode:
                nodes.append(PlayerNode(bag, names, options.rate, options.loop, options.paused,
                                        context=context))
                return nodes[0]

            command.status = run(play_bag, ros, lambda node: node.finished)
        if nodes and nodes[0].fault:
            raise ConfigurationError(nodes[0].fault)
    return command.status
