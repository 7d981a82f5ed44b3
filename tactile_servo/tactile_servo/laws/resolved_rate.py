"""Law 'resolved_rate', the thesis' resolved-rate control on contact parameters (5.3, 5.4)."""

from dataclasses import dataclass
import math
from typing import ClassVar

import numpy as np

from tactile_common.config import bounded, check_fields
from tactile_sensing.thesis.line import line_from_moments
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import Contact, ContactType
from tactile_sensing.types.contact import Reason as ContactReason
from tactile_sensing.types.image import SensorInfo
from tactile_sensing.types.moments import Moments
from tactile_servo.config import image_patience, MAX_STAMP_AGE, ServoConfig, STALE_AFTER
from tactile_servo.control.press_check import PressCheck
from tactile_servo.control.press_test import PRESSED
from tactile_servo.control.progress import LapGuard
from tactile_servo.control.scaling import clipped, ramp, slewed
from tactile_servo.control.stability import AGE_SHARE, DEAD_TIME, LAG, stable_gain
from tactile_servo.edge_map.picture import PadScale
from tactile_servo.image_order import ImageOrder
from tactile_servo.law import Assessment, done, Observation, overforce, Reference
from tactile_servo.laws.edge_law import EdgeLaw, total_stiffness
from tactile_servo.motion.motion import COMMITTED, Motion
from tactile_servo.reasons import Reason, ReasonCode
from tactile_servo.types import EdgeGoal, State, TaskError

# Largest speeds: across the edge and along the normal [m/s], about the normal and about x [rad/s]
ACROSS, PRESS, TURN, TILT = 0.1, 0.02, 2.0, 0.3
TILT_TIME = 0.2  # T_seg of the rotation about x [s]; long, as the moment along the edge is noisy
# Shares of half the array:
ALIGNED = 0.5  # lateral distance of the edge up to which the pad keeps its speed
END_BEHIND = 0.35  # distance by which the centre of pressure moves backwards where the edge ends
MISSED = 0.1  # lateral distance of the edge at its end, above which the pad may have missed a turn
# Shares of the wanted force:
FIRM = 0.5  # force from which on the pad keeps its speed
OVERFORCE = 1.5  # times the wanted force, above which the goal ends
# Relative difference of the second moment along the edge from that of an edge across the whole
# pad, from which on the tilt is unknown
UNEVEN = 0.15
LEAST_ELONGATION = 3.0  # least ratio of the principal second moments of an edge
MOST_YAW = 1.0  # rad, largest angle of an edge to the pad's y


@dataclass(frozen=True)
class EdgeFeatures:
    """Pose of the edge in the sensor frame, X_a of (5.6)."""

    lateral: float  # distance from the centre of the pad, positive towards +x [m]
    yaw: float  # rad
    force: float  # on the pad [N]
    # Position of the centre of pressure along +y from the pad's centre [m]. It moves backwards
    # when the edge ends ahead.
    remaining: float
    tilt: float = 0.0  # angle between pad and edge about x, positive if the edge rises to +y [rad]


def edge_features(contact: Contact, array: TactelArray,
                  stiffness: float) -> tuple[EdgeFeatures | None, str]:
    """
    Return the pose of the edge, or None and the reason.

    A valid line is used as fitted. For any other contact that is elongated enough to be an edge
    (a curve, a corner under the pad), the pose is computed from its moments, as in (5.6).

    Half the array's size along y is the thesis' L. The stiffness is the total K_z of (5.5) [N/m].
    """
    moments, half = contact.moments, array.half_width_y
    remaining = moments.centre_of_pressure[1]
    tilt = edge_tilt(moments, half, stiffness)
    if contact.type == ContactType.LINE and contact.valid:
        force = contact.normal_force if contact.force_valid else moments.m0
        features = EdgeFeatures(contact.offset, contact.yaw, force, remaining, tilt)
    elif (contact.type == ContactType.OTHER and moments.m0 > 0.0
          and ContactReason.LOW_SNR not in contact.reasons):
        elongation = moments.elongation()
        if not elongation >= LEAST_ELONGATION:
            return None, f'contact is no edge, elongation {elongation:.1f}'
        line = line_from_moments(moments, half)
        features = EdgeFeatures(line.a * math.cos(line.yaw), line.yaw, moments.m0, remaining, tilt)
    else:
        return None, (contact.reasons.name or '').lower().replace('|', ', ')
    if not math.isfinite(features.lateral + features.yaw + features.force + remaining):
        return None, 'estimate is not finite'
    if abs(features.lateral) > array.half_width_x or features.force < 0.0:
        return None, (f'estimate of {1e3 * features.lateral:.3g} mm, '
                      f'{features.force:.3g} N is impossible')
    if abs(features.yaw) > MOST_YAW:
        return None, f'it lies {math.degrees(features.yaw):.0f} degrees across the pad'
    return features, ''


