"""Every remedy beside the figure that it was said to reach, and what the fault does without it."""

import numpy as np

from benchmarks.contact.cases import faults
from benchmarks.contact.measure.limits import estimates
from benchmarks.contact.methods.peers import numpy_gauss_newton
from tactile_sensing.contact.load_fits import fit_loads
from tactile_sensing.half_space.layers import Layer
from tactile_sensing.thesis.point_moments import basic, MomentFlag
from tactile_sensing.types.contact import ContactType, line_offsets, RECORD

POINT, LINE = ContactType.POINT, ContactType.LINE


def plain(given):
    """Records of the bare fit, which takes the frames as they are; a line without shear."""
    layers = (Layer('zz', given.depth, given.noise),)
    fit = fit_loads(given.kind, given.frames[:, None], given.array, layers,
                    shear=given.kind == POINT)
    if given.kind == LINE:
        return _records(LINE, fit['converged'], x=fit['rho'] * np.cos(fit['yaw']),
                        y=fit['rho'] * np.sin(fit['yaw']), yaw=fit['yaw'],
                        line_force=fit['force'])
    return _records(POINT, fit['converged'], x=fit['a'], y=fit['b'], normal_force=fit['force'],
                    shear_force_x=fit['shear_x'], shear_force_y=fit['shear_y'])


def _records(kind, valid, **columns):
    records = np.zeros(len(valid), RECORD)
    records['type'], records['valid'] = kind, valid
    for name, column in columns.items():
        records[name] = column
    return records


def place_errors(given, records):
    """Errors of points along x, and of lines across them [m]."""
    if given.kind == POINT:
        return records['x'] - given.truth['x']
    return line_offsets(records) - line_offsets(given.truth)


def rms(given, records, *names):
    """RMS errors of the valid estimates: PLACE [mm], P and Qx [% of the force]."""
    valid = records['valid'] & (records['type'] == given.kind)
    errors = [1e3 * place_errors(given, records) if name == PLACE else
              100.0 / given.force * (records[name] - given.truth[name]) for name in names]
    return [float(np.sqrt(np.mean(error[valid]**2))) for error in errors]


def _figures(values, *texts):
    return ', '.join(text.format(value) for value, text in zip(values, texts, strict=True))


PLACE, FORCE, SHEAR = 'x', 'normal_force', 'shear_force_x'
_X, _P, _QX = 'x {:.3f} mm', 'P {:.2f} %', 'Qx {:.1f} %'


def remedies(count, rng, progress):
    """Rows of fault, effect if ignored, remedy, effect then: measured and as said before."""
    progress.step('remedies')
    rows = []

    def row(fault, ignored, remedy, mended, said, said_mended):
        rows.append({'fault': fault, 'ignored': ignored, 'remedy': remedy, 'mended': mended,
                     'said_ignored': said, 'said_mended': said_mended})

    def bare_and_mended(fault, given, remedy, said, said_mended, *names):
        texts = [{PLACE: _X, FORCE: _P, SHEAR: _QX}[name] for name in names]
        row(fault, _figures(rms(given, plain(given), *names), *texts), remedy,
            _figures(rms(given, estimates(given, {}), *names), *texts),
            said, said_mended)

    bare_and_mended('none', faults.sample(POINT, count, rng), 'none',
                    'bound: x 0.023 mm, P 0.55 %, Qx 3.7 %', 'the same', PLACE, FORCE, SHEAR)
    bare_and_mended('baseline drift, 3 % of the peak', faults.drift(POINT, count, rng, 3.0),
                    'median of the unloaded tactels', 'P 8 %, Qx 17 %', 'P 0.6 %, Qx 3.8 %',
                    FORCE, SHEAR)
    bare_and_mended('10 % dead tactels, not listed', faults.dead(POINT, count, rng, 10.0),
                    'Tukey weights', 'x 0.29 mm, P 14 %', 'x 0.03 mm, P 0.8 %', PLACE, FORCE)
    given = faults.dead_nan(POINT, count, rng, 10.0)
    lost = np.isnan(given.frames.sum(axis=(1, 2))).mean()
    row('10 % NaN tactels', f'moments NaN in {100 * lost:.0f} % of frames', 'weight 0',
        _figures(rms(given, estimates(given, {}), PLACE, FORCE), _X, _P),
        'moments give NaN', 'weight 0')
    bare_and_mended('saturation at 70 % of the peak', faults.full_scale(POINT, count, rng, 70.0),
                    'drop them', 'P 12 %, Qx 20 %', 'P 0.8 %, Qx 4.4 %', FORCE, SHEAR)
    bare_and_mended('threshold at 5 % of the peak', faults.threshold(POINT, count, rng, 5.0),
                    'drop the zeros', 'Qx 7.7 %', 'Qx 4.7 %', SHEAR)
    _depth_and_patch(count, rng, row)
    given = faults.noisy(POINT, faults.draw(POINT, count, rng, (2.0, 4.0)), rng)
    place, *_ = numpy_gauss_newton(given.frames[:, None], steps=2).T
    two = _records(POINT, np.ones(count, bool), x=place)
    found = estimates(given, {})
    row('shear of 2 to 4 P', 'after two steps ' + _figures(rms(given, two, PLACE), _X),
        'steps until the place rests', _figures(rms(given, found, PLACE), _X)
        + f', refused {100 * (1 - found["valid"].mean()):.1f} %', 'two steps too few',
        'four steps')
    given = faults.shear(LINE, count, rng, 0.3)
    bare_and_mended('line with shear of 0.3 P', given, 'fit the fourth parameter',
                    'across it 0.2 mm', 'none', PLACE)
    _closed_form_and_noise(count, rng, row)
    return rows


