"""How fast a pad goes over what it follows."""

from tactile_servo.control.scaling import ramp


def caution(pressed: float, astray: float) -> float:
    """
    Share of the speed, 0 to 1, that a pad may keep.

    Parameters
    ----------
    pressed : float
        Share of the wanted force that it presses with: it goes on between 0.7 and 1.1, and stands
        below 0.3 and above 1.3.
    astray : float
        How far it is from where it should be: 1 and more, and it stands; 0, and it goes on.
    """
    return (ramp(pressed, 0.3, 0.7) * ramp(pressed, 1.3, 1.1)
            * ramp(astray, 1.0, 0.0))


class SpeedController:
    """Speed [m/s] that changes within bounds."""

    def __init__(self) -> None:
        self.speed = 0.0

    def reset(self) -> None:
        """Stand still."""
        self.speed = 0.0

    def change(self, top: float, faster: float, slower: float) -> float:
        """Go to a speed [m/s] with no more than these changes [m/s] of it."""
        self.speed = min(max(top, self.speed - slower), self.speed + faster)
        return self.speed
