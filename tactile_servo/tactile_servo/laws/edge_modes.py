"""What a pad does along an edge, at its end and where it is lost."""

from typing import NamedTuple, Protocol

import numpy as np

from tactile_servo.edge_map.edge_map import Stand
from tactile_servo.edge_map.picture import PadScale
from tactile_servo.laws.edge_motion import EdgeMotion, SEARCH
from tactile_servo.motion.agility import Agility
from tactile_servo.reasons import Reason, ReasonCode

END_MARGIN = 1.5  # grains before the end of a ridge from which the pad coasts
STILL = np.zeros(3)


class Wanted(NamedTuple):
    """Motion in the frame of the plane."""

    velocity: tuple[float, float]  # in the plane [m/s],
    normal: float  # along its normal,
    turn: np.ndarray  # (3,) [rad/s]


class Mode(Protocol):
    """One thing that a pad does."""

    @property
    def reason(self) -> Reason:
        """What to call it."""
        ...

    def move(self, motion: EdgeMotion, stand: Stand, agility: Agility, dt: float) -> Wanted:
        """Motion of the next cycle."""
        ...


class Following:
    """Along the edge, with its force."""

    reason = Reason(ReasonCode.TRACKING)

    def move(self, motion: EdgeMotion, stand: Stand, agility: Agility, dt: float) -> Wanted:
        """Motion of the next cycle."""
        return Wanted(motion.along(stand, agility, dt), motion.press(stand, dt),
                      motion.turn(stand, dt))


class Coasting:
    """Straight on from the end of a ridge, to where it goes on beyond a gap."""

    reason = Reason(ReasonCode.COASTING)

    def __init__(self) -> None:
        self._way = 0.0

    def begun(self, scale: PadScale) -> bool:
        """Whether the end of the ridge is not reached yet."""
        return self._way <= END_MARGIN * scale.grain

    def over(self, scale: PadScale, unseen: float) -> bool:
        """Whether images show that the edge has passed; the last way [m] they do not show yet."""
        # It began that margin before the end, which is known to no less; 1.42 halves on, the edge
        # has passed from under the pad, corner to corner.
        return self._way - unseen >= 1.42 * scale.half + 2.0 * END_MARGIN * scale.grain

    def move(self, motion: EdgeMotion, stand: Stand, agility: Agility, dt: float) -> Wanted:
        """Motion of the next cycle."""
        velocity = motion.along(stand, agility, dt, may_lift=True)
        self._way += motion.speed * dt
        return Wanted(velocity, motion.press(stand, dt, may_press=False), STILL)


class Searching:
    """To where the pressure is."""

    reason = Reason(ReasonCode.SEARCHING)

    def __init__(self) -> None:
        self._way = 0.0

    def over(self, scale: PadScale) -> bool:
        """Whether it has gone too far."""
        return self._way > 1.18 * scale.half

    def move(self, motion: EdgeMotion, stand: Stand, agility: Agility, dt: float) -> Wanted:
        """Motion of the next cycle."""
        speed, pull = min(SEARCH, motion.goal.speed), motion.sight.edge.picture.pull
        assert pull is not None  # it is left where there is none
        self._way += speed * dt
        x, y = pull.tolist()
        return Wanted(motion.aside(speed * x, speed * y, dt), 0.0, STILL)


class ReachingDown:
    """Down for contact along the pad's own normal, as deep as allowed [m] from where it began."""

    reason = Reason(ReasonCode.REACHING_DOWN)

    def __init__(self, deepest: float):
        self._deepest, self._depth = deepest, 0.0
        self._begin: np.ndarray | None = None

    @property
    def over(self) -> bool:
        """Whether the pad is as deep as it may go: a tenth is left for the stop."""
        return self._depth > 0.9 * self._deepest

    def move(self, motion: EdgeMotion, stand: Stand, agility: Agility, dt: float) -> Wanted:
        """Motion of the next cycle."""
        there = stand.there
        self._begin = there.copy() if self._begin is None else self._begin
        way, normal = (there - self._begin)[:3, 3], self._begin[:3, 2]
        self._depth = float(way @ normal)
        x, y = motion.aside(0.0, 0.0, dt)
        down = motion.touch_speed(max(self._deepest - self._depth, 0.0))
        # While it still goes on, a pad that is inclined comes deeper by that as well.
        return Wanted((x, y), (down - x * normal.item(0) - y * normal.item(1)) / normal.item(2),
                      STILL)
