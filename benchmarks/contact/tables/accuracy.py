"""All tables of the contact benchmark, and those of its accuracy and speed."""

from benchmarks.contact.tables import limits, real_skin
from benchmarks.contact.tables.limits import table as _table


def everything(result):
    """All tables, one after the other."""
    left_out = ', '.join(result['left_out']) or 'nothing'
    versions = ', '.join(f'{name} {value}' for name, value in result['versions'].items())
    parts = [f'Seed {result["seed"]}; {versions}; left out: {left_out}.']
    for title, make in (
            ('Goals', lambda result: limits.goals(result, ratios(result))),
            ('Speed and accuracy at 40 dB', _speed), ('Ratios of time', _ratios),
            ('Error over the bound against noise', _noise),
            ('Noise-free loads up to 12.5 mm from the centre', _loads),
            ('Table 2.4 again: side of the sensible area in mm', _table_24),
            ('Table 3.3 again', _table_33), ('Operations beside Table 3.2', _operations),
            ('How large a fault each method takes', limits.trust),
            ('Wrong type of contact', limits.strangers),
            ('Remedies', limits.remedies), ('Choice of model', limits.confusion),
            ('Skin on bone, by finite elements', lambda result: real_skin.finite_elements(
                result['finite_elements'])),
            ('The ladder of loads', lambda result: real_skin.ladder(result['ladder']))):
        parts.append(f'### {title}\n\n{make(result)}')
    return '\n\n'.join(parts) + '\n'


def reference_time(result, kind):
    """Time of a single call of our fit [s], which all times are relative to."""
    return next(row['single_s'] for row in result['speed_and_accuracy']
                if row['contact'] == kind and row['method'] == 'fit' and row['model'] == 1)


def _speed(result):
    rows = []
    for row in result['speed_and_accuracy']:
        unit = reference_time(result, row['contact'])
        times = [f'{row[key] / unit:.2f}' if row[key] else '' for key in ('single_s', 'batched_s')]
        rms = row['rms']
        if row['contact'] == 'point':
            error = f'{1e3 * rms["x"]:.3f} mm, P {100 * rms["normal_force"]:.2f} %'
        else:
            error = f'{1e3 * rms["offset"]:.3f} mm, {57.29578 * rms["yaw"]:.2f}°'
            error += f', {rms["line_force"] / 2:.2f} %' if 'line_force' in rms else ', no force'
        rows.append([row['contact'], row['label'], *times, error, f'{row["ratio"]:.2f}',
                     f'{100 * row["refused"]:.1f} %'])
    return _table(['contact', 'method', 'one call / fit', 'batched / fit', 'RMS error',
                   'RMS / CRB', 'refused'], rows)


RATIOS = (  # name, above, below, goal
    ('point fit, batched / six moments as one matrix product',
     'point, fit, batched', 'six moments, batched', 'at most 20'),
    ('numpy Gauss-Newton, batched / point fit, batched',
     'point, numpy Gauss-Newton, batched', 'point, fit, batched', 'at least 8'),
    ('tuned numpy Gauss-Newton, batched / point fit, batched',
     'point, tuned numpy Gauss-Newton, batched', 'point, fit, batched', ''),
    ('point fit, one call / batched', 'point, fit', 'point, fit, batched', ''),
    ('line fit, one call / cv2.fitLine with its thresholding',
     'line, fit', 'line, cv2.fitLine', 'at most 2'),
    ('point fit, one call / cv2.fitLine with its thresholding',
     'point, fit', 'line, cv2.fitLine', 'at most 2'),
    ('line fit, one call / cv2.fitLine alone, points given',
     'line, fit', 'line, cv2.fitLine alone', ''),
    ('line fit, one call / skimage orientation',
     'line, fit', 'line, skimage orientation', 'at most 0.2'),
    ('point fit, one call / skimage orientation',
     'point, fit', 'line, skimage orientation', 'at most 0.2'),
    ('whole estimator, point, one call / point fit, one call',
     'point, estimator, fit', 'point, fit', ''),
    ('whole estimator, line, one call / line fit, one call',
     'line, estimator, fit', 'line, fit', ''))


