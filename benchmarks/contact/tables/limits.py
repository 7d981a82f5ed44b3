"""Tables of the contact benchmark's limits: goals, failure map, remedies, choice of model."""

from benchmarks.contact.cases.faults import FAULTS
from benchmarks.contact.cases.scenes import ANSWERS
from benchmarks.contact.measure.limits import METHODS

REFUSED, WRONG = 0.05, 0.01  # shares of frames up to which a method is said to work


def table(head, rows):
    """Markdown."""
    lines = ['| ' + ' | '.join(head) + ' |', '|' + ' --- |' * len(head)]
    return '\n'.join(lines + ['| ' + ' | '.join(row) + ' |' for row in rows])


def goals(result, ratios):
    """Goals of the project with what has been measured."""
    noise = result['fit_against_noise']
    worst = {kind: max(r['ratio'] for r in noise if r['contact'] == kind and (
        kind == 'point' or r['decibels'] <= 50.0)) for kind in ('point', 'line')}
    rows = [('point fit, models 1–3, 20 to 60 dB: worst RMS / CRB', worst['point'], 1.10),
            ('line fit, 20 to 50 dB: worst RMS / CRB', worst['line'], 1.05)]
    line = next(r['rms'] for r in result['speed_and_accuracy']
                if r['label'] == 'fit' and r['contact'] == 'line')
    rows += [('line fit at 40 dB: place [mm]', 1e3 * line['offset'], 0.005),
             ('line fit at 40 dB: angle [degrees]', 57.29578 * line['yaw'], 0.03),
             ('line fit at 40 dB: force [%]', line['line_force'] / 2.0, 0.25)]
    failures = sum(r['failures'] for r in result['noise_free_loads'])
    largest = max(1e3 * r['largest_error_m'] for r in result['noise_free_loads'])
    rows += [('noise-free loads up to 12.5 mm: failures', failures, 0),
             ('noise-free loads up to 12.5 mm: largest error [mm]', largest, 1e-4)]
    sides = min(r['side_mm'] for r in result['table_2_4']
                if r['method'] == 'fit' and r['decibels'] is None)
    told = [[name, f'{value:.3g}', f'at most {bar:g}', 'yes' if value <= bar else '**no**']
            for name, value, bar in rows]
    told.append(['sensible area of the fit without noise, smallest side [mm]', f'{sides}',
                 'at least 26', 'yes' if sides >= 26 else '**no**'])
    for name, shares, bar in _choice(result['confusion']):
        told.append([name, f'{100 * shares:.1f} %', f'at least {bar} %',
                     'yes' if 100 * shares >= bar else '**no**'])
    for name, (value, goal) in ratios.items():
        if goal:
            bar = float(goal.split()[-1])
            reached = value <= bar if 'most' in goal else value >= bar
            told.append([name, f'{value:.2f}', goal, 'yes' if reached else '**no**'])
    return table(['goal', 'measured', 'goal', 'reached'], told)


def _choice(rows):
    known = [r['right_type'] for r in rows if r['type'] != 'other']
    others = {level: [r['right_type'] for r in rows
                      if r['type'] == 'other' and r['decibels'] == level]
              for level in {r['decibels'] for r in rows}}
    yield 'type right, none/point/line, 20 dB and more: worst scene', min(known), 99
    yield 'type right, other, 30 dB and more: worst scene', min(others[30.0] + others[40.0]), 99
    yield 'type right, other, 20 dB: mean of scenes', sum(others[20.0]) / len(others[20.0]), 90
    yield 'type right, other, 20 dB: worst scene', min(others[20.0]), 90


