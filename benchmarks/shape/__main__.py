"""
Speed and accuracy of local shape from touch: chapter 4 of the thesis, measured again.

Prints tables, and writes benchmarks/results/shape.json, pictures into docs/ and the tables into
docs/results_shape.md. Times are processor time on one core.
"""

import numpy as np

from benchmarks.harness import run
from benchmarks.shape import cases, claims, methods, thesis
from tactile_shape.local_surface.local_quadric import LocalQuadricConfig
from tactile_shape.thesis.matrix_estimator import fit_matrix, MatrixEstimator
from tactile_shape.types.patch import Kind
from tactile_simulation.scene import load_scene

SPEEDS = (1e-5, 5e-5, 2e-4, 1e-3, 5e-3, 2e-2, 5e-2)  # m/s, Table 4.1
ACROSS = (1e-3, 1e-2, 5e-2)
SWEPT = (cases.PLANE_CASE, cases.CYLINDER_CASE, cases.SPHERE_CASE, cases.TORUS_CASE)
PROBING = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5)  # m/s
WINDOWS = (0.004, 0.008, 0.012, 0.018, 0.024, 0.036)  # m
LOCATION = (0.0, 4e-5, 7e-5, 1.5e-4, 3e-4, 6e-4)  # m
COUNTS = (4, 5, 6, 8, 12, 16, 24, 48)
TRAVELS = (1e-3, 2e-3, 4e-3, 8e-3, 1.2e-2, 1.6e-2, 2.4e-2)  # m
BREADTHS = (0.0, 1e-4, 2.5e-4, 5e-4, 1e-3, 2e-3)  # m
WRONG = 5e-4  # m; a patch with a larger error is wrong


def thesis_figures(trials, rng, progress):
    """Run Figures 4.4 to 4.10: errors over the cross-section, by form, speed and noise."""
    rows = []
    for form, (_, rotation) in thesis.FORMS.items():
        progress.step(f'figures 4.4 to 4.8, {form}')
        for along in SPEEDS:
            for across in ACROSS:
                error = thesis.section_error(
                    thesis.fit(form, thesis.zigzag(along, across, rotation=rotation)))
                rows.append({'form': form, 'along': along, 'across': across, 'noise': '',
                             'low': error.tolist(), 'high': error.tolist(),
                             'most': float(np.abs(error).max())})
        for noisy in ('Vx', 'Vy', 'v'):
            progress.step(f'figures 4.6 to 4.10, {form}, {noisy}')
            for along in SPEEDS:
                error = thesis.noisy_errors(form, along, 1e-2, noisy, trials, rng)
                each = np.abs(error).max(axis=1)
                rows.append({'form': form, 'along': along, 'across': 1e-2, 'noise': noisy,
                             'low': np.nanmin(error, axis=0).tolist(),
                             'high': np.nanmax(error, axis=0).tolist(),
                             'median': float(np.nanmedian(each)),
                             'most': float(np.nanpercentile(each, 95))})
    return rows


def bars(trials, rng, progress):
    """Return errors and kinds of the least model with realistic noise."""
    rows = []
    method = methods.local_quadric()
    for case in cases.CASES:
        progress.step(f'least model, {case.name}')
        errors, found = cases.run(method, case, trials, rng)
        kinds = [patch.kind for patch in found]
        rows.append({'case': case.name, **cases.spread(errors),
                     'right': float(np.mean([kind == case.kind for kind in kinds])),
                     'kinds': {kind.name.lower(): float(np.mean([k == kind for k in kinds]))
                               for kind in Kind},
                     'bar_median': case.median, 'bar_most': case.most, 'bar_right': case.right})
    return rows


def without_noise(progress):
    """Return least, median and largest error over headings, due to the models only."""
    rows = []
    exact = MatrixEstimator(LocalQuadricConfig(position_noise=1e-9))
    for method in (methods.local_quadric(), methods.Stream('surface_matrix, N = 6', exact)):
        progress.step(f'without noise, {method.name}')
        for case in cases.CASES:
            errors = [cases.run(method, case, 1, None, noise=None, heading=heading).errors.item()
                      for heading in np.radians(np.arange(0.0, 180.0, 7.5))]
            rows.append({'method': method.name, 'case': case.name,
                         **cases.spread(np.array(errors)), 'largest': float(np.max(errors))})
    return rows


def error_and_time(trials, rng, progress):
    """Run every method on every surface, with its time per update."""
    rows = []
    for method in methods.compared():
        progress.step(f'error and time, {method.name}')
        points, normals, _ = cases.trial(cases.SPHERE_CASE, rng, length=0.1)
        took = np.min([method.times(points, normals)[100:] for _ in range(5)], axis=0)
        for case in cases.CASES:
            errors, _ = cases.run(method, case, trials, rng)
            rows.append({'method': method.name, 'case': case.name, **cases.spread(errors),
                         'time_median': float(np.median(took)),
                         'time_most': float(np.percentile(took, 95))})
    return rows


def sweeps(trials, rng, progress):
    """Return the error by probing speed, window, location noise and number of contacts."""
    rows = []

    def add(sweep, value, method, case, **options):
        errors, found = cases.run(method, case, trials, rng, **options)
        right = np.mean([patch.kind == case.kind for patch in found])
        rows.append({'sweep': sweep, 'value': value, 'method': method.name, 'case': case.name,
                     'right': float(right), **cases.spread(errors)})

    least = methods.local_quadric()
    for case in SWEPT:
        progress.step(f'sweeps, {case.name}')
        for speed in PROBING:
            for method in (least, methods.surface_matrix()):
                add('probing speed [m/s]', speed, method, case, speed=speed)
        for window in WINDOWS:
            for method in (methods.local_quadric(window=window),
                           methods.surface_matrix(window=window)):
                add('window [m]', window, method, case, length=window + 4e-3)
        for location in LOCATION:
            noise = {**cases.NOISE, 'location': location}
            for method in (methods.local_quadric(location_noise=location),
                           methods.surface_matrix()):
                add('location noise [m]', location, method, case, noise=noise)
        for count in COUNTS:
            add('contacts N', count, methods.surface_matrix(count, name='surface_matrix'), case)
    return rows


