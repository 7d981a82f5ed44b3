"""A law of one's own, as an example: round a point beside the pad, with a force."""

from dataclasses import dataclass
import math

import numpy as np

from tactile_common.config import bounded
from tactile_servo.config import STALE_AFTER
from tactile_servo.control.scaling import clipped, slewed
from tactile_servo.law import Assessment, LawResult, Reference
from tactile_servo.laws.surface_goal import SurfaceGoal
from tactile_servo.reasons import Reason, ReasonCode
from tactile_servo.types import State, TaskError


@dataclass(frozen=True)
class CirclingConfig:
    """What a user knows of circle and skin."""

    radius: float = bounded(0.01, 'of the circle, whose centre lies in direction of x', 'm',
                            1e-3, 0.1)
    stiffness: float = bounded(1.2e4, 'of skin, finger and robot', 'N/m', 1.0, 1e7)
    gain: float = bounded(8.0, 'rate at which errors are made up', '1/s', 0.1, 100.0)
    acceleration: float = bounded(0.2, 'along the circle', 'm/s^2', 0.01, 10.0)


class Circling:
    """Once round a point of a plane."""

    name, goal_type, config_type = 'circling', SurfaceGoal, CirclingConfig
    sees_images, even, near, touch = False, True, math.inf, None
    unfelt, press = 0.0, None

    def __init__(self, servo, config=None):
        self.servo, self.config, self.error = servo, config or CirclingConfig(), None
        self.resume()

    def retune(self, config):
        """Take other gains from now on."""
        self.config = config

    @property
    def stiffness(self):
        """Of skin, finger and robot along the normal [N/m]."""
        return self.config.stiffness

    def depth(self, force):
        """Depth [m] that a force [N] stands for."""
        return force / self.stiffness

    def validate(self, goal):
        """Every goal will do."""

    def begin(self, goal, sensor):
        """Forget the last goal and take a new one."""
        self.goal, self._centre, self.error = goal, None, None
        self._force, self._shown = 0.0, -math.inf
        self.resume()

    def halt(self):
        """Without a check of the depth, nobody asks for it."""

    def resume(self):
        """Go on from a standstill."""
        self._speed = 0.0

    def observe(self, observation):
        """Take a contact."""
        if observation.contact is not None:
            self._force, self._shown = observation.contact.moments.m0, observation.arrival
            self.error = TaskError(math.nan, force=self._force)

    def lacks(self, now):
        """What keeps the law from tracking, or None."""
        late = now - self._shown > STALE_AFTER
        return Reason(ReasonCode.CONTACT_LOST) if late or self._force <= 0.0 else None

    def assess(self, now, progress, load):
        """Go on until it is once round."""
        if self.lacks(now):
            return Assessment(State.HOLD, self.lacks(now))
        if progress >= 2.0 * math.pi * self.config.radius:
            return Assessment(State.DONE, Reason(ReasonCode.PATH_COMPLETED), True)
        return Assessment(State.TRACK, Reason(ReasonCode.TRACKING))

    def reference(self, pose, commanded, robot, dt):
        """Along the circle, back to it, and down for the missing force."""
        c, place, rotation = self.config, commanded[:3, 3], commanded[:3, :3]
        if self._centre is None:
            self._centre = place + c.radius * rotation[:, 0]
        from_centre = rotation.T @ (place - self._centre)
        away = math.hypot(from_centre[0], from_centre[1])
        outward = np.array([from_centre[0], from_centre[1], 0.0]) / away
        along = np.array([-outward[1], outward[0], 0.0])
        pressed = self._force > 0.7 * self.goal.force
        self._speed = slewed(self._speed, self.goal.speed * pressed, c.acceleration * dt)
        inward = self._speed**2 / away * dt + c.gain * (away - c.radius)
        press = clipped(c.gain * self.depth(self.goal.force - self._force), -0.01, 0.01)
        twist = np.zeros(6)
        twist[:3] = self._speed * along - inward * outward
        twist[2] = press
        return Reference(twist, self._speed, (rotation @ along).tolist())

    def result(self):
        """Nothing beyond the poses of the sensor."""
        return LawResult()
