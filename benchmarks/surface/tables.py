"""Tables of the surface benchmark."""
from benchmarks.surface.cases import OBJECTS

COLUMNS = (('tracked', 'tracked_length', 1e3, 0), ('surface RMS', 'surface_rms', 1e3, 3),
           ('largest', 'surface_max', 1e3, 3), ('centre, farthest', 'centre_max', 1e3, 2),
           ('force RMS', 'force_rms_error', 1.0, 3), ('largest', 'force_max', 1.0, 1),
           ('contact', 'contact_kept', 100.0, 1))
PARTS = (('Speed and accuracy', 'speed_and_accuracy', ('object', 'control', 'speed', 'fastest')),
         ('Rasters of 60 x 60 mm, rows 6 mm apart, 50 mm/s', 'rasters', ('scene',)),
         ('Steps and an edge to fall off', 'steps', ('step', 'speed')),
         ('Starts, forces, friction (spheres of 70 mm)', 'starts', ('start',)),
         ('Errors of calibration (cylinder of 65 mm, 50 mm/s)', 'faults', ('fault',)))
BAR_SPEEDS = (0.01, 0.05, 0.1)


def everything(result):
    """Return all tables as text: mm, N, %; the worst of all seeds."""
    parts = ['Worst of all seeds; mm, N, % of the cycles. `fastest` is the speed reached.',
             *([] if result['quick'] else [_bars(result)])]
    for title, key, names in PARTS:
        rows = []
        for row in result[key]:
            cells = [f'{1e3 * row[name]:.0f} mm/s' if name in ('speed', 'fastest')
                     else str(row[name]) for name in (*names, 'seeds')]
            cells += [f'{factor * row[column]:.{digits}f}'
                      for _, column, factor, digits in COLUMNS]
            rows.append([*cells, row['reason_code'].replace('_', ' ')])
        heads = [*names, 'seeds', *(head for head, *_ in COLUMNS), 'end']
        parts.append(_table(title, heads, rows))
    if result['quick']:
        return '\n\n'.join(parts) + '\n'
    parts.append(_table(
        'Largest stable gain of the force loop, as a share of the limit in theory',
        ['latency', 'limit in theory', 'predicted', 'thesis'],
        [[f'{1e3 * row["latency"]:.0f} ms', f'{row["limit"]:.0f} 1/s', f'{row["predicted"]:g}',
          f'{row["thesis"]:g}'] for row in result['stability']]))
    parts.append(_table(
        'Tables of Jacobians: error of the step that a change of 0.5 mm is taken for',
        ['features', 'model', 'contacts', 'median', '95 %', 'look-up', 'built in', 'usable'],
        [[row['features'], row['model'], f'{row["across"]} x {row["across"]} x 6',
          f'{100 * row["median"]:.0f} %', f'{100 * row["p95"]:.0f} %',
          f'{1e6 * row["lookup"]:.0f} us', f'{row["built"]:.2f} s', f'{100 * row["usable"]:.0f} %']
         for row in result['resolution']]))
    parts.append(_table(
        'Least-squares Jacobian against others, largest difference over the pad',
        ['features', 'against', 'difference'],
        [[row['features'], row['against'], f'{100 * row["largest"]:.2f} %']
         for row in result['jacobians']]))
    parts.append(_table(
        'Finite elements', ['elements', 'solved in', 'memory', '36 x 7 table', 'force'],
        [[str(row['elements']), f'{row["solve"]:.1f} s', f'{1e-9 * row["memory"]:.2f} GB',
          f'{row["table"]:.2f} s', f'{100 * row["force"]:+.1f} %']
         for row in result['elements']]))
    return '\n\n'.join(parts) + '\n'


def _bars(result):
    """Return the table of requirements with the worst results of all seeds, held or not."""
    runs = [row for row in result['speed_and_accuracy'] if row['control'] == 'predicted']
    bars = [row for row in runs if row['speed'] in BAR_SPEEDS]
    middle = [row for row in runs if row['speed'] == 0.05]
    fast = [row for row in runs if row['speed'] == 0.15]
    rasters = result['rasters']
    starts = {row['start']: row for row in result['starts']}
    begun = [starts[f'from {force} N'] for force in (1, 15)] + [starts['11 mm beside the centre']]
    fragile, full = starts['fragile, 5 of 6 N'], next(
        row for row in result['elements'] if row['elements'] == 2500)

    def most(rows, key, factor=1e3):
        return factor * max(row[key] for row in rows)

    def ends(rows):
        return sum(not row['ok'] for row in rows)
    asked = (
        (f'{len(OBJECTS)} objects at 10, 50, 100 mm/s: goals not met', ends(bars), 0, ''),
        ('surface RMS', most(bars, 'surface_rms'), 0.05, 'mm'),
        ('surface, largest', most(bars, 'surface_max'), 0.2, 'mm'),
        ("contact from the pad's centre, farthest", most(bars, 'centre_max'), 0.5, 'mm'),
        ('force RMS at 50 mm/s', most(middle, 'force_rms_error', 1.0), 0.05, 'N'),
        ('150 mm/s: share without contact', 100.0 * (1.0 - min(
            row['contact_kept'] for row in fast)), 0.0, '%'),
        ('rasters: share without contact', 100.0 * (1.0 - min(
            row['contact_kept'] for row in rasters)), 0.1, '%'),
        ('rasters: mean force off by', 20.0 * max(
            abs(row['force_mean'] - 5.0) for row in rasters), 1.0, '%'),
        ('rasters: surface RMS', most(rasters, 'surface_rms'), 0.08, 'mm'),
        ('from 11 mm aside, 1 N, 15 N: goals not met', ends(begun), 0, ''),
        ('fragile object: largest force', fragile['force_max'], 6.0, 'N'),
        ('2500 elements: solved in', full['solve'], 60.0, 's'),
        ('2500 elements: memory', 1e-9 * full['memory'], 4.0, 'GB'),
        ('36 x 7 table after that', full['table'], 1.0, 's'),
        ('cached start', result['cached_start'], 1.0, 's'),
        ('least squares against Jacobian by differences',
         100.0 * max(row['largest'] for row in result['jacobians']), 1.0, '%'))
    return _table('Bars', ['bar', 'found', 'at most', ''], [
        [name, f'{found:.3g} {unit}'.strip(), f'{bound:g} {unit}'.strip(),
         'held' if found <= bound else '**not held**'] for name, found, bound, unit in asked])


def _table(title, heads, rows):
    lines = [f'### {title}', '', '| ' + ' | '.join(heads) + ' |', '|' + ' --- |' * len(heads)]
    return '\n'.join(lines + ['| ' + ' | '.join(row) + ' |' for row in rows])
