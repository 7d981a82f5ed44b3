"""Where in space a contact on the pad is: on the pad's surface, at the contact's stamp."""
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
import math
from typing import Any, NamedTuple

import numpy as np

from tactile_common.state_buffer import NS, PoseBuffer
from tactile_sensing.types.contact import Contact, ContactType, Reason
from tactile_sensing.types.image import TactileImage
from tactile_shape.contour.edge_point import edge_point

STRAIGHT = 1.2  # residual up to which a line is; a bend makes it more, and shifts the line
WAITING = 200  # contacts, or images, that wait for what belongs to them: a second of them
Place = tuple[float, float]  # x, y on the array [m]


@dataclass(frozen=True, eq=False)
class SpatialContact:
    """A contact in the base frame; of an edge, the point of it nearest to the pad's centre."""

    stamp_ns: int
    position: np.ndarray  # (3,) [m]
    normal: np.ndarray  # (3,), the object's inward unit normal
    edge: bool


class Placed(NamedTuple):
    """A contact that has been looked up."""

    extra: Any  # what was given with it
    contact: SpatialContact | None  # None if nothing is touched, or where is not known
    anew: bool  # whether the path begins anew with it
    reason: str  # why there is no contact in space


def needs_picture(contact: Contact) -> bool:
    """Whether a contact is to be located in its picture: bends, corners and ends of edges."""
    if contact.type == ContactType.LINE and np.isfinite(contact.yaw):
        x, y = contact.moments.centre_of_pressure
        middle = abs(y * np.cos(contact.yaw) - x * np.sin(contact.yaw))
        # The pressure of a whole line is centred within 2 mm of its nearest point.
        return not middle < 2e-3 or contact.residual > STRAIGHT
    return contact.type == ContactType.OTHER


def locate(contact: Contact, picture: TactileImage | None = None) -> tuple[Place | None, bool]:
    """
    Where a contact is on the array, if it is located, and whether it is with an edge.

    Of an edge it is the point nearest to the pad's centre, of a large area, which is neither
    point nor edge, its centre of pressure. The picture is the contact's, if it `needs_picture`.
    A contact that hardly stands out of the noise lies anywhere: that of a pad that touches down.
    """
    if contact.reasons & Reason.LOW_SNR:
        return None, False
    seen = edge_point(picture) if picture is not None and needs_picture(contact) else None
    if contact.type == ContactType.LINE and contact.valid and np.isfinite(contact.offset):
        c, s = np.cos(contact.yaw), np.sin(contact.yaw)
        # From the foot of the pad's centre, unless the line begins after it or ends before.
        along = float(np.fmin(np.fmax(0.0, contact.start), contact.end))
        place = (contact.offset * c - along * s, contact.offset * s + along * c)
        if picture is None or not needs_picture(contact):
            return place, True
        if seen is None:
            return None, False
        # The line goes on where the edge has ended, and cuts a bend: more than 1 mm off the ridge.
        near = not contact.residual > STRAIGHT and math.dist(seen, place) < 1e-3
        return (place if near else seen), True
    if contact.type == ContactType.OTHER:
        if seen is not None:
            return seen, True
        # No model explains it, but force and moments hold. Of a bent edge, whose second moments
        # differ tenfold and more, they tell a place that is millimetres off it.
        place, long = contact.moments.centre_of_pressure, contact.moments.elongation() > 4.0
        two = contact.reasons & Reason.TWO_CONTACTS
        return (None if two or long or not np.isfinite(place).all() else place), False
    if contact.type == ContactType.POINT and contact.valid:
        return (contact.x, contact.y), False
    return None, False


def on_pad(place: Place, finger_radius: float = 0.0) -> tuple:
    """
    Position (3,) [m] and outward normal (3,) of the pad, which is the object's inward one.

    Both are in the sensor frame; None for a place off the finger, or on no pad at all. A round
    finger is a sphere that touches the plane z = 0, a radius of 0 [m] means a flat pad.
    """
    x, y = place
    if not abs(x) + abs(y) < 1.0:  # NaN neither
        return None, None
    if not finger_radius:
        return np.array([x, y, 0.0]), np.array([0.0, 0.0, 1.0])
    square = finger_radius**2 - x * x - y * y
    if not square > 0.0:
        return None, None
    normal = np.array([x, y, np.sqrt(square)]) / finger_radius
    return finger_radius * (normal - [0.0, 0.0, 1.0]), normal


