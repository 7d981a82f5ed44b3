"""The whole loop without ROS: scene, sensor, estimator, servo and robot on one clock."""

from collections import deque
from pathlib import Path

import numpy as np

from tactile_sensing.array import TactelArray
from tactile_sensing.calibration import load_calibration
from tactile_sensing.estimator import ContactEstimator
from tactile_sensing.image import TactileImage
from tactile_sensing.scene import load_scene
from tactile_sensing.synthetic import EdgeRenderer
from tactile_servo.edge_servo import EdgeServo
from tactile_servo.limits import JointLimits
from tactile_servo.mock_robot import MockController
from tactile_servo.robot import RobotModel
from tactile_servo.servo_types import EdgeServoConfig

ROOT = Path(__file__).resolve().parents[2]
STEP = 1.25e-3  # s; control at 400 Hz, sensing at 200 Hz


def puma():
    return RobotModel.from_urdf(ROOT / 'launch/urdf/puma260.urdf', 'tactile_pad')


class Loop:
    """A servo that follows the edge of a scene; every delay is a parameter."""

    def __init__(self, scene='straight', *, latency=0.0025, seed=0, config=None, workspace=None,
                 robot_limits=None, **robot):
        self.scene = load_scene(ROOT / f'launch/scenes/{scene}.yaml')
        self.rng = np.random.default_rng(seed)
        calibration = load_calibration(
            ROOT / 'tactile_sensing/config/flexitac_16x16.yaml')
        self.array = TactelArray(16, 16, 0.0254 / 16, 0.0254 / 16)
        self.renderer = EdgeRenderer(self.scene, self.array)
        tare = calibration.make_tare(np.array(
            [self.renderer.counts(None, self.rng) for _ in range(100)]))
        self._convert = calibration.converter(tare)
        self.model = puma()
        start = self.model.inverse(self.scene.start_pose(), np.radians(
            [-22, 35, -172, 0, -48, -22]))
        self.robot = MockController(
            self.model.joint_names, self.model.lower, self.model.upper,
            self.model.velocity_limit, initial_positions=start, **robot)
        self.limits = robot_limits or JointLimits(
            self.model.joint_names, self.model.lower + 0.05, self.model.upper - 0.05,
            self.model.velocity_limit, np.full(6, 10.0))
        self.servo = EdgeServo(self.model, self.limits, config or EdgeServoConfig(),
                               workspace=workspace)
        self.estimator = ContactEstimator()
        self.latency = latency
        self.now, self.tick = 1.0, 0
        self._pictures = deque()
        self.sensor_alive = self.robot_alive = True
        self.log = []

    def estimate(self, pose):
        counts = self.renderer.counts(pose, self.rng)
        layer, saturated = self._convert(counts)
        return self.estimator.estimate(TactileImage(
            0, self.tick, (layer,), self.array, tared=True, saturated=saturated))

    def step(self):
        """Advance by STEP; returns the status of a control cycle or None."""
        self.tick += 1
        self.now = 1.0 + self.tick * STEP
        now_ns = round(self.now * 1e9)
        positions, _ = self.robot.step(self.now)
        pose = self.model.pose(positions)
        if self.robot_alive:
            self.servo.see_joints(positions, now_ns, self.now)
        if self.tick % 4 == 0 and self.sensor_alive:
            self._pictures.append((self.now + self.latency, now_ns, self.estimate(pose)))
        while self._pictures and self._pictures[0][0] <= self.now:
            _, stamp, contact = self._pictures.popleft()
            self.servo.see_contact(contact, stamp, self.now)
        if self.tick % 2:
            return None
        status, trajectory = self.servo.cycle(self.now, now_ns)
        if trajectory is not None:
            self.robot.accept(trajectory, self.now)
        lateral, along = self.scene.edge.nearest(pose[None, :3, 3])
        self.log.append((self.now, status, float(lateral[0]), float(along[0]),
                         self.renderer.force(pose), pose))
        return status

    def run(self, goal, seconds, until=None):
        """Start a goal if one is given and step until done, `until(status)` or time is up."""
        if goal is not None:
            while not (self.servo.joints and self.servo.contact):
                self.step()
            self.servo.start(goal, self.now)
        end = self.now + seconds
        while self.now < end:
            status = self.step()
            if status and (self.servo.goal is None or (until and until(status))):
                return status
        return status

    def tracked(self):
        """True lateral errors [m] and forces [N] while tracking, from 10 mm on."""
        rows = [(lateral, force) for _, status, lateral, _, force, _ in self.log
                if status.state == 2 and status.progress >= 0.01]
        return np.array(rows).T
