"""Where an edge is, from a contact estimate: the inverse model of the thesis (5.1), (5.6)."""

from dataclasses import dataclass
import math

from tactile_sensing.thesis.line_moments import line_from_moments
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import Contact, ContactType
from tactile_sensing.types.contact import Reason as ContactReason
from tactile_sensing.types.moments import Moments
from tactile_servo.control.scaling import ramp

# Second moment along the edge, relative to that of an edge across the whole pad, from which its
# rise is not known
UNEVEN = 0.15


@dataclass(frozen=True)
class EdgeFeatures:
    """Pose of the edge in the sensor frame, X_a of (5.6)."""

    lateral: float  # distance from the centre of the pad, positive towards +x [m]
    yaw: float  # rad
    force: float  # on the pad [N]
    # How far the centre of pressure stands ahead of the pad's centre along +y, negative once the
    # edge ends ahead [m].
    remaining: float
    tilt: float = 0.0  # rise of the edge towards +y, by which the pad is not level with it [rad]


def edge_features(contact: Contact, array: TactelArray,
                  stiffness: float) -> tuple[EdgeFeatures | None, str]:
    """
    Where the edge is, and otherwise why there is none.

    A valid line is taken as fitted. Anything else that is elongated enough to be an edge (a
    curve, a corner under the pad) is taken by its moments, as in (5.6).

    Half the array's size along y is the thesis' L, the stiffness [N/m] K_z of (5.5), total.
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
        if not elongation >= 3.0:
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
    if abs(features.yaw) > 1.0:
        return None, f'it lies {math.degrees(features.yaw):.0f} degrees across the pad'
    return features, ''


def edge_tilt(moments: Moments, half_length: float, stiffness: float) -> float:
    """
    Angle about x between pad and edge [rad], from the first moment along the edge (5.6).

    A load that grows in proportion along the whole edge, k (z + theta y), has
    My = K_z theta L^2 / 3 with K_z = 2 L k, and the second moment L^2 / 3 of an even one. Where
    an edge ends, or turns under the pad, My says nothing of its rise, and the second moment
    tells so: the angle counts in full where that is right, and not at all where it differs by
    the fraction `UNEVEN`. `half_length` is the thesis' L [m], the stiffness K_z [N/m].
    """
    even = moments.m0 * half_length**2 / 3.0
    if not (even > 0.0 and math.isfinite(moments.my) and math.isfinite(moments.myy)):
        return 0.0
    trust = ramp(abs(moments.myy / even - 1.0), UNEVEN, 0.0)
    return trust * 3.0 * moments.my / (stiffness * half_length**2)
