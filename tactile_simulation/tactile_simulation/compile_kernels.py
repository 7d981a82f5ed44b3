"""Every kernel of this package called once, for the step after a build that compiles them."""
from dataclasses import replace

import numpy as np

from tactile_servo.motion.trajectory import Trajectory
from tactile_simulation.edge_path import EdgePath
from tactile_simulation.joint_controller import MockController
from tactile_simulation.renderer import EdgeRenderer
from tactile_simulation.scene import Scene, Slip, Start


def compile_kernels() -> None:
    """Press a pad on an edge that slips, and move a joint."""
    edge = EdgePath(np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.1, 0.0]]))
    edge.point_at(0.05)
    scene = Scene('kernels', '', edge, start=Start(height=-0.001), slip=Slip(0.01, 0.001))
    pose = scene.start_pose()
    for sensor in (scene.sensor, replace(scene.sensor, area=0.0)):
        EdgeRenderer(replace(scene, sensor=sensor), sensor.array).counts(
            pose, np.random.default_rng(0))
    robot = MockController(('joint',), [-1.0], [1.0], [1.0], initial_positions=[0.0])
    robot.accept(Trajectory(('joint',), np.array([0.1]), np.zeros((1, 1)), np.zeros((1, 1))), 0.0)
    for tick in range(1, 5):
        robot.step(0.01 * tick)
