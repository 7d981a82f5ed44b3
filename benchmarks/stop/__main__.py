"""Distance and time of the pad from a pause to rest, by speed, in simulation: docs/safety.md."""

import argparse
from pathlib import Path

import numpy as np

from benchmarks.harness import table
from tactile_servo.motion.limits import JointLimits
from tactile_servo.motion.robot import RobotModel
from tactile_servo.types import EdgeGoal
from tactile_simulation.closed_loop import Simulation
from tactile_simulation.scene import load_scene

ROOT = Path(__file__).resolve().parents[2]
START = np.radians([-22, 35, -172, 0, -48, -22])
REST = 1e-6  # m/s


def stop(speed, acceleration):
    """Return the stop distance [m] and time [s] of a PUMA 260 on an edge, and the force [N]."""
    model = RobotModel.from_urdf(ROOT / 'launch/urdf/puma260.urdf', 'tactile_pad')
    limits = JointLimits(model.joint_names, model.lower + 0.05, model.upper - 0.05,
                         model.velocity_limit, np.full(6, acceleration))
    loop = Simulation(load_scene(ROOT / 'launch/scenes/straight.yaml'), 'trace',
                      robot=(model, limits), seed_positions=START)
    loop.run(EdgeGoal(speed, 5.0), 30.0, lambda status: status.progress > 0.09)
    begin, place, first = loop.now, loop.pose[:3, 3].copy(), len(loop.log)
    loop.servo.pause(True, begin)
    loop.run(None, 1.0)
    places = np.array([cycle.pose[:3, 3] for cycle in loop.log[first:]])
    times = np.array([cycle.time for cycle in loop.log[first:]])
    moving = np.linalg.norm(np.diff(places, axis=0), axis=1) / np.diff(times) > REST
    rest = times[1:][moving][-1]
    return (float(np.linalg.norm(places - place, axis=1).max()), float(rest - begin),
            max(cycle.force for cycle in loop.log[first:]))


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(prog='stop', description=__doc__)
    parser.add_argument('--acceleration', type=float, default=10.0, help='of joints [rad/s^2]')
    options = parser.parse_args()
    rows = []
    for speed in (0.01, 0.03, 0.1, 0.2):
        way, time, force = stop(speed, options.acceleration)
        rows.append((f'{1e3 * speed:g}', f'{1e3 * way:.1f}', f'{1e3 * time:.0f}', f'{force:.1f}'))
    print(table(('speed [mm/s]', 'way [mm]', 'time [ms]', 'largest force [N], of 5'), rows))


if __name__ == '__main__':
    main()
