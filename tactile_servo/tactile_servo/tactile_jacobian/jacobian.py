"""Least-squares tactile Jacobian from small changes of the contact: (6.7), (C.10)."""
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from tactile_sensing.types.array import TactelArray
from tactile_servo.tactile_jacobian.features import FeatureKind

Features = Callable[..., np.ndarray]  # contact (3,), shear (2,) -> features (3,)


@dataclass(frozen=True)
class Increments:
    """Increments of Table 6.1, and the friction during small sliding motions."""

    # By which the contact is moved either way [m]; at least a pitch, because over less the
    # centroid of a coarse array moves in steps.
    place: float = 1.0e-3
    force: float = 0.25  # share by which the force is changed either way
    friction: float = 0.0  # coefficient of Coulomb friction against the sliding
    stiffness: float = 1.5e4  # K_z of (6.7): of skin, finger and robot along the normal [N/m]

    @classmethod
    def of(cls, array: TactelArray, stiffness: float = stiffness) -> 'Increments':
        """Return the increments for an array and a stiffness K_z [N/m]."""
        return cls(max(cls.place, array.pitch_x, array.pitch_y), stiffness=stiffness)


class Cases(NamedTuple):
    """Loading cases of Table 6.1 around a contact."""

    motions: np.ndarray  # (6, 3), dX = (dx, dy, dp / K_z) [m]
    changes: np.ndarray  # (6, 3), changes of the features


class TactileJacobian(NamedTuple):
    """Change of the features with the contact's place and the motion along the normal."""

    forward: np.ndarray  # (3, 3), dF = J dX
    inverse: np.ndarray  # (3, 3), dX = J^-1 dF, fitted directly
    condition: float  # condition number of the scaled forward matrix, at least 1


def loading_cases(features: Features, contact: np.ndarray, increments: Increments) -> Cases:
    """
    Compute the changes of the features for the six increments of Table 6.1 from a base contact.

    The contact of the object slides over the skin by dx or dy, so the friction on the skin has
    the direction of the increment. (In the thesis it opposes the increment, which makes J^-1 a
    third larger at a coefficient of 0.5, not smaller.)
    """
    contact = np.asarray(contact, dtype=float)
    base, motions, changes = features(contact), [], []
    size = np.array([increments.place, increments.place, increments.force * contact[2]])
    for axis in range(3):
        for sign in (1.0, -1.0):
            change = np.zeros(3)
            change[axis] = sign * size[axis]
            shear = np.zeros(2)
            if axis < 2:
                shear[axis] = sign * increments.friction * contact[2]
            changes.append(features(contact + change, tuple(shear)) - base)
            motions.append(change / [1.0, 1.0, increments.stiffness])
    return Cases(np.array(motions), np.array(changes))


class Scale(NamedTuple):
    """Units of features and motions, so that all have comparable weight."""

    features: np.ndarray  # (3,)
    motions: np.ndarray  # (3,)


def scale_for(kind: FeatureKind, force: float, length: float, stiffness: float) -> Scale:
    """Return units from force [N], length on the pad [m], K_z [N/m]: J is near 1 at the centre."""
    lever = length * (force if kind is FeatureKind.MOMENTS else 1.0)
    return Scale(np.array([force, lever, lever]), np.array([length, length, force / stiffness]))


def least_squares(cases: Cases, scale: Scale) -> TactileJacobian:
    """
    Fit the Jacobian and its inverse separately to the six cases.

    The inverse is that of (C.10). Its 18 equations (the thesis counts 12) form three groups of
    six, one for each row: changes @ inverse' = motions.
    """
    forward = np.linalg.lstsq(cases.motions, cases.changes, rcond=None)[0].T
    scaled = cases.changes / scale.features
    inverse = np.linalg.lstsq(scaled, cases.motions, rcond=None)[0].T / scale.features
    return TactileJacobian(forward, inverse, condition_of(forward, scale))


def condition_of(forward: np.ndarray, scale: Scale) -> float:
    """Return the condition number of a Jacobian (3, 3) after scaling; inf if it is not finite."""
    if not np.isfinite(forward).all():
        return np.inf
    return float(np.linalg.cond(forward * scale.motions / scale.features[:, None]))
