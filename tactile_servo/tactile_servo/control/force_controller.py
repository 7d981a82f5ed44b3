"""Control of a pad's force along its normal: PI control of its predicted depth."""

from dataclasses import dataclass
import math

from tactile_servo.control.scaling import clipped

UNSEEN = 0.5  # largest increase of the force that no image has shown, as a share of it
INTEGRATED = 0.2  # largest force error that is integrated, relative: larger ones would overshoot
REACTION = 0.01  # s until the pad has slowed down


def unseen_way(force: float, stiffness: float) -> float:
    """Return the distance [m] to press before an image shows it: `UNSEEN` of a force [N] more."""
    return UNSEEN * force / stiffness


def touch_speed(force: float, stiffness: float, age: float) -> float:
    """Return the speed [m/s] at which images of an age [s] show a touch in time."""
    return unseen_way(force, stiffness) / (age + REACTION)


@dataclass(frozen=True)
class ForceGains:
    """Gains and bounds of the motion along the normal."""

    gain: float  # rate at which an error of the depth is corrected [1/s]
    integral: float  # 1/s^2
    press: float  # largest speed towards the object [m/s]
    lift: float  # largest speed off the object [m/s]
    # Assumed deceleration of the robot while it presses [m/s^2]: a fiftieth of gravity, so that an
    # arm with poor braking stops in time too.
    braking: float = 0.2


class ForceController:
    """PI control of a depth [m], which determines the force."""

    def __init__(self, gains: ForceGains):
        self.gains, self._integral = gains, 0.0

    def reset(self) -> None:
        """Reset the integral, at a standstill."""
        self._integral = 0.0

    def speed(self, missing: float, felt: float | None, dt: float, *, haste: float = 1.0,
              may_press: bool = True) -> float:
        """
        Compute the speed along the normal towards the object [m/s].

        Parameters
        ----------
        missing : float
            Predicted error: how much deeper the pad should be now [m].
        felt : float or None
            The same error from the newest image [m], which is integrated; None if it is too large
            for that.
        dt : float
            Duration of the cycle [s].
        haste : float
            Factor of the gain.
        may_press : bool
            If false, the pad may only move off the object.
        """
        c = self.gains
        if felt is not None:
            self._integral += felt * dt
        remaining = c.integral * self._integral
        # The pad stops in time even if the robot brakes no harder than this.
        wanted = min(haste * c.gain * missing + remaining,
                     math.sqrt(2.0 * c.braking * max(missing, 0.0)) + abs(remaining))
        return clipped(wanted, -c.lift, c.press if may_press else 0.0)
