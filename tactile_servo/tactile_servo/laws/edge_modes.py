"""Modes of a pad along an edge, at its end and after its loss: each has a motion and an end."""

import numpy as np

from tactile_servo.config import PRESS_DEPTH
from tactile_servo.edge_map.edge_map import PathPosition
from tactile_servo.edge_map.picture import PadScale
from tactile_servo.laws.edge_motion import EdgeMotion
from tactile_servo.motion.motion import Motion
from tactile_servo.reasons import Reason, ReasonCode

SEARCH = 0.02  # m/s, largest speed in the search for a lost edge
END_MARGIN = 1.5  # grains before the end of a ridge at which coasting begins
# Half sizes of the pad: a half diagonal, after which an edge has left the pad in any direction
PAD_LEFT = 1.42
SEARCH_REACH = 1.18  # half sizes of the pad, longest way of a search towards the load
# Share of PRESS_DEPTH; the rest is passed in the longest pause of the cycles, and in the stop.
PROBED_DEPTH = 0.8
STILL = np.zeros(3)

# Motion of a cycle in the frame of the plane: velocity x, y in the plane and along its normal
# [m/s], angular velocity (3,) [rad/s].
Wanted = tuple[tuple[float, float], float, np.ndarray]


class Following:
    """Move along the edge with the wanted force."""

    reason = Reason(ReasonCode.TRACKING)

    def move(self, motion: EdgeMotion, place: PathPosition, robot: Motion, dt: float) -> Wanted:
        """Return the motion of the next cycle."""
        return (motion.along(place, robot, dt), motion.press(place, robot, dt),
                motion.turn(place, robot, dt))


class Travelling:
    """Mode that ends after a way of the commanded pad, which other rules may slow down."""

    def __init__(self) -> None:
        self._way, self._last = 0.0, np.zeros(0)  # [m]; position in the plane

    def count(self, place: PathPosition) -> None:
        """Add the distance since the last cycle."""
        there = place.there[:3, 3].copy()
        self._way += float(np.linalg.norm(there - self._last)) if self._last.size else 0.0
        self._last = there


class Coasting(Travelling):
    """Move straight on from the end of a ridge, across a possible gap."""

    reason = Reason(ReasonCode.COASTING)

    def begun(self, scale: PadScale) -> bool:
        """Return True until the end of the ridge is reached."""
        return self._way <= END_MARGIN * scale.grain

    def over(self, scale: PadScale, unseen: float) -> bool:
        """Return True if the edge has left the pad; images lag behind by `unseen` [m]."""
        # Coasting began one margin before the end, and the end is uncertain by one margin. After
        # another half diagonal the edge has left the pad.
        return self._way - unseen >= PAD_LEFT * scale.half + 2.0 * END_MARGIN * scale.grain

    def move(self, motion: EdgeMotion, place: PathPosition, robot: Motion, dt: float) -> Wanted:
        """Return the motion of the next cycle."""
        self.count(place)
        velocity = motion.along(place, robot, dt, may_lift=True)
        return velocity, motion.press(place, robot, dt, may_press=False), STILL


class Searching(Travelling):
    """Move towards the pressure."""

    reason = Reason(ReasonCode.SEARCHING)

    def over(self, scale: PadScale) -> bool:
        """Return True if the search has gone too far."""
        return self._way > SEARCH_REACH * scale.half

    def move(self, motion: EdgeMotion, place: PathPosition, robot: Motion, dt: float) -> Wanted:
        """Return the motion of the next cycle."""
        speed, pull = min(SEARCH, motion.goal.speed), motion.sight.edge.picture.pull
        assert pull is not None  # without a pull the law does not search
        self.count(place)
        x, y = pull.tolist()
        return motion.aside(speed * x, speed * y, dt), 0.0, STILL


class ReachingDown:
    """Move down along the pad's normal to find contact, by at most PRESS_DEPTH."""

    reason = Reason(ReasonCode.REACHING_DOWN)

    def __init__(self) -> None:
        self._depth, self._begin = 0.0, np.zeros((0, 0))

    @property
    def over(self) -> bool:
        """True if the allowed depth is reached, less the reserve for the stop."""
        return self._depth > PROBED_DEPTH * PRESS_DEPTH

    def move(self, motion: EdgeMotion, place: PathPosition, robot: Motion, dt: float) -> Wanted:
        """Return the motion of the next cycle."""
        there = place.there
        self._begin = self._begin if self._begin.size else there.copy()
        way, normal = (there - self._begin)[:3, 3], self._begin[:3, 2]
        self._depth = float(way @ normal)
        x, y = motion.aside(0.0, 0.0, dt)
        down = motion.touch_speed(max(PRESS_DEPTH - self._depth, 0.0))
        # While the pad still moves in the plane, this changes the depth of an inclined pad too.
        return (x, y), (down - x * normal.item(0) - y * normal.item(1)) / normal.item(2), STILL


Mode = Following | Coasting | Searching | ReachingDown
