"""Skin on bone by finite elements, and what each rung of the ladder costs and saves."""

import numpy as np

from benchmarks.contact.cases import faults
from benchmarks.contact.cases.real_skin import all_profiles, ARRAYS, estimates, judge, pictures
from benchmarks.contact.measure.limits import estimates as estimated
from benchmarks.contact.measure.remedies import place_errors, plain
from tactile_sensing.half_space.kernels import add_segment
from tactile_sensing.types.contact import ContactType, line_offsets
from tactile_sensing.types.image import Layer


def finite_elements(count, rng, progress):
    """Shares of frames of every object and backing: right, wrong with confidence, refused."""
    rows = []
    groups: dict[tuple, list] = {}
    for profile in all_profiles():
        groups.setdefault((str(profile['kind']), float(profile['radius']),
                           float(profile['backing'])), []).append(profile)
    for (kind, radius, backing), profiles in groups.items():
        progress.step(f'finite elements, {kind}')
        row = {'object': kind, 'radius_mm': 1e3 * radius, 'bone_mm': 1e3 * backing}
        for name in ('layer', 'half-space'):
            judged, told = [], []
            for profile in profiles:
                for array in ARRAYS.values():
                    frames, places, noise = pictures(profile, array, count, rng)
                    layer = None if name == 'layer' else Layer(
                        'zz', 2e-3, np.empty(0), noise_std=noise)
                    found = estimates(profile, array, frames, noise, layer)
                    judged.append(judge(profile, places, found))
                    told.append(np.mean(~found['valid'] | (found['patch'] > 0.0)))
            row[name] = {key: _mean([getattr(it, key) for it in judged])
                         for key in ('right', 'wrong', 'refused', 'claims', 'force_claims')}
            row[name]['force'] = _mean([abs(it.force) for it in judged])
            row[name]['patch_or_refused'] = float(np.mean(told))
        rows.append(row)
    return rows


def _mean(values):
    known = [value for value in values if np.isfinite(value)]
    return float(np.mean(known)) if known else float('nan')


def _ended(count, rng):
    """Edges that end within the pad, in a half-space."""
    given = faults.sample(ContactType.LINE, count, rng)
    frames = np.zeros(given.frames.shape)
    for frame, truth in zip(frames, given.truth, strict=True):
        along = rng.uniform(-4e-3, 8e-3)
        rho, yaw = line_offsets(truth), truth['yaw']
        start, end = (np.array([rho * np.cos(yaw) - at * np.sin(yaw),
                                rho * np.sin(yaw) + at * np.cos(yaw)]) for at in (-0.1, along))
        add_segment(frame, given.array.x, given.array.y, given.depth, *start, *end,
                    faults.LINE_FORCE, faults.LINE_FORCE)
    return faults.noisy(ContactType.LINE, given.truth, rng, pictures=frames)


def ladder(count, rng, progress):
    """Errors of the sharp fit alone and of the ladder, where it is needed and where not."""
    cases = []
    for kind, name in ((ContactType.POINT, 'point'), (ContactType.LINE, 'line')):
        cases.append((f'sharp {name}', faults.noisy(
            kind, faults.draw(kind, count, rng, (0.0, 0.0)), rng)))
        cases += [(f'{name}, patch of {size:g} mm', faults.patch(kind, count, rng, size))
                  for size in (0.5, 1.0, 1.5)]
    cases.append(('line that ends on the pad', _ended(count, rng)))
    rows = []
    for name, given in cases:
        progress.step(f'ladder, {name}')
        force = 'normal_force' if given.kind == ContactType.POINT else 'line_force'
        bare, found = plain(given), estimated(given, {})
        row = {'contact': name}
        for label, records in (('sharp', bare), ('ladder', found)):
            valid = records['valid'] & (records['type'] == given.kind)
            off = records[force] / given.force - 1.0
            row[label] = {'place_mm': _rms(1e3 * place_errors(given, records)[valid]),
                          'force': _rms(off[valid]), 'refused': float(1.0 - valid.mean())}
        valid = found['valid']
        row['patch'] = float(np.mean(found['patch'][valid] > 0.0)) if valid.any() else 0.0
        row['ends'] = float(np.mean(np.isfinite(found['start'] + 0.0)[valid]
                                    | np.isfinite(found['end'])[valid])) if valid.any() else 0.0
        rows.append(row)
    return rows


def _rms(values):
    return float(np.sqrt(np.mean(values**2))) if len(values) else float('nan')
