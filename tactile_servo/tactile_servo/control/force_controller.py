"""Control of a pad's force along its normal: PI control of its predicted depth."""

import math

from tactile_servo.control.scaling import clipped

UNSEEN = 0.5  # largest increase of the force that no image has shown, as a share of it
INTEGRATED = 0.2  # largest force error that is integrated, relative: larger ones would overshoot
REACTION = 0.01  # s until the pad has slowed down
# Assumed deceleration of the robot while it presses [m/s^2]: a fiftieth of gravity, so that an
# arm with poor braking stops in time too.
BRAKING = 0.2


def unseen_way(force: float, stiffness: float) -> float:
    """Return the distance [m] to press before an image shows it: `UNSEEN` of a force [N] more."""
    return UNSEEN * force / stiffness


def stopping_speed(way: float, deceleration: float, delay: float) -> float:
    """Return the speed [m/s] at which a stop that begins after a delay [s] takes a way [m]."""
    return deceleration * (math.sqrt(delay**2 + 2.0 * way / deceleration) - delay)


class ForceController:
    """
    PI control of a depth [m], which determines the force.

    An error of the depth is corrected at the rate `gain` [1/s], its integral with `integral`
    [1/s^2]. The speed is at most `press` towards the object and `lift` off it [m/s].
    """

    def __init__(self, gain: float, integral: float, press: float, lift: float):
        self.gain, self._integral_gain, self._press, self._lift = gain, integral, press, lift
        self.reset()

    def reset(self) -> None:
        """Reset the integral, at a standstill."""
        self._integral = 0.0

    def speed(self, missing: float, felt: float | None, dt: float, *,
              may_press: bool = True) -> float:
        """
        Compute the speed along the normal towards the object [m/s] in a cycle of `dt` [s].

        `missing` is the predicted error: how much deeper the pad should be now [m]. `felt` is the
        same error from the newest image, which is integrated; None if it is too large for that.
        Unless it `may_press`, the pad may only move off.
        """
        if felt is not None:
            self._integral += felt * dt
        remaining = self._integral_gain * self._integral
        # The pad stops in time even if the robot brakes no harder than BRAKING.
        wanted = min(self.gain * missing + remaining,
                     math.sqrt(2.0 * BRAKING * max(missing, 0.0)) + abs(remaining))
        return clipped(wanted, -self._lift, self._press if may_press else 0.0)
