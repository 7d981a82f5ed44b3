"""Tables of the latency benchmark, in Markdown."""

AWAKE = ', processors kept awake'


def _table(head, rows):
    lines = ['| ' + ' | '.join(head) + ' |', '|' + ' --- |' * len(head)]
    return '\n'.join(lines + ['| ' + ' | '.join(row) + ' |' for row in rows]) + '\n'


def _ms(seconds):
    return f'{1e3 * seconds:.3f}'


def _quantiles(row):
    return [_ms(row[name]) for name in ('mean', 'p50', 'p99')]


def one(run):
    """Return the tables of one run."""
    head = (f'**{run["tracker"]}, pictures at {run["rate"]:g} Hz{AWAKE * run["awake"]}**: '
            f'{run["cycles"]} cycles in {run["seconds"]:.1f} s, {run["missed"]} missed; '
            f'{run["reason"]}')
    latency = _table(('latency [ms]', 'mean', 'p50', 'p99'),
                     [[name, *_quantiles(row)] for name, row in run['latency'].items()])
    cpu = _table(('CPU [ms]', 'mean', 'p50', 'p99', 'calls per cycle'), [
        [name, *_quantiles(row), f'{row["calls"]:.2f}'] for name, row in run['cpu'].items()] + [
        ['all of its thread, per cycle', _ms(run['thread']), '', '', ''],
        ['all of its process, per cycle', _ms(run['process']), '', '', '']])
    return f'{head}\n\n{cpu}\n{latency}'


def everything(result):
    """Return all tables."""
    load = f'With {result["load"]:.1f} programs running on {result["cores"]} cores (load average):'
    return '\n'.join([load, '', *(one(run) for run in result['runs'])])
