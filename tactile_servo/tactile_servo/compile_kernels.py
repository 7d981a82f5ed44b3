"""Compilation of this package's kernels, during the build and when the node starts."""

import math

import numpy as np

from tactile_sensing.devices.calibration import Calibration
from tactile_sensing.skin.half_spaces import half_spaces
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.image import Layer, TactileImage
from tactile_sensing.types.skin import Skin
from tactile_servo.config import ServoConfig
from tactile_servo.control.surface_path import PlanarPath, raster
from tactile_servo.edge_map.corner import corner_pressure, CornerShape
from tactile_servo.following import FollowingCheck
from tactile_servo.inputs import Inputs
from tactile_servo.law import Observation
from tactile_servo.laws.edge_following import EdgeFollowing
from tactile_servo.motion.limits import JointLimits
from tactile_servo.motion.motion import Motion
from tactile_servo.motion.robot import RobotModel
from tactile_servo.motion.window import at_rest, sample
from tactile_servo.types import EdgeGoal

ARRAY, DEPTH, NOISE = TactelArray(16, 16, 0.0254 / 16, 0.0254 / 16), 0.002, 600.0  # m, m, Pa
LOAD, FORCE = 200.0, 5.0  # N/m, N
IMAGES, STRIDE = 8, 1.0e-3  # number of images of a corner, and the way between them [m]
UP = np.array([0.0, 0.0, 1.0])
ROBOT = """<robot name="two_joints"><link name="base"/>
  <joint name="slide" type="prismatic"><parent link="base"/><child link="carriage"/>
    <axis xyz="0 1 0"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
  <link name="carriage"/>
  <joint name="turn" type="revolute"><parent link="carriage"/><child link="tip"/>
    <axis xyz="0 0 1"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
  <link name="tip"/></robot>"""


def compile_kernels() -> None:
    """Compile the kernels of motion and edge map that are not yet in numba's cache."""
    model = RobotModel.from_urdf(ROBOT, 'tip')
    limits = JointLimits(tuple(model.joint_names), model.lower, model.upper,
                         model.velocity_limit, np.ones(2))
    half_spaces(Skin(DEPTH, 2.0 * DEPTH))  # no kernel, but its first call is slow
    motion = Motion(model, limits, 0.0025)
    motion.seed(np.zeros(2))
    motion.command(np.full(6, 0.01), 0)
    sample(at_rest(np.zeros(2), 0.0), 0.0)
    inputs = Inputs(model, limits)
    inputs.see_joints(np.zeros(2), 0, 0.0)
    image = TactileImage(0, 0, (Layer('zz', DEPTH, np.zeros(ARRAY.shape)),), ARRAY, True)
    inputs.see_image(image, 0.0)
    following = FollowingCheck(0.002)
    following.sent(0.0, motion.pose, inputs.pose)
    following.problem(inputs.pose, 0.0, motion.rest_pose)
    _follow_an_edge(motion)
    place, ahead = np.zeros(3), np.array([1.0, 0.0, 0.0])
    PlanarPath(place, -UP, ahead, raster(0.02, 0.01, 0.005), 1.0).step(place, -UP, 30.0, 0.05)


def _follow_an_edge(motion: Motion) -> None:
    """Pass a law images of a corner: what other images need is compiled with it."""
    law, goal = EdgeFollowing(ServoConfig()), EdgeGoal(0.1, FORCE)
    law.begin(goal, Calibration(ARRAY, depth=DEPTH).sensor_info('pad', '', 0))
    for count in range(IMAGES):
        pose, now, way = np.eye(4), STRIDE / goal.speed * count, STRIDE * count
        pose[1, 3] = way
        corner = CornerShape(0.0, 0.5 * IMAGES * STRIDE - way, 0.5 * math.pi, 0.0, 0.0)
        pressure = LOAD * corner_pressure(corner, ARRAY.x, ARRAY.y, half_spaces(Skin(DEPTH)))
        layer = Layer('zz', DEPTH, pressure, noise_std=NOISE)
        image = TactileImage(count, count, (layer,), ARRAY, True)
        law.observe(Observation(count, now, 0.0, pose, image=image))
        if law.lacks(now) is None:
            law.assess(now, way, FORCE)
            law.reference(pose, pose, motion, 0.0025)
    _ = law.sight.edge.picture.pull  # used by a search, and computed only on access