class _Waiting(NamedTuple):
    stamp_ns: int
    contact: Contact
    extra: object
    picture: TactileImage | None


class ContactPath:
    """
    Contacts and poses, in whatever order they come, to contacts in space.

    Time is that of the stamps alone, so that a replayed recording gives what the run gave.

    Parameters
    ----------
    finger_radius : float
        As of `on_pad` [m].
    max_gap : float
        Contacts farther apart are not of one path, poses are not interpolated [s].
    """

    def __init__(self, finger_radius: float = 0.0, max_gap: float = 0.1):
        self._finger_radius, self._max_gap = finger_radius, round(max_gap * NS)
        self._poses = PoseBuffer(max_gap)
        self._waiting: deque[_Waiting] = deque(maxlen=WAITING)
        self._pictures: dict[int, Callable[[], TactileImage | None]] = {}  # by their stamps [ns]
        self.lost = 0  # contacts that no pose came for
        self._last: int | None = None  # stamp of the last contact [ns]
        self._touched = -self._max_gap - 1  # stamp of the last load [ns], and the largest one
        self._heaviest = 0.0

    def clear(self) -> None:
        """Forget poses and waiting contacts: another frame, or a recording that restarts."""
        self._poses.clear()
        self._waiting.clear()
        self._last = None

    def restarts(self, stamp_ns: int) -> bool:
        """Whether a pose at a stamp is of a recording that begins anew."""
        return self._poses.went_back(stamp_ns)

    def add_pose(self, stamp_ns: int, pose: np.ndarray) -> list[Placed]:
        """Add a pose (4, 4) of the sensor; returns the contacts that it places, as `settle`."""
        if self.restarts(stamp_ns):
            self.clear()
        self._poses.add(stamp_ns, pose)
        return self.settle()

    def add_picture(self, stamp_ns: int, unpack: Callable[[], TactileImage | None]) -> None:
        """Add a picture, before its contact. Few are needed, and to unpack all cost the most."""
        self._pictures[stamp_ns] = unpack
        if len(self._pictures) > WAITING:
            del self._pictures[next(iter(self._pictures))]

    def add_contact(self, stamp_ns: int, contact: Contact, extra: Any = None,
                    picture: TactileImage | None = None) -> list[Placed]:
        """
        Add a contact, see `locate`; returns the contacts that can be placed, as `settle`.

        Its picture may have been added before, or is given here.
        """
        unpack = self._pictures.get(stamp_ns)
        if unpack and needs_picture(contact):
            picture = unpack()
        if len(self._waiting) == self._waiting.maxlen:
            self.lost += 1
        self._waiting.append(_Waiting(stamp_ns, contact, extra, picture))
        return self.settle()

    def settle(self) -> list[Placed]:
        """Place the waiting contacts for which the poses are there."""
        placed = []
        newest = self._poses.newest_ns
        while self._waiting and newest is not None and self._waiting[0].stamp_ns <= newest:
            waiting = self._waiting.popleft()
            contact, anew, reason = self._place(waiting)
            placed.append(Placed(waiting.extra, contact, anew, reason))
        return placed

    def _place(self, waiting: _Waiting) -> tuple[SpatialContact | None, bool, str]:
        """Contact in space, whether the path begins anew with it, and why there is none."""
        stamp = waiting.stamp_ns
        place, edge = locate(waiting.contact, waiting.picture)
        position, normal = (None, None) if place is None else on_pad(place, self._finger_radius)
        if waiting.contact.type == ContactType.NONE:
            self._last = None
            return None, True, 'nothing is touched'
        if self._leaves(stamp, waiting.contact.moments.m0):
            return None, False, 'too light: the pad lifts off'
        if position is None:
            return None, False, 'the contact is not located'
        pose = self._poses.at(stamp)
        if pose is None:
            self.lost += 1
            return None, False, 'no pose of the sensor at its stamp'
        anew = self._last is None or not 0 <= stamp - self._last <= self._max_gap
        self._last = stamp
        return SpatialContact(stamp, pose[:3, :3] @ position + pose[:3, 3],
                              pose[:3, :3] @ normal, edge), anew, ''

    def _leaves(self, stamp: int, load: float) -> bool:
        """Whether the pad lifts off, with half of its load: its contacts lie anywhere on it."""
        if not 0 <= stamp - self._touched <= self._max_gap:
            self._heaviest = 0.0
        self._touched, self._heaviest = stamp, max(self._heaviest, load)
        return load < 0.5 * self._heaviest
