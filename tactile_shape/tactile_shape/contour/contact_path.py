"""Locates contacts on the pad's surface and transforms them into space at their stamps."""
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
import math
from typing import Any, NamedTuple

import numpy as np

from tactile_common.state_buffer import NS, pose_between, StateBuffer
from tactile_sensing.contact.ridge import ridge_points
from tactile_sensing.types.contact import Contact, ContactType, Reason
from tactile_sensing.types.image import TactileImage

STRAIGHT = 1.2  # largest residual of a straight edge; a bend has more, and shifts the line
# Largest distance along a line between its centre of pressure and its point nearest to the pad's
# centre, for a line across the whole pad [m].
MIDDLE = 2e-3
BEYOND = 1e-3  # m between a fitted line and its ridge; if farther apart, the ridge is used
ELONGATED = 4.0  # ratio of second moments; a bent edge has 10 or more, a round contact 1
FARTHEST = 1.0  # m, largest |x| + |y| of a place on a pad
LEAVING = 0.5  # share of the largest load of late; below it, the pad lifts off
FORGOTTEN = 1.0  # time constant with which that largest load is forgotten [s]
WAITING = 200  # most contacts or images that wait for their counterpart: about one second
# Contacts farther apart belong to different paths: one and a half frames of a sensor of 10 Hz.
MAX_GAP_NS = NS * 3 // 20
POSES = 500  # newest poses that are kept
POSE_GAP_NS = NS // 10  # between poses farther apart than this there is no interpolation
RESTART_NS = NS  # a recording restarted if a pose is older than the newest by this much
QUALITY = 0.5  # smallest quality of a ridge point on a line; on a round spot it is less
FEWEST = 3  # smallest number of such points that show an edge
END = 0.5  # share of the pressure along an edge that remains at its end
Place = tuple[float, float]  # x, y on the array [m]


@dataclass(frozen=True, eq=False)
class SpatialContact:
    """A contact in the base frame; for an edge, its point nearest to the pad's centre."""

    position: np.ndarray  # (3,) [m]
    normal: np.ndarray  # (3,), the object's inward unit normal
    edge: bool


class Placed(NamedTuple):
    """Result of the transformation of a contact into space."""

    extra: Any  # value given with the contact
    contact: SpatialContact | None  # None without contact, or if its place is unknown
    anew: bool  # True if a new path begins here
    reason: str  # why `contact` is None


def needs_picture(contact: Contact) -> bool:
    """Return True if the image is needed to locate a contact: bends, corners, ends of edges."""
    if contact.type == ContactType.LINE and np.isfinite(contact.yaw):
        x, y = contact.moments.centre_of_pressure
        middle = abs(y * np.cos(contact.yaw) - x * np.sin(contact.yaw))
        return not middle < MIDDLE or contact.residual > STRAIGHT
    return contact.type == ContactType.OTHER


def locate(contact: Contact, picture: TactileImage | None = None) -> tuple[Place | None, bool]:
    """
    Return the place of a contact on the array, or None, and True if it is with an edge.

    For an edge this is the point nearest to the pad's centre. For a large area, neither point nor
    edge, it is the centre of pressure. `picture` is the contact's image, if it `needs_picture`. A
    contact hardly above the noise, as when the pad touches down, has no reliable place.
    """
    if contact.reasons & Reason.LOW_SNR:
        return None, False
    if picture is not None and not needs_picture(contact):
        picture = None
    seen = None if picture is None else edge_point(picture)
    if contact.type == ContactType.LINE and contact.valid and np.isfinite(contact.offset):
        c, s = np.cos(contact.yaw), np.sin(contact.yaw)
        # Foot of the perpendicular from the pad's centre, or the end of the line nearest to it.
        along = float(np.fmin(np.fmax(0.0, contact.start), contact.end))
        place = (contact.offset * c - along * s, contact.offset * s + along * c)
        if seen is None:
            return (place, True) if picture is None else (None, False)
        # Beyond the end of an edge or in a bend, the line is far from the ridge.
        near = not contact.residual > STRAIGHT and math.dist(seen, place) < BEYOND
        return (place if near else seen), True
    if contact.type == ContactType.OTHER:
        if seen is not None:
            return seen, True
        # No model explains the image, but force and moments are valid. For a bent edge, whose
        # second moments differ by a factor of ten or more, the centre is millimetres off the edge.
        place = contact.moments.centre_of_pressure
        long = contact.moments.elongation() > ELONGATED
        two = contact.reasons & Reason.TWO_CONTACTS
        return (None if two or long or not np.isfinite(place).all() else place), False
    if contact.type == ContactType.POINT and contact.valid:
        return (contact.x, contact.y), False
    return None, False


