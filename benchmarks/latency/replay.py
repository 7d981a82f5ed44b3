"""
Processor time of a cycle of the servo's core, without ROS, with the repeated inputs of a run.

The simulation records the inputs of a servo that follows the straight edge at 30 mm/s. Then
another servo gets the same inputs: warm; with 8 MB touched before every call; and after a sleep
before every cycle, on processors that halt in the sleep and on processors that are kept awake.
Every call counts with its best time of several passes; on a busy machine runs still differ by a
third. Prints a table; run it as a module.
"""

import argparse
from contextlib import nullcontext
from time import sleep

import numpy as np

from benchmarks.latency.awake import kept_awake
from benchmarks.latency.meter import Meter
from edge_tracking.resources import share
from tactile_servo.goal_run import GoalRun
from tactile_servo.inputs import Inputs
from tactile_servo.motion.limits import JointLimits, WorkspaceBox
from tactile_servo.motion.motion import Motion
from tactile_servo.motion.robot import RobotModel
from tactile_servo.supervisor import Supervisor
from tactile_servo.types import EdgeGoal, TRACKING
from tactile_simulation.closed_loop import Simulation
from tactile_simulation.scene import find_scene, load_scene

GOAL, SECONDS = EdgeGoal(0.03, 5.0, length=0.05), 4.0
ELBOW = np.radians([-22, 35, -172, 0, -48, -22])
WORKSPACE = WorkspaceBox(np.full(3, -10.0), np.full(3, 10.0))  # m
OTHER = np.zeros(1_000_000)  # 8 MB
PAUSE = 0.0025  # s
PASSES = 5
CALLS = ('see_joints', 'see_image', 'see_contact', 'cycle')
# Clocks take time, so nested parts are timed in different passes.
SETS = ({name: (Supervisor, name) for name in CALLS},
        {'- freshness': (Inputs, 'refresh'),
         '- decided': (GoalRun, 'decide'), '- moved on': (GoalRun, 'command'),
         '- status': (Supervisor, '_status')},
        {'- - twist': (GoalRun, 'twist'), '- - Motion.command': (Motion, 'command')})


def simulation():
    """Return the simulation of the demo's robot on the straight edge."""
    robot = RobotModel.from_urdf(share('urdf', 'puma260.urdf'), 'tactile_pad')
    limits = JointLimits(robot.joint_names, robot.lower + 0.05, robot.upper - 0.05,
                         robot.velocity_limit, np.full(6, 10.0))
    return Simulation(load_scene(find_scene('straight')), 'trace', robot=(robot, limits),
                      seed_positions=ELBOW, latency=0.0025, workspace=WORKSPACE)


def record():
    """Return the calls of a servo's methods in a run, (name, arguments), and its trajectories."""
    loop, tape, given = simulation(), [], []

    def taped(name):
        call = getattr(loop.servo, name)

        def method(*arguments):
            tape.append((name, arguments))
            result = call(*arguments)
            if name == 'cycle':
                given.append(result[1])
            return result
        return method

    for name in (*CALLS, 'start'):
        setattr(loop.servo, name, taped(name))
    loop.run(GOAL, SECONDS)
    return tape, given


def play(tape, meter=None, disturb=None):
    """Repeat recorded calls with a new servo; return its trajectories."""
    servo, given = simulation().servo, []
    for name, arguments in tape:
        if disturb is not None:
            disturb(name)
        if meter is not None:
            meter.running = servo.state in TRACKING
        result = getattr(servo, name)(*arguments)
        if name == 'cycle':
            given.append(result[1])
    return given


def same(one, other):
    """
    Return the largest difference of two lists of trajectories.

    It compares times, positions and velocities.
    """
    return max(np.abs(getattr(a, field) - getattr(b, field)).max()
               for a, b in zip(one, other, strict=True) if a is not None
               for field in ('times', 'positions', 'velocities'))


def touch(_):
    """Touch other memory before any call."""
    OTHER[:] += 1.0


def rest(name):
    """Sleep before a cycle."""
    if name == 'cycle':
        sleep(PAUSE)


def account(tape, disturb=None):
    """Return the mean processor time of every part [s]; a call counts with its best pass."""
    means = {}
    for parts in SETS:
        passes = []
        for _ in range(PASSES):
            meter = Meter()
            meter.apart = meter.inside = True
            with meter.timing(parts):
                play(tape, meter, disturb)
            passes.append(meter.times)
        for name in parts:
            means[name] = float(np.min([times[name] for times in passes], axis=0).mean())
    return means


def main():
    """Print the table."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    tape, given = record()
    print(f'replayed to {same(given, play(tape)):.1g} rad')
    columns = {}
    for title, disturb, awake in (('warm', None, False), ('caches cold', touch, False),
                                  ('after a sleep', rest, False), ('the same, awake', rest, True)):
        with kept_awake() if awake else nullcontext():
            columns[title] = account(tape, disturb)
    print('\n| mean, us | ' + ' | '.join(columns) + ' |\n|' + ' --- |' * (1 + len(columns)))
    for name in (name for parts in SETS for name in parts):
        print(f'| {name} | ' + ' | '.join(
            f'{1e6 * means[name]:.1f}' for means in columns.values()) + ' |')


if __name__ == '__main__':
    main()
