"""Tables of the surface benchmark."""
COLUMNS = (('tracked', 'tracked_length', 1e3, 0), ('surface RMS', 'surface_rms', 1e3, 3),
           ('largest', 'surface_max', 1e3, 3), ('centre, farthest', 'centre_max', 1e3, 2),
           ('force RMS', 'force_rms_error', 1.0, 3), ('largest', 'force_max', 1.0, 1),
           ('contact', 'contact_kept', 100.0, 1))
PARTS = (('Speed and accuracy', 'speed_and_accuracy', ('object', 'control', 'speed')),
         ('Where the Jacobian comes from (sphere of 70 mm, 50 mm/s)', 'sources',
          ('features', 'method')),
         ('Errors of calibration (cylinder of 65 mm, 50 mm/s)', 'faults', ('fault',)),
         ('Other scenes', 'others', ('scene',)))


def everything(result):
    """All tables as text: mm, N, %; the worst of all seeds."""
    parts = []
    for title, key, names in PARTS:
        heads = [*names, *(head for head, *_ in COLUMNS), 'end']
        lines = [f'### {title}', '', '| ' + ' | '.join(heads) + ' |', '|' + ' --- |' * len(heads)]
        for row in result[key]:
            cells = [f'{1e3 * row[name]:g} mm/s' if name == 'speed' else str(row[name])
                     for name in names]
            cells += [f'{factor * row[column]:.{digits}f}'
                      for _, column, factor, digits in COLUMNS]
            lines.append('| ' + ' | '.join([*cells, row['reason']]) + ' |')
        parts.append('\n'.join(lines))
    return '\n\n'.join(parts) + '\n'
