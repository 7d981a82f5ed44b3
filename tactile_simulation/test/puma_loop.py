"""The closed loop of the tests: a PUMA 260 on one of the shipped scenes."""

from copy import deepcopy
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from scipy.spatial.transform import Rotation

from tactile_sensing.dome.finite_elements import SkinConfig
from tactile_servo.motion.limits import JointLimits
from tactile_servo.motion.robot import RobotModel
from tactile_servo.types import EdgeGoal, State
from tactile_simulation.closed_loop import Simulation
from tactile_simulation.joint_controller import MockController
from tactile_simulation.scene import load_scene
from tactile_simulation.world import Plant

ROOT = Path(__file__).resolve().parents[2]
PUMA = RobotModel.from_urdf(ROOT / 'launch/urdf/puma260.urdf', 'tactile_pad')
LIMITS = JointLimits(PUMA.joint_names, PUMA.lower + 0.05, PUMA.upper - 0.05,
                     PUMA.velocity_limit, np.full(6, 10.0))
ELBOW = np.radians([-22, 35, -172, 0, -48, -22])
GOAL = EdgeGoal(speed=0.03, force=5.0, length=0.05)


COARSE = SkinConfig(across=15, layers=4)  # solved in some seconds, once; then from the cache


def coarse_scene(name):
    """Shipped scene of a surface, whose probe has a coarse skin."""
    return replace(load_scene(ROOT / f'launch/scenes/surfaces/{name}.yaml'), rubber=COARSE)


def free_controller(start, **options):
    """Controller of a PUMA 260 without limits, whose joints are where they are commanded."""
    free = SimpleNamespace(joint_names=PUMA.joint_names, lower=np.full(6, -np.inf),
                           upper=np.full(6, np.inf), velocity_limit=np.full(6, np.inf))
    return MockController(free, start, Plant(dead_time=0.0, lag=0.0), **options)


def summary_of(simulation, goal, seconds=20.0):
    """Run a goal and return its summary."""
    simulation.run(goal, seconds)
    return simulation.summary(goal)


def turned(simulation, axes, degrees):
    """Mount the sensor of a simulation with turns about its own axes."""
    turn, render, force = np.eye(4), simulation.world.render, simulation.world.force
    turn[:3, :3] = Rotation.from_euler(axes, degrees, degrees=True).as_matrix()
    simulation.world.render = lambda pose: render(pose @ turn)
    simulation.world.force = lambda pose: force(pose @ turn)
    return simulation


def puma_loop(scene='straight', tracker='resolved_rate', *, latency=0.0025,
              robot=(PUMA, LIMITS), **options):
    """Simulation of a PUMA 260 on a shipped scene."""
    return Simulation(load_scene(ROOT / f'launch/scenes/{scene}.yaml'), tracker,
                      robot=robot, seed_positions=ELBOW, latency=latency, **options)


@cache
def _steady(goal, tracker, state, options):
    loop = puma_loop(tracker=tracker, **dict(options))
    loop.run(goal, 20.0, lambda status: status.state == state and (
        status.progress > 0.02 or state != State.TRACK))
    assert loop.servo.state == state
    return loop


def steady(goal=GOAL, tracker='resolved_rate', state=State.TRACK, **options):
    """Loop on the straight edge, in a state or after 20 mm of it: a copy of the first such."""
    return deepcopy(_steady(goal, tracker, state, tuple(options.items())))


def tracked(loop):
    """True lateral errors [m] and forces [N] while tracking, from 10 mm on."""
    truth = loop.truth()
    return truth.lateral[truth.settled], truth.force[truth.settled]
