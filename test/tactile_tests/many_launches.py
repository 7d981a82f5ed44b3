"""
Launches in a row, each with goals while readers of every topic come and go: no process may die.

  ./ws shell -c 'python3 -m tactile_tests.many_launches --launches 40 --readers 12'

It needs launch and launch_ros; the exit status is 0 only if every goal was met and every process
ended with 0.
"""
import argparse
from functools import partial
from itertools import cycle
import re
import sys
import time

from rclpy.node import Node

from edge_tracking.recording.topics import topics
from edge_tracking.track import TrackNode
from tactile_tests.graph import Bench, bench
from tactile_tests.launching import DEADLINE, launched

LENGTH = 0.02  # m
PERIOD = 0.05  # s between readers that go; each is replaced at once
BAD = r'has died|Traceback|\[FATAL\]'


class Readers:
    """Nodes that each listen to all topics; one after the other goes, and another one comes."""

    def __init__(self, it: Bench, count: int):
        self._graph, self._number, self._count = it.graph, 0, count
        self._nodes: list[Node] = []
        self.come_and_go()

    def come_and_go(self) -> None:
        """Let the eldest go, unless some are missing, and the next come."""
        if len(self._nodes) == self._count:
            self._remove(self._nodes.pop(0))
        while len(self._nodes) < self._count:
            self._number += 1
            node = self._graph.add(Node, own={'node_name': f'reader_{self._number}'})
            for name, kind, qos in topics(self._graph.namespace):
                node.create_subscription(kind, name, lambda _: None, qos, raw=True)
            self._nodes.append(node)

    def _remove(self, node):
        self._graph.nodes.remove(node)
        self._graph.executor.remove_node(node)
        last = self._graph.executor.create_task(lambda: None)
        self._graph.spin(last.done)  # no callback of it is queued any more
        node.destroy_node()


def over(client: TrackNode, end: float) -> bool:
    """Whether a goal has ended, or a steady time [s] has come."""
    return client.finished or time.monotonic() > end


def run(readers: int, goals: int) -> list[str]:
    """Launch once and send goals; returns what went wrong, a line each."""
    wrong = []
    with launched('start:=false') as launch, bench() as it:
        crowd = Readers(it, readers)
        it.wait(lambda: it.listener.tared, 'the tare', DEADLINE)
        turn = time.monotonic()
        for direction, _ in zip(cycle((1, -1)), range(goals), strict=False):
            client = it.start_tracking(length=LENGTH, direction=direction, wait=DEADLINE)
            while not client.finished and launch.status is None:
                it.attend(partial(over, client, time.monotonic() + PERIOD), 'the next reader')
                crowd.come_and_go()
            if not client.success:
                wrong.append(f'goal: {client.reason or "not ended"}')
            it.remove('track')
        print(f'  {time.monotonic() - turn:.1f} s, {crowd._number} readers', file=sys.stderr)
        launch.interrupt()
        status = launch.end()
        if status:
            wrong.append(f'exit status {status}')
        wrong += [line for line in launch.lines if re.search(BAD, line)]
    return wrong


def main(args: list[str] | None = None) -> int:
    """Launch again and again, and say what went wrong."""
    parser = argparse.ArgumentParser(prog='many_launches', description=__doc__.split('\n')[1])
    parser.add_argument('--launches', type=int, default=40)
    parser.add_argument('--readers', type=int, default=12)
    parser.add_argument('--goals', type=int, default=2, help='of each launch')
    options = parser.parse_args(args)
    failed = 0
    for number in range(1, options.launches + 1):
        wrong = run(options.readers, options.goals)
        failed += bool(wrong)
        print(f'launch {number}: {"; ".join(wrong) or "all well"}', flush=True)
    print(f'{failed} of {options.launches} launches failed')
    return int(failed > 0)


if __name__ == '__main__':
    sys.exit(main())
