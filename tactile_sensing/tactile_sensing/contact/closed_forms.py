"""Contact by the closed forms of the thesis: what the fit is compared with (2.3, 2.4, 3.3)."""

from dataclasses import astuple
import math

import numpy as np

from tactile_sensing.contact.parameters import LINE_ROWS, POINT_ROWS
from tactile_sensing.half_space import point
from tactile_sensing.half_space.layers import first_pressure_layer, Layer
from tactile_sensing.half_space.line import chord_length, pressure
from tactile_sensing.moments.compensation import (
    compensated,
    from_window,
    MOMENT_ORDERS,
    window_arms,
    window_moments,
)
from tactile_sensing.moments.image_moments import image_moments, line_from_moments
from tactile_sensing.moments.point_moments import basic, MomentFlag
from tactile_sensing.types.contact import ContactType, PARAMETERS, Reason
from tactile_sensing.types.image import COMPONENTS
from tactile_sensing.types.moments import Moments

THRESHOLD = 4.0  # standard deviations below which a line's tactels count as zero (3.5)
MIN_ELONGATION = 3.0  # of second moments; less is no edge, whatever the closed form says
UNEXPLAINED = 0.5  # share of the energy that the biased closed forms may leave unexplained
KNOWN_LAYERS = (('zz',), ('zz', 'xz'), ('zz', 'xz', 'yz'))  # at one depth
STEP = 1e-6  # m, for derivatives by the place

_POINT_NAMES = ('a', 'b', *(PARAMETERS[i] for i in POINT_ROWS[2:]))  # of PointMoments
_POINT, _LINE = np.ix_(POINT_ROWS, POINT_ROWS), np.ix_(LINE_ROWS[:5], LINE_ROWS[:5])


def estimate_by_moments(frame, array, layers, config, estimate):
    """
    Estimate a preprocessed frame (layers, rows, columns) [Pa] by 'moments' or 'compensated'.

    NaN marks tactels that are not used; layers are `layers.LAYER` records with the frame's noise;
    the estimate, a `contact.ESTIMATE` record, is written.
    """
    main = first_pressure_layer.py_func(layers.view(np.recarray))
    noise, image = layers['noise'][main], frame[main]
    cleaned = image_moments(image, array, threshold=THRESHOLD * noise)
    is_line = config.model == 'line' or (
        config.model == 'auto' and cleaned.elongation() >= MIN_ELONGATION)
    if is_line:
        kind, why, model = _line(image, cleaned, array, layers['depth'][main], noise, estimate)
    else:
        known = tuple(Layer(COMPONENTS[layer['component']], float(layer['depth']),
                            float(layer['noise'])) for layer in layers)
        kind, why, model = _point(np.nan_to_num(frame), known, array, config, estimate)
    if model is not None:
        kind, why = _judge(kind, why, image, model, noise, array, config, estimate)
    estimate['type'] = kind
    estimate['reasons'] |= int(why)


def _judge(kind, why, image, model, noise, array, config, estimate):
    """Refuse what is too weak, off the pad or unlike its model; scale the covariance."""
    rest = image - model
    squared = np.nansum(rest**2)
    top, force = model.max(), estimate['normal_force']
    if not (top > 0.0 and np.isfinite(force)):
        return ContactType.OTHER, Reason.BAD_FIT
    estimate['snr'] = 20.0 * math.log10(top / noise)
    live = np.isfinite(image)
    estimate['residual'] = math.sqrt(squared / max(np.count_nonzero(live) - 5, 1)) / noise
    if estimate['snr'] < config.min_snr:
        return ContactType.NONE, Reason.LOW_SNR
    if not squared <= UNEXPLAINED * np.nansum(image**2):
        return ContactType.OTHER, Reason.BAD_FIT
    if why:
        return kind, why
    if abs(estimate['x']) > array.half_width_x or abs(estimate['y']) > array.half_width_y:
        return kind, Reason.OFF_PAD
    estimate['covariance'] *= max(1.0, estimate['residual']**2)
    return kind, Reason(0)


