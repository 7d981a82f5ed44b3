"""How fast a pad may go along a traced edge."""

from dataclasses import dataclass

from tactile_common.config import bounded
from tactile_servo.control.path_controller import PathConfig
from tactile_servo.control.scaling import ramp
from tactile_servo.edge_map.edge_map import EdgeMap
from tactile_servo.edge_map.picture import PadScale
from tactile_servo.edge_map.traced_path import PathEnd

ANSWER = 5.0e-3  # s until the robot answers to what an image showed
LIFTED, PRESSED = 0.3, 0.7  # of the force, at which the pad stands and goes at full speed
CROWDED, BORNE = 1.3, 1.1  # of the force, the same for too much of it
ASTRAY, ON_PATH = 0.6, 0.1  # grains from the path, at which the pad stands and does not slow down


@dataclass(frozen=True)
class SpeedConfig:
    """Bounds of the speed along the edge."""

    acceleration: float = bounded(
        2.0, 'largest acceleration of the pad in the plane of the edge', 'm/s^2', 0.01, 100.0)
    blind: float = bounded(
        0.05, 'speed to which the pad can slow down where the pad sees no further', 'm/s',
        1e-3, 1.0, live=True)
    entry: float = bounded(
        0.03, 'speed at which a second leg may come under the pad: its load comes at once, and '
        'the force controller must follow', 'm/s', 1e-3, 1.0, live=True)
    search: float = bounded(0.02, 'largest speed while the edge is searched', 'm/s', 1e-3, 0.5,
                            live=True)
    unseen: float = bounded(
        1.0, 'way that the pad may go until the robot answers to an image, in lengths that an '
        'image resolves (depth of the tactels, or 1.25 pitches): the pad is slower where images '
        'come later, down to speed.entry', 'grains', 0.05, 500.0)


def contact_scale(ratio: float) -> float:
    """Slow down while the pad presses with less than its force, of which this is the share."""
    return ramp(ratio, LIFTED, PRESSED)


def overload_scale(ratio: float) -> float:
    """Slow down while the pad presses with more than its force."""
    return ramp(ratio, CROWDED, BORNE)


def stray_scale(distance: float, grain: float) -> float:
    """Slow down off the path, where going ahead leads away from it."""
    return ramp(distance / grain, ASTRAY, ON_PATH)


class SpeedPlanner:
    """Speed along an edge: as asked for, unless something slows it down."""

    def __init__(self, config: SpeedConfig, path: PathConfig):
        self.config, self._path = config, path
        self.speed, self.acceleration = 0.0, config.acceleration

    def reset(self) -> None:
        """Stand still."""
        self.speed = 0.0

    def top(self, speed: float, *, pressed: float, distance: float, coming: float,
            scale: PadScale, age: float, coasting: bool = False) -> float:
        """
        Speed that is safe here, whatever lies ahead [m/s].

        Parameters
        ----------
        speed, pressed : float
            Asked for [m/s]; share of the wanted force.
        distance, coming : float
            From the path, and length of a second leg that is about to come under the pad [m].
        age : float
            Of the images, on average [s].
        coasting : bool
            The pad need not press.
        """
        c = self.config
        top = speed if coasting else speed * contact_scale(pressed)
        # Images that come late show late what lies ahead.
        top = min(top, max(c.unseen * scale.grain / (age + ANSWER), c.entry))
        # A second leg that comes under the pad adds its load at once: give way first.
        share = min(coming / min(scale.half_x, scale.half_y), 1.0)
        top -= max(top - c.entry, 0.0) * share
        return top * overload_scale(pressed) * stray_scale(distance, scale.grain)

    def plan(self, edge: EdgeMap, station: float, top: float, dt: float) -> float:
        """Speed at a station [m] from which every turn ahead can be taken [m/s]."""
        c = self.config
        end = {PathEnd.CLOSED: top, PathEnd.RIDGE: min(c.search, top),
               PathEnd.VIEW: c.blind}[edge.path.end]
        limit = edge.speed_limit(station, top, self.acceleration, end, self._path.corner_cut,
                                 self._path.corner_settle)
        self.speed = min(limit, self.speed + self.acceleration * dt)
        return self.speed

    def search(self, top: float) -> float:
        """Speed of a search [m/s]."""
        self.speed = min(self.config.search, top)
        return self.speed
