"""Newest inputs of a servo, and their freshness."""

import math
from typing import Any, NamedTuple

import numpy as np

from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import Contact
from tactile_sensing.types.contact import Reason as ContactReason
from tactile_sensing.types.image import SensorInfo, TactileImage
from tactile_servo.config import image_patience, MAX_STAMP_AGE, STALE_AFTER
from tactile_servo.control.press_check import most_unfelt
from tactile_servo.control.scaling import ramp
from tactile_servo.motion.joint_history import JointHistory
from tactile_servo.motion.limits import JointLimits
from tactile_servo.motion.robot import RobotModel
from tactile_servo.reasons import Reason, ReasonCode, Refused
from tactile_servo.sensor_watch import SensorWatch, SURE
from tactile_servo.types import IMPOSSIBLE, pressure_layer

_SATURATED, _NOT_TARED = int(ContactReason.SATURATED), int(ContactReason.NOT_TARED)
SAME_PITCH = 1e-3  # relative
# Largest difference of a joint from its command [rad]; more is too far even if the sensor hardly
# moves by it.
JOINT_ERROR = 0.15
REST_WEIGHT = 0.02  # weight of the newest force in the running mean at rest
DISAGREEING = 0.1  # s for which pad and wrist may differ: they are filtered differently
AGEING = 0.4  # share of the allowed age of an input above which the pad slows down


class Sample(NamedTuple):
    """Newest value of an input, with its stamp [ns] and steady time of arrival [s]."""

    value: Any
    stamp_ns: int
    arrival: float


class Wrist:
    """
    Force at the wrist relative to its value while the pad was free and no goal was active [N].

    This baseline includes the weight of the tool. If the tool is rotated much, its weight must be
    compensated.
    """

    def __init__(self) -> None:
        self.force, self._rest = 0.0, np.full(3, np.nan)
        self._arrival, self._agreed = math.nan, math.inf

    def see(self, force: np.ndarray, arrival: float, at_rest: bool) -> None:
        """Process a force (3,) [N] and its steady arrival time [s]; ignore one not finite."""
        if not np.isfinite(force).all():
            return
        if not self.heard:
            self._rest = force.copy()
        elif at_rest:
            self._rest += REST_WEIGHT * (force - self._rest)
        self._arrival, self.force = arrival, float(np.linalg.norm(force - self._rest))

    def judge(self, load: float, now: float) -> None:
        """Compare with the load on the pad [N] at a steady time [s]."""
        most = most_unfelt(max(self.force, load))
        if not self.heard or abs(self.force - load) <= most:
            self._agreed = now

    @property
    def heard(self) -> bool:
        """Whether any force has been received."""
        return not math.isnan(self._arrival)

    def missing(self, now: float, within: float) -> bool:
        """Return whether the wrist sent forces before, but none within a time [s]."""
        return now - self._arrival > within  # false without a wrist: NaN

    def problem(self, load: float, now: float) -> Reason | None:
        """Return why the pad cannot be trusted, or None."""
        if now - self._agreed <= DISAGREEING:
            return None
        return Reason(ReasonCode.SENSOR_DISAGREES,
                      f'{load:.1f} N on the pad, {self.force:.1f} N at the wrist')


