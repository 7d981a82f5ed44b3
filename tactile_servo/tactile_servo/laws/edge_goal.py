"""Checks and ends of goals, and the stiffness, that all edge-following laws share."""

import math

from tactile_common.config import checked
from tactile_sensing.types.image import SensorInfo
from tactile_servo.control.progress import LapGuard
from tactile_servo.law import Assessment, done, Refusal
from tactile_servo.reasons import ReasonCode
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


def refuse_edge_goal(goal: EdgeGoal) -> Refusal | None:
    """Return why a goal is invalid, or None."""
    if not 0.0 <= goal.length < math.inf:
        return Refusal(ReasonCode.INVALID_GOAL,
                       f'length {goal.length:g} is negative or not finite')
    if goal.direction not in (-1, 1):
        return Refusal(ReasonCode.INVALID_GOAL, f'direction {goal.direction} is neither +1 nor -1')
    return None


def goal_end(goal: EdgeGoal, laps: LapGuard, progress: float, found: Assessment) -> Assessment:
    """End a goal, except in a hold, if its length is reached or its contour cannot close."""
    if found.state is State.HOLD:
        return found
    if 0.0 < goal.length <= progress:
        return done(ReasonCode.LENGTH_REACHED, success=True)
    problem = '' if goal.length or found.state is State.DONE else laps.problem(progress)
    return done(ReasonCode.LAP_LIMIT, problem) if problem else found


def edge_end(goal: EdgeGoal, progress: float) -> Assessment:
    """
    End the goal at the end of the edge.

    It is a success if the goal has no length and is not closed, and the `progress` [m] is long
    enough for its errors to be known.
    """
    if goal.length == 0.0 and not goal.closed and progress > SETTLING_LENGTH:
        return done(ReasonCode.EDGE_ENDED, success=True)
    return done(ReasonCode.EDGE_ENDED, f'after {1e3 * progress:.0f} mm')
