"""Accelerations that a controller makes from windows, with the sampling of a real one."""

from contextlib import suppress
import heapq
from pathlib import Path

import numpy as np

from tactile_servo.motion.limits import JointLimits
from tactile_servo.motion.motion import COMMITTED, Motion
from tactile_servo.motion.robot import RobotModel
from tactile_servo.motion.trajectory import Trajectory
from tactile_simulation.joint_controller import Late, MockController
from tactile_simulation.metrics import accelerations
from tactile_simulation.world import Plant

ROOT = Path(__file__).resolve().parents[2]
CYCLE, DURATION, BEGIN = 0.0025, 1.2, 100.0  # s
START = np.radians([-22, 35, -172, 0, -48, -22])
ACCELERATION, SPEED, SWING = 10.0, 0.1, 9.4  # rad/s^2, m/s, rad/s
RARE = 40


def stamped(window):
    return window


def at_once(window):
    return Trajectory(window.joint_names, window.times, window.positions, window.velocities)


def ahead(window):
    """Remove points less than 5 ms ahead, and the stamp."""
    later = window.times > 0.005 - 1e-9
    return Trajectory(window.joint_names, window.times[later], window.positions[later],
                      window.velocities[later])


def play(shape, *, committed=COMMITTED, least=0.5e-3, mean=0.3e-3, late=0.0,
         period=0.002, clock=0.0, joined=True, seed=0):
    """
    Return largest and RMS acceleration [rad/s^2] of the commands for a swinging pad.

    One window of `RARE` is `late` [s], and those after it wait until then.
    """
    robot = RobotModel.from_urdf(ROOT / 'launch/urdf/puma260.urdf', 'tactile_pad')
    limits = JointLimits(robot.joint_names, robot.lower, robot.upper, robot.velocity_limit,
                         np.full(6, ACCELERATION))
    rng, motion = np.random.default_rng(seed), Motion(robot, limits, CYCLE)
    motion.expect_lateness(committed)
    motion.seed(START)
    controller = MockController(robot, START, Plant(), rate=1.0 / period, from_desired=joined)
    steps = BEGIN + 0.25e-3 + np.arange(0.0, DURATION, period)
    arrivals, commands, last = [], [], 0.0
    for count, now in enumerate(BEGIN + np.arange(0.0, DURATION, CYCLE)):
        now += rng.uniform(0.0, 1e-4)
        speed = SPEED * np.sin(SWING * max(now - BEGIN - 0.2, 0.0))
        window = motion.command(np.array([0.0, speed, 0.0, 0.0, 0.0, 0.0]),
                                round(now * 1e9)).trajectory
        if window is None:
            continue
        way = least + rng.exponential(mean) + (late if count % RARE == 0 else 0.0)
        last = max(now + way, last)  # windows keep their order
        heapq.heappush(arrivals, (last, count, shape(window)))
    for now in steps:
        while arrivals and arrivals[0][0] <= now:
            with suppress(Late):
                controller.accept(heapq.heappop(arrivals)[2], now + clock)
        controller.step(now + clock)
        commands.append(controller.commanded[0])
    acceleration = accelerations(steps, np.array(commands))
    return np.abs(acceleration).max(), np.sqrt((acceleration**2).mean(axis=0)).max()


CASES = (
    ('stamped', stamped, {}), ('the same, from the measured state', stamped, {'joined': False}),
    ('the same, ways of 3 ms on average', stamped, {'mean': 3e-3}),
    *((f'the same, one of 40 {late} ms late', stamped, {'late': 1e-3 * late})
      for late in (5, 8, 10, 15, 20, 60)),
    ('the same, controller at 1 kHz', stamped, {'period': 0.001}),
    ('the same, controller at 125 Hz', stamped, {'period': 0.008}),
    ('the same, its clock 2 ms behind', stamped, {'clock': -0.002}),
    ('the same, its clock 3 ms ahead', stamped, {'clock': 0.003}),
    ('the same, its clock 10 ms ahead', stamped, {'clock': 0.01}),
    ('stamped, 10 ms committed', stamped, {'committed': 0.01}),
    *((f'the same, one of 40 {late} ms late', stamped, {'committed': 0.01, 'late': 1e-3 * late})
      for late in (8, 10, 15, 20, 60)),
    ('stamp 0, the same points', at_once, {}),
    ('the same, from the measured state', at_once, {'joined': False}),
    ('stamp 0, first point 5 ms ahead', ahead, {}),
    ('the same, from the measured state', ahead, {'joined': False}))


def main():
    """Print the table."""
    print('| window | largest joint acceleration [rad/s²] | RMS |')
    print('| --- | --- | --- |')
    for name, shape, options in CASES:
        largest, rms = play(shape, **options)
        print(f'| {name} | {largest:.1f} | {rms:.1f} |')
