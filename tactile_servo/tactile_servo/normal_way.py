"""The pad's way along its own normal: to what is to be touched, into it, and off it."""

import numpy as np

from tactile_servo.config import ServoConfig
from tactile_servo.control.force_controller import REACTION, unseen_way
from tactile_servo.control.press_test import PressTest
from tactile_servo.control.scaling import clipped
from tactile_servo.inputs import Inputs
from tactile_servo.law import Goal, ServoLaw
from tactile_servo.motion.motion import Motion
from tactile_servo.state_times import approach_speed


class NormalWay:
    """
    How far the commanded pad has come along its normal, and how fast it may go on.

    What was touched before is sought where it was: a sensor that has gone blind meanwhile
    presses no harder.
    """

    def __init__(self, config: ServoConfig, goal: Goal, law: ServoLaw, inputs: Inputs,
                 motion: Motion):
        self._config, self._goal, self._law = config, goal, law
        self._inputs, self._motion = inputs, motion
        self._touched, self._lift = False, config.retreat.distance
        self._test: PressTest | None = None
        self.begin()

    def begin(self) -> None:
        """Count from where the pad is commanded now."""
        self._anchor = self._motion.pose

    def lift(self) -> None:
        """Lift off from here: to where the approach began, if it has not touched anything."""
        if not self._touched:
            self._lift = max(self._lift, self.advance)
        self.begin()

    def touch(self) -> None:
        """Count from here: what is to be tracked has been met."""
        self._touched = True
        self.begin()

    @property
    def advance(self) -> float:
        """How far the commanded sensor stands beyond where its way began [m]."""
        return self._beyond(self._motion.pose)

    def _beyond(self, pose: np.ndarray) -> float:
        anchor = self._anchor
        return 0.0 if pose is anchor else float((pose[:3, 3] - anchor[:3, 3]) @ anchor[:3, 2])

    @property
    def farthest(self) -> float:
        """Advance at which an approach has met nothing [m]."""
        return self._unseen_way() if self._touched else self._config.approach.distance

    @property
    def lifted(self) -> bool:
        """Whether the pad has come off."""
        return -self.advance >= self._lift

    def approach(self) -> np.ndarray:
        """Twist of the pad (6,) towards what is to be touched [m/s, rad/s]."""
        speed = self._careful_speed() if self._inputs.load < self._goal.force else 0.0
        return np.array([0.0, 0.0, speed, 0.0, 0.0, 0.0])

    def begin_test(self) -> None:
        """What was touched is to be pressed and released, before anything else."""
        self.touch()
        self._test = PressTest(self._goal.force, self._inputs.load, self._law.depth)

    def test(self, dt: float) -> np.ndarray:
        """Twist of the pad (6,) in that test, for a cycle of `dt` [s]."""
        assert self._test is not None and self._inputs.contact is not None
        stamp = self._inputs.contact.stamp_ns
        pose = self._inputs.pose_at(stamp)
        if pose is not None:
            self._test.see(stamp, self._inputs.load, self._beyond(pose))
        speed = min(self._test.speed(self._inputs.load, dt), self._careful_speed())
        return np.array([0.0, 0.0, speed, 0.0, 0.0, 0.0])

    def test_problem(self) -> str:
        """Why the sensor has failed the test, '' if it has not."""
        assert self._test is not None
        if not self._test.pressed and self.advance > self._test.deepest + self._unseen_way():
            return f'{1e3 * self.advance:.1f} mm deeper, {self._inputs.load:.1f} N are felt'
        return self._test.problem() if self._test.over else ''

    @property
    def tested(self) -> bool:
        """Whether the test is over."""
        return self._test is not None and self._test.over

    def retreat(self, dt: float) -> np.ndarray:
        """
        Twist of the pad (6,) off what it touches, for a cycle of `dt` [s] [m/s, rad/s].

        What it still does otherwise slows down: joints that are to stop all motion at once bring
        the normal to rest no sooner than the rest.
        """
        twist = self._motion.twist
        beside = np.hypot(twist[0], twist[1])
        twist *= max(1.0 - self._motion.across() * dt / max(beside, 1e-9), 0.0)
        twist[2] = 0.0 if self.lifted else -self._config.approach.speed
        return twist

    def _careful_speed(self) -> float:
        """Speed at which the pad may press what has been touched, or not yet [m/s]."""
        return min(approach_speed(self._config, self._goal.force), self._law.touch_speed,
                   self._sighted_speed())

    def _sighted_speed(self) -> float:
        """Speed at which the force cannot grow much on a way that no image has shown [m/s]."""
        way, contact = self._unseen_way(), self._inputs.contact
        seen = None if contact is None else self._inputs.pose_at(contact.stamp_ns)
        if seen is None:
            return way / self._config.input.max_stamp_age
        pose = self._motion.pose
        blind = float((pose[:3, 3] - seen[:3, 3]) @ pose[:3, 2])
        return clipped((way - blind) / REACTION, 0.0, np.inf)

    def _unseen_way(self) -> float:
        return unseen_way(self._goal.force, self._law.stiffness)
