"""Goal of the laws that follow a surface, its path and its result."""
from dataclasses import dataclass, field
from enum import IntEnum
import math

import numpy as np

from tactile_servo.control.surface_path import (
    PlanarPath,
    raster,
    SectionPath,
    seen_along,
    spiral,
    SurfacePath,
)
from tactile_servo.law import LawResult
from tactile_servo.reasons import Reason, ReasonCode
from tactile_servo.types import Goal

MAX_PATH = 100.0  # longest pattern [m]
LINE_LENGTH = 0.06  # default length of a line [m]


class Pattern(IntEnum):
    """Patterns of motion over a surface; the values are those of TrackSurface.action."""

    LINE = 0
    RASTER = 1
    SPIRAL = 2
    POINTS = 3


@dataclass(frozen=True, eq=False)
class SurfaceGoal(Goal):
    """Goal of surface tracking, as in TrackSurface.action."""

    pattern: int = Pattern.LINE
    direction: tuple[float, float, float] = (0.0, 1.0, 0.0)  # in the base frame, any norm
    length: float = 0.0  # length of a line [m]; 0 = until `duration`
    duration: float = 0.0  # time from first contact to the end [s]; 0 = unlimited
    size: tuple[float, float] = (0.0, 0.0)  # sides of a raster, radius of a spiral [m]
    step_over: float = 0.0  # distance of neighbouring lines of a raster or spiral [m]
    points: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))  # base frame [m]
    features: str = ''  # names of taught features, separated by commas

    @property
    def way(self) -> float:
        """Length of the path [m], about; 0 if it is not known before the first contact."""
        if self.pattern == Pattern.LINE:
            return self.length
        if self.pattern == Pattern.RASTER:
            return self.size[0] * (self.size[1] / self.step_over + 1.0) + self.size[1]
        if self.pattern == Pattern.SPIRAL:
            return math.pi * self.size[0] ** 2 / self.step_over
        # From the base, since the place of the first contact is not known.
        return float(np.linalg.norm(np.diff(self.points, axis=0, prepend=0.0), axis=1).sum())


@dataclass(frozen=True, eq=False)
class SurfaceResult(LawResult):
    """Measured contacts: points (N, 3) in `contour` and inward normals (N, 3)."""

    normals: np.ndarray | None = None
    contact_kept: float = math.nan  # share of the tracking time with contact
    centre_rms: float = math.nan  # RMS distance of the contact from its wanted place [m]


def refuse_surface_goal(goal: SurfaceGoal) -> Reason | None:
    """Return why a goal is invalid, or None."""
    numbers = [goal.length, goal.duration, *goal.size, goal.step_over]
    if not all(0.0 <= value < math.inf for value in numbers):
        return _invalid('length, duration, size and step_over must be finite and not negative')
    if goal.pattern not in list(Pattern):
        return _invalid(f'pattern {goal.pattern} is none of {", ".join(p.name for p in Pattern)}')
    square = float(np.dot(goal.direction, goal.direction))
    if goal.pattern != Pattern.POINTS and not 1e-12 < square < math.inf:
        return _invalid(f'direction {tuple(goal.direction)} has no direction')
    if goal.pattern == Pattern.LINE and goal.length == goal.duration == 0.0:
        return _invalid('a line needs a length or a duration')
    if goal.pattern in (Pattern.RASTER, Pattern.SPIRAL):
        across = goal.size[1] if goal.pattern == Pattern.RASTER else goal.size[0]
        if not (min(goal.size[0], across) > 0.0 and goal.step_over > 0.0):
            return _invalid('size and step_over must be above 0')
    if goal.pattern == Pattern.POINTS:
        shape = np.shape(goal.points)
        if len(shape) != 2 or shape[0] < 1 or shape[1] != 3 or not np.isfinite(goal.points).all():
            return _invalid('points must be one or more finite places')
    if goal.way > MAX_PATH:
        return _invalid(f'the path would be longer than {MAX_PATH:g} m')
    return None


def _invalid(detail: str) -> Reason:
    return Reason(ReasonCode.INVALID_GOAL, detail)


def plan_path(goal: SurfaceGoal, point: np.ndarray, normal: np.ndarray,
              acceleration: float) -> SurfacePath:
    """Return the path of a goal from its first contact (3,) and the inward normal (3,) there."""
    direction = np.array(goal.direction, dtype=float)
    if goal.pattern == Pattern.LINE:
        return SectionPath(point, normal, direction)
    if goal.pattern == Pattern.RASTER:
        plan = raster(*goal.size, goal.step_over)
    elif goal.pattern == Pattern.SPIRAL:
        plan = spiral(goal.size[0], goal.step_over)
    else:
        plan = seen_along(np.asarray(goal.points, dtype=float), point, normal, direction)
    return PlanarPath(point, normal, direction, plan, acceleration)
