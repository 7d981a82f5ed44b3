"""
Law 'tactile_jacobian': along the contact's normal, which is predicted from how it turns.

The probe turns about its centre to bring the contact where it is wanted, goes along the contact's
normal to keep the force, and over the surface across it. That normal is filtered and predicted
from the robot's own pose, so that the age of the images is not in the loop.
"""
from typing import ClassVar

import numpy as np

from tactile_servo.laws.surface_law import SurfaceLaw
from tactile_servo.motion.agility import Agility


class SurfaceFollowing(SurfaceLaw):
    """Follow a surface by the tactile Jacobian and the robot's own pose."""

    name: ClassVar[str] = 'tactile_jacobian'

    def normal(self, commanded: np.ndarray, dt: float) -> np.ndarray:
        """Normal (3,) where the probe will be."""
        return self._motion.normal_ahead(commanded, dt)

    def twist(self, normal: np.ndarray, way: np.ndarray, pose: np.ndarray,
              commanded: np.ndarray, agility: Agility, dt: float) -> np.ndarray:
        """Twist (6,) with PI control of the force."""
        going, motion, felt = self._going, self._motion, self.felt
        depth, wanted = self._sense.depth(felt.force), self._sense.depth(going.aim.force)
        press = motion.press(pose, commanded, felt, going.aim, wanted,
                             depth if going.met else None, dt)
        return motion.twist(way, normal, press, commanded, going.aim, agility, dt)
