"""Law 'jacobian_rate' of the thesis: moves in the sensor's plane, J^-1 dF as rate (6.3, 6.5)."""
from dataclasses import dataclass, field
import math
from typing import ClassVar

import numpy as np

from tactile_common.config import bounded
from tactile_servo.control.scaling import clipped
from tactile_servo.laws.surface_config import SurfaceConfig
from tactile_servo.laws.surface_law import SurfaceLaw
from tactile_servo.laws.surface_motion import LIFT, PRESS
from tactile_servo.motion.agility import Agility


@dataclass(frozen=True)
class RateConfig:
    """Gain of the rate."""

    gain: float = bounded(
        20.0, 'share of J^-1 dF that is made up in a second: the printed law makes up all of it '
        'at every image, which is a gain of 200/s', '1/s', 0.1, 500.0, live=True)


@dataclass(frozen=True)
class JacobianRateConfig(SurfaceConfig):
    """User settings of probe, robot and task."""

    thesis: RateConfig = field(default_factory=RateConfig)


class JacobianRate(SurfaceLaw):
    """Follow a surface with the law of the thesis."""

    name: ClassVar[str] = 'jacobian_rate'
    config_type: ClassVar[type] = JacobianRateConfig
    config: JacobianRateConfig

    def normal(self, commanded: np.ndarray, dt: float) -> np.ndarray:
        """Return the inward normal (3,) of the newest image."""
        return self.felt.normal

    def twist(self, normal: np.ndarray, way: np.ndarray, pose: np.ndarray,
              commanded: np.ndarray, agility: Agility, dt: float) -> np.ndarray:
        """Return the twist (6,) of V_d in the sensor plane (6.5) plus J^-1 dF (6.3) as a rate."""
        twist, ahead = np.zeros(6), commanded[:3, :3].T @ way
        twist[:2] = self._motion.speed * ahead[:2] / max(math.hypot(ahead[0], ahead[1]), 1e-9)
        dx, dy, dz = self.config.thesis.gain * (self.felt.error - self._going.aim.error)
        twist[2] = clipped(dz, -LIFT, PRESS)
        turn = np.array([dy, -dx, 0.0]) / self._dome.array_radius
        turn *= min(1.0, self.config.roll.max_rate / max(math.sqrt(turn @ turn), 1e-12))
        twist[:3] += np.cross(turn, -self._dome.centre)
        twist[3:] = turn
        return twist