def edge_point(image: TactileImage) -> Place | None:
    """
    Return the point x, y [m] of an edge that is nearest to the pad's centre.

    Returns None if the image shows no edge or is not a tared pressure.
    """
    layer = next((layer for layer in image.layers if layer.component == 'zz'), None)
    if layer is None or layer.unit != 'Pa' or not layer.depth > 0.0 or not image.tared:
        return None
    points = ridge_points(layer.stress, image.array, float(layer.noise_std), layer.depth)
    peak = points['pressure'].max(initial=0)
    strong = points[(points['quality'] > QUALITY) & (points['pressure'] > END * peak)]
    if len(strong) < FEWEST:
        return None
    # One ridge point is accurate to a hundredth of a millimetre at 40 dB. A mean is not needed,
    # and would include the turn of a nearby corner.
    nearest = strong[(strong['x']**2 + strong['y']**2).argmin()]
    x, y, tx, ty = (float(nearest[name]) for name in ('x', 'y', 'tx', 'ty'))
    along = -(x * tx + y * ty)  # to the point of the line nearest to the centre
    if along < 0.0:
        along, tx, ty = -along, -tx, -ty
    ahead = (points['x'] - x) * tx + (points['y'] - y) * ty
    onward = np.argsort(ahead)[np.count_nonzero(ahead <= 0.0):]
    along = min(along, _reach(
        ahead[onward], points['pressure'][onward], nearest['pressure'],
        END * np.median(strong['pressure']), max(image.array.pitch_x, image.array.pitch_y)))
    return x + along * tx, y + along * ty


def _reach(ahead: np.ndarray, pressures: np.ndarray, here: float, half: float,
           pitch: float) -> float:
    """Return how far a ridge continues [m]: until its pressure is half, or the ridge ends."""
    reach = 0.0
    for place, pressure in zip([*ahead, math.inf], [*pressures, 0.0], strict=True):
        if place - reach > 2.0 * pitch:
            place, pressure = reach + pitch, 0.0
        if pressure < half:
            return reach + (place - reach) * max(here - half, 0.0) / (here - pressure)
        reach, here = place, pressure
    return reach


def on_pad(place: Place, finger_radius: float = 0.0) -> tuple:
    """
    Return the position (3,) [m] and the pad's outward normal (3,), the object's inward one.

    Both are in the sensor frame, or None for a place outside the finger or pad. A round finger is
    a sphere that touches the plane z = 0; a radius of 0 [m] means a flat pad.
    """
    x, y = place
    if not abs(x) + abs(y) < FARTHEST:  # also true for NaN
        return None, None
    if not finger_radius:
        return np.array([x, y, 0.0]), np.array([0.0, 0.0, 1.0])
    square = finger_radius**2 - x * x - y * y
    if not square > 0.0:
        return None, None
    normal = np.array([x, y, np.sqrt(square)]) / finger_radius
    return finger_radius * (normal - [0.0, 0.0, 1.0]), normal


