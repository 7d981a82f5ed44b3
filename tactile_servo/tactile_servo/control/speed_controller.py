"""Speed of a pad along the edge or surface that it follows."""

from tactile_servo.control.scaling import ramp

# Measured force over wanted force: a pad stands still below LIFTED and above CROWDED, and keeps
# its speed between LIGHTEST and HEAVIEST.
LIFTED, LIGHTEST = 0.3, 0.7
HEAVIEST, CROWDED = 1.1, 1.3


def caution(pressed: float, astray: float) -> float:
    """
    Return the factor, 0 to 1, by which to reduce the speed of a pad.

    Parameters
    ----------
    pressed : float
        Measured force over wanted force. The pad keeps its speed between `LIGHTEST` and
        `HEAVIEST`, and stops below `LIFTED` and above `CROWDED`.
    astray : float
        Deviation from the path: the pad keeps its speed at 0, and stops from 1 on.
    """
    return (ramp(pressed, LIFTED, LIGHTEST) * ramp(pressed, CROWDED, HEAVIEST)
            * ramp(astray, 1.0, 0.0))


class SpeedController:
    """Speed [m/s] with bounded changes."""

    def __init__(self) -> None:
        self.speed = 0.0

    def reset(self) -> None:
        """Set the speed to 0."""
        self.speed = 0.0

    def change(self, top: float, faster: float, slower: float) -> float:
        """Change to the speed `top`, by at most `faster` up or `slower` down; return it [m/s]."""
        self.speed = min(max(top, self.speed - slower), self.speed + faster)
        return self.speed
