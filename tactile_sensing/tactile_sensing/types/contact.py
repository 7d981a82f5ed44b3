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


def _told(unit: str, doc: str, *, dtype: str = 'f8', row: bool = False) -> dict:
    """Return the metadata of a field that is written to files."""
    return {'unit': unit, 'doc': doc, 'dtype': dtype, 'row': row}


def _parameter(unit: str, doc: str) -> dict:
    """Return the metadata of a parameter that has a row and a column in the covariance."""
    return _told(unit, doc, row=True)


def no_covariance() -> np.ndarray:
    """Return a covariance (7, 7) of NaN."""
    return np.full((len(PARAMETERS), len(PARAMETERS)), NAN)


@dataclass  # not frozen, to be faster: one is created for every image
class Contact:
    """
    Contact estimate in the sensor frame; fields as in Contact.msg, SI units.

    Parameters that the type does not have are NaN. If `valid` is false, all parameters are NaN;
    if `force_valid` is false, forces and patch are NaN.
    """

    type: ContactType = field(metadata=_told(
        '', 'least model that explains the frame; see Types', dtype='u1'))
    valid: bool = field(metadata=_told(
        '', 'whether place and direction may be used', dtype='?'))
    force_valid: bool = field(default=False, kw_only=True, metadata=_told(
        '', 'whether forces and patch may be used as well', dtype='?'))
    reasons: Reason = field(metadata=_told(
        '', 'why not valid, or what was left out; see Flags', dtype='u4'))
    method: str
    model: str = ''
    x: float = field(default=NAN, metadata=_parameter(
        'm', 'of the contact; line: of its point nearest to the centre of the load'))
    y: float = field(default=NAN, metadata=_parameter('m', 'likewise'))
    yaw: float = field(default=NAN, metadata=_parameter(
        'rad', 'line: its direction, right-handed about +z, 0 along +y, in (-pi/2, pi/2]'))
    normal_force: float = field(default=NAN, metadata=_parameter(
        'N', 'normal force, positive into the skin; line: on the whole pad'))
    shear_force_x: float = field(default=NAN, metadata=_parameter(
        'N', 'tangential force on the skin, +x; line: of the shear across it'))
    shear_force_y: float = field(default=NAN, metadata=_parameter(
        'N', 'tangential force on the skin, +y; line: likewise'))
    line_force: float = field(default=NAN, metadata=_parameter(
        'N/m', 'line: normal force per length of edge'))
    patch: float = field(default=NAN, metadata=_told(
        'm', 'radius of the patch of a blunt point, half width of a blunt line; 0: sharp'))
    start: float = field(default=NAN, metadata=_told(
        'm', 'line: where it begins within the pad, along yaw from the foot of the origin'))
    end: float = field(default=NAN, metadata=_told('m', 'line: where it ends, likewise'))
    covariance: np.ndarray = field(default_factory=no_covariance, metadata=_told(
        'SI', 'of (x, y, yaw, normal_force, shear_force_x, shear_force_y, line_force)'))
    snr: float = field(default=NAN, metadata=_told(
        'dB', '20 log10 of the fitted peak over the noise of a tactel'))
    residual: float = field(default=NAN, metadata=_told('', 'RMS of (frame - model) / noise'))
    iterations: int = field(default=0, metadata=_told(
        '', 'steps taken by the estimator', dtype='u4'))
    moments: Moments = field(default=Moments(NAN, NAN, NAN, NAN, NAN, NAN), metadata=_told(
        'SI', 'M0, Mx, My, Mxx, Myy, Mxy of the pressure, of every frame'))

    @property
    def offset(self) -> float:
        """Distance of a line from the origin, positive towards (cos yaw, sin yaw) [m]."""
        if not math.isfinite(self.yaw):
            return NAN
        return self.x * math.cos(self.yaw) + self.y * math.sin(self.yaw)


def line_offsets(records: np.ndarray) -> np.ndarray:
    """Return `Contact.offset` [m] of lines; records: structured array with x, y and yaw."""
    return records['x'] * np.cos(records['yaw']) + records['y'] * np.sin(records['yaw'])


# Order of the rows and columns of Contact.covariance; ROW.x is the index of x, and so on.
PARAMETERS = tuple(f.name for f in fields(Contact) if f.metadata.get('row'))
ROW: Any = namedtuple('ROW', PARAMETERS)(*range(len(PARAMETERS)))
FORCES = ('normal_force', 'shear_force_x', 'shear_force_y', 'line_force')  # in PARAMETERS
REALS = tuple(f.name for f in fields(Contact) if f.type is float)
# Fields that are written to files.
COLUMNS = {f.name: f for f in fields(Contact) if f.metadata}


def _type_of(name: str, dtype: str) -> tuple:
    shape = {'covariance': (len(PARAMETERS),) * 2, 'moments': (6,)}.get(name, ())
    return name, dtype, shape


# One row of `ContactEstimator.estimate_batch` and of the command `estimate`.
RECORD = np.dtype([_type_of(name, f.metadata['dtype']) for name, f in COLUMNS.items()])
STAMPED = np.dtype([*RECORD.descr, ('t', 'f8')])  # the same for an image of a bag; t: stamp [s]
