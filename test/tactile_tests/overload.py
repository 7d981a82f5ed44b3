"""
Force on the pad while the machine has too little time for the graph.

The demo's processes track short ways, goal after goal, beside busy loops. What is reported does
not pass through the servo: the force is the scene's at the joint states that the mock robot
published, and so is what each picture should have shown at its stamp.

  ./ws shell -c 'python3 -m tactile_tests.overload --goals 24 --loops 4 --out FOLDER'
"""
import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
import os
from pathlib import Path
import subprocess
import sys
import tempfile
import time

import numpy as np

from edge_tracking.graph import add_servo, calibrate, Graph, linger, private_port
from edge_tracking.process_group import apart
from edge_tracking.recording.run import read_run
from edge_tracking.resources import share
from edge_tracking.track import RESUMES, TrackNode
from tactile_common.ros.bag_reader import Bag
from tactile_common.ros.conversions import stamp_to_ns
from tactile_common.state_buffer import PoseBuffer
from tactile_servo.motion.robot import RobotModel
from tactile_servo.types import State
from tactile_simulation.edge_world import EdgeWorld
from tactile_simulation.metrics import to_json
from tactile_simulation.scene import find_scene, load_scene

GIVE_UP = 60.0  # s for one goal


@contextmanager
def busy(count: int) -> Iterator[None]:
    """Run endless loops, each a process at the usual niceness that ends with this one."""
    program = 'import os\nparent = os.getppid()\nwhile os.getppid() == parent: pass'
    loops = [subprocess.Popen([sys.executable, '-c', program]) for _ in range(count)]
    try:
        yield
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()


def run_goals(options: argparse.Namespace, bag: Path) -> list[tuple[float, float, str]]:
    """Send the goals; begin and end [s] and reason of each."""
    path, robot = find_scene(options.scene), share('urdf', 'puma260.urdf')
    scene, ended = load_scene(path), []
    with private_port() as port, apart('listeners', bag), \
            apart('mocks', port, path, robot, 0), apart('sensing', port, calibrate(port, scene)), \
            Graph() as graph, busy(options.loops):
        servo = add_servo(graph, robot)
        graph.spin(lambda: servo.count_subscribers('servo_status') > 0)
        for number in range(options.goals):
            begin = time.time()
            track = graph.add(TrackNode, own={'on_feedback': lambda _: None}, wait=GIVE_UP,
                              speed=options.speed, force=options.force, length=options.length,
                              direction=1 - 2 * (number % 2), resumes=RESUMES)
            linger(graph, partial(getattr, track, 'finished'), GIVE_UP)
            if not track.finished:
                track.cancel()
                linger(graph, partial(getattr, track, 'finished'), 5.0)
            ended.append((begin, time.time(), track.reason or 'not ended'))
            print(f'goal {number}: {track.reason}', file=sys.stderr)
            graph.nodes.remove(track)
            graph.executor.remove_node(track)
            linger(graph, lambda: False)
            track.destroy_node()
    return ended


def true_course(bag: Path, scene) -> tuple[np.ndarray, np.ndarray, PoseBuffer]:
    """Stamps (N,) [ns] of the joint states, the force (N,) [N] and the poses at them."""
    robot = RobotModel.from_urdf(share('urdf', 'puma260.urdf'), 'tactile_pad')
    renderer, poses = EdgeWorld(scene), PoseBuffer(max_gap=1.0, size=10**7)
    stamps, forces = [], []
    with Bag(bag) as recording:
        for row in recording.messages(['/joint_states']):
            joints = dict(zip(row.message.name, row.message.position, strict=True))
            pose = robot.pose(np.array([joints[name] for name in robot.joint_names]))
            if poses.add(stamp_to_ns(row.message.header.stamp), pose):
                stamps.append(poses.newest_ns)
                forces.append(renderer.force(pose))
    return np.array(stamps), np.array(forces), poses


def picture_errors(images, scene, stamps, poses) -> np.ndarray:
    """Force of each picture less that of the pad's pose at its stamp (N,) [N]; NaN: no pose."""
    renderer, array = EdgeWorld(scene), scene.sensor.array
    area = array.pitch_x * array.pitch_y
    near = [poses._states[k][1] for k in
            np.clip(np.searchsorted(stamps, images.stamp_ns), 0, len(stamps) - 1)]
    shown = area * np.nansum(images.frames, axis=(1, 2))
    return shown - area * np.array([renderer.render(pose).sum() for pose in near])


def report(bag: Path, goals, scene) -> list[dict]:
    """Say of each goal how large the force was, and how wrong the pictures were."""
    data = read_run(bag)
    stamps, forces, poses = true_course(bag, scene)
    errors = picture_errors(data.images, scene, stamps, poses)
    rows = []
    for number, (begin, end, reason) in enumerate(goals):
        def within(at, begin=begin, end=end):
            return (1e-9 * at >= begin) & (1e-9 * at <= end)
        force, seen = forces[within(stamps)], within(data.images.stamp_ns)
        states = data.statuses.state[within(data.statuses.stamp_ns)]
        rows.append({
            'goal': number, 'reason': reason, 'force_max': force.max(initial=0.0),
            'picture_error_max': np.abs(errors[seen]).max(initial=0.0),
            'picture_gap_max': np.diff(data.images.stamp_ns[seen]).max(initial=0) * 1e-9,
            'joint_state_gap_max': np.diff(stamps[within(stamps)]).max(initial=0) * 1e-9,
            'cycle_gap_max': np.diff(
                data.statuses.stamp_ns[within(data.statuses.stamp_ns)]).max(initial=0) * 1e-9,
            'holds': int(np.count_nonzero(np.diff((states == State.HOLD).astype(int)) > 0))})
    return rows


def main(args: list[str] | None = None) -> int:
    """Run and report; exit status 0 if no force passed 1.5 times what was asked for."""
    parser = argparse.ArgumentParser(prog='overload', description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add('--goals', type=int, default=24)
    add('--loops', type=int, default=4, help='busy loops beside the graph')
    add('--scene', default='straight')
    add('--speed', type=float, default=0.03, help='[m/s]')
    add('--force', type=float, default=5.0, help='[N]')
    add('--length', type=float, default=0.02, help='[m]')
    add('--out', help='new folder of the recording; default: none is kept')
    options = parser.parse_args(args)
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(options.out or folder, 'bag')
        bag.parent.mkdir(parents=True, exist_ok=True)
        goals = run_goals(options, bag)
        rows = report(bag, goals, load_scene(find_scene(options.scene)))
    for row in rows:
        print(to_json(row))
    worst = max(row['force_max'] for row in rows)
    print(f'load average {os.getloadavg()[0]:.1f}; largest force {worst:.2f} N for '
          f'{options.force:g} N', file=sys.stderr)
    return int(worst > 1.5 * options.force)


if __name__ == '__main__':
    sys.exit(main())