def _depth_and_patch(count, rng, row):
    given = faults.sample(POINT, count, rng)
    [right] = rms(given, estimates(given, {}), FORCE)
    given = faults.wrong_depth(POINT, count, rng, 5.0)
    found = force, _ = rms(given, estimates(given, {'fit_depth': True}), FORCE, SHEAR)
    row('depth wrong by 5 %', _figures(rms(given, plain(given), FORCE, SHEAR), _P, _QX),
        'fit the depth too', _figures(found, _P, _QX) + f', P × {force / right:.2f}',
        'P 5 %, Qx 5–6 %', 'P × 1.5')
    given = faults.patch(POINT, count, rng, 1.0)
    bare, found = plain(given), estimates(given, {})
    valid = found['valid'] & (found['type'] == POINT)
    off = 100.0 * (found[FORCE] - given.truth[FORCE])[valid]
    row('Hertz patch of 1 mm', 'P {:+.1f} %, false Qx {:.1f} %'.format(
        100.0 * np.mean(bare[FORCE][bare['valid']] - 1.0), *rms(given, bare, SHEAR)),
        'fit the patch too',
        'P {:+.1f} % ± {:.1f} %, Qx {:.1f} %'.format(
            off.mean(), off.std(), *rms(given, found, SHEAR)),
        'P −7.7 %, false Q 4 %', 'no figure')


def _closed_form_and_noise(count, rng, row):
    given = faults.sample(POINT, count, rng)
    layers = (Layer('zz', given.depth, given.noise),)
    negative = MomentFlag.NEGATIVE_DISCRIMINANT_X | MomentFlag.NEGATIVE_DISCRIMINANT_Y
    share = np.mean([bool(basic(frame[None], given.array, layers).flags & negative)
                     for frame in given.frames[:500]])
    refused = 1.0 - estimates(given, {})['valid'].mean()
    row('Δ < 0 in the closed form', f'{100 * share:.0f} % of frames', 'the fit has no Δ',
        f'refused {100 * refused:.1f} %', '50 % of frames', 'not needed')
    texts = [], []
    for decibels in (15.0, 12.0):
        given = faults.noise(POINT, 4 * count, rng, decibels)
        for text, options in zip(texts, ({'min_snr': 0.0}, {}), strict=True):
            found = estimates(given, options)
            far = np.hypot(*(found[name] - given.truth[name] for name in 'xy')) > 1e-3
            wrong = found['valid'] & (far | (found['type'] != POINT))
            text.append('{:.0f} dB: valid {:.1f} %, off by 1 mm {:.2f} %'.format(
                decibels, 100.0 * found['valid'].mean(), 100.0 * wrong.mean()))
    row('little SNR', '; '.join(texts[0]), 'refuse below 16 dB', '; '.join(texts[1]),
        'under 15 dB 1–20 % of frames off by 1 mm', 'refused')
