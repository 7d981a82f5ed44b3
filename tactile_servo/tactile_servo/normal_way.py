"""Motion of the pad along its normal: approach, press and retreat."""

import math

import numpy as np

from tactile_servo.config import MAX_STAMP_AGE, ServoConfig
from tactile_servo.control.force_controller import REACTION, unseen_way
from tactile_servo.control.press_test import PressTest
from tactile_servo.control.scaling import clipped
from tactile_servo.inputs import Inputs
from tactile_servo.law import Goal, ServoLaw
from tactile_servo.motion.motion import Motion


class NormalWay:
    """
    Measures how far the commanded pad has moved along its normal, and sets its speed there.

    Once the pad has touched, a later approach searches only near the last touch, so that a sensor
    that has failed in the meantime does not press harder.
    """

    def __init__(self, config: ServoConfig, goal: Goal, law: ServoLaw, inputs: Inputs,
                 motion: Motion):
        self._config, self._goal, self._law = config, goal, law
        self._inputs, self._motion = inputs, motion
        self._touched, self._lift = False, config.retreat.distance
        self._test: PressTest | None = None
        self._first = math.nan  # slope measured by the first test
        self.begin()

    def begin(self) -> None:
        """Measure the advance from the pose that is commanded now."""
        self._anchor = self._motion.pose

    def lift(self) -> None:
        """Begin to lift off; without a touch so far, at least to the start of the approach."""
        if not self._touched:
            self._lift = max(self._lift, self.advance)
        self.begin()

    def touch(self) -> None:
        """Record a touch, and measure the advance from here."""
        self._touched = True
        self.begin()

    @property
    def advance(self) -> float:
        """Distance of the commanded sensor from its start, along the normal [m]."""
        return self._beyond(self._motion.pose)

    def _beyond(self, pose: np.ndarray) -> float:
        anchor = self._anchor
        return 0.0 if pose is anchor else float((pose[:3, 3] - anchor[:3, 3]) @ anchor[:3, 2])

    @property
    def farthest(self) -> float:
        """Advance at which an approach without contact gives up [m]."""
        return self._unseen_way() if self._touched else self._config.approach.distance

    @property
    def lifted(self) -> bool:
        """Whether the pad has lifted off."""
        return -self.advance >= self._lift

    def approach(self) -> np.ndarray:
        """Compute the twist of the pad (6,) towards the object [m/s, rad/s]."""
        speed = self._careful_speed() if self._inputs.load < self._goal.force else 0.0
        return np.array([0.0, 0.0, speed, 0.0, 0.0, 0.0])

    def begin_test(self) -> None:
        """Record a touch and begin the first or another press test of the sensor."""
        self.touch()
        if self._test is not None and math.isnan(self._first):
            self._first = self._test.slope
        sensor = self._inputs.sensor
        rate = sensor.nominal_rate if sensor and sensor.nominal_rate else math.inf
        self._test = PressTest(
            self._goal.force, self._inputs.load, self._law.depth, self._first, rate,
            self._config.approach.speed)

    def test(self, dt: float) -> np.ndarray:
        """Compute the twist of the pad (6,) in the press test, for a cycle of `dt` [s]."""
        assert self._test is not None and self._inputs.contact is not None
        twist = self._slowed(dt)
        if twist[:2].any():  # a pad that follows stops first
            twist[2] = 0.0
            return twist
        stamp = self._inputs.contact.stamp_ns
        pose = self._inputs.pose_at(stamp)
        advance = math.nan if pose is None else self._beyond(pose)
        self._test.see(stamp, self._inputs.load, advance)
        speed = min(self._test.speed(self._inputs.load, dt), self._careful_speed())
        return np.array([0.0, 0.0, speed, 0.0, 0.0, 0.0])

    def test_problem(self) -> str:
        """Return why the sensor has failed the test, '' if it has not."""
        assert self._test is not None
        saturated = self._inputs.saturated
        deepest = self._test.deepest(saturated) + self._unseen_way()
        if not self._test.pressed and self.advance > deepest:
            problem = f'{1e3 * self.advance:.1f} mm deeper, {self._inputs.load:.1f} N are felt'
        else:
            problem = self._test.problem() if self._test.over else ''
        return problem + ', with saturated tactels' * (saturated and problem != '')

    @property
    def tested(self) -> bool:
        """Whether the test is over."""
        return self._test is not None and self._test.over

    def retreat(self, dt: float) -> np.ndarray:
        """
        Compute the twist of the pad (6,) off the object [m/s, rad/s], for a cycle of `dt` [s].

        Motion in the other directions slows down gradually. If all motion had to stop at once,
        the joint limits would delay the motion along the normal as well.
        """
        twist = self._slowed(dt)
        twist[2] = 0.0 if self.lifted else -self._config.approach.speed
        return twist

    def _slowed(self, dt: float) -> np.ndarray:
        twist = self._motion.twist
        beside = np.hypot(twist[0], twist[1])
        return twist * max(1.0 - self._motion.across() * dt / max(beside, 1e-9), 0.0)

    def _careful_speed(self) -> float:
        """
        Return the speed at which the pad may approach or press in the test [m/s].

        At this speed the force cannot grow much before an image shows it.
        """
        way, contact = self._unseen_way(), self._inputs.contact
        seen = None if contact is None else self._inputs.pose_at(contact.stamp_ns)
        if seen is None:
            return min(self._config.approach.speed, way / MAX_STAMP_AGE)
        pose = self._motion.pose
        blind = float((pose[:3, 3] - seen[:3, 3]) @ pose[:3, 2])
        return clipped((way - blind) / REACTION, 0.0, self._config.approach.speed)

    def _unseen_way(self) -> float:
        return unseen_way(self._goal.force, self._law.stiffness)
