"""Observation of the followed edge from images and contacts."""

import math
from typing import NamedTuple

import numpy as np

from tactile_sensing.types.contact import Contact, ContactType
from tactile_servo.control.press_check import PressCheck
from tactile_servo.control.stability import AGE_SHARE
from tactile_servo.edge_map.edge_map import EdgeMap, NO_RIDGE
from tactile_servo.edge_map.picture import indentation_of, slope_where_lifted
from tactile_servo.edge_map.traced_path import PathEnd
from tactile_servo.image_order import ImageOrder
from tactile_servo.law import Observation
from tactile_servo.reasons import Reason, ReasonCode
from tactile_servo.types import EdgeGoal, TaskError

# Largest difference of the force of a fitted line from the sum of the pressures, as a share
FIT_DIFFERENCE = 0.1
LEVEL = 3  # successive images in which the pad does not lift off, after which it is level


class Load(NamedTuple):
    """Load along an edge in one image."""

    force: float = 0.0  # N
    length: float = 0.0  # length of the edge under the pad [m]
    coming: float = 0.0  # length that is about to reach the pad suddenly [m]


class EdgeSight:
    """
    Edge as seen in the images since the start of a goal.

    Once the pad moves, an image with less than `contact_force` [N] shows no edge, only what a
    skin that creeps keeps of the last one.
    """

    def __init__(self, goal: EdgeGoal, skin_stiffness: float, contact_force: float):
        self._goal, self.edge = goal, EdgeMap(skin_stiffness)
        self._contact_force = contact_force
        # Steady times of the last usable image, and of the last one that shows the edge [s].
        self.looked = self.shown = -math.inf
        self.age = 0.0  # running mean of the images' age [s]
        self.problem: Reason | None = Reason(ReasonCode.NO_IMAGE)  # why the last one shows no edge
        # At the newest image: height of the pad along the plane's normal and its station on the
        # path [m], and slope of the edge along the path against the plane.
        self.height = self.station = self.slope = 0.0
        self._level = 0  # successive images in motion in which the pad does not lift off
        self.load, self.press, self.order = Load(), PressCheck(), ImageOrder()
        self.error: TaskError | None = None

    @property
    def lifted(self) -> bool:
        """Whether the ridge may end because the pad was tilted when it touched."""
        return self._level < LEVEL

    def refine(self, observation: Observation, contact: Contact) -> None:
        """Take the force of a contact's line, which is better than a sum; check the order."""
        picture, load = self.edge.picture, self.load
        if picture is None:
            return
        self.order.see(contact, observation.pose, picture.scale)
        if (observation.stamp_ns == picture.stamp_ns
                and contact.force_valid and contact.type == ContactType.LINE
                and abs(contact.normal_force - load.force) < FIT_DIFFERENCE * load.force):
            self.load = load._replace(force=contact.normal_force)

    def see(self, observation: Observation, pose: np.ndarray, ahead: float,
            anew: bool) -> bool:
        """
        Process an image taken at a pose (4, 4); return True if a new path begins with it.

        `ahead` is the station of the commanded pose [m]. With `anew` a new path begins in any
        case; this is used until the pad moves along it.
        """
        edge, direction = self.edge, self._goal.direction
        assert observation.image is not None
        problem = edge.see(observation.image, pose)
        if problem is not None:
            self.problem = problem
            return False
        picture = edge.picture
        self.looked, self.height = observation.arrival, picture.height
        self.age += AGE_SHARE * (observation.age - self.age)
        self.problem, begun = (edge.follow(direction, anew=anew)
                               if anew or picture.force >= self._contact_force
                               else (NO_RIDGE, False))
        length = self.load.length
        if edge.followed:
            lateral, angle, length, slope = edge.at_picture(
                direction, edge.station if begun else ahead)
            slope = self._slope_at_start(slope, anew)
        self.load = Load(picture.force, length, picture.coming)
        if self.problem is None:
            self.shown, self.station = observation.arrival, edge.station
            self.slope = self.slope if begun or math.isnan(slope) else slope
            self.error = TaskError(lateral, angle=angle, force=picture.force)
            found, depth, way = indentation_of(picture.points, picture.pose, picture.scale.half)
            if found and not anew:
                self.press.see(picture.pose, picture.pose[:3, 3], way, depth)
        elif self.error is not None:
            self.error = self.error._replace(force=picture.force)
        return begun

    def _slope_at_start(self, slope: float, anew: bool) -> float:
        """Return the slope of the edge, also for a pad that touches it with its rear alone."""
        if not self.lifted:
            return slope
        tilted = (slope_where_lifted(self.edge.picture, self.edge.path.nodes['way'][-1])
                  if self.edge.path.end is PathEnd.RIDGE and self.problem is None else math.nan)
        if math.isnan(tilted):
            self._level += not anew
            return slope
        self._level = 0
        return tilted
