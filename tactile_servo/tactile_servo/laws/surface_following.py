"""
Law 'tactile_jacobian', with prediction of the contact's normal.

The probe turns about its centre to bring the contact to the wanted place on the pad. It moves
along the contact's normal to keep the force, and at right angles to it over the surface. The
normal is filtered, and predicted from the robot's pose, so the age of the images is not in the
loop.
"""
from typing import ClassVar

import numpy as np

from tactile_servo.laws.surface_law import SurfaceLaw
from tactile_servo.motion.agility import Agility


class SurfaceFollowing(SurfaceLaw):
    """Follow a surface with the tactile Jacobian and the robot's own pose."""

    name: ClassVar[str] = 'tactile_jacobian'

    def normal(self, commanded: np.ndarray, dt: float) -> np.ndarray:
        """Return the inward normal (3,) predicted for the end of the cycle."""
        return self._motion.normal_ahead(commanded, dt)

    def twist(self, normal: np.ndarray, way: np.ndarray, pose: np.ndarray,
              commanded: np.ndarray, agility: Agility, dt: float) -> np.ndarray:
        """Return the twist (6,), with PI control of the force."""
        going, motion, felt = self._going, self._motion, self.felt
        depth, wanted = self._sense.depth(felt.force), self._sense.depth(going.aim.force)
        press = motion.press(pose, commanded, felt, going.aim, wanted,
                             depth if going.met else None, dt)
        return motion.twist(way, normal, press, commanded, going.aim, agility, dt)
