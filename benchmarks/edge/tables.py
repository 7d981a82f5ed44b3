"""Tables of the edge benchmark, in Markdown."""

import math


def _table(head, rows):
    lines = ['| ' + ' | '.join(head) + ' |', '|' + ' --- |' * len(head)]
    return '\n'.join(lines + ['| ' + ' | '.join(row) + ' |' for row in rows]) + '\n'


def _mm(value, digits=3):
    return '–' if value is None or not math.isfinite(value) else f'{1e3 * value:.{digits}f}'


def _outcome(row):
    return 'yes' if row['ok'] == row['runs'] else f'{row["ok"]} of {row["runs"]}'


def speed(result):
    """Return the table of speed against accuracy."""
    return _table(
        ('edge', 'law', 'speed [mm/s]', 'mean speed', 'RMS [mm]', 'largest [mm]',
         'force error RMS [N]', 'largest force [N]', 'acceleration, largest [1/s²]', 'RMS [1/s²]',
         'scatter of speed [mm/s]', 'tracked', 'CPU per cycle [µs]',
         'per image [µs]'),
        [(row['course'], row['tracker'], _mm(row['speed'], 0), _mm(row['mean_speed'], 0),
          _mm(row['lateral_rms']), _mm(row['lateral_max']), f'{row["force_rms_error"]:.2f}',
          f'{row["force_max"]:.1f}', f'{row["joint_acceleration_max"]:.1f}',
          f'{row["joint_acceleration_rms"]:.1f}', _mm(row['pad_speed_scatter'], 2),
          _outcome(row), f'{1e6 * row["cpu_per_cycle"]:.0f}',
          f'{1e6 * row["cpu_per_image"]:.0f}')
         for row in result['speed_and_accuracy']])


def stability(result):
    """Return the largest stable gain of the tested ones, with the theoretical limit."""
    rows = []
    for latency in sorted({row['latency'] for row in result['stability']}):
        here = [row for row in result['stability'] if row['latency'] == latency]
        cells = [_mm(latency, 0), f'{here[0]["limit"]:.0f}']
        for tracker in ('resolved_rate', 'trace'):
            own = sorted((row['gain'], row['stable']) for row in here
                         if row['tracker'] == tracker)
            unstable = [gain for gain, stable in own if not stable]
            below = [gain for gain, stable in own
                     if stable and (not unstable or gain < unstable[0])]
            cells.append(f'{max(below):.0f}' if below else 'none')
        rows.append(cells)
    return _table(('image latency [ms]', 'limit in theory [1/s]',
                   'resolved_rate, stable up to', 'trace, stable up to'), rows)


def corners(result):
    """Return the table of corners and radii: held, cut or lost."""
    rows = []
    for row in result['corners']:
        size = f'{row["size"]}°' if row['kind'] == 'corner' else f'{1e3 * row["size"]:g} mm'
        rows.append((row['kind'], size, row['tracker'], row['verdict'],
                     _mm(row['lateral_rms']), _mm(row['lateral_max']),
                     f'{row["force_max"]:.1f}'))
    return _table(('shape', 'size', 'law', 'verdict', 'RMS [mm]', 'largest [mm]',
                   'largest force [N]'), rows)


def hard(result):
    """Return the table of the hard scenes."""
    return _table(
        ('scene', 'law', 'survived', 'tracked [mm]', 'RMS [mm]', 'largest [mm]',
         'largest force [N]', 'why it ended'),
        [(row['scene'], row['tracker'], 'yes' if row['survived'] else 'no', _mm(row['length'], 0),
          _mm(row['lateral_rms']), _mm(row['lateral_max']), f'{row["force_max"]:.1f}',
          row['reason']) for row in result['hard_scenes']])


def figures(result):
    """Return the table of the thesis' figures."""
    rows = []
    for row in result['figures']:
        area = row['contour_area_error']
        rows.append((row['figure'], row['scene'], row['tracker'], _mm(row['speed'], 0),
                     _mm(row['lateral_rms']), _mm(row['lateral_max']),
                     _mm(row['contour_max_error']) if math.isfinite(area) else '–',
                     f'{100 * area:.3f}' if math.isfinite(area) else '–'))
    return _table(('figure', 'edge', 'law', 'speed [mm/s]', 'RMS [mm]', 'largest [mm]',
                   'outline within [mm]', 'area off by [%]'), rows)


def everything(result):
    """Return all tables."""
    parts = (('Speed and accuracy', speed), ('Stability', stability),
             ('Corners and radii at 50 mm/s', corners), ('Hard scenes at 30 mm/s', hard),
             ("The thesis' figures", figures))
    seeds = ', '.join(str(seed) for seed in result['seeds'])
    text = f'Seeds {seeds}; where there are several, the worst counts.\n'
    return text + ''.join(f'\n### {title}\n\n{make(result)}' for title, make in parts)
