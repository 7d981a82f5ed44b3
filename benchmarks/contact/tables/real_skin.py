"""Tables of skin on bone and of the ladder of loads."""

from benchmarks.contact.tables.limits import table


def _percent(value, digits=1):
    return '' if value is None else f'{100.0 * value:.{digits}f} %'


def _number(value, digits=2):
    return '' if value is None else f'{value:.{digits}f}'


def finite_elements(rows):
    """Objects on a skin on bone, told its thickness and not."""
    return table(
        ['object', 'bone [mm]', 'right', 'wrong', 'refused', 'force off', 'place / claim',
         'force / claim', 'half-space: right', 'wrong', 'refused'],
        [[f'{r["object"]}, {r["radius_mm"]:g} mm', f'{r["bone_mm"] or "none"}',
          *(_percent(r['layer'][key]) for key in ('right', 'wrong', 'refused', 'force')),
          *(_number(r['layer'][key]) for key in ('claims', 'force_claims')),
          *(_percent(r['half-space'][key]) for key in ('right', 'wrong', 'refused'))]
         for r in rows])


def ladder(rows):
    """What each rung costs where it is not needed, and saves where it is."""
    return table(
        ['contact', 'sharp fit: place', 'force', 'with the ladder: place', 'force', 'refused',
         'given a patch', 'given an end'],
        [[r['contact'], *(f'{_number(r[label]["place_mm"], 4)} mm' if key == 'place_mm' else
                          _percent(r[label][key], 2)
                          for label in ('sharp', 'ladder') for key in ('place_mm', 'force')),
          _percent(r['ladder']['refused']), _percent(r['patch']), _percent(r['ends'])]
         for r in rows])
