"""The thesis' inverse-model servo: resolved-rate control on contact parameters (5.3, 5.4)."""

from dataclasses import dataclass, field

import numpy as np

from tactile_sensing.moments.image_moments import line_from_moments
from tactile_sensing.types.contact import ContactType, Reason
from tactile_servo.control.stability import gain_limit
from tactile_servo.types import KEEP, State, Verdict, WINDOW_PERIODS

AGE_SHARE = 0.1  # of a picture's age in their running mean
DEAD_TIME, LAG = 2.5e-3, 10e-3  # s; of the robot that the gains are bounded for: the mock
OVERFORCE = 1.5  # of the wanted force, beyond which the goal ends
ASIDE = 0.1  # of half the array; a pad further beside an edge's end may have missed its turn


@dataclass(frozen=True)
class EdgeFeatures:
    """
    Pose of the edge in the sensor frame, X_a of (5.6).

    lateral [m]: where the edge crosses y = 0; yaw [rad]; force [N] on the pad;
    remaining [m]: how far the centre of pressure stands ahead of the pad's centre along +y,
    negative once the edge ends ahead; tilt [rad]: rise of the edge towards +y, by which the
    pad is not level with it.
    """

    lateral: float
    yaw: float
    force: float
    remaining: float
    tilt: float = 0.0


@dataclass(frozen=True)
class ResolvedRateConfig:
    """Gains of the servo: every error is to vanish within its T_seg of (5.3)."""

    segment_time: float = field(default=0.08, metadata={
        'doc': 'T_seg of (5.3) for position and angle across the edge: gain 1 / T_seg',
        'unit': 's', 'range': (0.01, 10.0)})
    force_segment_time: float = field(default=0.06, metadata={
        'doc': 'T_seg of (5.3) for the contact force', 'unit': 's', 'range': (0.01, 10.0)})
    stiffness: float = field(default=5000.0, metadata={
        'doc': 'K_z of (5.5): total stiffness of skin, finger and robot along the normal',
        'unit': 'N/m', 'range': (10.0, 1e7)})
    max_normal_speed: float = field(default=0.02, metadata={
        'doc': 'largest speed along the normal that the force loop may ask for',
        'unit': 'm/s', 'range': (1e-4, 1.0)})
    max_lateral_speed: float = field(default=0.1, metadata={
        'doc': 'largest speed across the edge', 'unit': 'm/s', 'range': (1e-4, 1.0)})
    max_turn_rate: float = field(default=2.0, metadata={
        'doc': 'largest rate of turn about the normal', 'unit': 'rad/s',
        'range': (1e-3, 20.0)})
    tilt_segment_time: float = field(default=0.2, metadata={
        'doc': 'T_seg of (5.3) for the rotation about x, which levels the pad with an edge '
               'in space', 'unit': 's', 'range': (0.01, 10.0)})
    max_tilt_rate: float = field(default=0.3, metadata={
        'doc': 'largest rate of the rotation about x; 0 keeps the pad as level as it began',
        'unit': 'rad/s', 'range': (0.0, 20.0)})
    limit_share: float = field(default=0.4, metadata={
        'doc': 'share of the gain at which a loop through pictures of the measured age would '
               'swing: every T_seg is at least so long that its gain is no larger; a robot with '
               'more dead time than 2.5 ms or lag than 10 ms needs less',
        'range': (0.01, 10.0)})
    uneven: float = field(default=0.15, metadata={
        'doc': 'the pad is not levelled where the second moment along the edge differs by this '
               'fraction from that of an edge across the whole pad',
        'range': (1e-3, 1.0)})
    min_elongation: float = field(default=3.0, metadata={
        'doc': 'a contact that is no straight line is followed as an edge by its moments if '
               'its principal second moments differ by this ratio', 'range': (1.0, 100.0)})
    max_yaw: float = field(default=1.0, metadata={
        'doc': 'an edge further off than this is not followed', 'unit': 'rad',
        'range': (0.1, 1.5)})


