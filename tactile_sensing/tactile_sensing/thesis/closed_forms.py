"""Estimate a contact by the closed forms of the thesis, for comparison (2.3, 2.4, 3.3)."""

from collections.abc import Sequence
import math
from typing import Any

import numpy as np

from tactile_sensing.image import image_moments
from tactile_sensing.skin.bumps import chord
from tactile_sensing.skin.pressure import SkinPressure
from tactile_sensing.thesis.line import line_from_moments, pressure
from tactile_sensing.thesis.point_moments import basic, compensated, form_of
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import ContactType, FORCES, PARAMETERS, Reason
from tactile_sensing.types.image import Layer
from tactile_sensing.types.moments import Moments
from tactile_sensing.types.skin import Skin

MIN_ELONGATION = 3.0  # smallest ratio of the second moments of an edge
THRESHOLD_STD = 4.0  # a line's tactels below this count as zero, (3.5) [standard deviations]
# Largest share of the energy that a contact may leave unexplained: the closed forms are biased.
UNEXPLAINED = 0.5
# Kind of contact, why it is refused, and its image (rows, columns); None: it has none.
Found = tuple[ContactType, Reason, np.ndarray | None]


def write_record(frame: np.ndarray, array: TactelArray, layers: Sequence[Layer], config: Any,
                 min_snr: float, record: np.void) -> None:
    """
    Write the contact of a frame, without covariance: bias is most of the error.

    Parameters
    ----------
    frame : ndarray, shape (layers, rows, columns)
        Stress; NaN: no reading.
    array : TactelArray
    layers : sequence of Layer
        With the noise of the frame; their stress is not used.
    config : EstimatorConfig
    min_snr : float
        Weaker contacts are refused [dB].
    record : record of types.contact.RECORD
        With what `contact.answer` has written that needs no fit.
    """
    seen = Reason(int(record['reasons']))
    if seen & (Reason.FEW_TACTELS | Reason.BAD_FIT | Reason.NO_CONTACT):
        return
    full = np.reshape([layer.full_scale or np.inf for layer in layers], (-1, 1, 1))
    frame = np.where(frame >= full, np.nan, frame)
    main = [layer.component for layer in layers].index('zz')
    layer, image = layers[main], frame[main]
    cleaned = image_moments(image, array, threshold=THRESHOLD_STD * layer.noise_std)
    if config.model == 'line' or (
            config.model == 'auto' and cleaned.elongation() >= MIN_ELONGATION):
        kind, why, expected = _line(record, cleaned, array, layer.depth)
    else:
        kind, why, expected = _point(record, frame, array, layers, config)
    if expected is not None:
        used, squared = np.count_nonzero(np.isfinite(image)), np.nansum((image - expected)**2)
        top = expected.max()
        if not (top > 0.0 and np.isfinite(record['normal_force'])):
            kind, why = ContactType.OTHER, Reason.BAD_FIT
        else:
            record['snr'] = 20.0 * math.log10(top / layer.noise_std)
            record['residual'] = math.sqrt(squared / max(used - 5, 1)) / layer.noise_std
            if record['snr'] < min_snr:
                kind, why = ContactType.NONE, Reason.LOW_SNR
            elif not squared <= UNEXPLAINED * np.nansum(image**2):
                kind, why = ContactType.OTHER, Reason.BAD_FIT
            elif not why and (abs(record['x']) > array.half_width_x
                              or abs(record['y']) > array.half_width_y):
                why = Reason.OFF_PAD
    record['type'], record['reasons'], record['valid'] = kind, seen | why, not why
    record['force_valid'] = not why and layer.unit == 'Pa'
    for name in PARAMETERS if why else () if record['force_valid'] else FORCES:
        record[name] = np.nan


def _line(record: np.void, cleaned: Moments, array: TactelArray, depth: float) -> Found:
    """
    Write (3.8) to (3.10), corrected, into a record.

    (3.2) assumes the length 2L / cos(yaw), i.e. a line that crosses the two sides y = +-L.
    """
    if not cleaned.m0 > 0.0:
        return ContactType.NONE, Reason.LOW_SNR, None
    if not cleaned.elongation() >= MIN_ELONGATION:
        return ContactType.OTHER, Reason.BAD_FIT, None
    line = line_from_moments(cleaned, array.half_width_y)
    cos, sin = math.cos(line.yaw), math.sin(line.yaw)
    offset = line.a * cos
    first, last = chord(array.half_width_x, array.half_width_y, offset, line.yaw)
    force = line.line_force * max(last - first, 0.0)
    if not force > 0.0:
        return ContactType.LINE, Reason.OFF_PAD, None
    centre_x, centre_y = cleaned.centre_of_pressure
    along = centre_y * cos - centre_x * sin
    record['x'], record['y'] = offset * cos - along * sin, offset * sin + along * cos
    record['yaw'], record['normal_force'], record['line_force'] = line.yaw, force, line.line_force
    return ContactType.LINE, Reason(0), pressure(
        array.x, array.y[:, None], offset, line.yaw, line.line_force, depth)


def _point(record: np.void, frame: np.ndarray, array: TactelArray, layers: Sequence[Layer],
           config: Any) -> Found:
    """Write (2.3), (2.4) or (2.6) into a record; without a form for the layers, (2.3)."""
    averaging, main = config.tactel == 'area', [it.component for it in layers].index('zz')
    skin, images = Skin(layers[main].depth), np.nan_to_num(frame)
    if form_of(layers) is None:
        images, layers = images[main:main + 1], layers[main:main + 1]
    method = compensated if config.method == 'compensated' else basic
    found = method(images, array, layers, averaging=averaging)
    record['iterations'] = found.iterations
    if found.reasons & Reason.BAD_FIT:
        return ContactType.OTHER, Reason.BAD_FIT, None
    record['x'], record['y'], record['normal_force'] = found.a, found.b, found.normal_force
    record['shear_force_x'], record['shear_force_y'] = found.shear_force_x, found.shear_force_y
    size = (array.pitch_x, array.pitch_y) if averaging else ()
    return ContactType.POINT, found.reasons, SkinPressure(skin, *size).point(
        array.x, array.y[:, None], found.a, found.b, found.normal_force, found.shear_force_x,
        found.shear_force_y)
