"""What a law that follows a surface has in mind: the state of one goal, and what was felt."""
from collections.abc import Sequence
from dataclasses import dataclass, field
import math

import numpy as np

from tactile_servo.control.surface_path import (
    Line,
    PlanarPath,
    raster,
    seen_along,
    spiral,
    SurfacePath,
)
from tactile_servo.law import Assessment, Touch
from tactile_servo.laws.stall import Stall
from tactile_servo.laws.surface_config import ProbeConfig
from tactile_servo.laws.surface_features import Felt, Told
from tactile_servo.laws.surface_goal import Pattern, SurfaceGoal, SurfaceResult
from tactile_servo.reasons import Reason


@dataclass
class Going:
    """State of one goal."""

    wanted: Sequence[Told] = ()  # contacts, to go from one to the next
    felt: Felt | None = None  # newest contact
    shown: float = -math.inf  # steady time of it [s]
    problem: Reason | None = None  # of the newest image
    begun: float | None = None  # steady time of first contact [s]
    path: SurfacePath | None = None
    met: bool = False  # whether the force was met once
    end: Assessment | None = None  # what the path has come to
    over: bool = False  # whether the goal has ended: what is felt on lifting off is no surface
    stall: Stall = field(default_factory=Stall)
    aim: Told = field(init=False)  # the contact that is wanted now

    def __post_init__(self) -> None:
        if self.wanted:
            self.aim = self.wanted[0]


@dataclass
class Record:
    """What was felt over the whole goal."""

    probe: ProbeConfig
    points: list[np.ndarray] = field(default_factory=list)  # (3,) [m]
    normals: list[np.ndarray] = field(default_factory=list)
    images: int = 0
    kept: int = 0
    pressed: int = 0  # with the whole print on the pad
    area: float = 0.0  # of the print, running mean [m^2]
    square: float = 0.0  # of the contact's distance from where it is wanted [m^2]
    newest: Touch | None = None

    def keep(self, stamp_ns: int, felt: Felt, off: float, normal: np.ndarray,
             whole: bool) -> None:
        """
        Take a contact, its squared distance from where it is wanted [m^2], the inward normal.

        The normal (3,) is the filtered one; `whole`, whether all of the print is felt.
        """
        self.kept += 1
        self.square += off
        if not whole:
            return
        self.pressed += 1
        self.area += max(0.02, 1.0 / self.pressed) * (felt.area - self.area)
        if self.pressed < 20:  # the print does not say yet how deep the skin is pressed
            return
        point = felt.centre + (self.probe.skin_radius - self._deflection(felt.force)) * normal
        self.newest = Touch(stamp_ns, point, normal.copy())
        if not self.points or np.linalg.norm(point - self.points[-1]) >= 2.5e-4:
            self.points.append(point)
            self.normals.append(self.newest.normal)

    def _deflection(self, force: float) -> float:
        """
        Indentation of the skin [m], told by the size of its print.

        On an elastic foundation P = pi / 2 k d a b, a and b the half axes of the patch; the
        variance of its pressure is a^2 / 6 and b^2 / 6. It is larger on what curves more.
        """
        # The variance of an image is less than the mean of x^2 of what presses by 2 mm^2: of the
        # default probe, by finite elements.
        area = max(self.area + 2.0e-6, 1e-6)
        return force / (3.0 * math.pi * self.probe.modulus * area)

    def result(self) -> SurfaceResult:
        """Contacts that were felt."""
        if not self.points:
            return SurfaceResult()
        return SurfaceResult(
            contour=np.array(self.points), normals=np.array(self.normals),
            contact_kept=self.kept / max(self.images, 1),
            centre_rms=math.sqrt(self.square / max(self.kept, 1)))


def plan_path(goal: SurfaceGoal, point: np.ndarray, normal: np.ndarray,
              acceleration: float) -> SurfacePath:
    """Way of a goal from its first contact (3,) and inward normal (3,) there."""
    direction = np.array(goal.direction, dtype=float)
    if goal.pattern == Pattern.LINE:
        return Line(point, normal, direction)
    if goal.pattern == Pattern.RASTER:
        plan = raster(*goal.size, goal.step_over)
    elif goal.pattern == Pattern.SPIRAL:
        plan = spiral(goal.size[0], goal.step_over)
    else:
        plan = seen_along(np.asarray(goal.points, dtype=float), point, normal, direction)
    return PlanarPath(point, normal, direction, plan, acceleration)
