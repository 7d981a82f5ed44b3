"""
Force on the pad while the machine has too little time for the graph.

The demo's processes track short ways, goal after goal, beside busy loops. The force is the scene's
at the joint states that the mock robot published: it does not pass through the servo.

  ./ws shell -c 'python3 -m tactile_tests.overload --goals 24 --loops 4'
"""
import argparse
from functools import partial
import os
from pathlib import Path
import subprocess
import sys
from tempfile import TemporaryDirectory
import time

import numpy as np

from edge_tracking.graph import add_servo, calibrate, Graph, private_port, SETTLE
from edge_tracking.process_group import apart
from edge_tracking.recording.run import read_run
from edge_tracking.resources import share
from edge_tracking.track import RESUMES, TrackNode
from tactile_common.command_line import to_json
from tactile_common.ros.bag_reader import Bag
from tactile_common.ros.conversions import stamp_to_ns
from tactile_servo.motion.robot import RobotModel
from tactile_servo.types import State
from tactile_simulation.edge_world import EdgeWorld
from tactile_simulation.scene import find_scene, load_scene

GIVE_UP = 60.0  # s for one goal
FORCE, ROBOT, SCENE = 5.0, share('urdf', 'puma260.urdf'), find_scene('straight')
# A loop at the usual niceness that ends with this process.
BUSY = 'import os\nparent = os.getppid()\nwhile os.getppid() == parent: pass'


def run_goals(count, bag):
    """Send so many goals; begin and end [s] and reason of each."""
    ended = []
    with private_port() as port, apart('recorder', bag), apart('shape'), \
            apart('mocks', port, SCENE, ROBOT, 0), \
            apart('sensing', port, calibrate(port, load_scene(SCENE))), Graph() as graph:
        servo = add_servo(graph, ROBOT)
        graph.spin(lambda: servo.count_subscribers('servo_status') > 0)
        for number in range(count):
            begin = time.time()
            track = graph.add(TrackNode, own={'on_feedback': lambda _: None}, wait=GIVE_UP,
                              speed=0.03, force=FORCE, length=0.02,
                              direction=1 - 2 * (number % 2), resumes=RESUMES)
            graph.spin(partial(getattr, track, 'finished'), GIVE_UP)
            if not track.finished:
                track.cancel()
                graph.spin(partial(getattr, track, 'finished'), 5.0)
            ended.append((begin, time.time(), track.reason or 'not ended'))
            graph.nodes.remove(track)
            graph.executor.remove_node(track)
            graph.spin(lambda: False, SETTLE)
            track.destroy_node()
    return ended


def true_forces(bag):
    """Stamps (N,) [s] of the joint states and the force (N,) [N] at them."""
    robot, world, rows = RobotModel.from_urdf(ROBOT, 'tactile_pad'), EdgeWorld(
        load_scene(SCENE)), []
    with Bag(bag) as recording:
        for row in recording.messages(['/joint_states']):
            joints = dict(zip(row.message.name, row.message.position, strict=True))
            pose = robot.pose(np.array([joints[name] for name in robot.joint_names]))
            rows.append((1e-9 * stamp_to_ns(row.message.header.stamp), world.force(pose)))
    return np.array(rows).T


def main(args=None):
    """Run and report each goal; exit status 0 if no force passed 1.5 times what was asked for."""
    parser = argparse.ArgumentParser(prog='overload', description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--goals', type=int, default=24)
    parser.add_argument('--loops', type=int, default=4, help='busy loops beside the graph')
    options = parser.parse_args(args)
    with TemporaryDirectory() as folder:
        bag = Path(folder, 'bag')
        loops = [subprocess.Popen([sys.executable, '-c', BUSY]) for _ in range(options.loops)]
        try:
            goals = run_goals(options.goals, bag)
        finally:
            for loop in loops:
                loop.kill()
                loop.wait()
        (times, forces), statuses = true_forces(bag), read_run(bag).statuses
    worst = 0.0
    for number, (begin, end, reason) in enumerate(goals):
        most = forces[(begin <= times) & (times <= end)].max(initial=0.0)
        told = 1e-9 * statuses.stamp_ns
        held = statuses.state[(begin <= told) & (told <= end)] == State.HOLD
        worst = max(worst, most)
        print(to_json({'goal': number, 'reason': reason, 'force_max': most,
                       'holds': np.count_nonzero(np.diff(held.astype(int)) > 0)}))
    print(f'load average {os.getloadavg()[0]:.1f}; largest force {worst:.2f} N for {FORCE:g} N',
          file=sys.stderr)
    return int(worst > 1.5 * FORCE)


if __name__ == '__main__':
    sys.exit(main())
