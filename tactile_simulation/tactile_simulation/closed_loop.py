"""Closed loop without ROS: scene, sensor, estimator, servo and robot on one clock."""
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import groupby
import math
from typing import Any

import numpy as np

from tactile_common.errors import TactileError
from tactile_sensing.contact.estimator import ContactEstimator, EstimatorConfig
from tactile_sensing.devices.calibration import Convert
from tactile_sensing.types.image import SensorInfo, TactileImage
from tactile_servo.config import ServoConfig
from tactile_servo.laws.registry import law_for, LAWS, make_law
from tactile_servo.motion.limits import JointLimits, WorkspaceBox
from tactile_servo.motion.robot import RobotModel
from tactile_servo.supervisor import Supervisor
from tactile_servo.track_statistics import SETTLING_LENGTH
from tactile_servo.types import Goal, ON_TRACK, Status
from tactile_shape.contour.contact_path import ContactPath, Placed
from tactile_shape.contour.outline import find_outline, Outline
from tactile_shape.local_surface.local_quadric import LocalQuadric
from tactile_shape.shape_estimator import ShapeEstimator
from tactile_simulation.faults import Fault, Faults
from tactile_simulation.gantry import gantry
from tactile_simulation.joint_controller import Late, MockController
from tactile_simulation.metrics import accelerations, judged, measure, NAN, percentile
from tactile_simulation.world import calibration_of, Course, Scene

PICTURE_RATE = 200.0  # Hz; rounded so that a whole number of control cycles lies between two
ROBOT_STEP, ROBOT_PHASE = 2.0e-3, 0.25e-3  # s; joint states and the robot's controller at 500 Hz
TRANSPORT = 0.5e-3  # s; from a control cycle to the robot's controller, without faults
TARE_FRAMES = 100
WEIGHT = np.array([0.3, -0.2, 4.0])  # N, weight of the tool


@dataclass(frozen=True, eq=False)
class Cycle:
    """One control cycle with the truth at its time."""

    time: float  # s
    status: object
    pose: np.ndarray  # of the sensor; the measured pose is the true one
    force: float  # on the pad [N]
    shift: np.ndarray  # of the object, which may have slipped [m]


