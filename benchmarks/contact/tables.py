"""Tables of the contact benchmark, as Markdown."""

import math

from benchmarks.harness import table

FAMILIES = {
    'half': 'half-space, 20 to 60 dB, models 1 to 3',
    'drifted': 'the same, drift 3 %, gains 5 % off', 'dome': 'points on a dome',
    'fe': 'finite elements, bone 2 to 12 mm and none',
    'pads': 'finite elements, 4×4 to 32×32 tactels',
    'faults': 'finite elements, faults of the sensor', 'flat': 'flat punches and strips',
    'short': 'edges that end on the pad', 'uneven': 'edges that press unevenly: tapered and wavy',
    'reject': 'neither a point nor a line', 'real-loaded': 'real presses on a pad of 5×5',
    'real-weights': 'weights that lie on that pad', 'real-foil': 'real foil strips',
    'real-finger': 'a real finger', 'real-fingers': 'two real fingers or more',
    'real-emed': 'a real foot'}
NEITHER = 'reject', 'real-weights', 'real-fingers', 'real-emed'  # families that are to be refused


def everything(result):
    """Return all tables."""
    left_out = ', '.join(result['left_out']) or 'nothing'
    versions = ', '.join(f'{name} {value}' for name, value in result['versions'].items())
    return '\n\n'.join([
        '### Golden frames: before → now', golden(result['golden'], result['golden_now']),
        '### Speed and accuracy at 40 dB',
        f'Seed {result["seed"]}; {versions}; left out: {left_out}.',
        _speed(result['speed_and_accuracy'])]) + '\n'


def reference_time(rows, kind):
    """Return the time of a single call of the estimator [s], the unit of all times."""
    return next(row['single_s'] for row in rows if row['contact'] == kind)


def _speed(rows):
    lines = []
    for row in rows:
        unit, rms = reference_time(rows, row['contact']), row['rms']
        if row['contact'] == 'point':
            error = f'{1e3 * rms["x"]:.3f} mm'
            force = rms.get('normal_force')
        else:
            error = f'{1e3 * rms["offset"]:.3f} mm, {math.degrees(rms["yaw"]):.2f}°'
            force = rms['line_force'] / 200.0 if 'line_force' in rms else None
        lines.append([
            f'{row["contact"]}, model {row["model"]}', row['method'],
            *(f'{row[key] / unit:.2f}' if row[key] else '' for key in ('single_s', 'batched_s')),
            error, '' if force is None else f'{100 * force:.2f} %', f'{row["ratio"]:.2f}',
            f'{100 * row["refused"]:.1f} %'])
    return table(['contact', 'method', 'one call', 'batched', 'place', 'force', 'RMS / CRB',
                  'refused'], lines)


def _change(before, now, form, factor=1.0):
    cells = [form.format(factor * row) if row is not None and math.isfinite(row) else '–'
             for row in (before, now)]
    return ' → '.join(cells) if cells != ['–', '–'] else ''


def _claim(row):
    values = [row[name] for name in ('claim_place', 'claim_yaw', 'claim_spread')
              if row.get(name) is not None and math.isfinite(row[name])]
    return max(values, default=None)


def golden(before, now):
    """Return the table of the families, before and now; times are relative to the `pads`."""
    unit = next(row['us'] for row in now if row['set'] == 'pads' and row['skin'] == 'known')
    old = {(row['set'], row['skin']): row for row in before}
    lines = []
    for row in now:
        was = old.get((row['set'], row['skin']), {})
        lines.append([
            FAMILIES.get(row['set'], row['set']), row['skin'], f'{row["n"]}',
            *(_change(was.get(name), row.get(name), '{:.1f}', 100.0) if (
                row['set'] not in NEITHER or name != 'right') else ''
              for name in ('right', 'wrong', 'wrong_force')),
            _change(was.get('place_um'), row.get('place_um'), '{:.0f}'),
            _change(_claim(was), _claim(row), '{:.2f}'),
            _change(was.get('claim_force'), row.get('claim_force'), '{:.2f}'),
            *(f'{row[name] / unit:.1f}' if math.isfinite(row[name]) else ''
              for name in ('us', 'us_refused'))])
    return table(['frames', 'skin', 'number', 'right [%]', 'wrong [%]', 'of these force [%]',
                  'place [µm]', 'worst claim', 'of force', 'time', 'refused: time'], lines)
