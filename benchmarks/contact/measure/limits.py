"""Part (e) of the contact benchmark: what every method makes of every fault."""

from dataclasses import replace

import numpy as np

from benchmarks.contact.cases import scenes
from benchmarks.contact.cases.faults import FAULTS, LOAD, noisy
from tactile_sensing.contact.estimator import ContactEstimator, EstimatorConfig
from tactile_sensing.types.contact import ContactType, line_offsets, Reason, ROW
from tactile_sensing.types.image import Layer

METHODS = {'fit': {}, 'fit with depth': {'fit_depth': True},
           'compensated': {'method': 'compensated'}, 'moments': {'method': 'moments'}}
# What makes a valid estimate wrong, for place [m], force and shear [share of the force]: off by
# more than so much and so many of the standard deviations that it claims itself, either way.
LIMITS = tuple((np.array(least)[:, None], np.array(times)[:, None]) for least, times in (
    ((1e-3, 0.1, np.inf), (0.0, 3.0, 0.0)), ((1e-4, 0.02, 0.1), (5.0, 5.0, 5.0))))


def estimates(given, options, model='auto'):
    """Records of the estimator for a sample."""
    layer = Layer(
        'zz', given.depth, None, given.full_scale, given.noise, floor=given.floor)
    estimator = ContactEstimator(EstimatorConfig(model=model, tactel='point', **options))
    return estimator.estimate_batch(given.frames, given.array, (layer,))


def errors(given, records):
    """Errors of place, force and shear, shape (3, N), see LIMITS, and their claimed deviations."""
    nothing, truth = np.full(len(records), np.nan), given.truth
    variance = {name: records['covariance'][:, i, i] for name, i in ROW._asdict().items()}
    shear, claimed_shear = nothing, nothing
    if given.kind == ContactType.POINT:
        place = np.hypot(records['x'] - truth['x'], records['y'] - truth['y'])
        claimed_place = np.sqrt(variance['x'] + variance['y'])
        force = records['normal_force'] - truth['normal_force']
        claimed_force = np.sqrt(variance['normal_force'])
        shear = np.hypot(*(records[name] - truth[name]
                           for name in ('shear_force_x', 'shear_force_y')))
        claimed_shear = np.sqrt(variance['shear_force_x'] + variance['shear_force_y'])
    else:  # farthest between the two lines within the circle in the pad
        half = given.array.half_width_x
        place = np.abs(line_offsets(records) - line_offsets(truth)) + half * (
            np.abs(np.sin(records['yaw'] - truth['yaw'])))
        claimed_place = np.sqrt(variance['x'] + variance['y'] + half**2 * variance['yaw'])
        force = records['line_force'] - truth['line_force']
        claimed_force = np.sqrt(variance['line_force'])
    scale = np.array([[1.0], [given.force], [given.force]])
    return (np.array([place, np.abs(force), shear]) / scale,
            np.array([claimed_place, claimed_force, claimed_shear]) / scale)


def judge(given, records):
    """Shares of frames refused and wrong, and the RMS errors of those of the right type."""
    error, claimed = errors(given, records)
    valid, right = records['valid'], records['type'] == given.kind
    off = [(error > least) & (error > times * claimed) for least, times in LIMITS]
    wrong = valid & (~right | np.any(off, axis=(0, 1)))
    told = wrong & ((records['reasons'] & int(Reason.SKIN_MISMATCH)) > 0)
    used = error[:, valid & right]
    place, force, shear = np.sqrt((used**2).mean(axis=1)) if used.shape[1] >= 10 else (np.nan,) * 3
    return {'refused': float(1.0 - valid.mean()), 'wrong': float(wrong.mean()),
            'wrong_but_told': float(told.mean()), 'rms_place_m': float(place),
            'rms_force': float(force), 'rms_shear': float(shear)}


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
    ('two points', 'flat disc', 'corner'), ('auto', 'point', 'line'))}


def wrong_type(count, few, rng, progress):
    """Part (e), wrong contact type: share of valid estimates of what the model is not."""
    rows = []
    for name, models in STRANGERS.items():
        progress.step(f'wrong type: {name}')
        _, right = scenes.SCENES[name]
        clean_pictures = scenes.pictures(name, count, rng)
        given = noisy(ContactType.POINT, np.zeros(count, LOAD), rng, pictures=clean_pictures)
        for model in models:
            for method, options in METHODS.items():
                part = replace(given, frames=given.frames[:few]) if 'method' in options else given
                records = estimates(part, options, model)
                rows.append({
                    'scene': name, 'model': model, 'method': method,
                    'refused': float(1.0 - records['valid'].mean()),
                    'wrong': float((records['valid'] & (records['type'] != right)).mean())})
    return rows