class Simulation:
    """
    A servo that follows the edge or surface of a scene, and a model of what it touched.

    Parameters
    ----------
    scene : Scene
    law : str, optional
        Name of the servo law; default: that of the scene's action.
    seed : int
        Seed of the sensor's noise.
    latency : float, optional
        From the instant that an image shows to its arrival [s]; default: the scene's.
    config, settings, estimator : optional
        Configurations of supervisor, law and contact estimator.
    robot : tuple of (RobotModel, JointLimits), optional
        Default: a gantry with the acceleration of the scene's plant.
    seed_positions : array_like (n,), optional
        Joint positions where the search for the start pose begins, see `RobotModel.inverse`.
    workspace : WorkspaceBox, optional
        Box that the sensor does not leave.
    clock : callable, optional
        Returns seconds; if given, the servo's computation time is measured with it.
    faults : sequence of Fault
        Faults during a goal.
    wrist : bool
        True if the robot has a force sensor at its wrist, which also measures 4 N of the tool.

    Attributes
    ----------
    world : World
    now : float
        Time; begins at 1 [s].
    control_rate, sensor_rate : float
        Control cycles, `rate` of `config`, and images per second [Hz].
    pose : ndarray, shape (4, 4)
        Pose of the sensor.
    transport : float
        Delay from a control cycle to the robot's controller [s].
    log : list of Cycle
    commands : list of (float, ndarray)
        Time [s] and joint positions (n,) of every command of the robot's controller.
    cycle_costs, picture_costs : list of float
        Computation time of every control cycle and image [s], if there is a clock.
    """

    supervisor: Any = Supervisor

    def __init__(self, scene: Scene, law: str | None = None, *, seed: int = 0,
                 latency: float | None = None, config: ServoConfig | None = None,
                 settings: Any = None, robot: tuple[RobotModel, JointLimits] | None = None,
                 seed_positions: np.ndarray | None = None, workspace: WorkspaceBox | None = None,
                 estimator: EstimatorConfig | None = None,
                 clock: Callable[[], float] | None = None, faults: Sequence[Fault] = (),
                 wrist: bool = False):
        self.scene, plant = scene, scene.plant
        self.rng = np.random.default_rng(seed)
        self.array, self.seed = scene.sensor.array, seed
        self.world = scene.world()
        self._convert, info = self._tared()
        self.model, self.limits = robot or gantry(plant.acceleration)
        if robot is None and seed_positions is None:
            seed_positions = np.zeros(len(self.model.joint_names))
        start = self.model.inverse(scene.start_pose(), seed_positions)
        self.robot = MockController(self.model, start, plant, rate=1.0 / ROBOT_STEP)
        config = config or ServoConfig()
        self._every = max(1, round(config.rate / PICTURE_RATE))  # cycles between two images
        self.control_rate, self.sensor_rate = config.rate, config.rate / self._every
        self.servo = self.supervisor(
            self.model, self.limits, make_law(law_for(scene.action, law), config, settings),
            config, workspace)
        self.servo.see_sensor(info)
        self.estimator = ContactEstimator(
            estimator or EstimatorConfig(**scene.parameters().get('contact_estimator', {})))
        self.estimate = self.estimator.estimate
        self._path, self.shape = ContactPath(), ShapeEstimator(LocalQuadric())
        self.latency = plant.latency if latency is None else latency
        self.now, self.tick, self.pose = 1.0, 0, self.model.pose(start)
        self._on_the_way: deque = deque()
        self._windows: deque = deque()
        self.sensor_alive = self.robot_alive = True
        self.wrist = wrist
        self._faults = Faults(faults, scene.sensor)
        self._began = math.inf  # start of the first goal [s]
        self.transport = TRANSPORT
        self.log, self.commands = [], []
        self._clock = clock or (lambda: 0.0)
        self.cycle_costs, self.picture_costs = [], []

    def _tared(self) -> tuple[Convert, SensorInfo]:
        calibration = calibration_of(self.scene)
        tare = calibration.make_tare(np.array(
            [self.world.counts(None, self.rng) for _ in range(TARE_FRAMES)]))
        return calibration.converter(tare), calibration.sensor_info('pad', '', 0, tare)

    def picture(self, pose: np.ndarray) -> TactileImage:
        """Return the TactileImage at a pose."""
        counts = self.world.counts(pose, self.rng, self.now)
        layer, saturated = self._convert(self._faults.counts(counts, self.now - self._began))
        stamp_ns = round((self.now + self.scene.plant.stamp_error) * 1e9)
        return TactileImage(stamp_ns, self.tick, (layer,), self.array, tared=True,
                            saturated=saturated)

    def step(self) -> Status:
        """Advance to the next control cycle and return its status."""
        self.tick += 1
        self.now = 1.0 + self.tick * (1.0 / self.control_rate)
        now_ns = round(self.now * 1e9)
        self._run_robot()
        self.pose = pose = self.model.pose(self.robot.measured(self.now)[0])
        self._feel(self._path.add_pose(now_ns, pose))
        if self.tick % self._every == 0 and self.sensor_alive:
            image = self.picture(pose)
            self._on_the_way.append((self.now + self.latency, image, self.estimate(image)))
        while self._on_the_way and self._on_the_way[0][0] <= self.now + 1e-9:
            _, image, contact = self._on_the_way.popleft()
            before = self._clock()
            self.servo.see_image(image, self.now)
            self.servo.see_contact(contact, image.stamp_ns, self.now)
            self.picture_costs.append(self._clock() - before)
            self._feel(self._path.add_contact(image.stamp_ns, contact, picture=image))
        if self._faults.client_lives(self.now - self._began):
            self.servo.hear_client()
        if self.wrist:
            self.servo.see_wrench(WEIGHT + self.world.force(pose) * pose[:3, 2], self.now)
        before = self._clock()
        status, trajectory = self.servo.cycle(self.now, now_ns)
        self.cycle_costs.append(self._clock() - before)
        if trajectory is not None:
            late = self._faults.delay(self.now - self._began)
            self._windows.append((self.now + self.transport + late, trajectory))
        self.log.append(Cycle(self.now, status, pose, self.world.force(pose),
                              self.world.shift))
        return status

    def _feel(self, placed: Iterable[Placed]) -> None:
        for contact in placed:
            self.shape.take(contact)

    def outline(self) -> Outline | None:
        """Return the outline of the contacts until now; None if there are too few."""
        self.shape.lose()
        with suppress(TactileError):
            return find_outline(self.shape.model.contour)
        return None

    def _run_robot(self) -> None:
        """Run the robot's controller until now, and pass its joint states to the servo."""
        while (now := 1.0 + ROBOT_PHASE + len(self.commands) * ROBOT_STEP) <= self.now:
            while self._windows and self._windows[0][0] <= now:
                with suppress(Late):
                    self.robot.accept(self._windows.popleft()[1], now)
            positions, _ = self.robot.step(now)
            self.commands.append((now, self.robot.commanded[0]))
            if self.robot_alive:
                with suppress(ValueError):  # the servo refuses a jump of the joint states at first
                    self.servo.see_joints(positions, round(now * 1e9), now)
                self.servo.see_reference(
                    self.robot.commanded[0], round((now + ROBOT_STEP) * 1e9))

    def run(self, goal: Goal | None, seconds: float,
            until: Callable[[Status], bool] | None = None) -> Status:
        """
        Start a goal, if given, and step until it ends; return the last status.

        The run also ends after `seconds` of simulated time, or when `until(status)` is True.
        """
        if goal is not None:
            while not (self.servo.inputs.joints and self.servo.inputs.contact):
                self.step()
            self.servo.start(goal, self.now)
            self._began = min(self._began, self.now)
        end = self.now + seconds
        while True:
            status = self.step()
            if not self.servo.active or (until and until(status)) or self.now >= end:
                return status

    def accelerations(self) -> np.ndarray:
        """Return the accelerations (K, n) of the commands of the robot's controller [rad/s^2]."""
        times, positions = zip(*self.commands, strict=True)
        return accelerations(np.array(times), np.array(positions))

    def truth(self) -> Course:
        """Return the true course of the pad at every cycle, compared with the scene."""
        time, force, progress = np.array([
            (cycle.time, cycle.force, cycle.status.progress) for cycle in self.log]).T
        tracking = np.isin([cycle.status.state for cycle in self.log], ON_TRACK)
        return self.scene.truth(Course(
            time, np.array([cycle.pose for cycle in self.log]), force,
            np.array([cycle.shift for cycle in self.log]), progress, tracking,
            tracking & (progress >= SETTLING_LENGTH)))

    def felt(self) -> np.ndarray:
        """Return the contacts (N, 3) with a surface, or the vertices of an edge's outline [m]."""
        if LAWS[self.servo.law.name].maps_surface:
            felt = self.servo.result().contour
        else:
            outline = self.outline()
            felt = None if outline is None else outline.points
        return np.zeros((0, 3)) if felt is None else felt

    def summary(self, goal: Goal, elapsed: float = NAN) -> dict[str, Any]:
        """
        Return the summary of a goal's run, with the keys and SI units of all commands.

        `elapsed` is the real computation time [s]. `ok` is True only if the servo met the goal and
        the truth of the scene confirms it.
        """
        truth, servo = self.truth(), self.servo
        duration = float(np.ptp(truth.time))
        numbers = {
            **_state(self.log[-1].status), 'scene': self.scene.name,
            'law': servo.law.name, 'seed': self.seed, 'speed': goal.speed,
            'tracked_length': servo.statistics.tracked_length,
            **measure(truth, goal.force, self.accelerations()),
            **self.scene.numbers(truth, self.felt(), goal.force),
            'force_end': self.log[-1].force,
            'closed': servo.result().closed, 'duration': duration,
            'real_time_factor': duration / elapsed, 'sensor_rate': self.sensor_rate,
            'control_rate': self.control_rate, 'latency_p50': self.latency,
            'latency_p99': self.latency, 'cpu_per_cycle': percentile(self.cycle_costs),
            'cpu_per_image': percentile(self.picture_costs),
            'states': [{'time': first.time, **_state(first.status)} for _, (first, *_) in groupby(
                self.log, key=lambda cycle: cycle.status.state)]}
        return judged(numbers, servo.success, self.scene)


def _state(status: Status) -> dict[str, str]:
    return {'state': status.state.name.lower(), 'reason': status.reason.text,
            'reason_code': status.reason.code.name.lower()}
