"""How large the gain of a loop may be that acts on pictures which come late."""

import math

AGE_SHARE = 0.1  # of an image's age in their running mean


def gain_limit(delay: float, lag: float) -> float:
    """
    Gain of an integrating loop at the limit of stability [1/s].

    Of a loop g exp(-j omega d) / (j omega (1 + j omega tau)) of the dead time d > 0 and the
    robot's lag tau [s]. At the limit it has gain 1 and phase -pi:
    omega d + atan(omega tau) = pi / 2 and g = omega sqrt(1 + omega^2 tau^2).
    """
    omega, step = 0.0, math.inf
    # The phase is concave in omega: Newton's method climbs to the limit from below.
    while step > 1e-12 * omega:
        step = (0.5 * math.pi - omega * delay - math.atan(omega * lag)) / (
            delay + lag / (1.0 + (omega * lag)**2))
        omega += step
    return omega * math.hypot(1.0, omega * lag)
