"""Parts (a), (b) and (c) of the contact benchmark: speed, accuracy, Tables 2.4 and 3.3 again."""

from functools import partial
import time

import numpy as np

from benchmarks.contact.cases import loads as cases
from benchmarks.contact.methods import estimators as methods
from benchmarks.contact.methods import peers as peer

DECIBELS = 40.0
LEVELS = (20.0, 30.0, 40.0, 50.0, 60.0)
TABLE_24 = {'case 1': (1.0, 0.3, 0.1), 'case 2': (11.0, 0.3, 0.1), 'case 3': (11.0, 0.3, 0.5)}
TABLE_24_LEVELS = (None, 60.0, 50.0, 40.0, 30.0)
TURN = 0.03  # s
POSITIONS = 14  # 0 to 13 mm; the thesis' twelve are 0 to 11 mm
TABLE_33 = {'case 1': (3.8, 12.0, 1.29), 'case 2': (2.5, 18.6, 0.96), 'case 3': (2.2, 21.5, 0.43)}


def least_time(function, *, budget=0.15, repeats=5):
    """Processor time of one call [s]: least of several repeats within a budget [s]."""
    function()
    start = time.thread_time()
    function()
    calls = max(1, int(budget / repeats / max(time.thread_time() - start, 1e-7)))
    best = np.inf
    for _ in range(repeats):
        start = time.thread_time()
        for _ in range(calls):
            function()
        best = min(best, (time.thread_time() - start) / calls)
    return best


def accuracy(method, contacts, frames, decibels):
    """RMS error, its ratio to the Cramer-Rao bound (geometric mean too), share refused."""
    found = method.run(frames)
    done = np.isfinite(found[:, :2]).all(axis=1)  # the place
    given = np.isfinite(found[done]).all(axis=0)
    error = (found - contacts.truth)[done][:, given]
    bound = (contacts.bound * contacts.noise(decibels)[:, None])[done][:, given]
    rms = np.sqrt((error**2).mean(axis=0))
    ratio = rms / np.sqrt((bound**2).mean(axis=0))
    names = [name for name, is_given in zip(contacts.names, given, strict=True) if is_given]
    return {'rms': dict(zip(names, rms.tolist(), strict=True)), 'ratios': ratio.tolist(),
            'ratio': float(np.exp(np.log(ratio).mean())), 'refused': float(1.0 - done.mean())}


def time_per_frame(method, frames, *, share):
    """Seconds of a single call, mean over 20 frames, and batched; None where there is none."""
    single = batched = None
    if method.estimate:
        some = frames[:20]
        single = least_time(lambda: [method.estimate(frame) for frame in some],
                            budget=share) / len(some)
    if method.batch:
        batched = least_time(lambda: method.batch(frames[:1000]), budget=share) / min(
            len(frames), 1000)
    return single, batched


def speed_and_accuracy(samples, peers, rng, progress, budget):
    """Part (a): every method at 40 dB."""
    rows = []
    for model in (1, 2, 3):
        contacts = cases.random_points(samples, model, rng)
        noise = float(contacts.noise(DECIBELS)[0])
        frames = contacts.noisy(DECIBELS, rng)
        for method in methods.point_methods(model, noise, peers):
            progress.step(method.label)
            rows.append(_row(method, contacts, frames, budget))
    contacts = cases.random_lines(samples, rng)
    frames = contacts.noisy(DECIBELS, rng)
    for method in methods.line_methods(float(contacts.noise(DECIBELS)[0]), peers):
        progress.step(f'line, {method.label}')
        rows.append(_row(method, contacts, frames, budget))
    return rows


def contest(rounds, peers, rng, progress):
    """
    Seconds per frame of those whose ratio of time matters, the least of all rounds.

    They take turns, so that a busy moment of the machine meets all; in each turn a function
    runs for TURN seconds, so that its frames are in the cache, and the least counts.
    """
    progress.step('ratios of time')
    points, lines = cases.random_points(1000, 1, rng), cases.random_lines(20, rng)
    many, some = points.noisy(DECIBELS, rng), lines.noisy(DECIBELS, rng)
    of_point = {m.name: m for m in methods.point_methods(
        1, float(points.noise(DECIBELS)[0]), peers)}
    of_line = {m.name: m for m in methods.line_methods(
        float(lines.noise(DECIBELS)[0]), peers)}
    runs = {'six moments, batched': (lambda: peer.six_moments(many), len(many))}
    for name in ('fit', 'numpy Gauss-Newton', 'tuned numpy Gauss-Newton'):
        runs[f'point, {name}, batched'] = partial(of_point[name].batch, many), len(many)
    for kind, methods_of, frames, names in (
            ('point', of_point, many[:20], ('fit', 'estimator, fit')),
            ('line', of_line, some, ('fit', 'estimator, fit', 'cv2.fitLine',
                                     'skimage orientation'))):
        for name in names:
            if name in methods_of:
                runs[f'{kind}, {name}'] = partial(_each, methods_of[name].estimate, frames), 20
    if 'cv2' in peers:
        call = partial(peer.fit_line_call, peers['cv2'])
        runs['line, cv2.fitLine alone'] = partial(
            _each, call, [peer.line_points(frame) for frame in some]), 20
    best = dict.fromkeys(runs, np.inf)
    for _ in range(rounds):
        for name, (run, count) in runs.items():
            end = time.thread_time() + TURN
            while (start := time.thread_time()) < end:
                run()
                best[name] = min(best[name], (time.thread_time() - start) / count)
    return best


