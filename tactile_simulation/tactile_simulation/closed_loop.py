"""The whole loop without ROS: scene, sensor, estimator, servo and robot on one clock."""

from collections import deque
from dataclasses import dataclass

import numpy as np

from tactile_sensing.contact.estimator import ContactEstimator
from tactile_sensing.devices.calibration import Calibration
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.image import TactileImage
from tactile_servo.laws.registry import make_tracker
from tactile_servo.supervisor import EdgeServo
from tactile_servo.types import EdgeServoConfig, State
from tactile_simulation.gantry import gantry
from tactile_simulation.joint_controller import MockController
from tactile_simulation.renderer import EdgeRenderer

STEP = 2.5e-3  # s; control at 400 Hz
PICTURE_EVERY = 2  # steps; sensing at 200 Hz
SIZE, PITCH = 16, 0.0254 / 16  # of the thesis' array: tactels a side, m
TARE_FRAMES = 100


@dataclass(frozen=True, eq=False)
class Cycle:
    """One control cycle, and the truth beside it."""

    time: float  # s
    status: object
    pose: np.ndarray  # of the sensor, measured and true
    force: float  # on the pad [N]
    shift: np.ndarray  # of the object, which may have slipped [m]


class Simulation:
    """
    A servo that follows the edge of a scene.

    The servo, estimator, calibration, limits and scene are those that the nodes run; the
    clock starts at 1 s.

    Parameters
    ----------
    scene : Scene
    tracker : str
        'resolved_rate' or 'trace'.
    seed : int
        Of the sensor's noise.
    latency : float, optional
        From the instant that a picture shows to its arrival [s]; default as the scene says.
    config : EdgeServoConfig, optional
    settings : object, optional
        Configuration of the tracker.
    robot : tuple of (RobotModel, JointLimits), optional
        Default a gantry with the acceleration of the scene's plant.
    seed_positions : array_like (n,), optional
        Where the search for the joint positions of the start pose begins; default zeros for
        the gantry, else see `RobotModel.inverse`.
    workspace : WorkspaceBox, optional
    clock : callable, optional
        Returns seconds; the servo's own computation is then measured with it.

    Attributes
    ----------
    pose : ndarray, shape (4, 4)
        Where the sensor is.
    log : list of Cycle
    cycle_costs, picture_costs : list of float
        Computation of every control cycle and picture [s], if there is a clock.
    """

    def __init__(self, scene, tracker='trace', *, seed=0, latency=None, config=None,
                 settings=None, robot=None, seed_positions=None, workspace=None, clock=None):
        self.scene, plant = scene, scene.plant
        self.rng = np.random.default_rng(seed)
        self.array = TactelArray(SIZE, SIZE, PITCH, PITCH)
        self.renderer = EdgeRenderer(scene, self.array)
        self._convert = self._tared()
        self.model, self.limits = robot or gantry(plant.acceleration)
        if robot is None and seed_positions is None:
            seed_positions = np.zeros(len(self.model.joint_names))
        start = self.model.inverse(scene.start_pose(), seed_positions)
        self.robot = MockController(
            self.model.joint_names, self.model.lower, self.model.upper,
            self.model.velocity_limit, initial_positions=start, dead_time=plant.dead_time,
            lag=plant.lag)
        config = config or EdgeServoConfig()
        self.servo = EdgeServo(self.model, self.limits, config,
                               make_tracker(tracker, config, settings), workspace)
        self.estimator = ContactEstimator()
        self.latency = plant.latency if latency is None else latency
        self.now, self.tick, self.pose = 1.0, 0, self.model.pose(start)
        self._on_the_way = deque()
        self.sensor_alive = self.robot_alive = True
        self.log = []
        self._clock = clock or (lambda: 0.0)
        self.cycle_costs, self.picture_costs = [], []

    @property
    def control_rate(self):
        """Control cycles per second."""
        return 1.0 / STEP

    @property
    def sensor_rate(self):
        """Pictures per second."""
        return 1.0 / (STEP * PICTURE_EVERY)

    def _tared(self):
        sensor, skin = self.scene.sensor, self.scene.skin
        calibration = Calibration(
            self.array, gain=sensor.pa_per_count, baseline=sensor.baseline, depth=skin.depth,
            skin_stiffness=skin.stiffness)
        return calibration.converter(calibration.make_tare(np.array(
            [self.renderer.counts(None, self.rng) for _ in range(TARE_FRAMES)])))

    def picture(self, pose):
        """Take a picture at a pose: TactileImage."""
        layer, saturated = self._convert(self.renderer.counts(pose, self.rng))
        stamp_ns = round((self.now + self.scene.plant.stamp_error) * 1e9)
        return TactileImage(stamp_ns, self.tick, (layer,), self.array, tared=True,
                            saturated=saturated)

    def estimate(self, image):
        """Estimate the contact in a picture."""
        return self.estimator.estimate(image)

    def step(self):
        """Advance by STEP and return the status of the control cycle."""
        self.tick += 1
        self.now = 1.0 + self.tick * STEP
        now_ns = round(self.now * 1e9)
        positions, _ = self.robot.step(self.now)
        self.pose = pose = self.model.pose(positions)
        if self.robot_alive:
            self.servo.see_joints(positions, now_ns, self.now)
        if self.tick % PICTURE_EVERY == 0 and self.sensor_alive:
            image = self.picture(pose)
            self._on_the_way.append((self.now + self.latency, image, self.estimate(image)))
        while self._on_the_way and self._on_the_way[0][0] <= self.now + 1e-9:
            _, image, contact = self._on_the_way.popleft()
            before = self._clock()
            if self.servo.tracker.sees_images:
                self.servo.see_image(image, self.now)
            self.servo.see_contact(contact, image.stamp_ns, self.now)
            self.picture_costs.append(self._clock() - before)
        before = self._clock()
        status, trajectory = self.servo.cycle(self.now, now_ns)
        self.cycle_costs.append(self._clock() - before)
        if trajectory is not None:
            self.robot.accept(trajectory, self.now)
        self.log.append(Cycle(self.now, status, pose, self.renderer.force(pose),
                              self.renderer.shift))
        return status

    def run(self, goal, seconds, until=None):
        """
        Start a goal, if one is given, and step until it ends.

        Parameters
        ----------
        goal : EdgeGoal or None
        seconds : float
            Longest time to simulate [s].
        until : callable, optional
            Ends the run when it is true of a status.

        Returns
        -------
        Status
            The last one.
        """
        if goal is not None:
            while not (self.servo.joints and self.servo.contact):
                self.step()
            self.servo.start(goal, self.now)
        end = self.now + seconds
        while True:
            status = self.step()
            if self.servo.goal is None or (until and until(status)) or self.now >= end:
                return status

    def truth(self, states=(State.TRACK, State.CORNER)):
        """
        Where the pad really was while it tracked.

        Returns
        -------
        ndarray, shape (N, 4)
            Time [s], lateral error [m], force [N] and progress [m] of every cycle.
        """
        rows = [cycle for cycle in self.log if cycle.status.state in states]
        if not rows:
            return np.empty((0, 4))
        places = np.array([cycle.pose[:3, 3] - cycle.shift for cycle in rows])
        lateral, _ = self.scene.edge.nearest(places)
        return np.column_stack([
            [cycle.time for cycle in rows], lateral, [cycle.force for cycle in rows],
            [cycle.status.progress for cycle in rows]])