def rank_map(progress):
    """Return the parameters that noise-free contacts determine, by motion and their number."""
    progress.step('rank map')
    rows = []
    plane, cylinder, sphere = cases.PLANE_CASE, cases.CYLINDER_CASE, cases.SPHERE_CASE
    for name, case, path in (
            ('plane, zig-zag', plane, {'amplitude': 3e-3}),
            ('cylinder, along the axis', cylinder, {'amplitude': 0.0, 'heading': 0.0}),
            ('cylinder, straight round it', cylinder, {'amplitude': 0.0, 'heading': np.pi / 2}),
            ('cylinder, straight and oblique', cylinder, {'amplitude': 0.0, 'heading': 0.6}),
            ('cylinder, zig-zag', cylinder, {'amplitude': 3e-3, 'heading': np.pi / 2}),
            ('sphere, great circle', sphere, {'amplitude': 0.0}),
            ('sphere, zig-zag', sphere, {'amplitude': 3e-3}), ('pivot', plane, None)):
        least = None
        if path is not None:
            touched = cases.trial(case, np.random.default_rng(0), noise=None, **path)
            patch = methods.local_quadric()(touched.points, touched.normals)
            least = [bool(seen) for seen in patch.seen]
        for count in range(1, 9):
            if path is None:
                lean = 0.1 * np.arange(count)
                points = np.zeros((count, 3))
                normals = np.column_stack([np.sin(lean), 0 * lean, np.cos(lean)])
            else:
                # A zig-zag: contacts alternate between both sides.
                weave = {'wavelength': 16e-3, 'heading': 0.0, **path}
                along = 4e-3 * np.arange(-count + 1, 1)
                side = weave['amplitude'] * (np.arange(count)[::-1] % 2)
                c, s = np.cos(weave['heading']), np.sin(weave['heading'])
                points, normals = case.surface.at(c * along - s * side, s * along + c * side)
            fit = fit_matrix(points, normals)
            rows.append({'motion': name, 'contacts': count, 'rank': fit.rank,
                         'unseen': list(fit.unseen_names), 'least_model_sees': least})
    return rows


def refusals(trials, rng, progress):
    """Return shares of refused and wrong patches, by length and breadth of the path."""
    rows = []
    for method in (methods.local_quadric(), methods.surface_matrix()):
        for case in (cases.CYLINDER_CASE, cases.SPHERE_CASE):
            progress.step(f'refusals, {method.name}, {case.name}')
            for travel in TRAVELS:
                for breadth in BREADTHS:
                    _, found = cases.run(
                        method, case, trials, rng, length=travel, amplitude=breadth,
                        wavelength=8e-3, heading=np.pi / 2)
                    errors = np.array([cases.error_where_seen(p, case) for p in found])
                    rows.append({
                        'method': method.name, 'case': case.name, 'travel': travel,
                        'breadth': breadth, 'refused': float(np.mean(np.isnan(errors))),
                        'both': float(np.mean([p.valid and p.seen.all() for p in found])),
                        'wrong': float(np.mean(errors > WRONG))})
    return rows


def certainty(trials, rng, progress):
    """Return the RMS of error over claim, and the kinds, with errors that are alike."""
    rows = []

    def add(errors, name, kind, found):
        kinds = [patch.kind for patch in found.found if patch.valid]
        rows.append({'errors': errors, 'case': name, 'patches': len(kinds),
                     'score': float(np.sqrt(np.mean(found.scores**2))),
                     'largest': float(np.abs(found.scores).max()),
                     'right': float(np.mean([one == kind for one in kinds]))})

    for alike in claims.ALIKE:
        for case in SWEPT:
            progress.step(f'claims, errors alike over {alike:g} contacts, {case.name}')
            add(f'alike over {alike:g} contacts' if alike else 'independent', case.name, case.kind,
                claims.with_noise(case, alike, trials, rng))
    for scene, kind in claims.SCENES.items():
        progress.step(f'claims, closed loop, {scene}')
        add('closed loop', scene, kind, claims.in_the_loop(load_scene(f'surfaces/{scene}')))
    return rows


def measure(arguments, progress):
    """Return all data of the tables and pictures as one dictionary."""
    rng = np.random.default_rng(arguments.seed)
    part = 0.1 if arguments.quick else 1.0
    return {
        'seed': arguments.seed,
        'thesis': thesis_figures(int(300 * part), rng, progress),
        'bars': bars(int(1000 * part), rng, progress),
        'without_noise': without_noise(progress),
        'error_and_time': error_and_time(int(300 * part), rng, progress),
        'sweeps': sweeps(int(150 * part), rng, progress),
        'rank': rank_map(progress),
        'refusals': refusals(int(60 * part), rng, progress),
        'certainty': certainty(int(200 * part), rng, progress)}


if __name__ == '__main__':
    run('shape', __doc__, measure, lambda _: 12 + 6 + 2 + 6 + 4 + 1 + 4 + 16, {
        '--seed': {'type': int, 'default': 4, 'help': 'of every random number (%(default)s)'}})
