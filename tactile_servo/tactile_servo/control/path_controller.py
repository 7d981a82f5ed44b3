"""Motion of a pad in the plane of a path: along the path, and back to it."""

import math

RETURN_SPEED = 0.1  # m/s, largest speed back to the path


class PathController:
    """Control of the velocity in the plane; returns to the path at a rate `gain` [1/s]."""

    def __init__(self, gain: float):
        self.gain = gain
        self.reset()

    def reset(self) -> None:
        """Set the velocity to 0."""
        self.velocity = 0.0, 0.0

    def follow(self, along: tuple[float, float], aside: tuple[float, float],
               acceleration: float, dt: float) -> tuple[float, float]:
        """
        Compute the velocity x, y along a path and back to it [m/s].

        Parameters
        ----------
        along, aside : tuple of float
            Velocity x, y along the path [m/s], and vector x, y from the pad to the path [m].
        acceleration, dt : float
            Largest acceleration of the pad in the plane [m/s^2]; duration of the cycle [s].
        """
        (ux, uy), (x, y) = along, aside
        distance = math.hypot(x, y)
        # Slow enough to stop at the path.
        back = min(self.gain * distance, math.sqrt(acceleration * distance), RETURN_SPEED) / max(
            distance, 1e-9)
        return self.change(ux + back * x, uy + back * y, acceleration * dt)

    def change(self, x: float, y: float, most: float) -> tuple[float, float]:
        """Change the velocity towards x, y by at most `most` [m/s], and return it."""
        before_x, before_y = self.velocity
        size = math.hypot(x - before_x, y - before_y)
        share = most / size if size > most else 1.0
        self.velocity = before_x + (x - before_x) * share, before_y + (y - before_y) * share
        return self.velocity