class ContactPath:
    """
    Transforms contacts into space, with poses that may arrive before or after them.

    It uses only the time of the stamps, so that a replayed recording gives the same result.
    `finger_radius` [m] is that of `on_pad`.
    """

    def __init__(self, finger_radius: float = 0.0):
        self._finger_radius = finger_radius
        self._poses = StateBuffer(
            pose_between, size=POSES, max_gap_ns=POSE_GAP_NS, restart_ns=RESTART_NS)
        # Stamp [ns], contact, its image and its extra value.
        self._waiting: deque[tuple[int, Contact, TactileImage | None, Any]] = deque(maxlen=WAITING)
        self._pictures: dict[int, Callable[[], TactileImage | None]] = {}  # by their stamps [ns]
        self.lost = 0  # number of contacts without a pose
        self._last: int | None = None  # stamp of the last contact [ns]
        self._touched = -MAX_GAP_NS - 1  # stamp of the last load [ns], and the largest of late
        self._heaviest = 0.0

    def clear(self) -> None:
        """Remove poses and waiting contacts, for another frame or a restarted recording."""
        self._poses.clear()
        self._waiting.clear()
        self._last = None

    def restarts(self, stamp_ns: int) -> bool:
        """Return True if the stamp of a pose shows that a recording restarted."""
        return self._poses.went_back(stamp_ns)

    def add_pose(self, stamp_ns: int, pose: np.ndarray) -> list[Placed]:
        """Add a pose (4, 4) of the sensor; return the contacts that it places, see `settle`."""
        if self.restarts(stamp_ns):
            self.clear()
        self._poses.add(stamp_ns, pose)
        return self.settle()

    def add_picture(self, stamp_ns: int, unpack: Callable[[], TactileImage | None]) -> None:
        """Add an image before its contact; it is only unpacked if needed, because this is slow."""
        self._pictures[stamp_ns] = unpack
        if len(self._pictures) > WAITING:
            del self._pictures[next(iter(self._pictures))]

    def add_contact(self, stamp_ns: int, contact: Contact, extra: Any = None,
                    picture: TactileImage | None = None) -> list[Placed]:
        """
        Add a contact (see `locate`); return the contacts that can be placed, see `settle`.

        Its image is given here or was added before.
        """
        unpack = self._pictures.get(stamp_ns)
        if unpack and needs_picture(contact):
            picture = unpack()
        if len(self._waiting) == self._waiting.maxlen:
            self.lost += 1
        self._waiting.append((stamp_ns, contact, picture, extra))
        return self.settle()

    def settle(self) -> list[Placed]:
        """Transform the waiting contacts for which poses have arrived."""
        placed = []
        newest = self._poses.newest_ns
        while self._waiting and newest is not None and self._waiting[0][0] <= newest:
            stamp_ns, contact, picture, extra = self._waiting.popleft()
            placed.append(Placed(extra, *self._place(stamp_ns, contact, picture)))
        return placed

    def _place(self, stamp: int, contact: Contact, picture: TactileImage | None
               ) -> tuple[SpatialContact | None, bool, str]:
        """Return contact, whether a new path begins, and the reason if the contact is None."""
        place, edge = locate(contact, picture)
        position, normal = (None, None) if place is None else on_pad(place, self._finger_radius)
        if contact.type == ContactType.NONE:
            self._last = None
            return None, True, 'nothing is touched'
        if self._leaves(stamp, contact.moments.m0):
            return None, False, 'too light: the pad lifts off'
        if position is None:
            return None, False, 'the contact is not located'
        pose = self._poses.at(stamp)
        if pose is None:
            self.lost += 1
            return None, False, 'no pose of the sensor at its stamp'
        anew = self._last is None or not 0 <= stamp - self._last <= MAX_GAP_NS
        self._last = stamp
        turn = pose[:3, :3]
        return SpatialContact(turn @ position + pose[:3, 3], turn @ normal, edge), anew, ''

    def _leaves(self, stamp: int, load: float) -> bool:
        """Return True if the load is far below that of late: places are then unreliable."""
        gap = stamp - self._touched
        kept = math.exp(-gap / (NS * FORGOTTEN)) if 0 <= gap <= MAX_GAP_NS else 0.0
        self._touched, self._heaviest = stamp, max(kept * self._heaviest, load)
        return load < LEAVING * self._heaviest
