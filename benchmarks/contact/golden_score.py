"""
Judge of answers to golden images: right and confidently wrong answers, and their claims.

It reads the records of `ContactEstimator.estimate_batch`. Lengths are in m, angles in rad.
"""

from collections import Counter
import time
from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from tactile_sensing.contact.estimator import ContactEstimator
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import INFORMATION, Reason
from tactile_sensing.types.image import Layer

POINT, LINE = 1, 2  # ContactType
NEAR, FAR = 1e-4, 1e-3  # m: always accepted up to NEAR; always wrong from FAR on
TURNED = np.radians(3.0)
FORCE_OFF, FORCE_NEAR = 0.1, 0.02  # shares of the force
CHUNK = 10  # images that are timed together


class Answers(NamedTuple):
    """Records (N,) and the time of each image (N,) [s]."""

    records: np.ndarray
    seconds: np.ndarray

    @property
    def times(self) -> dict:
        """Median time of an image, and mean time of a refused one [us]."""
        valid = self.records['valid'].astype(float)
        mixed = np.unique(valid).size == 2
        parts = np.stack([valid, 1.0 - valid], axis=-1)
        each = nnls(_by_chunk(parts), _by_chunk(self.seconds))[0] if mixed else [
            np.nan, np.nan if valid.all() else self.seconds.mean()]
        # Of too few refused images the least squares leave nothing: no time.
        return {'us': 1e6 * np.median(self.seconds), 'us_refused': 1e6 * each[1] or np.nan}


def _by_chunk(values):
    """Return sums over the images of every chunk that was timed together."""
    return np.add.reduceat(values, np.arange(0, len(values), CHUNK))


def layers_of(arrays: dict, *, known: bool) -> list:
    """Return the layers given to the estimator: the true skin, or only pitch and noise."""
    given = {'full_scale': float(arrays['full_scale']), 'noise_std': float(arrays['noise'])}
    if known:
        given |= {'thickness': float(arrays['thickness']), 'poisson': float(arrays['poisson'])}
    return [Layer(str(component), float(depth) if known else 0.0, np.empty(0), **given)
            for component, depth in zip(arrays['components'], arrays['depths'], strict=True)]


def answered(arrays: dict, *, known: bool, config=None) -> Answers:
    """Estimate every image of a set."""
    frames = np.asarray(arrays['frames'], float)
    array = TactelArray(*frames.shape[2:], float(arrays['pitch_x']), float(arrays['pitch_y']))
    layers, estimator = layers_of(arrays, known=known), ContactEstimator(config)
    estimator.estimate_batch(frames[:2], array, layers)  # compiles
    records, seconds = [], []
    for i in range(0, len(frames), CHUNK):
        begin = time.process_time()
        records.append(estimator.estimate_batch(frames[i:i + CHUNK], array, layers))
        spent = time.process_time() - begin
        seconds += [spent / len(records[-1])] * len(records[-1])
    return Answers(np.concatenate(records), np.array(seconds))


class Errors(NamedTuple):
    """Errors (N,) and their claims; the place is that of a point, or across a line."""

    place: np.ndarray  # m
    place_sd: np.ndarray
    normalised: np.ndarray  # (N, K): errors of place (and yaw) over their claims
    turned: np.ndarray  # rad
    force: np.ndarray  # share of the force
    force_sd: np.ndarray
    named: dict  # errors of parameters that have bounds


def _sd(variance):
    return np.sqrt(np.where(variance > 0.0, variance, np.nan))


def _point_errors(arrays, records):
    covariance = records['covariance']
    dx, dy = (records[name] - arrays[name] for name in 'xy')
    sd = _sd(np.diagonal(covariance, axis1=1, axis2=2))
    named = {'x': dx, 'y': dy}
    force = np.asarray(arrays['force'], float) if 'force' in arrays else np.full(len(dx), np.nan)
    named['normal_force'] = records['normal_force'] - force
    for axis in 'xy':
        if f'shear_{axis}' in arrays:
            named[f'shear_force_{axis}'] = records[
                f'shear_force_{axis}'] - arrays[f'shear_{axis}']
    return Errors(np.hypot(dx, dy), np.maximum(sd[:, 0], sd[:, 1]),
                  np.stack([dx / sd[:, 0], dy / sd[:, 1]], axis=-1), np.zeros(len(dx)),
                  named['normal_force'] / force, sd[:, 3] / force, named)