def edge_tilt(moments: Moments, half_length: float, stiffness: float) -> float:
    """
    Return the angle about x between pad and edge [rad], from the first moment along it (5.6).

    A load that is linear along the whole edge, k (z + theta y), has My = K_z theta L^2 / 3 with
    K_z = 2 L k, and the second moment L^2 / 3 of a uniform load. If the edge ends or turns under
    the pad, the second moment differs, and My does not measure the tilt. The weight of the angle
    falls from 1, for the correct second moment, to 0 for a relative difference of `UNEVEN`.
    `half_length` is the thesis' L [m], `stiffness` its K_z [N/m].
    """
    even = moments.m0 * half_length**2 / 3.0
    if not (even > 0.0 and math.isfinite(moments.my) and math.isfinite(moments.myy)):
        return 0.0
    trust = ramp(abs(moments.myy / even - 1.0), UNEVEN, 0.0)
    return trust * 3.0 * moments.my / (stiffness * half_length**2)


@dataclass(frozen=True)
class ResolvedRateConfig:
    """Gains of the law 'resolved_rate': every error is to be corrected within its T_seg (5.3)."""

    acceleration: float = bounded(
        1.0, 'acceleration along the edge', 'm/s^2', 0.01, 100.0, name='speed.acceleration')
    across_time: float = bounded(
        0.08, 'T_seg of (5.3) for position and angle across the edge: gain 1 / T_seg', 's',
        0.01, 10.0, live=True, name='position.segment_time')
    force_time: float = bounded(
        0.06, 'T_seg of (5.3) for the contact force', 's', 0.01, 10.0, live=True,
        name='force.segment_time')

    def __post_init__(self) -> None:
        check_fields(self)


def speed_factor(features: EdgeFeatures, half_width: float, force: float) -> float:
    """Return a factor, 0 to 1, that falls near the border of the pad, and with a small force."""
    return min(ramp(abs(features.lateral) / half_width, 1.0, ALIGNED),
               ramp(features.force / force, 0.0, FIRM))


def edge_twist(features: EdgeFeatures, speed: float, force: float, stiffness: float,
               config: ResolvedRateConfig, shortest: float = 0.0) -> np.ndarray:
    """
    Return the twist (6,) that drives X_a to X_d: dX = (X_f - X_a) / T_seg dt of (5.3).

    It is in the sensor frame [m/s, rad/s], for a signed speed along the sensor's y [m/s] and a
    wanted force [N]. The total stiffness [N/m] converts force to position: z_a = P / K_z (5.6).
    Every component is bounded, because the rate of (5.3) is unbounded as t approaches T_seg;
    `shortest` is the lower bound of every T_seg [s].
    """
    def rate(error: float, segment_time: float, most: float) -> float:
        return clipped(error / max(segment_time, shortest), -most, most)

    return np.array([
        rate(features.lateral, config.across_time, ACROSS), speed,
        rate((force - features.force) / stiffness, config.force_time, PRESS),
        # A larger load ahead means that the edge rises there: turn the pad's front away from it.
        rate(-features.tilt, TILT_TIME, TILT), 0.0,
        rate(features.yaw, config.across_time, TURN)])