def edge_features(contact, array_half_length, config):
    """
    Where the edge is, from a contact estimate: the inverse model f_s^-1 of (5.1).

    A valid line is taken as fitted. Anything else that is elongated enough to be an edge (a
    curve, a corner under the pad) is taken by its moments, as in (5.6).

    Parameters
    ----------
    contact : Contact
    array_half_length : float
        Half the size of the array along y, the thesis' L [m].
    config : ResolvedRateConfig

    Returns
    -------
    features : EdgeFeatures or None
    reason : str
        Why there are none; otherwise empty.
    """
    remaining = contact.moments.centre_of_pressure[1]
    tilt = edge_tilt(contact.moments, array_half_length, config)
    if contact.type == ContactType.LINE and contact.valid:
        features = EdgeFeatures(contact.a, contact.yaw, contact.normal_force, remaining, tilt)
    elif (contact.type == ContactType.OTHER and Reason.LOW_SNR not in contact.reasons
          and contact.moments.m0 > 0.0):
        elongation = contact.moments.elongation()
        if not elongation >= config.min_elongation:
            return None, f'contact is no edge: elongation {elongation:.1f}'
        line = line_from_moments(contact.moments, array_half_length)
        features = EdgeFeatures(line.a, line.yaw, contact.moments.m0, remaining, tilt)
    else:
        why = contact.reasons.name or 'no edge'
        return None, f'no edge: {why.lower().replace("|", ", ")}'
    if not np.isfinite([features.lateral, features.yaw, features.force, remaining]).all():
        return None, 'no edge: estimate is not finite'
    if abs(features.lateral) > array_half_length or features.force < 0.0:
        return None, (f'no edge: estimate of {1e3 * features.lateral:.3g} mm, '
                      f'{features.force:.3g} N is impossible')
    if abs(features.yaw) > config.max_yaw:
        return None, f'edge lies {np.degrees(features.yaw):.0f} degrees across the pad'
    return features, ''


def edge_tilt(moments, half_length, config):
    """
    Angle about x between pad and edge [rad], from the first moment along the edge (5.6).

    A load that grows in proportion along the whole edge, k (z + theta y), has
    My = K_z theta L^2 / 3 with K_z = 2 L k, and the second moment L^2 / 3 of an even one. Where
    an edge ends, or turns under the pad, My says nothing of its rise, and the second moment
    tells so: the angle counts in full where that is right, and not at all where it is not.

    Parameters
    ----------
    moments : Moments
    half_length : float
        Half the size of the array along y, the thesis' L [m].
    config : ResolvedRateConfig
    """
    even = moments.m0 * half_length**2 / 3.0
    if not (even > 0.0 and np.isfinite(moments.my) and np.isfinite(moments.myy)):
        return 0.0
    trust = _bounded(1.0 - abs(moments.myy / even - 1.0) / config.uneven, 0.0, 1.0)
    return trust * 3.0 * moments.my / (config.stiffness * half_length**2)


def alignment_scale(features, half_width):
    """Slow down as the edge nears the border of the pad, where it would be lost: 0 to 1."""
    return _bounded(2.0 * (1.0 - abs(features.lateral) / half_width), 0.0, 1.0)


def contact_scale(features, force):
    """Slow down while the pad presses with less than half of the force: 0 to 1."""
    return _bounded(2.0 * features.force / force, 0.0, 1.0)


def edge_twist(features, speed, force, config, shortest=0.0):
    """
    Twist that drives X_a to X_d: dX = (X_f - X_a) / T_seg dt of (5.3).

    Force becomes position through the stiffness, z_a = P / K_z (5.6 with K_z a total
    stiffness). Every component is bounded, since a rate without bound is what (5.3) asks for
    as t nears T_seg.

    Parameters
    ----------
    features : EdgeFeatures
    speed : float
        Along the sensor's y, signed [m/s].
    force : float
        Wanted normal force [N].
    config : ResolvedRateConfig
    shortest : float
        Least T_seg that every one is raised to [s].

    Returns
    -------
    ndarray, shape (6,)
        Linear and angular velocity of the sensor frame, in the sensor frame [m/s, rad/s].
    """
    c = config
    segment, tilt_segment = max(c.segment_time, shortest), max(c.tilt_segment_time, shortest)
    lateral = _bounded(features.lateral / segment, -c.max_lateral_speed, c.max_lateral_speed)
    normal = _bounded(
        (force - features.force) / (c.stiffness * max(c.force_segment_time, shortest)),
        -c.max_normal_speed, c.max_normal_speed)
    turn = _bounded(features.yaw / segment, -c.max_turn_rate, c.max_turn_rate)
    # More load ahead means that the edge rises: the pad is turned away from it there.
    level = _bounded(-features.tilt / tilt_segment, -c.max_tilt_rate, c.max_tilt_rate)
    return np.array([lateral, speed, normal, level, 0.0, turn])


