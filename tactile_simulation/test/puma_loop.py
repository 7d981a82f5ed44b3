"""The closed loop of the tests: a PUMA 260 on one of the shipped scenes."""

from pathlib import Path

import numpy as np

from tactile_servo.motion.limits import JointLimits
from tactile_servo.motion.robot import RobotModel
from tactile_simulation.closed_loop import Simulation
from tactile_simulation.scene import load_scene

ROOT = Path(__file__).resolve().parents[2]
PUMA = RobotModel.from_urdf(ROOT / 'launch/urdf/puma260.urdf', 'tactile_pad')
LIMITS = JointLimits(PUMA.joint_names, PUMA.lower + 0.05, PUMA.upper - 0.05,
                     PUMA.velocity_limit, np.full(6, 10.0))
ELBOW = np.radians([-22, 35, -172, 0, -48, -22])


def puma_loop(scene='straight', tracker='resolved_rate', *, latency=0.0025,
              robot=(PUMA, LIMITS), **options):
    """Simulation of a PUMA 260 on a shipped scene."""
    return Simulation(load_scene(ROOT / f'launch/scenes/{scene}.yaml'), tracker,
                      robot=robot, seed_positions=ELBOW, latency=latency, **options)


def tracked(loop):
    """True lateral errors [m] and forces [N] while tracking, from 10 mm on."""
    truth = loop.truth()
    return truth.lateral[truth.settled], truth.force[truth.settled]
