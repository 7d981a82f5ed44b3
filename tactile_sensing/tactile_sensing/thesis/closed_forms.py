"""Contact by the closed forms of the thesis: what the fit is compared with (2.3, 2.4, 3.3)."""

from collections.abc import Callable, Sequence
from dataclasses import astuple
import math
from typing import Any

import numpy as np

from tactile_sensing.image import image_moments
from tactile_sensing.thesis import point
from tactile_sensing.thesis.compensation import (
    compensated,
    from_window,
    MOMENT_ORDERS,
    window_arms,
    window_moments,
)
from tactile_sensing.thesis.line import chord_length, pressure
from tactile_sensing.thesis.line_moments import line_from_moments
from tactile_sensing.thesis.point_moments import basic, MomentFlag, PointMoments
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import Contact, ContactType, Reason, ROW
from tactile_sensing.types.moments import Moments

THRESHOLD = 4.0  # standard deviations below which a line's tactels count as zero (3.5)
MIN_ELONGATION = 3.0  # of second moments; less is no edge, whatever the closed form says
UNEXPLAINED = 0.5  # share of the energy that the biased closed forms may leave unexplained
KNOWN_LAYERS = (('zz',), ('zz', 'xz'), ('zz', 'xz', 'yz'))  # at one depth
STEP = 1e-6  # m, for derivatives by the place

# Expected picture, rows of the covariance, and a function that gives this.
Found = tuple[np.ndarray, tuple[int, ...], Callable[[], np.ndarray]]
_POINT = ROW.x, ROW.y, ROW.normal_force, ROW.shear_force_x, ROW.shear_force_y
_LINE = ROW.x, ROW.y, ROW.yaw, ROW.normal_force, ROW.line_force


