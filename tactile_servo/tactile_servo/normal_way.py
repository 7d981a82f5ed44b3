"""The pad's way along its own normal: to what is to be touched, into it, and off it."""

import numpy as np

from tactile_servo.config import ServoConfig
from tactile_servo.control.force_controller import REACTION, unseen_way
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
        pose, anchor = self._motion.pose, self._anchor
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
        force, speed = self._goal.force, 0.0
        if self._inputs.load < force:
            speed = min(approach_speed(self._config, force), self._law.touch_speed,
                        self._sighted_speed())
        return np.array([0.0, 0.0, speed, 0.0, 0.0, 0.0])

    def retreat(self) -> np.ndarray:
        """Twist of the pad (6,) off what it touches [m/s, rad/s]."""
        speed = 0.0 if self.lifted else self._config.approach.speed
        return np.array([0.0, 0.0, -speed, 0.0, 0.0, 0.0])

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
