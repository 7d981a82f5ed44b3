"""Tables of the surface benchmark."""
COLUMNS = (('tracked', 'tracked_length', 1e3, 0), ('surface RMS', 'surface_rms', 1e3, 3),
           ('largest', 'surface_max', 1e3, 3), ('centre, farthest', 'centre_max', 1e3, 2),
           ('force RMS', 'force_rms_error', 1.0, 3), ('largest', 'force_max', 1.0, 1),
           ('contact', 'contact_kept', 100.0, 1))
PARTS = (('Speed and accuracy', 'speed_and_accuracy', ('object', 'control', 'speed')),
         ('Rasters of 60 x 60 mm, rows 6 mm apart, 50 mm/s', 'rasters', ('scene',)),
         ('Steps and an edge to fall off', 'steps', ('step', 'speed')),
         ('Starts, forces, friction (spheres of 70 mm)', 'starts', ('start',)),
         ('Where the Jacobian comes from (sphere of 70 mm, 50 mm/s)', 'sources',
          ('features', 'method')),
         ('Errors of calibration (cylinder of 65 mm, 50 mm/s)', 'faults', ('fault',)))


def everything(result):
    """All tables as text: mm, N, %; the worst of all seeds."""
    parts = ['Worst of all seeds; mm, N, % of the cycles.']
    for title, key, names in PARTS:
        heads = [*names, 'seeds', *(head for head, *_ in COLUMNS), 'end']
        lines = [f'### {title}', '', '| ' + ' | '.join(heads) + ' |', '|' + ' --- |' * len(heads)]
        for row in result[key]:
            cells = [f'{1e3 * row[name]:g} mm/s' if name == 'speed' else str(row[name])
                     for name in (*names, 'seeds')]
            cells += [f'{factor * row[column]:.{digits}f}'
                      for _, column, factor, digits in COLUMNS]
            end = row['reason_code'].replace('_', ' ')
            lines.append('| ' + ' | '.join([*cells, end]) + ' |')
        parts.append('\n'.join(lines))
    return '\n\n'.join(parts) + '\n'