def _bounded(value, low, high):
    """Value within bounds; NaN stays. numpy's clip takes ten times as long for one number."""
    return min(max(value, low), high)


class ResolvedRate:
    """
    The thesis' tracker: what the newest contact says is servoed to where it should be.

    The age of the pictures is part of its loops, so it lengthens T_seg with their age.

    Parameters
    ----------
    servo : EdgeServoConfig
    gains : ResolvedRateConfig, optional

    Attributes
    ----------
    shortest : float
        Least T_seg for which the pictures do not come too late [s].
    """

    name = 'resolved_rate'
    sees_images = False
    closes_contours = False
    closed = False
    config_type = ResolvedRateConfig

    def __init__(self, servo, gains=None):
        self.servo, self.gains = servo, gains or ResolvedRateConfig()
        self._age, self.shortest = servo.max_stamp_age, np.inf
        self.begin(None)

    def refuse(self, goal):
        """Return why a goal is beyond this tracker, or ''."""
        return 'closed contours are not tracked by resolved_rate; use trace' * goal.closed

    def begin(self, goal):
        """Forget the last goal."""
        self.goal = goal
        self.features, self.arrival, self.reason = None, -np.inf, 'edge lost'
        self.looked = -np.inf
        self.speed = 0.0

    def resume(self):
        """Go on from a standstill."""
        self.speed = 0.0

    def see_contact(self, contact, stamp_ns, arrival, age):
        """Take a contact estimate, its picture's stamp [ns], steady arrival time and age [s]."""
        # On average it is acted upon half of the time later that the next one takes to come.
        age += 0.5 * _bounded(arrival - self.looked, 0.0, self.servo.stale_image)
        self._age += AGE_SHARE * (min(age, self.servo.max_stamp_age) - self._age)
        # Half of a control period, and those that a window looks ahead.
        delay = self._age + (0.5 + WINDOW_PERIODS) / self.servo.rate + DEAD_TIME
        self.shortest = 1.0 / (self.gains.limit_share * gain_limit(delay, LAG))
        self.looked = arrival
        features, self.reason = edge_features(
            contact, self.servo.array_half_width, self.gains)
        if features is not None:
            self.features, self.arrival = features, arrival

    @property
    def touch_speed(self):
        """Speed at which the force loop would press a pad that feels nothing yet [m/s]."""
        return self.goal.force / (self.gains.stiffness * self.shortest)

    def ready(self, now):
        """Whether there is an edge to track."""
        return now - self.arrival < self.servo.edge_lost

    def judge(self, now, pose, length, load):
        """Decide whether to go on tracking: Verdict."""
        c, goal = self.servo, self.goal
        long_enough = length > 2.0 * c.array_half_width
        if not self.ready(now):
            lost = 'contact lost' if load < c.contact_force else 'edge lost'
            return Verdict(State.HOLD, self.reason or lost)
        if load > OVERFORCE * goal.force:
            return Verdict(State.DONE, f'force of {load:.1f} N is beyond {OVERFORCE:g} times '
                           f'the {goal.force:g} N asked for', lift=True)
        ahead = goal.direction * self.features.remaining
        if ahead < -c.end_of_edge * c.array_half_width and long_enough:
            aside = abs(self.features.lateral)
            if aside > ASIDE * c.array_half_width:
                return Verdict(State.DONE, f'edge lost: it ended {1e3 * aside:.1f} mm beside '
                               "the pad's centre")
            return Verdict(State.DONE, 'the edge ended', goal.length == 0.0)
        return KEEP

    def twist(self, pose, commanded, dt):
        """
        Wanted twist of the sensor in its own frame (6,) [m/s, rad/s].

        pose, commanded : ndarray, shape (4, 4)
            Measured and commanded pose of the sensor; this law needs neither.
        """
        c, goal, features = self.servo, self.goal, self.features
        speed = goal.speed * min(alignment_scale(features, c.array_half_width),
                                 contact_scale(features, goal.force))
        change = c.max_acceleration * dt
        self.speed += _bounded(speed - self.speed, -change, change)
        return edge_twist(features, goal.direction * self.speed, goal.force, self.gains,
                          self.shortest)

    def heading(self, pose):
        """Direction of travel in the base frame (3,)."""
        return self.goal.direction * pose[:3, 1]

    def contour(self):
        """No contour beyond the poses of the sensor."""
        return None
