"""Force of a pad along an edge: predicted from the newest image, and how the pad moved since."""

from dataclasses import dataclass
import math
from typing import NamedTuple

from tactile_common.config import bounded
from tactile_servo.control.scaling import clipped

COMING_SHARE = 0.35  # of the length that comes under the pad at once which is given way to before
GIVE_WAY = 5.0  # times the gain with which the pad gives way to what comes under it
INTEGRATED = 0.2  # of the force, the error up to which the integral counts it
SHORTEST = 0.5  # of the pad's half size, the edge that the force is spread over at the least


@dataclass(frozen=True)
class ForceConfig:
    """Gains and bounds of the motion along the normal."""

    gain: float = bounded(
        60.0, 'rate at which an error of the force is made up', '1/s', 1.0, 200.0, live=True)
    integral_gain: float = bounded(
        60.0, 'integral gain of the force', '1/s^2', 0.0, 1e4, live=True)
    stiffness: float = bounded(
        5000.0, 'total stiffness of skin, finger and robot along the normal', 'N/m', 10.0, 1e7)
    skin_stiffness: float = bounded(
        2.0e5, 'line force per length and indentation, which tells the height of the edge',
        'N/m^2', 1e2, 1e9)
    press_acceleration: float = bounded(
        0.2, 'deceleration along the normal that the robot is trusted with as it presses',
        'm/s^2', 1e-3, 100.0)
    max_speed: float = bounded(0.05, 'largest speed along the normal', 'm/s', 1e-4, 1.0)


class Load(NamedTuple):
    """What an image says of the load along an edge."""

    force: float = 0.0  # N
    length: float = 0.0  # of the edge on the pad [m]
    coming: float = 0.0  # length that is about to come under the pad all at once [m]


class ForceController:
    """
    PI control of the force, on a prediction of it.

    The line force of the image and the way of the pad since give the line force now; with the
    length that is under the pad in a moment, it gives the indentation that is missing.
    """

    def __init__(self, config: ForceConfig):
        self.config, self._integral = config, 0.0

    def reset(self) -> None:
        """Forget the past, at a standstill."""
        self._integral = 0.0

    def speed(self, force: float, load: Load, *, half: float, length: float, pressed: float,
              dt: float, may_press: bool = True) -> float:
        """
        Speed along the normal towards the edge, beside that which follows its rise [m/s].

        Parameters
        ----------
        force, load : float, Load
            Wanted [N], and that of the newest image.
        half, length : float
            Half the pad's smaller size, and length of the edge under the pad in a moment [m].
        pressed : float
            How much deeper in the edge the pad stands than as the image was taken [m].
        dt : float, s
        may_press : bool
            Otherwise the pad only gives way.
        """
        c, shortest = self.config, SHORTEST * half
        predicted = load.force / max(load.length, shortest) + c.skin_stiffness * pressed
        # A share of what is to come is given way to before: as much too little first as it
        # is too much then.
        wanted = force / (max(length, shortest) + COMING_SHARE * load.coming)
        error = (wanted - max(predicted, 0.0)) / c.skin_stiffness
        if abs(force - load.force) < INTEGRATED * force:
            self._integral += (force - load.force) / c.stiffness * dt
        # There is not much time, and what was moved since the image is known: give way fast.
        gain = c.gain * (GIVE_WAY if load.coming > 0.0 and error < 0.0 else 1.0)
        give = gain * error + c.integral_gain * self._integral
        # Pressing ends in time even for a robot that brakes this hard only.
        give = min(give, math.sqrt(2.0 * c.press_acceleration * max(error, 0.0))
                   + c.integral_gain * abs(self._integral))
        return give if may_press else min(give, 0.0)

    def bounded(self, speed: float) -> float:
        """Speed along the normal within its bound [m/s]."""
        return clipped(speed, -self.config.max_speed, self.config.max_speed)
