"""Part (e) of the contact benchmark: what every method makes of every fault."""

from dataclasses import replace

import numpy as np

from benchmarks.contact import scenes
from benchmarks.contact.faults import FAULTS, noisy
from tactile_sensing.contact.estimator import ContactEstimator, EstimatorConfig
from tactile_sensing.types.contact import ContactType, Reason
from tactile_sensing.types.image import Layer

METHODS = {'fit': {}, 'fit with depth': {'fit_depth': True},
           'compensated': {'method': 'compensated'}, 'moments': {'method': 'moments'}}
# What makes a valid estimate wrong, for place [m], force and shear [share of the force]: off by
# more than so much and so many of the standard deviations that it claims itself, either way.
LIMITS = (((1e-3, 0.1, np.inf), (0.0, 3.0, 0.0)), ((1e-4, 0.02, 0.1), (5.0, 5.0, 5.0)))


def estimates(given, options, model='auto'):
    """Records of the estimator for a sample."""
    layer = Layer('zz', given.depth, None, given.full_scale, given.noise)
    estimator = ContactEstimator(EstimatorConfig(model=model, **options))
    return estimator.estimate_batch(given.frames, given.array, (layer,))


def errors(given, records):
    """Errors of place, force and shear (N, 3), see LIMITS, and their claimed deviations."""
    error = np.full((len(records), 3), np.nan)
    claimed = error.copy()
    variance = np.diagonal(records['covariance'], axis1=1, axis2=2)
    truth = given.truth
    if given.kind == ContactType.POINT:
        error[:, 0] = np.hypot(records['a'] - truth[:, 0], records['b'] - truth[:, 1])
        claimed[:, 0] = np.sqrt(variance[:, 0] + variance[:, 1])
        error[:, 1], claimed[:, 1] = np.abs(records['P'] - truth[:, 2]), np.sqrt(variance[:, 3])
        error[:, 2] = np.hypot(records['Qx'] - truth[:, 3], records['Qy'] - truth[:, 4])
        claimed[:, 2] = np.sqrt(variance[:, 4] + variance[:, 5])
    else:  # farthest between the two lines within the circle in the pad
        cos, half = np.cos(records['yaw']), given.array.half_width_x
        error[:, 0] = np.abs(records['a'] * cos - truth[:, 0] * np.cos(truth[:, 1])) + half * (
            np.abs(np.sin(records['yaw'] - truth[:, 1])))
        claimed[:, 0] = np.sqrt(variance[:, 0] * cos**2 + half**2 * variance[:, 2])
        error[:, 1] = np.abs(records['line_force'] - truth[:, 2])
        claimed[:, 1] = np.sqrt(variance[:, 6])
    scale = np.array([1.0, given.force, given.force])
    return error / scale, claimed / scale


def judge(given, records):
    """Shares of frames refused and wrong, and the RMS errors of those of the right type."""
    error, claimed = errors(given, records)
    valid, right = records['valid'], records['type'] == given.kind
    off = [(error > least) & (error > times * claimed) for least, times in LIMITS]
    wrong = valid & (~right | np.any(off, axis=(0, 2)))
    told = wrong & ((records['flags'] & int(Reason.FORCE_MISMATCH)) > 0)
    used = error[valid & right]
    rms = np.sqrt((used**2).mean(axis=0)) if len(used) >= 10 else np.full(3, np.nan)
    return {'refused': float(1.0 - valid.mean()), 'wrong': float(wrong.mean()),
            'wrong_but_told': float(told.mean()), 'rms_place_m': float(rms[0]),
            'rms_force': float(rms[1]), 'rms_shear': float(rms[2])}


def fault_map(count, few, rng, progress):
    """Part (e): every method under every fault; `few` frames for the slow closed forms."""
    rows = []
    for kind in (ContactType.POINT, ContactType.LINE):
        for fault in FAULTS:
            progress.step(f'{kind.name.lower()}: {fault.name}')
            for level in fault.levels:
                given = fault.make(kind, count, rng, level)
                for method, options in METHODS.items():
                    part = given
                    if 'method' in options:
                        part = replace(given, frames=given.frames[:few], truth=given.truth[:few])
                    rows.append({'contact': kind.name.lower(), 'fault': fault.name,
                                 'level': level, 'method': method,
                                 **judge(part, estimates(part, options))})
    return rows


STRANGERS = {'edge': ('auto', 'point'), 'point with shear': ('auto', 'line'), **dict.fromkeys(
    ('two points', 'flat disc', 'corner', 'end of an edge'), ('auto', 'point', 'line'))}


def wrong_type(count, few, rng, progress):
    """Part (e), wrong contact type: share of valid estimates of what the model is not."""
    rows = []
    for name, models in STRANGERS.items():
        progress.step(f'wrong type: {name}')
        right = scenes.SCENES[name][1]
        clean_pictures = scenes.pictures(name, count, rng)
        given = noisy(ContactType.POINT, np.zeros((count, 5)), rng, pictures=clean_pictures)
        for model in models:
            for method, options in METHODS.items():
                part = replace(given, frames=given.frames[:few]) if 'method' in options else given
                records = estimates(part, options, model)
                rows.append({
                    'scene': name, 'model': model, 'method': method,
                    'refused': float(1.0 - records['valid'].mean()),
                    'wrong': float((records['valid'] & (records['type'] != right)).mean())})
    return rows