def _line_errors(arrays, records):
    """Return errors at the middle of the pressed part: across the line there, and of its yaw."""
    yaw, covariance = records['yaw'], records['covariance']
    n = np.stack([np.cos(yaw), np.sin(yaw)], axis=-1)
    along = np.stack([-np.sin(yaw), np.cos(yaw)], axis=-1)
    foot, block = np.stack([records['x'], records['y']], axis=-1), covariance[:, :3, :3]
    middle = np.stack([arrays['x'], arrays['y']], axis=-1)
    lever = ((middle - foot) * along).sum(axis=-1)
    # off = (middle - foot) . n(yaw): derivatives by foot and yaw.
    gradient = np.concatenate([-n, lever[:, None]], axis=-1)
    variance = np.einsum('ni,nij,nj->n', gradient, block, gradient)
    off = ((middle - foot) * n).sum(axis=-1)
    turned = np.remainder(yaw - arrays['yaw'] + 0.5 * np.pi, np.pi) - 0.5 * np.pi
    flipped = np.where(np.cos(yaw - arrays['yaw']) < 0.0, -1.0, 1.0)
    force = (np.asarray(arrays['force'], float) if 'force' in arrays
             else np.full(len(yaw), np.nan))
    force_error = records['line_force'] - force
    named = {'across': off, 'yaw': turned, 'line_force': force_error,
             'rho': flipped * (foot * n).sum(axis=-1) - arrays['rho']}
    sd = _sd(variance)
    return Errors(np.abs(off), sd, np.stack([off / sd, turned / _sd(block[:, 2, 2])], axis=-1),
                  turned, force_error / force, _sd(covariance[:, 6, 6]) / force, named)


def _rms(values):
    values = np.asarray(values)
    values = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(values**2))) if values.size else np.nan


def _verdict(errors, typed, with_force):
    """
    Return which places and directions are right, and which forces are wrong: (N,) each.

    A force is wrong if its error exceeds the limits and its claim.
    """
    sd = np.nan_to_num(errors.place_sd)
    right = typed & (errors.place <= np.maximum(NEAR, 5.0 * sd)) & (errors.place < FAR)
    right &= np.abs(errors.turned) <= TURNED
    off, claimed = np.abs(errors.force), np.nan_to_num(errors.force_sd)
    wrong_force = with_force & np.isfinite(off) & (
        ((off > FORCE_OFF) & (off > 3.0 * claimed)) | ((off > FORCE_NEAR) & (off > 5.0 * claimed)))
    return right, wrong_force


def refusals(records) -> str:
    """Return the three most common reasons of invalid images, with their shares of all images."""
    found: Counter = Counter()
    for value in records['reasons'][~records['valid']]:
        names = [flag.name for flag in Reason if int(value) & flag & ~INFORMATION]
        found['+'.join(names) or 'no reason'] += 1
    return ', '.join(f'{name} {100 * count / len(records):.0f}%'
                     for name, count in found.most_common(3))


def score(arrays: dict, records: np.ndarray) -> dict:
    """Return the table's row for one set and the records of its images, shape (N,)."""
    kind, valid = str(arrays['kind']), records['valid'].astype(bool)
    row = {'n': len(records), 'valid': valid.mean(), 'refused': 1.0 - valid.mean(),
           'reasons': refusals(records)}
    spread = {} if 'site' not in arrays else site_spread(arrays, records)
    if kind not in ('point', 'line') or 'x' not in arrays:
        typed = valid & (records['type'] == {'point': POINT, 'line': LINE}.get(kind, -1))
        bad = valid & ~typed
        if 'yaw' in arrays and typed.any():
            turned = np.remainder(records['yaw'] - arrays['yaw'] + np.pi / 2, np.pi) - np.pi / 2
            bad |= typed & (np.abs(turned) > TURNED)
        return {**row, 'answered': typed.mean(), 'right': (typed & ~bad).mean(),
                'wrong': bad.mean(), **spread}
    errors = (_point_errors if kind == 'point' else _line_errors)(arrays, records)
    typed = valid & (records['type'] == (POINT if kind == 'point' else LINE))
    with_force = typed & records['force_valid']
    right, wrong_force = _verdict(errors, typed, with_force)
    good, forced = right & ~wrong_force, right & with_force
    row |= {'answered': typed.mean(), 'right': right.mean(), 'forced': with_force.mean(),
            'wrong': (valid & ~good).mean(), 'wrong_force': (right & wrong_force).mean(),
            'place_um': 1e6 * _rms(errors.place[right]),
            'claim_place': max((_rms(part) for part in errors.normalised[right].T[
                :2 if kind == 'point' else 1]), default=np.nan),
            'claim_yaw': np.nan if kind == 'point' else _rms(errors.normalised[right, 1]),
            'force_error': _rms(errors.force[forced]),
            'force_bias': float(errors.force[forced].mean()) if forced.any() else np.nan,
            'claim_force': _rms((errors.force / errors.force_sd)[forced])}
    if 'crb' in arrays:
        bounds = dict(zip(arrays['crb_names'].astype(str), arrays['crb'].T, strict=True))
        for label, names in (('place', ('x', 'y', 'across')), ('yaw', ('yaw',)),
                             ('force', ('normal_force', 'line_force')),
                             ('shear', ('shear_force_x', 'shear_force_y'))):
            ratios = [_rms((errors.named[name] / bounds[name])[right]) for name in names
                      if name in bounds and name in errors.named]
            row[f'crb_{label}'] = max(ratios, default=np.nan)
    return {**row, **spread}


