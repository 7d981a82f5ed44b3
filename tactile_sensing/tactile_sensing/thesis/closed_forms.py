"""Estimate a contact by the closed forms of the thesis, for comparison (2.3, 2.4, 3.3)."""

from collections.abc import Sequence
import math
from typing import Any

import numpy as np

from tactile_sensing.image import image_moments
from tactile_sensing.skin.pressure import SkinPressure
from tactile_sensing.thesis.compensation import compensated
from tactile_sensing.thesis.line import chord_length, pressure
from tactile_sensing.thesis.line_moments import line_from_moments
from tactile_sensing.thesis.point_moments import basic, form_of, MomentFlag
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import (
    COLUMNS,
    Contact,
    ContactType,
    FORCES,
    PARAMETERS,
    Reason,
)
from tactile_sensing.types.image import Layer
from tactile_sensing.types.moments import Moments
from tactile_sensing.types.skin import Skin

MIN_ELONGATION = 3.0  # smallest ratio of the second moments of an edge
THRESHOLD_STD = 4.0  # a line's tactels below this count as zero, (3.5) [standard deviations]
# Largest share of the energy that a contact may leave unexplained: the closed forms are biased.
UNEXPLAINED = 0.5


def write_record(frame: np.ndarray, array: TactelArray, layers: Sequence[Layer], config: Any,
                 min_snr: float, record: np.void) -> str:
    """
    Write the record of a frame, to which `contact.answer` has written what needs no fit.

    The layers have their noise; `config` is an EstimatorConfig. Contacts below `min_snr` [dB]
    are refused. Returns the name of the model.
    """
    seen = Reason(int(record['reasons']))
    if seen & (Reason.FEW_TACTELS | Reason.BAD_FIT | Reason.NO_CONTACT):
        return ''
    full = np.reshape([layer.full_scale or np.inf for layer in layers], (-1, 1, 1))
    contact = estimate_by_moments(
        np.where(frame >= full, np.nan, frame), array, layers, method=config.method,
        model=config.model, averaging=config.tactel == 'area', min_snr=min_snr)
    main = next(layer for layer in layers if layer.component == 'zz')
    contact.reasons |= seen
    contact.force_valid = contact.valid and main.unit == 'Pa'
    unknown = {*PARAMETERS} if not contact.valid else {
        *FORCES} if not contact.force_valid else set()
    for name in COLUMNS:
        if name != 'moments':
            record[name] = np.nan if name in unknown else getattr(contact, name)
    return contact.model


def estimate_by_moments(frame: np.ndarray, array: TactelArray, layers: Sequence[Any], *,
                        method: str, model: str, averaging: bool, min_snr: float) -> Contact:
    """
    Estimate the contact of a frame by closed forms, without covariance: bias is most of the error.

    Parameters
    ----------
    frame : ndarray, shape (layers, rows, columns)
        Stress [Pa]; NaN: tactel is not used.
    array : TactelArray
    layers : sequence
        Objects with component, depth [m] and noise_std, the noise of the frame [Pa].
    method : str
        'moments', or 'compensated' with the iteration of section 2.4.
    model : str
        'point', 'line', or 'auto' to decide by the elongation.
    averaging : bool
        Whether a tactel measures the mean over its area.
    min_snr : float
        Weaker contacts are refused [dB].

    Returns
    -------
    Contact
        Valid if it has no reasons.
    """
    main = [layer.component for layer in layers].index('zz')
    noise, image = layers[main].noise_std, frame[main]
    cleaned = image_moments(image, array, threshold=THRESHOLD_STD * noise)
    contact = Contact(ContactType.OTHER, False, Reason(0), method)
    if model == 'line' or (model == 'auto' and cleaned.elongation() >= MIN_ELONGATION):
        expected = _line(contact, cleaned, array, layers[main].depth)
    else:
        expected = _point(contact, frame, layers, array, averaging)
    if expected is not None:
        _judge(contact, image, expected, noise, array, min_snr)
    contact.valid = contact.force_valid = not contact.reasons
    return contact