def _line(image, cleaned, array, depth, noise, estimate):
    """(3.8) to (3.10), corrected, from the tactels above the threshold."""
    if not cleaned.m0 > 0.0:
        return ContactType.NONE, Reason.LOW_SNR, None
    if not cleaned.elongation() >= MIN_ELONGATION:
        return ContactType.OTHER, Reason.BAD_FIT, None

    def closed(moments):
        line = line_from_moments(Moments(*moments[0]), array.half_width_y)
        offset = line.a * math.cos(line.yaw)
        length = chord_length(offset, line.yaw, array.half_width_x, array.half_width_y)
        return np.array([offset, line.yaw, line.line_force * length, line.line_force])

    moments = np.array([astuple(cleaned)])
    offset, yaw, force, line_force = closed(moments)
    cos, sin = math.cos(yaw), math.sin(yaw)
    centre_x, centre_y = cleaned.centre_of_pressure
    along = centre_y * cos - centre_x * sin
    estimate['x'], estimate['y'] = offset * cos - along * sin, offset * sin + along * cos
    estimate['yaw'], estimate['normal_force'], estimate['line_force'] = yaw, force, line_force
    if not force > 0.0:
        return ContactType.LINE, Reason.OFF_PAD, None
    weights = _weights(array, 0.0, 0.0, np.inf)[:, (image >= THRESHOLD * noise).ravel()]
    spread = noise**2 * weights @ weights.T
    change = np.eye(5, 4, -1)  # of x, y, yaw, forces by offset, yaw, forces
    change[:2, 0] = cos, sin  # across the edge alone
    change[:2, 1] = -along * cos, -along * sin
    estimate['covariance'][_LINE] = change @ _propagated(closed, moments, [spread]) @ change.T
    model = pressure(array.x, array.y[:, None], offset, yaw, line_force, depth)
    return ContactType.LINE, Reason(0), model


def _point(frame, layers, array, config, estimate):
    """(2.3), (2.4) or (2.6), at once or with the iteration of section 2.4."""
    if not _has_closed_form(layers):
        main = [layer.component for layer in layers].index('zz')
        frame, layers = frame[main:main + 1], layers[main:main + 1]
    averaging = config.tactel == 'area'
    iterated = config.method == 'compensated'
    found = (compensated if iterated else basic)(frame, array, layers, averaging=averaging)
    estimate['iterations'] = found.iterations
    if found.flags & MomentFlag.NO_FORCE:
        return ContactType.OTHER, Reason.BAD_FIT, None
    why = Reason(0)
    if found.flags & (MomentFlag.NOT_CONVERGED | MomentFlag.SINGULAR):
        why = Reason.NOT_CONVERGED
    if found.flags & MomentFlag.OFF_PAD:
        why = Reason.OFF_PAD
    for row, value in zip(POINT_ROWS, _five(found), strict=True):
        estimate[PARAMETERS[row]] = value
    estimate['has_shear'] = True
    depth = next(layer.depth for layer in layers if layer.component == 'zz')
    stress, area = (point.average, (array.pitch_x, array.pitch_y)) if averaging else (
        point.stress, ())
    model = stress('zz', array.x, array.y[:, None], *_five(found), depth, *area)
    if not why:
        estimate['covariance'][_POINT] = (
            _iterated_noise(found, frame, layers, array, averaging) if iterated else
            _window_noise(np.zeros(2), np.inf, found, frame, layers, array, averaging))
    return ContactType.POINT, why, model


def _has_closed_form(layers):
    """Whether these layers have a closed form: (2.3), (2.4) or (2.6)."""
    components, depths = zip(*((layer.component, layer.depth) for layer in layers), strict=True)
    if components == ('zz', 'zz'):
        return depths[0] < depths[1]
    return components in KNOWN_LAYERS and len(set(depths)) == 1


def _five(found):
    return np.array([getattr(found, name) for name in _POINT_NAMES])


def _iterated_noise(found, frame, layers, array, averaging):
    """
    Covariance (5, 5) of the iteration where it rests.

    There x = T(x, images), so that dx = (1 - dT/dx)^-1 dT/dimages.
    """
    at = np.array([found.a, found.b])

    def step(place):
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
        lead = np.linalg.inv(lead)
    except np.linalg.LinAlgError:
        return np.full((5, 5), np.inf)
    return lead @ once @ lead.T


def _window_noise(at, mask, found, frame, layers, array, averaging):
    """Covariance (5, 5) of the closed form in a window that stays, by the noise of the moments."""
    x, y = at
    weights = _weights(array, x, y, mask)
    spread = [layer.noise_std**2 * weights @ weights.T for layer in layers]
    reach = min(mask, array.half_width_x + array.half_width_y)
    moments = np.array([astuple(m) for m in window_moments(frame, array, x, y, reach)])
    peak = found.a - math.copysign(1e-9, found.shear_force_x) - x, (
        found.b - math.copysign(1e-9, found.shear_force_y) - y)

    def closed(changed):
        return _five(from_window([Moments(*m) for m in changed], array, layers, mask, peak,
                                 averaging=averaging))

    return _propagated(closed, moments, spread)


def _weights(array, x, y, mask):
    """Weight of every tactel in the six moments about (x, y), shape (6, rows * columns)."""
    reach = min(mask, array.half_width_x + array.half_width_y + abs(x) + abs(y))
    weight_x, arm_x = window_arms(array.x - x, array.pitch_x, reach)
    weight_y, arm_y = window_arms(array.y - y, array.pitch_y, reach)
    return np.array([np.outer(weight_y * arm_y**q, weight_x * arm_x**p).ravel()
                     for p, q in MOMENT_ORDERS])


def _propagated(function, moments, spread):
    """Covariance of function(moments), by differences as wide as the noise."""
    total = 0.0
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
