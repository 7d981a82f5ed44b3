"""Motion of a pad in the plane of a path: along it, and back to it."""

from dataclasses import dataclass
import math

from tactile_common.config import bounded


@dataclass(frozen=True)
class PathConfig:
    """How closely a path is followed."""

    lateral_gain: float = bounded(
        30.0, "rate at which the pad's distance from the traced edge is made up", '1/s',
        1.0, 200.0, live=True)
    max_lateral_speed: float = bounded(0.1, 'largest speed back to the edge', 'm/s', 1e-4, 1.0)
    corner_cut: float = bounded(
        5e-5, 'distance from a sharp corner at which the pad may pass it; what the task allows',
        'm', 1e-6, 1e-2)
    corner_settle: float = bounded(
        3e-4, 'distance before and after a sharp corner that is passed at its speed, for the '
        'lag of the robot', 'm', 0.0, 1e-2)


class PathController:
    """Velocity in the plane, of bounded acceleration: the pad's largest there [m/s^2]."""

    def __init__(self, config: PathConfig, acceleration: float):
        self.config, self.acceleration = config, acceleration
        self.reset()

    def reset(self) -> None:
        """Stand still."""
        self.velocity = 0.0, 0.0

    def follow(self, way: tuple[float, float], speed: float, aside: tuple[float, float],
               dt: float) -> tuple[float, float]:
        """
        Velocity x, y along a path and back to it [m/s].

        Parameters
        ----------
        way, aside : tuple of float
            Unit vector x, y of the path, and way x, y from the pad to it [m].
        speed, dt : float
            Along the path [m/s]; [s].
        """
        c, (ux, uy), (x, y) = self.config, way, aside
        distance = math.hypot(x, y)
        # No faster than the pad can stop at the path.
        back = min(c.lateral_gain * distance, math.sqrt(self.acceleration * distance),
                   c.max_lateral_speed) / max(distance, 1e-9)
        return self.change(speed * ux + back * x, speed * uy + back * y, dt)

    def change(self, x: float, y: float, dt: float) -> tuple[float, float]:
        """Change the velocity towards x, y within the acceleration."""
        (before_x, before_y), most = self.velocity, self.acceleration * dt
        size = math.hypot(x - before_x, y - before_y)
        if size > most:
            share = most / size
            x, y = before_x + (x - before_x) * share, before_y + (y - before_y) * share
        self.velocity = x, y
        return x, y
