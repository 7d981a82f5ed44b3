"""Largest gain of a control loop whose images arrive with a delay."""

import math

AGE_SHARE = 0.1  # weight of the newest image's age in the running mean
LIMIT_SHARE = 0.4  # largest gain, as a share of the stability limit
DEAD_TIME, LAG = 2.5e-3, 10e-3  # s, of the robot that the stability limit assumes


def stable_gain(delay: float, lag: float = 0.0) -> float:
    """Return the largest gain of a loop with a margin of stability [1/s], see `gain_limit`."""
    return LIMIT_SHARE * gain_limit(delay, lag)


def gain_limit(delay: float, lag: float) -> float:
    """
    Compute the gain of an integrating loop at the limit of stability [1/s].

    The loop g exp(-j omega d) / (j omega (1 + j omega tau)) has the dead time d > 0 and the
    robot's lag tau [s]. At the limit it has gain 1 and phase -pi:
    omega d + atan(omega tau) = pi / 2 and g = omega sqrt(1 + omega^2 tau^2).
    """
    omega, step = 0.0, math.inf
    # The phase is concave in omega, so Newton's method approaches the limit from below.
    while step > 1e-12 * omega:
        step = (0.5 * math.pi - omega * delay - math.atan(omega * lag)) / (
            delay + lag / (1.0 + (omega * lag)**2))
        omega += step
    return omega * math.hypot(1.0, omega * lag)
