"""Tables of the shape benchmark, as Markdown."""
import numpy as np

KINDS = ('none', 'plane', 'cylinder', 'sphere', 'general')


def _table(head, rows):
    lines = [f'| {" | ".join(head)} |', f'| {" | ".join("---" for _ in head)} |']
    return '\n'.join(lines + [f'| {" | ".join(map(str, row))} |' for row in rows])


def _mm(value, digits=3):
    return '' if not np.isfinite(value) else f'{1e3 * value:.{digits}f}'


def _short(value):
    """Return a length in mm with two significant digits; very small ones in exponent form."""
    return f'{1e3 * value:.1e}' if value < 1e-7 else f'{1e3 * value:.2g}'


def bars(result):
    """Return the table of the least model and its requirements."""
    return _table(
        ['surface', 'median [mm]', 'bar', '95 % [mm]', 'bar', 'right kind', 'bar', 'refused'],
        [[row['case'], _mm(row['median'], 4), _mm(row['bar_median']), _mm(row['most'], 4),
          _mm(row['bar_most']), f'{100 * row["right"]:.1f} %', f'{100 * row["bar_right"]:.0f} %',
          f'{100 * row["refused"]:.1f} %'] for row in result['bars']])


def confusion(result):
    """Return the table of the kinds found."""
    return _table(['surface', *KINDS], [
        [row['case'], *(f'{100 * row["kinds"][kind]:.1f} %' for kind in KINDS)]
        for row in result['bars']])


def without_noise(result):
    """Return the table of errors due to the models only."""
    names = list(dict.fromkeys(row['case'] for row in result['without_noise']))
    rows = []
    for method in dict.fromkeys(row['method'] for row in result['without_noise']):
        mine = {row['case']: row for row in result['without_noise'] if row['method'] == method}
        rows.append([method, *(
            'refused' if mine[name]['refused'] == 1.0 else
            f'{_short(mine[name]["median"])} / {_short(mine[name]["largest"])}'
            for name in names)])
    return _table(['method', *names], rows)


def error_and_time(result):
    """Return the table of median / 95 % errors of each method on each surface, and its time."""
    names = list(dict.fromkeys(row['case'] for row in result['error_and_time']))
    rows = []
    for method in dict.fromkeys(row['method'] for row in result['error_and_time']):
        mine = {row['case']: row for row in result['error_and_time'] if row['method'] == method}
        first = mine[names[0]]
        cells = []
        for name in names:
            row = mine[name]
            refused = f' ({100 * row["refused"]:.0f} %)' if row['refused'] > 0.005 else ''
            cells.append(f'{_mm(row["median"])} / {_mm(row["most"])}{refused}'
                         if row['refused'] < 1.0 else 'refused')
        rows.append([method, f'{1e6 * first["time_median"]:.0f} / '
                     f'{1e6 * first["time_most"]:.0f}', *cells])
    return _table(['method', 'time [µs]', *names], rows)


def thesis(result):
    """Return the table of the largest error of the cross-section by form, speed and noise."""
    rows = []
    speeds = list(dict.fromkeys(row['along'] for row in result['thesis']))
    for form in dict.fromkeys(row['form'] for row in result['thesis']):
        for noise in ('', 'Vx', 'Vy', 'v'):
            mine = {row['along']: row['most'] for row in result['thesis'] if (
                row['form'], row['noise'], row['across']) == (form, noise, 1e-2)}
            rows.append([form, f'{noise} ±15 %' if noise else 'none',
                         *(_short(mine[speed]) for speed in speeds)])
    return _table(['form', 'noise', *(f'{1e3 * speed:g} mm/s' for speed in speeds)], rows)


def rank(result):
    """Return the table of ranks by motion and number of contacts."""
    counts = sorted({row['contacts'] for row in result['rank']})
    rows = []
    for motion in dict.fromkeys(row['motion'] for row in result['rank']):
        mine = {row['contacts']: row for row in result['rank'] if row['motion'] == motion}
        last = mine[counts[-1]]
        sees = last['least_model_sees']
        rows.append([motion, *(mine[count]['rank'] for count in counts),
                     ', '.join(last['unseen']) or 'none',
                     '' if sees is None else ('both' if all(sees) else 'one' if any(sees)
                                              else 'refused')])
    return _table(['motion', *(f'N = {count}' for count in counts), f'unseen at N = {counts[-1]}',
                   'least model sees'], rows)


def certainty(result):
    """Return the table of errors of curvatures over their claimed standard deviations."""
    return _table(['errors', 'surface', 'patches', 'RMS of error / claim', 'largest',
                   'right kind'], [
        [row['errors'], row['case'], row['patches'], f'{row["score"]:.2f}',
         f'{row["largest"]:.1f}', f'{100 * row["right"]:.0f} %'] for row in result['certainty']])


def everything(result):
    """Return all tables."""
    versions = ', '.join(f'{name} {value}' for name, value in result['versions'].items())
    return '\n\n'.join([
        f'Seed {result["seed"]}; {versions}.',
        '### The least model against its goals', bars(result),
        '### Which surface was found', confusion(result),
        '### Without noise',
        'Median / largest error over 20×4 mm [mm], over 24 headings of the path.',
        without_noise(result),
        '### Error and time of every method',
        'Median / 95th percentile of the largest error over 20×4 mm [mm] (share refused); time of '
        'one update, median / 95 %.', error_and_time(result),
        '### What patches claim',
        'Errors of the seen curvatures over their standard deviations. Closed loop: a probe of '
        'finite elements follows a raster of 24×12 mm at 80 mm/s.', certainty(result),
        "### The thesis' simulation",
        'Largest error over the cross-section [mm]; with noise, the 95th percentile of 300 runs.',
        thesis(result),
        '### Rank of the nine unknowns', rank(result), ''])
