"""Checks and ends of goals that all edge-following laws share."""

import math

from tactile_servo.control.lap_guard import LapGuard
from tactile_servo.law import Assessment, Refusal
from tactile_servo.reasons import Reason, ReasonCode
from tactile_servo.types import EdgeGoal, State


def refuse_edge_goal(goal: EdgeGoal) -> Refusal | None:
    """Return why a goal is invalid, or None."""
    if not 0.0 <= goal.length < math.inf:
        return Refusal(ReasonCode.INVALID_GOAL,
                       f'length {goal.length:g} is negative or not finite')
    if goal.direction not in (-1, 1):
        return Refusal(ReasonCode.INVALID_GOAL, f'direction {goal.direction} is neither +1 nor -1')
    return None


def within_goal(goal: EdgeGoal, laps: LapGuard, progress: float, found: Assessment) -> Assessment:
    """End a goal, except in a hold, if its length is reached or its contour cannot close."""
    if found.state is not State.HOLD and 0.0 < goal.length <= progress:
        return Assessment(State.DONE, Reason(ReasonCode.LENGTH_REACHED), True)
    problem = '' if goal.length or found.state in (State.HOLD, State.DONE) else (
        laps.problem(progress))
    return Assessment(State.DONE, Reason(ReasonCode.LAP_LIMIT, problem)) if problem else found


def ended(goal: EdgeGoal, progress: float, shortest: float) -> Assessment:
    """
    End the goal at the end of the edge.

    It is a success if the goal has no length and is not closed, and `progress` exceeds `shortest`
    [m].
    """
    asked = goal.length == 0.0 and not goal.closed
    return Assessment(State.DONE, Reason(ReasonCode.EDGE_ENDED), asked and progress > shortest)