def estimate_by_moments(frame: np.ndarray, array: TactelArray, layers: Sequence[Any], *,
                        method: str, model: str, averaging: bool, min_snr: float) -> Contact:
    """
    Contact of a frame by the closed forms.

    Parameters
    ----------
    frame : ndarray, shape (layers, rows, columns)
        Stress [Pa]; NaN marks tactels that are not used.
    array : TactelArray
    layers : sequence
        Objects with component, depth [m] and noise_std, that of the frame [Pa].
    method : str
        'moments', or 'compensated', with the iteration of section 2.4.
    model : str
        'point', 'line', or 'auto' for the one that the elongation says.
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
    cleaned = image_moments(image, array, threshold=THRESHOLD * noise)
    contact = Contact(ContactType.OTHER, False, Reason(0), method)
    if model == 'line' or (model == 'auto' and cleaned.elongation() >= MIN_ELONGATION):
        found = _line(contact, image, cleaned, array, layers[main].depth, noise)
    else:
        found = _point(contact, np.nan_to_num(frame), layers, array, averaging)
    if found is not None:
        expected, rows, covariance = found
        _judge(contact, image, expected, noise, array, min_snr)
        if not contact.reasons:  # it takes longer than the rest
            contact.covariance[np.ix_(rows, rows)] = (
                max(1.0, contact.residual**2) * covariance())
    contact.valid = contact.force_valid = not contact.reasons
    return contact


def _judge(contact: Contact, image: np.ndarray, expected: np.ndarray, noise: float,
           array: TactelArray, min_snr: float) -> None:
    """Refuse what is too weak, off the pad or unlike its model."""
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


def _line(contact: Contact, image: np.ndarray, cleaned: Moments, array: TactelArray,
          depth: float, noise: float) -> Found | None:
    """(3.8) to (3.10), corrected, from the tactels above the threshold; see `_point`."""
    if not cleaned.m0 > 0.0:
        contact.type, contact.reasons = ContactType.NONE, Reason.LOW_SNR
        return None
    if not cleaned.elongation() >= MIN_ELONGATION:
        contact.reasons = Reason.BAD_FIT
        return None

    def closed(moments: np.ndarray) -> np.ndarray:
        line = line_from_moments(Moments(*moments[0]), array.half_width_y)
        offset = line.a * math.cos(line.yaw)
        length = chord_length(offset, line.yaw, array.half_width_x, array.half_width_y)
        return np.array([offset, line.yaw, line.line_force * length, line.line_force])

    moments = np.array([astuple(cleaned)])
    offset, yaw, force, line_force = closed(moments).tolist()
    cos, sin = math.cos(yaw), math.sin(yaw)
    centre_x, centre_y = cleaned.centre_of_pressure
    along = centre_y * cos - centre_x * sin
    contact.type = ContactType.LINE
    contact.x, contact.y = offset * cos - along * sin, offset * sin + along * cos
    contact.yaw, contact.normal_force, contact.line_force = yaw, force, line_force
    if not force > 0.0:
        contact.reasons = Reason.OFF_PAD
        return None

    def covariance() -> np.ndarray:
        weights = _weights(array, 0.0, 0.0, np.inf)[:, (image >= THRESHOLD * noise).ravel()]
        spread = noise**2 * weights @ weights.T
        change = np.eye(5, 4, -1)  # of x, y, yaw, forces by offset, yaw, forces
        change[:2, 0] = cos, sin  # across the edge alone
        change[:2, 1] = -along * cos, -along * sin
        return change @ _propagated(closed, moments, [spread]) @ change.T

    expected = pressure(array.x, array.y[:, None], offset, yaw, line_force, depth)
    return expected, _LINE, covariance


def _point(contact: Contact, frame: np.ndarray, layers: Sequence[Any], array: TactelArray,
           averaging: bool) -> Found | None:
    """
    (2.3), (2.4) or (2.6), at once or with the iteration of section 2.4, into a contact.

    Returns None if there is none, else its picture, the rows of its covariance, and a function
    that gives this.
    """
    if not _has_closed_form(layers):
        main = [layer.component for layer in layers].index('zz')
        frame, layers = frame[main:main + 1], layers[main:main + 1]
    iterated = contact.method == 'compensated'
    found = (compensated if iterated else basic)(frame, array, layers, averaging=averaging)
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

    def covariance() -> np.ndarray:
        if iterated:
            return _iterated_noise(found, frame, layers, array, averaging)
        return _window_noise(np.zeros(2), np.inf, found, frame, layers, array, averaging)

    depth = next(layer.depth for layer in layers if layer.component == 'zz')
    load = found.a, found.b, found.normal_force, found.shear_force_x, found.shear_force_y
    place = array.x, array.y[:, None], *load, depth
    expected = (point.average('zz', *place, array.pitch_x, array.pitch_y) if averaging else
                point.stress('zz', *place))
    return expected, _POINT, covariance


def _has_closed_form(layers: Sequence[Any]) -> bool:
    """Whether these layers have a closed form: (2.3), (2.4) or (2.6)."""
    components, depths = zip(*((layer.component, layer.depth) for layer in layers), strict=True)
    if components == ('zz', 'zz'):
        return depths[0] < depths[1]
    return components in KNOWN_LAYERS and len(set(depths)) == 1


def _five(found: PointMoments) -> np.ndarray:
    return np.array([found.a, found.b, found.normal_force, found.shear_force_x,
                     found.shear_force_y])


def _iterated_noise(found: PointMoments, frame: np.ndarray, layers: Sequence[Any],
                    array: TactelArray, averaging: bool) -> np.ndarray:
    """
    Covariance (5, 5) of the iteration where it rests.

    There x = T(x, images), so that dx = (1 - dT/dx)^-1 dT/dimages.
    """
    at = np.array([found.a, found.b])

    def step(place: np.ndarray) -> np.ndarray:
        x, y = place
        mask = min(array.half_width_x - abs(x), array.half_width_y - abs(y))
        moved = from_window(
            window_moments(frame, array, x, y, mask), array, layers, mask,
            tuple(at - place), averaging=averaging)
        return _five(moved) + np.array([x, y, 0.0, 0.0, 0.0])

    by_place = np.stack([(step(at + shift) - step(at - shift)) / (2.0 * STEP)
                         for shift in STEP * np.eye(2)], axis=1)  # (5, 2)
    lead = np.eye(5)
    lead[:, :2] -= by_place
    once = _window_noise(at, found.mask, found, frame, layers, array, averaging)
    try:
        inverse = np.linalg.inv(lead)
    except np.linalg.LinAlgError:
        return np.full((5, 5), np.inf)
    return inverse @ once @ inverse.T


def _window_noise(at: np.ndarray, mask: float, found: PointMoments, frame: np.ndarray,
                  layers: Sequence[Any], array: TactelArray, averaging: bool) -> np.ndarray:
    """Covariance (5, 5) of the closed form in a window that stays, by the noise of the moments."""
    x, y = at
    weights = _weights(array, x, y, mask)
    spread = [layer.noise_std**2 * weights @ weights.T for layer in layers]
    reach = min(mask, array.half_width_x + array.half_width_y)
    moments = np.array([astuple(m) for m in window_moments(frame, array, x, y, reach)])
    peak = found.a - math.copysign(1e-9, found.shear_force_x) - x, (
        found.b - math.copysign(1e-9, found.shear_force_y) - y)

    def closed(changed: np.ndarray) -> np.ndarray:
        return _five(from_window([Moments(*m) for m in changed], array, layers, mask, peak,
                                 averaging=averaging))

    return _propagated(closed, moments, spread)


def _weights(array: TactelArray, x: float, y: float, mask: float) -> np.ndarray:
    """Weight of every tactel in the six moments about (x, y), shape (6, rows * columns)."""
    reach = min(mask, array.half_width_x + array.half_width_y + abs(x) + abs(y))
    weight_x, arm_x = window_arms(array.x - x, array.pitch_x, reach)
    weight_y, arm_y = window_arms(array.y - y, array.pitch_y, reach)
    return np.array([np.outer(weight_y * arm_y**q, weight_x * arm_x**p).ravel()
                     for p, q in MOMENT_ORDERS])


def _propagated(function: Callable[[np.ndarray], np.ndarray], moments: np.ndarray,
                spread: Sequence[np.ndarray]) -> np.ndarray:
    """Covariance of function(moments), by differences as wide as the noise."""
    total: Any = 0.0
    for layer, cov in enumerate(spread):
        steps = np.sqrt(np.diag(cov))
        columns = []
        for i, step in enumerate(steps):
            up, down = moments.copy(), moments.copy()
            up[layer, i] += step
            down[layer, i] -= step
            columns.append((function(up) - function(down)) / (2.0 * step) if step > 0.0
                           else np.zeros_like(function(up)))
        slope = np.stack(columns, axis=1)
        total = total + slope @ cov @ slope.T
    return total
