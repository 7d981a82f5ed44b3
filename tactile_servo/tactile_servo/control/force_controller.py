"""Force of a pad along its normal: PI control of how deep it presses, on a prediction of that."""

from dataclasses import dataclass
import math

from tactile_servo.control.scaling import clipped

INTEGRATED = 0.2  # of it, the error up to which the integral counts it: more would overshoot
REACTION = 0.01  # s until the pad has slowed down


def unseen_way(force: float, stiffness: float) -> float:
    """Way [m] on which a force [N] may grow by its half before an image shows it."""
    return 0.5 * force / stiffness


def touch_speed(force: float, stiffness: float, age: float) -> float:
    """Speed [m/s] at which images of an age [s] show a touch in time."""
    return unseen_way(force, stiffness) / (age + REACTION)


@dataclass(frozen=True)
class ForceGains:
    """Gains and bounds of the motion along the normal."""

    gain: float  # rate at which a missing depth is made up [1/s]
    integral: float  # 1/s^2
    press: float  # largest speed towards the object [m/s],
    lift: float  # and off it [m/s]
    # Deceleration that the robot is trusted with as it presses [m/s^2]: a fiftieth of gravity, so
    # that an arm which brakes badly ends its way as well.
    braking: float = 0.2


class ForceController:
    """PI control of a depth [m], which stands for the force."""

    def __init__(self, gains: ForceGains):
        self.gains, self._integral = gains, 0.0

    def reset(self) -> None:
        """Forget the past, at a standstill."""
        self._integral = 0.0

    def speed(self, missing: float, felt: float | None, dt: float, *, haste: float = 1.0,
              may_press: bool = True) -> float:
        """
        Speed along the normal towards the object [m/s].

        Parameters
        ----------
        missing, felt : float
            How much deeper the pad should be now [m], as predicted; and as the newest image shows
            it, for the integral; None if that is too much to be counted.
        dt : float, s
        haste : float
            Factor of the gain.
        may_press : bool
            Otherwise the pad only gives way.
        """
        c = self.gains
        if felt is not None:
            self._integral += felt * dt
        remaining = c.integral * self._integral
        # Pressing ends in time even for a robot that brakes this hard only.
        wanted = min(haste * c.gain * missing + remaining,
                     math.sqrt(2.0 * c.braking * max(missing, 0.0)) + abs(remaining))
        return clipped(wanted, -c.lift, c.press if may_press else 0.0)
