"""What an estimator says about one tactile image."""

from dataclasses import dataclass, field
from enum import IntEnum, IntFlag

import numpy as np

from tactile_sensing.moments.image_moments import Moments

NAN = float('nan')

# Order of the rows and columns of Contact.covariance.
PARAMETERS = (
    'a', 'b', 'yaw', 'normal_force', 'shear_force_x', 'shear_force_y', 'line_force')


class ContactType(IntEnum):
    """Least model that explains the image; the numbers of Contact.msg."""

    NONE = 0
    POINT = 1
    LINE = 2
    OTHER = 3


class Reason(IntFlag):
    """Why an estimate is not valid, or what it left out; the numbers of Contact.msg."""

    NO_CONTACT = 1
    LOW_SNR = 2
    OFF_PAD = 4
    FEW_TACTELS = 8
    NOT_CONVERGED = 16
    BAD_FIT = 32
    BAD_IMAGE = 64
    TWO_CONTACTS = 128
    NOT_TARED = 256
    SATURATED = 512
    DEAD_TACTELS = 1024
    FORCE_MISMATCH = 2048

# What says that something was left out, not that there is no estimate.
INFORMATION = Reason.SATURATED | Reason.DEAD_TACTELS | Reason.FORCE_MISMATCH | Reason.NOT_TARED

# One row of `ContactEstimator.estimate_batch`: the fields of Contact, SI units.
RECORD = np.dtype([
    ('type', np.uint8), ('valid', np.bool_), ('flags', np.uint32),
    *((name, np.float64) for name in ('a', 'b', 'yaw', 'P', 'Qx', 'Qy', 'line_force')),
    ('covariance', np.float64, (7, 7)), ('snr', np.float64), ('residual', np.float64),
    ('force_windowed', np.float64), ('iterations', np.uint32)])


def no_covariance():
    """Covariance of nothing: (7, 7) of NaN."""
    return np.full((len(PARAMETERS), len(PARAMETERS)), NAN)


@dataclass(frozen=True)
class Contact:
    """
    Contact estimate in the sensor frame; fields as in Contact.msg, SI units.

    Parameters that the type does not have are NaN, and all of them are when not valid.
    """

    type: ContactType
    valid: bool
    reasons: Reason
    method: str
    model: str = ''
    a: float = NAN
    b: float = NAN
    yaw: float = NAN
    normal_force: float = NAN
    shear_force_x: float = NAN
    shear_force_y: float = NAN
    line_force: float = NAN
    covariance: np.ndarray = field(default_factory=no_covariance)
    snr: float = NAN
    residual: float = NAN
    iterations: int = 0
    force_windowed: float = NAN
    moments: Moments = Moments(NAN, NAN, NAN, NAN, NAN, NAN)
