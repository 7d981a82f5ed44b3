"""The thesis' inverse-model servo: resolved-rate control on contact parameters (5.3, 5.4)."""

from dataclasses import dataclass, field

import numpy as np

from tactile_sensing.contact import ContactType, Reason
from tactile_sensing.moments import line_from_moments


@dataclass(frozen=True)
class EdgeFeatures:
    """
    Pose of the edge in the sensor frame, X_a of (5.6).

    lateral [m]: where the edge crosses y = 0; yaw [rad]; force [N] on the pad;
    remaining [m]: how far the centre of pressure stands ahead of the pad's centre along +y,
    negative once the edge ends ahead.
    """

    lateral: float
    yaw: float
    force: float
    remaining: float


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
    if contact.type == ContactType.LINE and contact.valid:
        features = EdgeFeatures(contact.a, contact.yaw, contact.normal_force, remaining)
    elif (contact.type == ContactType.OTHER and Reason.LOW_SNR not in contact.reasons
          and contact.moments.m0 > 0.0):
        elongation = contact.moments.elongation()
        if not elongation >= config.min_elongation:
            return None, f'contact is no edge: elongation {elongation:.1f}'
        line = line_from_moments(contact.moments, array_half_length)
        features = EdgeFeatures(line.a, line.yaw, contact.moments.m0, remaining)
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


def alignment_scale(features, half_width):
    """Slow down as the edge nears the border of the pad, where it would be lost: 0 to 1."""
    return float(np.clip(2.0 * (1.0 - abs(features.lateral) / half_width), 0.0, 1.0))


def contact_scale(features, force):
    """Slow down while the pad presses with less than half of the force: 0 to 1."""
    return float(np.clip(2.0 * features.force / force, 0.0, 1.0))


def edge_twist(features, speed, force, config):
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

    Returns
    -------
    ndarray, shape (6,)
        Linear and angular velocity of the sensor frame, in the sensor frame [m/s, rad/s].
    """
    c = config
    lateral = np.clip(
        features.lateral / c.segment_time, -c.max_lateral_speed, c.max_lateral_speed)
    normal = np.clip((force - features.force) / (c.stiffness * c.force_segment_time),
                     -c.max_normal_speed, c.max_normal_speed)
    turn = np.clip(features.yaw / c.segment_time, -c.max_turn_rate, c.max_turn_rate)
    return np.array([lateral, speed, normal, 0.0, 0.0, turn])