class ResolvedRate(EdgeLaw):
    """
    Control the features of the newest contact towards their wanted values.

    The age of the images is a dead time in the control loops, so T_seg increases with it:
    `shortest` is the least T_seg with a sufficient margin of stability [s].
    """

    name: ClassVar[str] = 'resolved_rate'
    config_type: ClassVar[type] = ResolvedRateConfig
    sees_images: ClassVar[bool] = False
    features: EdgeFeatures  # newest; before it `lacks` prevents tracking
    _array: TactelArray  # set by `begin`

    def __init__(self, servo: ServoConfig, config: ResolvedRateConfig | None = None):
        self.servo, self.config = servo, config or ResolvedRateConfig()
        self.stiffness = math.nan  # set by `begin`
        self._stale, self._begun = STALE_AFTER, False
        self._age, self.shortest, self._looked = MAX_STAMP_AGE, math.inf, -math.inf

    def retune(self, config: ResolvedRateConfig) -> None:
        self.config = config

    def validate(self, goal: EdgeGoal) -> Reason | None:
        if goal.closed:
            return Reason(ReasonCode.UNSUPPORTED_GOAL,
                          'closed contours are not tracked without a map of them')
        return super().validate(goal)

    def begin(self, goal: EdgeGoal, sensor: SensorInfo) -> None:
        self.goal, self._array = goal, sensor.array
        self.stiffness = total_stiffness(sensor)
        self._stale = image_patience(sensor.nominal_rate)
        self.error, self._problem, self._begun = None, '', True
        self._looked = self._shown = -math.inf
        self._laps, self._progress = LapGuard(), 0.0
        self.press, self._order = PressCheck(), ImageOrder()
        self.resume()

    def halt(self) -> None:
        self._halted = True

    def resume(self) -> None:
        self._speed, self._halted = 0.0, False
        self.press.forget()

    def observe(self, observation: Observation) -> None:
        if observation.contact is None:
            return
        arrival = observation.arrival
        # A contact is used until the next one: add half of this interval to its age, on average.
        age = observation.age + 0.5 * clipped(arrival - self._looked, 0.0, self._stale)
        self._age += AGE_SHARE * (min(age, MAX_STAMP_AGE) - self._age)
        # Add the committed time and half a control period, in which the velocity changes.
        delay = self._age + COMMITTED + 0.5 / self.servo.rate + DEAD_TIME
        self.shortest = 1.0 / stable_gain(delay, LAG)
        self._looked = arrival
        if not self._begun:
            return
        contact, pose = observation.contact, observation.pose
        self._order.see(contact, pose, PadScale.of(self._array, 0.0))
        features, self._problem = edge_features(contact, self._array, self.stiffness)
        if features is not None:
            self.features, self._shown = features, arrival
            self.error = TaskError(features.lateral, angle=features.yaw, force=features.force)
            self._compare_depth(contact, pose, features)

    def _compare_depth(self, contact: Contact, pose: np.ndarray | None,
                       features: EdgeFeatures) -> None:
        if pose is None or not (
                contact.valid and contact.force_valid and contact.type == ContactType.LINE):
            return
        up = [0.0, math.sin(features.tilt), math.cos(features.tilt)]
        at = pose @ [features.lateral, features.remaining, 0.0, 1.0]
        # K_z = 2 L k; valid for any length under the pad
        self.press.see(pose, at[:3], pose[:3, :3] @ up,
                       contact.line_force * self._array.size_y / self.stiffness,
                       features.force > PRESSED * self.goal.force)

    def depth(self, force: float) -> float:
        return force / self.stiffness

    def lacks(self, now: float) -> Reason | None:
        if now - self._shown < self._stale:
            return None
        return Reason(ReasonCode.EDGE_LOST, self._problem)

    def _assess(self, now: float, progress: float, load: float) -> Assessment:
        goal, array = self.goal, self._array
        if order := self._order.problem():
            return done(*order, lift=True)
        lacking = self.lacks(now)
        if lacking is not None:
            if load < self.servo.contact_force:
                lacking = Reason(ReasonCode.CONTACT_LOST, lacking.detail)
            return Assessment(State.HOLD, lacking)
        if load > OVERFORCE * goal.force:
            return overforce(load, goal.force, OVERFORCE)
        ahead = goal.direction * self.features.remaining
        if ahead < -END_BEHIND * array.half_width_y:
            aside = abs(self.features.lateral)
            if aside > MISSED * array.half_width_x:
                return done(ReasonCode.ENDED_BESIDE, f'{1e3 * aside:.1f} mm')
            return self._end_of_edge()
        return Assessment(State.TRACK, Reason(ReasonCode.TRACKING))

    def reference(self, pose: np.ndarray, commanded: np.ndarray, robot: Motion,
                  dt: float) -> Reference:
        goal, features = self.goal, self.features
        slowed = speed_factor(features, self._array.half_width_x, goal.force)
        self._speed = slewed(self._speed, 0.0 if self._halted else slowed * goal.speed,
                             self.config.acceleration * dt)
        twist = edge_twist(features, goal.direction * self._speed, goal.force, self.stiffness,
                           self.config, self.shortest)
        heading = [goal.direction * way for way in pose[:3, 1].tolist()]
        self._laps.see(pose[:3, 3].tolist(), pose[:3, 2].tolist(), heading, self._progress)
        return Reference(twist, self._speed, heading)
