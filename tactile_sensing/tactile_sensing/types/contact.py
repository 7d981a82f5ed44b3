"""Result of the contact estimation for one image; all its fields are defined here only."""

from collections import namedtuple
from dataclasses import dataclass, field, fields
from enum import IntEnum, IntFlag
import math
from typing import Any

import numpy as np

from tactile_sensing.types.moments import Moments

NAN = float('nan')


class ContactType(IntEnum):
    """Simplest model that explains the image; numbers as in Contact.msg."""

    NONE = 0
    POINT = 1
    LINE = 2
    OTHER = 3


class Reason(IntFlag):
    """Why an estimate is not valid, or what is missing; numbers as in Contact.msg."""

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
    SKIN_MISMATCH = 2048
    UNCALIBRATED = 4096


# Reasons that do not make an estimate invalid.
INFORMATION = (Reason.SATURATED | Reason.DEAD_TACTELS | Reason.SKIN_MISMATCH | Reason.NOT_TARED
               | Reason.UNCALIBRATED)


def _column(unit: str, doc: str, dtype: str = 'f8', row: bool = False) -> dict:
    """Return the metadata of a field that is written to files; `row`: and in the covariance."""
    return {'unit': unit, 'doc': doc, 'dtype': dtype, 'row': row}


def _real(unit: str, doc: str, row: bool = False) -> Any:
    return field(default=NAN, metadata=_column(unit, doc, row=row))


@dataclass  # not frozen, to be faster: one is created for every image
class Contact:
    """
    Contact estimate in the sensor frame; fields as in Contact.msg, SI units.

    Parameters that the type does not have are NaN. If `valid` is false, all parameters are NaN;
    if `force_valid` is false, forces and patch are NaN.
    """

    type: ContactType = field(metadata=_column(
        '', 'least model that explains the frame; see Types', 'u1'))
    valid: bool = field(metadata=_column('', 'whether place and direction may be used', '?'))
    force_valid: bool = field(default=False, kw_only=True, metadata=_column(
        '', 'whether forces and patch may be used as well', '?'))
    reasons: Reason = field(metadata=_column(
        '', 'why not valid, or what was left out; see Flags', 'u4'))
    method: str
    model: str = ''
    x: float = _real('m', 'of the contact; line: of its point nearest to the centre of the load',
                     True)
    y: float = _real('m', 'likewise', True)
    yaw: float = _real(
        'rad', 'line: its direction, right-handed about +z, 0 along +y, in (-pi/2, pi/2]', True)
    normal_force: float = _real(
        'N', 'normal force, positive into the skin; line: on the whole pad', True)
    shear_force_x: float = _real(
        'N', 'tangential force on the skin, +x; line: of the shear across it', True)
    shear_force_y: float = _real('N', 'tangential force on the skin, +y; line: likewise', True)
    line_force: float = _real('N/m', 'line: normal force per length of edge', True)
    patch: float = _real(
        'm', 'radius of the patch of a blunt point, half width of a blunt line; 0: sharp')
    start: float = _real(
        'm', 'line: where it begins within the pad, along yaw from the foot of the origin')
    end: float = _real('m', 'line: where it ends, likewise')
    covariance: np.ndarray = field(default_factory=lambda: np.full(MATRIX, NAN), metadata=_column(
        'SI', 'of (x, y, yaw, normal_force, shear_force_x, shear_force_y, line_force)'))
    snr: float = _real('dB', '20 log10 of the fitted peak over the noise of a tactel')
    residual: float = _real('', 'RMS of (frame - model) / noise')
    iterations: int = field(default=0, metadata=_column('', 'steps taken by the estimator', 'u4'))
    moments: Moments = field(default=Moments(NAN, NAN, NAN, NAN, NAN, NAN), metadata=_column(
        'SI', 'M0, Mx, My, Mxx, Myy, Mxy of the pressure, of every frame'))

    @property
    def offset(self) -> float:
        """Distance of a line from the origin, positive towards (cos yaw, sin yaw) [m]."""
        if not math.isfinite(self.yaw):
            return NAN
        return self.x * math.cos(self.yaw) + self.y * math.sin(self.yaw)


# Order of the rows and columns of Contact.covariance; ROW.x is the index of x, and so on.
PARAMETERS = tuple(f.name for f in fields(Contact) if f.metadata.get('row'))
ROW: Any = namedtuple('ROW', PARAMETERS)(*range(len(PARAMETERS)))
FORCES = ('normal_force', 'shear_force_x', 'shear_force_y', 'line_force')  # in PARAMETERS
REALS = tuple(f.name for f in fields(Contact) if f.type is float)
# Fields that are written to files.
COLUMNS = {f.name: f for f in fields(Contact) if f.metadata}
MATRIX: tuple[int, int] = (len(PARAMETERS), len(PARAMETERS))  # shape of the covariance
_SHAPES = {'covariance': MATRIX, 'moments': (6,)}  # of fields that are not single values
# One row of `ContactEstimator.estimate_batch` and of the command `estimate`.
RECORD = np.dtype([(name, f.metadata['dtype'], _SHAPES.get(name, ()))
                   for name, f in COLUMNS.items()])
STAMPED = np.dtype([*RECORD.descr, ('t', 'f8')])  # the same for an image of a bag; t: stamp [s]
