"""Common parts of the benchmarks: progress bar, results, pictures, results page in docs/."""

import argparse
from importlib import import_module
from importlib.util import find_spec
import json
import math
from pathlib import Path
import platform
import time

import numpy as np

from tactile_common.progress import Progress

ROOT = Path(__file__).resolve().parent.parent
END = '<!-- end of print -->'


class Steps(Progress):
    """Progress bar of a known number of steps."""

    _begun = 0

    def step(self, what):
        """Show and count a step that is about to begin."""
        self.show(self._begun, 'bench', what)
        self._begun += 1


def run(name, description, measure, pieces, options=None):
    """
    Run a benchmark from the command line: measure, print, draw, and write its results page.

    Parameters
    ----------
    name : str
        Name of the page results_NAME.md in docs/, and of the folder with `tables` and `charts`.
    description : str
        Description for --help.
    measure : callable
        Takes the arguments and Steps; returns all data of tables and pictures as a dictionary.
    pieces : callable
        Takes the arguments; returns the number of steps.
    options : dict, optional
        Additional options: flag and keywords of `add_argument`.
    """
    parser = argparse.ArgumentParser(
        prog=f'./ws bench {name}', description=description.strip(),
        formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--quick', action='store_true', help=(
        f'a part of the runs; writes into runs/bench_{name} and leaves docs/ alone'))
    for flag, keywords in (options or {}).items():
        parser.add_argument(flag, **keywords)
    arguments = parser.parse_args()
    begin = time.perf_counter()
    with Steps(pieces(arguments)) as steps:
        measured = measure(arguments, steps)
    versions = {'python': platform.python_version(), 'numpy': np.__version__,
                **measured.pop('versions', {})}
    result = {'quick': arguments.quick, 'versions': versions, **measured,
              'seconds': time.perf_counter() - begin}
    if arguments.quick:
        results = pictures = ROOT / 'runs' / f'bench_{name}'
    else:
        results, pictures = ROOT / 'benchmarks' / 'results', ROOT / 'docs'
    results.mkdir(parents=True, exist_ok=True)
    (results / f'{name}.json').write_text(as_json(finite(result)), 'utf-8')
    text = import_module(f'benchmarks.{name}.tables').everything(result)
    print(text)
    if find_spec(f'benchmarks.{name}.charts'):
        try:
            charts = import_module(f'benchmarks.{name}.charts')
        except ImportError as error:
            print(f'no pictures: {error}')
        else:
            charts.draw(result, pictures)
    if not arguments.quick:
        _print_into(ROOT / 'docs' / f'results_{name}.md',
                    f'<!-- printed by ./ws bench {name} -->', text)


def table(head, rows):
    """Return a Markdown table."""
    lines = ['| ' + ' | '.join(head) + ' |', '|' + ' --- |' * len(head)]
    return '\n'.join(lines + ['| ' + ' | '.join(row) + ' |' for row in rows])


def _print_into(page, begin, text):
    before, _, rest = page.read_text('utf-8').partition(begin)
    after = rest.partition(END)[2]
    page.write_text(f'{before}{begin}\n\n{text}\n{END}{after}', 'utf-8')


def finite(value):
    """Round all numbers to six digits, and replace non-finite ones by None for strict JSON."""
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(item) for item in value]
    if isinstance(value, float):
        return float(f'{value:.6g}') if math.isfinite(value) else None
    return value


def as_json(result):
    """Return strict JSON with one table row per line, without keys that begin with _."""
    parts = []
    for key, value in result.items():
        text = json.dumps(value, allow_nan=False)
        if isinstance(value, list) and value and isinstance(value[0], dict):
            rows = ',\n  '.join(json.dumps(
                {name: item for name, item in row.items() if not name.startswith('_')},
                allow_nan=False) for row in value)
            text = f'[\n  {rows}]'
        parts.append(f' {json.dumps(key)}: {text}')
    return '{\n' + ',\n'.join(parts) + '\n}\n'