def site_spread(arrays: dict, records: np.ndarray) -> dict:
    """
    Return the spread of repeated presses, for images without a truth.

    `site` numbers the presses of one place. The spread is relative to the site's median: of a
    point's place, or of a line's yaw. It is also divided by the claims.
    """
    typed, off, over = records['valid'], [], []
    for site in np.unique(arrays['site'][arrays['site'] >= 0]):
        part = records[typed & (arrays['site'] == site)]
        kinds = part['type']
        part = part[kinds == (LINE if 2 * (kinds == LINE).sum() > len(kinds) else POINT)]
        if len(part) < 3:
            continue
        sd = _sd(np.diagonal(part['covariance'], axis1=1, axis2=2))
        if part['type'][0] == POINT:
            for k, name in enumerate('xy'):
                error = part[name] - np.median(part[name])
                off.append(error)
                over.append(error / sd[:, k])
        else:
            turned = np.remainder(part['yaw'] - part['yaw'][0] + np.pi / 2, np.pi)
            over.append((turned - np.median(turned)) / sd[:, 2])
    if not off and not over:
        return {}
    return {'spread_um': 1e6 * _rms(np.concatenate(off)) if off else np.nan,
            'claim_spread': _rms(np.concatenate(over))}


# --------------------------------------------------------------------------------- table

COLUMNS = (('n', 'n', '{:.0f}', 1), ('ans', 'answered', '{:.1f}', 100),
           ('right', 'right', '{:.1f}', 100), ('wrong', 'wrong', '{:.1f}', 100),
           ('wr.F', 'wrong_force', '{:.1f}', 100), ('refus', 'refused', '{:.1f}', 100),
           ('F', 'forced', '{:.0f}', 100), ('um', 'place_um', '{:.1f}', 1),
           ('c.place', 'claim_place', '{:.2f}', 1), ('c.yaw', 'claim_yaw', '{:.2f}', 1),
           ('F err%', 'force_error', '{:.2f}', 100), ('c.F', 'claim_force', '{:.2f}', 1),
           ('/CRB', 'crb_place', '{:.2f}', 1), ('yaw', 'crb_yaw', '{:.2f}', 1),
           ('F', 'crb_force', '{:.2f}', 1), ('shear', 'crb_shear', '{:.2f}', 1),
           ('spread', 'spread_um', '{:.0f}', 1), ('c.spr', 'claim_spread', '{:.2f}', 1),
           ('us', 'us', '{:.0f}', 1), ('us ref', 'us_refused', '{:.0f}', 1))


def _cell(row, name, form, factor):
    value = row.get(name, np.nan)
    return form.format(factor * value) if np.isfinite(value) else ''


def _family(rows):
    """Return the mean of the shares, and the worst of the claims, over the sets of a family."""
    total = sum(row['n'] for row in rows)
    shares = 'answered', 'right', 'wrong', 'wrong_force', 'refused', 'forced'
    found = {name: sum(row['n'] * row.get(name, 0.0) for row in rows) / total for name in shares}
    for name in ('claim_place', 'claim_yaw', 'claim_force', 'crb_place', 'crb_yaw', 'crb_force',
                 'crb_shear', 'claim_spread'):
        found[name] = max((row[name] for row in rows if np.isfinite(row.get(name, np.nan))),
                          default=np.nan)
    for name in ('us', 'us_refused', 'place_um'):
        values = [row[name] for row in rows if np.isfinite(row.get(name, np.nan))]
        found[name] = float(np.median(values)) if values else np.nan
    return {**found, 'n': total, 'reasons': ''}


def families(rows: list[dict]) -> list[dict]:
    """Return the rows of the families of sets (shares: means; claims: the worst)."""
    found: dict = {}
    for row in rows:
        found.setdefault((row['set'].split('/')[0], row['skin']), []).append(row)
    return [{'set': name, 'skin': skin, **_family(part)} for (name, skin), part in found.items()]


def table(rows: list[dict]) -> str:
    """Return a table with one row per set, then one per family."""
    rows = [*rows, *(row | {'set': f'= {row["set"]}'} for row in families(rows))]
    lines = [[f'{row["set"]}{"" if row["skin"] == "known" else " (unknown)"}',
              *(_cell(row, *column[1:]) for column in COLUMNS), row['reasons']] for row in rows]
    lines.insert(0, ['set', *(column[0] for column in COLUMNS), 'refusals'])
    widths = [max(len(line[k]) for line in lines) for k in range(len(lines[0]))]
    return '\n'.join('  '.join(
        text.ljust(width) if k in (0, len(line) - 1) else text.rjust(width)
        for k, (text, width) in enumerate(zip(line, widths, strict=True))).rstrip()
        for line in lines)
