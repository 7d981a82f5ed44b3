"""Pose of an edge from a contact estimate: the inverse model of the thesis (5.1), (5.6)."""

from dataclasses import dataclass
import math

from tactile_sensing.thesis.line import line_from_moments
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import Contact, ContactType
from tactile_sensing.types.contact import Reason as ContactReason
from tactile_sensing.types.moments import Moments
from tactile_servo.control.scaling import ramp

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
