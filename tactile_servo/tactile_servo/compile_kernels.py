"""Compilation of this package's kernels, during the build and when the node starts."""

import numpy as np

from tactile_sensing.devices.calibration import Calibration
from tactile_sensing.skin.half_spaces import add_segment, half_spaces
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.image import Layer, TactileImage
from tactile_sensing.types.skin import Skin
from tactile_servo.config import ServoConfig
from tactile_servo.control.surface_path import PlanarPath, raster
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
# m; a contour with three sides, tracked one lap and further, with a gap and an end
PATH = np.array([(0.0, 0.0), (0.0, 0.05), (0.04, 0.025), (0.0, 0.0), (0.0, 0.04)])
GAPS = ((0.02, 0.026),)  # stations [m]
STRIDE = 1.0e-3  # m between images
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
    """Pass a law images of a closed edge with corners and a gap."""
    law, goal = EdgeFollowing(ServoConfig()), EdgeGoal(0.1, FORCE, closed=True)
    law.begin(goal, Calibration(ARRAY, depth=DEPTH).sensor_info('pad', '', 0))
    stations = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(PATH, axis=0), axis=1)))
    rng, pose = np.random.default_rng(0), np.eye(4)
    for count, station in enumerate(np.arange(0.0, stations[-1] + 0.02, STRIDE)):
        pose = pose.copy()
        pose[:2, 3] = [np.interp(station, stations, axis) for axis in PATH.T]
        now = STRIDE / goal.speed * count
        # At the end, so much noise that the images are smoothed.
        noise = NOISE if station < stations[-1] else 10.0 * NOISE
        layer = _layer(pose[:2, 3], stations, noise * rng.standard_normal(ARRAY.shape), noise)
        image = TactileImage(count, count, (layer,), ARRAY, True)
        law.observe(Observation(count, now, 0.0, pose, image=image))
        if law.lacks(now) is None:
            law.assess(now, station, FORCE)
            law.reference(pose, pose, motion, 0.0025)
    _ = law.sight.edge.picture.pull  # used by a search, and computed only on access


def _layer(place: np.ndarray, stations: np.ndarray, pressure: np.ndarray, noise: float) -> Layer:
    """Add the pressure of the edge on the array at a position (2,) to a pressure."""
    cuts = np.union1d(stations, np.ravel(GAPS))
    corners = np.column_stack([np.interp(cuts, stations, axis) for axis in PATH.T]) - place
    for begin, first, last in zip(cuts, corners, corners[1:], strict=False):
        if not any(gap[0] <= begin < gap[1] for gap in GAPS):
            add_segment(pressure, ARRAY.x, ARRAY.y, DEPTH, *first, *last, LOAD, LOAD)
    return Layer('zz', DEPTH, pressure, noise_std=noise)
