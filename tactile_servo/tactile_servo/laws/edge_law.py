"""What all edge-following laws share: checks and ends of goals, and the stiffness of the skin."""

from abc import abstractmethod
import math
from typing import ClassVar

from tactile_common.config import checked
from tactile_sensing.types.image import SensorInfo
from tactile_servo.control.press_check import PressCheck
from tactile_servo.control.progress import LapGuard
from tactile_servo.law import Assessment, done, ServoLaw
from tactile_servo.reasons import Reason, ReasonCode
from tactile_servo.track_statistics import SETTLING_LENGTH
from tactile_servo.types import EdgeGoal, State

SKIN_STIFFNESS = 2e5  # N/m^2, of a skin whose calibration gives none: that of a FlexiTac pad


def skin_stiffness_of(sensor: SensorInfo) -> float:
    """Return the line force per indentation [N/m^2]; ConfigurationError if it is impossible."""
    return checked('skin_stiffness', sensor.skin_stiffness or SKIN_STIFFNESS, float,
                   {'range': (1e3, 1e9), 'unit': 'N/m^2'})


def total_stiffness(sensor: SensorInfo) -> float:
    """Return K_z = 2 L k of (5.5), of a skin k [N/m^2] with an edge along all of its y [N/m]."""
    return skin_stiffness_of(sensor) * sensor.array.size_y


class EdgeLaw(ServoLaw):
    """A law that follows an edge; `_progress` [m] and `_laps` are those of the goal."""

    goal_type: ClassVar[type] = EdgeGoal
    goal: EdgeGoal
    press: PressCheck
    _laps: LapGuard
    _progress: float

    @property
    def unfelt(self) -> float:
        return self.press.unexplained / self.depth(1.0)

    def validate(self, goal: EdgeGoal) -> Reason | None:
        if not 0.0 <= goal.length < math.inf:
            return Reason(ReasonCode.INVALID_GOAL,
                          f'length {goal.length:g} is negative or not finite')
        if goal.direction not in (-1, 1):
            return Reason(
                ReasonCode.INVALID_GOAL, f'direction is {goal.direction}, must be +1 or -1')
        return None

    def assess(self, now: float, progress: float, load: float) -> Assessment:
        """End a goal, except in a hold, if its length is reached or its contour cannot close."""
        self._progress, goal = progress, self.goal
        found = self._assess(now, progress, load)
        if found.state is State.HOLD:
            return found
        if 0.0 < goal.length <= progress:
            return done(ReasonCode.LENGTH_REACHED, success=True)
        problem = '' if goal.length or found.state is State.DONE else self._laps.problem(progress)
        return done(ReasonCode.LAP_LIMIT, problem) if problem else found

    @abstractmethod
    def _assess(self, now: float, progress: float, load: float) -> Assessment:
        """Decide as `assess` does, without length and laps of the goal."""

    def _end_of_edge(self) -> Assessment:
        """
        End the goal at the end of the edge.

        It is a success if the goal has no length and is not closed, and the way so far is long
        enough for its errors to be known.
        """
        if self.goal.length == 0.0 and not self.goal.closed and self._progress > SETTLING_LENGTH:
            return done(ReasonCode.EDGE_ENDED, success=True)
        return done(ReasonCode.EDGE_ENDED, f'after {1e3 * self._progress:.0f} mm')