class Inputs:
    """Newest inputs of a servo: joint state, image, contact, description of the sensor."""

    def __init__(self, robot: RobotModel, limits: JointLimits):
        self._robot, self._names = robot, limits.names
        self._history, self.watch, self.wrist = JointHistory(limits), SensorWatch(), Wrist()
        self.joints: Sample | None = None
        self.contact: Sample | None = None
        self.image: Sample | None = None
        self.sensor: SensorInfo | None = None
        self.pose = np.full((4, 4), np.nan)  # measured, of the sensor
        self.refused: Reason | None = None  # why the newest image or contact was, if it was
        # Freshness at the last `refresh`; `saturated`: whether the newest contact is.
        self.contact_fresh = self.joints_fresh = self.saturated = False
        self._image_fresh = self._wrist_missing = False
        self._tared = True
        self.unbelieved = ''  # why the newest joint state was rejected
        self._felt = self._summed = 0.0  # force by the newest contact, and by the image [N]
        self._noise = 0.0  # standard deviation of the force by an image [N]

    def see_joints(self, positions: np.ndarray, stamp_ns: int, arrival: float) -> None:
        """Process a measured joint state; ValueError if it is not plausible."""
        try:
            positions = self._history.add(positions, stamp_ns)
        except ValueError as error:
            self.unbelieved = str(error)
            raise
        self.unbelieved = ''
        self.joints = Sample(positions, stamp_ns, arrival)
        self.pose = self._robot.pose(positions)

    def see_contact(self, contact: Contact, stamp_ns: int, arrival: float) -> None:
        """Process a contact estimate."""
        self.contact = Sample(contact, stamp_ns, arrival)
        if self.refused is not None and self.refused.code is not ReasonCode.BAD_IMAGE:
            self.refused = None
        fitted = contact.normal_force if contact.force_valid else 0.0
        self._felt = max(filter(math.isfinite, (fitted, contact.moments.m0)), default=0.0)
        reasons = int(contact.reasons)  # operations on a Flag are slow
        self.saturated = bool(reasons & _SATURATED)
        self._tared = not reasons & _NOT_TARED

    def see_image(self, image: TactileImage, arrival: float) -> None:
        """Compute the load of an image; Refused if frame or array differ from the sensor."""
        array, sensor = image.array, self.sensor
        if sensor is not None:
            known = sensor.array
            if image.frame_id != sensor.frame_id:
                self.refuse(Reason(ReasonCode.WRONG_FRAME, f'image in {image.frame_id!r}, sensor '
                                   f'in {sensor.frame_id!r}'))
            if array is not known and not _alike(array, known):
                self.refuse(Reason(ReasonCode.BAD_IMAGE, f'{_size_of(array)}, but the sensor has '
                                   f'{_size_of(known)}'))
        pressure, noise, layer = 0.0, 0.0, pressure_layer(image.layers)
        if image.tared and layer is not None and layer.unit == 'Pa':
            stress = np.asarray(layer.stress, np.float64)
            pressure = float(stress[np.abs(stress) < IMPOSSIBLE].sum())
            noise = float(layer.noise_std) * math.sqrt(stress.size)
        area = array.pitch_x * array.pitch_y
        self.image, self.refused = Sample(image, image.stamp_ns, arrival), None
        self._summed, self._noise = pressure * area, noise * area

    def refuse(self, reason: Reason) -> None:
        """Store the reason of a refusal and raise Refused."""
        self.refused = reason
        raise Refused(reason)

    @property
    def load(self) -> float:
        """Force on the pad [N]: the larger of the contact's force and the sum over the image."""
        return max(self._felt, self._summed)

    def touches(self, force: float, most: float) -> bool:
        """Return whether the load is at least a force [N] and no noise, or at least `most` [N]."""
        return self.load >= min(max(force, self.least_force), most)

    @property
    def least_force(self) -> float:
        """Smallest force on the pad that is no noise [N]; 0 before the first image."""
        return SURE * self._noise

    @property
    def largest_load(self) -> float:
        """Larger of the forces on the pad and at the wrist [N]."""
        return max(self.load, self.wrist.force)

    def age(self, stamp_ns: int) -> float:
        """Return the age of a stamp relative to the newest joint state [s]; inf without one."""
        return max(1e-9 * (self.joints.stamp_ns - stamp_ns), 0.0) if self.joints else math.inf

    def pose_at(self, stamp_ns: int) -> np.ndarray | None:
        """Return the sensor's measured pose (4, 4) at a stamp [ns]; None if it is unknown."""
        positions = self._history.at(stamp_ns)
        return None if positions is None else self._robot.pose(positions)

    def refresh(self, now: float, now_ns: int) -> None:
        """Update the freshness of all inputs, and compare pad and wrist."""
        self._image_fresh = self.image is not None and (
            now - self.image.arrival <= self.patience)
        if not self._image_fresh:
            self._summed = 0.0
        self.contact_fresh = self.sensor is not None and _fresh(
            self.contact, now, now_ns, self.patience)
        self.joints_fresh = _fresh(self.joints, now, now_ns)
        self._wrist_missing = self.wrist.missing(now, STALE_AFTER)
        self.wrist.judge(self.load, now)

    @property
    def patience(self) -> float:
        """Time without an image after which the servo holds [s]."""
        return image_patience(self.sensor.nominal_rate if self.sensor else 0.0)

    def trust(self, now: float, touch: bool) -> float:
        """
        Return the factor of the speed, 0 to 1, for the age of the joint state.

        With `touch`, the age of the contact counts too.
        """
        share = _trust(self.joints, now)
        return min(share, _trust(self.contact, now, self.patience)) if touch else share

    def joints_missing(self) -> Reason | None:
        """Return what is wrong with the joint states, or None."""
        if self.joints_fresh:
            return None
        return Reason(ReasonCode.STALE_JOINT_STATE if self.joints else ReasonCode.NO_JOINT_STATE,
                      self.unbelieved)

    def contact_missing(self, images: bool) -> Reason | None:
        """Return what is wrong with contacts, wrist or (if they are needed) `images`, or None."""
        if not self.contact_fresh or self.contact is None:
            return self.refused or Reason(
                ReasonCode.STALE_IMAGE if self.contact else ReasonCode.NO_IMAGE)
        if images and not self._image_fresh:
            return self.refused or Reason(ReasonCode.STALE_IMAGE)
        if not self._tared:
            return Reason(ReasonCode.NOT_TARED)
        return Reason(ReasonCode.NO_WRENCH) if self._wrist_missing else None

    def astray(self, commanded: np.ndarray) -> Reason | None:
        """Return which joint is far from its commanded position (n,) [rad], or None."""
        if self.joints is None:
            return None
        off = np.abs(commanded - self.joints.value)
        if (off <= JOINT_ERROR).all():
            return None
        # The joint with the largest difference, or with NaN.
        return Reason(ReasonCode.NOT_FOLLOWING, self._names[int(np.argmax(off))])


def _fresh(sample: Sample | None, now: float, now_ns: int, stale: float = STALE_AFTER) -> bool:
    return (sample is not None and now - sample.arrival <= stale
            and abs(now_ns - sample.stamp_ns) * 1e-9 <= MAX_STAMP_AGE + stale - STALE_AFTER)


def _trust(sample: Sample | None, now: float, stale: float = STALE_AFTER) -> float:
    return 0.0 if sample is None else ramp(now - sample.arrival, stale, AGEING * stale)


def _size_of(array: TactelArray) -> str:
    return (f'{array.rows} x {array.columns} tactels every {1e3 * array.pitch_y:g} x '
            f'{1e3 * array.pitch_x:g} mm')


def _alike(one: TactelArray, other: TactelArray) -> bool:
    """Return whether two arrays are equal, apart from rounding of their pitches."""
    return (one.shape == other.shape
            and abs(one.pitch_x - other.pitch_x) <= SAME_PITCH * other.pitch_x
            and abs(one.pitch_y - other.pitch_y) <= SAME_PITCH * other.pitch_y)