def _each(function, items):
    for item in items:
        function(item)


def _row(method, contacts, frames, budget):
    single, batched = time_per_frame(method, frames, share=budget)
    return {'contact': method.kind, 'method': method.name, 'model': method.model,
            'label': method.label, 'peer': method.peer, 'single_s': single,
            'batched_s': batched, **accuracy(method, contacts, frames, DECIBELS)}


def fit_against_noise(samples, rng, progress):
    """RMS error over the bound of every fit from 20 to 60 dB, and the noise-free failures."""
    rows = []
    for model in (1, 2, 3):
        contacts = cases.random_points(samples, model, rng)
        for level in LEVELS:
            progress.step(f'fit, model {model}, {level:.0f} dB')
            fit = methods.fit_method(model, float(contacts.noise(level)[0]))
            rows.append({'contact': 'point', 'model': model, 'decibels': level, **accuracy(
                fit, contacts, contacts.noisy(level, rng), level)})
    contacts = cases.random_lines(samples, rng)
    for level in LEVELS:
        progress.step(f'line fit, {level:.0f} dB')
        fit = methods.line_fit_method(float(contacts.noise(level)[0]))
        rows.append({'contact': 'line', 'model': 1, 'decibels': level, **accuracy(
            fit, contacts, contacts.noisy(level, rng), level)})
    return rows


def noise_free_loads(samples, rng, progress):
    """Fit of random loads up to 0.5 mm from the border: failures and the largest error."""
    rows = []
    for model in (1, 2, 3):
        progress.step(f'noise-free loads, model {model}')
        failures, largest, count = 0, 0.0, 0
        while count < samples:
            size = min(1000, samples - count)
            contacts = cases.random_points(size, model, rng, reach=12.5e-3)
            fit = methods.fit_method(model, 1.0)
            error = np.abs(fit.run(contacts.clean) - contacts.truth)[:, :2].max(axis=1)
            failures += int(np.count_nonzero(~(error < 1e-4)))
            largest = max(largest, float(np.nanmax(error)))
            count += size
        rows.append({'model': model, 'loads': count, 'failures': failures,
                     'largest_error_m': largest})
    return rows


def table_24(draws, rng, progress):
    """
    Part (b): side of the square within which +-1 tactel and +-1 N hold [mm].

    With noise, at every position for nine draws of ten; ten times the draws where a method
    takes batches.
    """
    rows = []
    for name, (force, ratio_x, ratio_y) in TABLE_24.items():
        for level in TABLE_24_LEVELS:
            progress.step(f'Table 2.4, {name}, {"no noise" if level is None else level}')
            noise = force * cases.POINT_PEAK * 10.0 ** (-(160.0 if level is None else level) / 20)
            for method in (method for model in (1, 2, 3) for method in (
                    methods.fit_method(model, noise), *methods.closed_forms(model, noise))):
                tries = draws * (10 if method.batch else 1)
                side = _sensible_side(
                    method, force, (ratio_x * force, ratio_y * force), level,
                    1 if level is None else tries, rng)
                rows.append({'case': name, 'decibels': level, 'method': method.name,
                             'model': method.model, 'side_mm': side})
    return rows


def _sensible_side(method, force, shear, level, draws, rng):
    """Rings of growing distance from the centre until a position fails."""
    for k in range(POSITIONS):
        ring = [(k, i) for i in range(k + 1)] + [(i, k) for i in range(k)]
        truth = np.array([(1e-3 * a, 1e-3 * b, force, *shear) for a, b in ring])
        contacts = cases.point_contacts(truth, method.model)
        right = np.zeros(len(ring), dtype=int)
        for _ in range(draws):
            frames = contacts.clean if level is None else contacts.noisy(level, rng)
            error = np.abs(method.run(frames) - truth)
            right += (error < [1e-3, 1e-3, 1.0, 1.0, 1.0]).all(axis=1)  # false for NaN
        if right.min() < 0.9 * draws:
            return 2 * (k - 1) if k else 0
    return 2 * (POSITIONS - 1)


def table_33(draws, peers, rng, progress):
    """Part (c): the thesis' three edges, noise-free and at 40 dB."""
    rows = []
    pitch = cases.LINE_ARRAY.pitch_x
    for name, (tactels, degrees, force) in TABLE_33.items():
        progress.step(f'Table 3.3, {name}')
        yaw = -np.radians(degrees)
        contacts = cases.line_contacts([[tactels * pitch * np.cos(yaw), yaw, force]] * draws)
        noise = float(contacts.noise(DECIBELS)[0])
        noisy = contacts.noisy(DECIBELS, rng)
        for method in methods.line_methods(noise, peers):
            if method.name.startswith('estimator'):
                continue
            [(b, yaw, line_force)] = _as_printed(method.run(contacts.clean[:1]))
            error = _as_printed(method.run(noisy)) - _as_printed(contacts.truth)
            rms_b, rms_yaw, rms_force = np.sqrt((error**2).mean(axis=0))
            rows.append({
                'case': name, 'method': method.name, 'b_tactel': b / pitch,
                'alpha_deg': -np.degrees(yaw), 'force': line_force,
                'rms_b_tactel': rms_b / pitch, 'rms_alpha_deg': np.degrees(rms_yaw),
                'rms_force_percent': 100.0 * rms_force / force})
    return rows


def _as_printed(lines):
    """Lines (N, 3) by the thesis' b, where they cross y = 0, in place of their offset."""
    offset, yaw, force = lines.T
    return np.column_stack([offset / np.cos(yaw), yaw, force])