def ratios(result):
    """Ratios of time that the goals are about: name -> (value, goal or '')."""
    times = result['times']
    return {name: (times[above] / times[below], goal) for name, above, below, goal in RATIOS
            if above in times and below in times}


def _ratios(result):
    return _table(['ratio', 'value', 'goal'], [
        [name, f'{value:.2f}', goal] for name, (value, goal) in ratios(result).items()])


def _noise(result):
    rows = result['fit_against_noise']
    levels = sorted({row['decibels'] for row in rows})
    names = dict.fromkeys((row['contact'], row['model']) for row in rows)
    lines = []
    for kind, model in names:
        own = {r['decibels']: r for r in rows if (r['contact'], r['model']) == (kind, model)}
        lines.append([f'point fit, model {model}' if kind == 'point' else 'line fit', *(
            f'{own[level]["ratio"]:.2f} ({100 * own[level]["refused"]:.1f} %)'
            for level in levels)])
    return 'RMS / CRB (share refused).\n\n' + _table(
        ['method', *(f'{level:.0f} dB' for level in levels)], lines)


def _loads(result):
    return _table(['fit', 'loads', 'failed (refused or off by 0.1 mm)', 'largest error'], [
        [f'model {row["model"]}', f'{row["loads"]}', f'{row["failures"]}',
         f'{1e3 * row["largest_error_m"]:.1e} mm'] for row in result['noise_free_loads']])


def _table_24(result):
    rows = result['table_2_4']
    levels = list(dict.fromkeys(row['decibels'] for row in rows))
    lines = []
    for method, model in dict.fromkeys((row['method'], row['model']) for row in rows):
        for case in dict.fromkeys(row['case'] for row in rows):
            own = {row['decibels']: row['side_mm'] for row in rows
                   if (row['method'], row['model'], row['case']) == (method, model, case)}
            lines.append([f'{method}, model {model}', case, *(f'{own[x]}' for x in levels),
                          f'{THESIS_24[case][model - 1]}'])
    return _table(['method', 'load', *('no noise' if x is None else f'{x:.0f} dB' for x in levels),
                   'thesis'], lines)


THESIS_24 = {'case 1': (14, 20, 20), 'case 2': (14, 18, 20), 'case 3': (12, 16, 16)}
THESIS_33 = {'case 1': ((3.8, 12.0, 1.29), (3.62, 12.8, 1.27), (3.9, 13.6)),
             'case 2': ((2.5, 18.6, 0.96), (2.48, 19.8, 0.97), (2.56, 23.0)),
             'case 3': ((2.2, 21.5, 0.43), (2.31, 21.8, 0.57), (2.26, 22.0))}


def _table_33(result):
    lines = []
    for case, (real, own, berger) in THESIS_33.items():
        lines += [[case, 'real values', *_line(*real), ''],
                  [case, "thesis' experiment, its algorithm", *_line(*own), ''],
                  [case, "thesis' experiment, Berger-Khosla", *_line(*berger), '']]
        for row in result['table_3_3']:
            if row['case'] != case:
                continue
            rms = f'{row["rms_b_tactel"]:.4f} tactel, {row["rms_alpha_deg"]:.3f}°'
            if row['force'] is not None:
                rms += f', {row["rms_force_percent"]:.2f} %'
            lines.append([case, row['method'], *_line(
                row['b_tactel'], row['alpha_deg'], row['force']), rms])
    return _table(['load', 'method', 'b [tactel]', 'α', 'P [N/m]', 'RMS error at 40 dB'], lines)


def _line(b, alpha, force=None):
    return f'{b:.2f}', f'{alpha:.1f}°', '' if force is None else f'{force:.2f}'


def _operations(result):
    return _table(['algorithm', 'operations per frame'], [
        [name, f'{count}'] for name, count in result['operations'].items()])