def _judge(contact: Contact, image: np.ndarray, expected: np.ndarray, noise: float,
           array: TactelArray, min_snr: float) -> None:
    """Refuse a contact that is too weak, off the pad or does not explain the image."""
    squared = np.nansum((image - expected)**2)
    top = expected.max()
    if not (top > 0.0 and np.isfinite(contact.normal_force)):
        contact.type, contact.reasons = ContactType.OTHER, Reason.BAD_FIT
        return
    contact.snr = 20.0 * math.log10(top / noise)
    used = np.count_nonzero(np.isfinite(image))
    contact.residual = math.sqrt(squared / max(used - 5, 1)) / noise
    if contact.snr < min_snr:
        contact.type, contact.reasons = ContactType.NONE, Reason.LOW_SNR
    elif not squared <= UNEXPLAINED * np.nansum(image**2):
        contact.type, contact.reasons = ContactType.OTHER, Reason.BAD_FIT
    elif not contact.reasons and (
            abs(contact.x) > array.half_width_x or abs(contact.y) > array.half_width_y):
        contact.reasons = Reason.OFF_PAD


def _line(contact: Contact, cleaned: Moments, array: TactelArray,
          depth: float) -> np.ndarray | None:
    """Write (3.8) to (3.10), corrected, into a contact; return its image or None (refused)."""
    if not cleaned.m0 > 0.0:
        contact.type, contact.reasons = ContactType.NONE, Reason.LOW_SNR
        return None
    if not cleaned.elongation() >= MIN_ELONGATION:
        contact.reasons = Reason.BAD_FIT
        return None
    line = line_from_moments(cleaned, array.half_width_y)
    cos, sin = math.cos(line.yaw), math.sin(line.yaw)
    offset = line.a * cos
    force = line.line_force * chord_length(
        offset, line.yaw, array.half_width_x, array.half_width_y)
    centre_x, centre_y = cleaned.centre_of_pressure
    along = centre_y * cos - centre_x * sin
    contact.type = ContactType.LINE
    contact.x, contact.y = offset * cos - along * sin, offset * sin + along * cos
    contact.yaw, contact.normal_force, contact.line_force = line.yaw, force, line.line_force
    if not force > 0.0:
        contact.reasons = Reason.OFF_PAD
        return None
    return pressure(array.x, array.y[:, None], offset, line.yaw, line.line_force, depth)


def _point(contact: Contact, frame: np.ndarray, layers: Sequence[Any], array: TactelArray,
           averaging: bool) -> np.ndarray | None:
    """Write (2.3), (2.4) or (2.6) into a contact; return its image or None (refused)."""
    main = [layer.component for layer in layers].index('zz')
    depth, images = layers[main].depth, np.nan_to_num(frame)
    if form_of(layers) is None:
        images, layers = images[main:main + 1], layers[main:main + 1]
    method = compensated if contact.method == 'compensated' else basic
    found = method(images, array, layers, averaging=averaging)
    contact.iterations = found.iterations
    if found.flags & MomentFlag.NO_FORCE:
        contact.reasons = Reason.BAD_FIT
        return None
    contact.type = ContactType.POINT
    if found.flags & (MomentFlag.NOT_CONVERGED | MomentFlag.SINGULAR):
        contact.reasons = Reason.NOT_CONVERGED
    if found.flags & MomentFlag.OFF_PAD:
        contact.reasons = Reason.OFF_PAD
    contact.x, contact.y, contact.normal_force = found.a, found.b, found.normal_force
    contact.shear_force_x, contact.shear_force_y = found.shear_force_x, found.shear_force_y
    size = (array.pitch_x, array.pitch_y) if averaging else ()
    return SkinPressure(Skin(depth), *size).point(
        array.x, array.y[:, None], found.a, found.b, found.normal_force, found.shear_force_x,
        found.shear_force_y)