def trust(result):
    """How large a fault the fits take, and what they do of a larger one."""
    parts = []
    for contact in ('point', 'line'):
        lines = []
        for fault in FAULTS:
            own = [r for r in result['fault_map']
                   if (r['contact'], r['fault']) == (contact, fault.name)]
            lines.append([f'{fault.name}: {fault.axis}', *(
                _reach(fault, [r for r in own if r['method'] == method])
                for method in ('fit', 'fit with depth'))])
        parts.append(f'{contact.capitalize()}:\n\n'
                     + table(['fault', 'fit', 'fit with depth'], lines))
    harmless = [r for r in result['fault_map'] if r['fault'] == 'shear' and r['level'] == 0.0]
    parts.append('For comparison, every method on loads without shear and without any fault:\n\n'
                 + table(['contact', 'method', 'place', 'force', 'refused', 'wrong'], [
                     [r['contact'], r['method'], f'{1e3 * r["rms_place_m"]:.3f} mm',
                      f'{100 * r["rms_force"]:.2f} %', f'{100 * r["refused"]:.1f} %',
                      f'{100 * r["wrong"]:.1f} %'] for r in harmless]))
    return '\n\n'.join(parts)


def _reach(fault, rows):
    """Last size on the way from harmless at which a method works, and what follows."""
    own = {r['level']: r for r in rows}
    two_sided = fault.levels[0] < 0.0 < fault.levels[-1]
    sizes = sorted({abs(x) for x in own}) if two_sided else fault.levels
    worst = [{key: max(own[x][key] for x in own if x == size or two_sided and abs(x) == size)
              for key in ('refused', 'wrong', 'wrong_but_told')} for size in sizes]
    good = [r['refused'] <= REFUSED and r['wrong'] <= WRONG for r in worst]
    if all(good):
        return f'all, to {_size(sizes[-1], two_sided)}'
    first = good.index(False)
    parts = [f'to {_size(sizes[first - 1], two_sided)}' if first else 'never']
    for key, limit, name in (('refused', REFUSED, 'refused'), ('wrong', WRONG, 'wrong')):
        beyond = next((i for i, r in enumerate(worst) if r[key] > limit), None)
        if beyond is not None:
            most = max(range(len(sizes)), key=lambda i, key=key: worst[i][key])
            told = key == 'wrong' and worst[most]['wrong_but_told'] > 0.8 * worst[most]['wrong']
            parts.append(f'{name} from {_size(sizes[beyond], two_sided)} '
                         f'({100 * worst[most][key]:.0f} %{", mostly told" if told else ""})')
    return '; '.join(parts)


def _size(level, two_sided):
    return f'±{abs(level):g}' if two_sided and level else f'{level:g}'


def strangers(result):
    """Share of valid estimates of what the model is not."""
    rows = result['wrong_type']
    lines = []
    for scene, model in dict.fromkeys((r['scene'], r['model']) for r in rows):
        own = {r['method']: r for r in rows if (r['scene'], r['model']) == (scene, model)}
        lines.append([scene, model, *(
            f'{100 * own[m]["wrong"]:.1f} % ({100 * own[m]["refused"]:.0f} %)' for m in METHODS)])
    return table(['what touched', 'model', *METHODS], lines)


def remedies(result):
    """Remedies beside the figures that they were said to reach."""
    return table(
        ['fault', 'if ignored', 'said', 'remedy', 'then', 'said'],
        [[r['fault'], r['ignored'], r['said_ignored'], r['remedy'], r['mended'],
          r['said_mended']] for r in result['remedies']])


def confusion(result):
    """Answers for every scene at every strength of noise."""
    rows = result['confusion']
    levels = list(dict.fromkeys(r['decibels'] for r in rows))
    lines = []
    for scene in dict.fromkeys(r['scene'] for r in rows):
        own = {r['decibels']: r for r in rows if r['scene'] == scene}
        lines.append([
            scene, *(' / '.join(_percent(own[x]['answers'][answer]) for x in levels)
                     for answer in ANSWERS),
            ' / '.join(_percent(own[x]['right_type']) for x in levels)])
    return (f'Percent of frames at {" / ".join(f"{x:.0f}" for x in levels)} dB.\n\n'
            + table(['what touched', *ANSWERS, 'right type'], lines))


def _percent(share):
    return f'{100 * share:.1f}'.removesuffix('.0')
