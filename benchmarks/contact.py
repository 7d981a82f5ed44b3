"""
Speed, accuracy and limits of contact estimation: chapters 2 and 3 of the thesis measured again.

Prints tables, and writes benchmarks/results/contact.json, pictures into docs/ and the tables
into docs/contact.md. Times are processor time on one core, the least of several repeats.
"""

import os

for _library in ('OMP', 'OPENBLAS', 'MKL'):  # one core; before numpy is loaded
    os.environ.setdefault(f'{_library}_NUM_THREADS', '1')

# ruff: noqa: E402
import argparse
import json
import math
from pathlib import Path
import platform
import sys
import time

import _contact_accuracy as accuracy
import _contact_judge as judge
import _contact_operations as operations
import _contact_peers as peer
import _contact_remedies as remedies
import _contact_scenes as scenes
import _contact_tables as tables
import numpy as np

from tactile_sensing.progress import Progress

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / 'docs' / 'contact.md'
BEGIN, END = '<!-- printed by ./ws bench contact -->', '<!-- end of print -->'
PIECES = 111  # that call `Steps.step`


class Steps:
    """Progress bar of a known number of pieces of work."""

    def __init__(self, bar, total):
        self._bar, self._total, self._done = bar, total, 0

    def step(self, what):
        """Count one piece, about to begin."""
        self._bar.show(min(self._done / self._total, 1.0), 'bench', what)
        self._done += 1


def measure(arguments, progress):
    """Everything that the tables and pictures show, as one dictionary."""
    peers, missing = peer.load()
    rng = np.random.default_rng(arguments.seed)
    part = 0.1 if arguments.quick else 1.0
    begin = time.perf_counter()
    many, few = int(2000 * part), int(200 * part)
    return {
        'seed': arguments.seed, 'quick': arguments.quick, 'left_out': missing,
        'versions': {'python': platform.python_version(), 'numpy': np.__version__, **{
            name: module.__version__ for name, module in peers.items()}},
        'speed_and_accuracy': accuracy.speed_and_accuracy(
            many, peers, rng, progress, 0.5 * max(part, 0.3)),
        'times': accuracy.contest(int(50 * part), peers, rng, progress),
        'fit_against_noise': accuracy.fit_against_noise(int(4000 * part), rng, progress),
        'noise_free_loads': accuracy.noise_free_loads(int(20000 * part), rng, progress),
        'table_2_4': accuracy.table_24(max(2, int(10 * part)), rng, progress),
        'table_3_3': accuracy.table_33(int(500 * part), peers, rng, progress),
        'operations': operations.counts(),
        'fault_map': judge.fault_map(many, few, rng, progress),
        'wrong_type': judge.wrong_type(int(500 * part), few, rng, progress),
        'remedies': remedies.remedies(many, rng, progress),
        'confusion': scenes.confusion(int(1000 * part), rng, progress),
        'seconds': time.perf_counter() - begin}


def finite(value):
    """Six digits of every number, and None, which strict JSON has, for what is not finite."""
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(item) for item in value]
    if isinstance(value, float):
        return float(f'{value:.6g}') if math.isfinite(value) else None
    return value


def as_json(result):
    """Strict JSON with one row of a table to a line."""
    parts = []
    for key, value in result.items():
        text = json.dumps(value, allow_nan=False)
        if isinstance(value, list) and value and isinstance(value[0], dict):
            rows = ',\n  '.join(json.dumps(row, allow_nan=False) for row in value)
            text = f'[\n  {rows}]'
        parts.append(f' {json.dumps(key)}: {text}')
    return '{\n' + ',\n'.join(parts) + '\n}\n'


def main():
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(
        prog='./ws bench contact', description=__doc__.strip(),
        formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--quick', action='store_true', help=(
        'a tenth of the samples; writes into runs/bench_contact and leaves docs/ alone'))
    parser.add_argument('--seed', type=int, default=3, help='of every random number (%(default)s)')
    parser.add_argument('--peers', metavar='FOLDER', help=(
        'where `pip install --target FOLDER` has put opencv-python-headless and scikit-image; '
        'what is missing is left out and named'))
    arguments = parser.parse_args()
    if arguments.peers:
        sys.path.append(arguments.peers)
    with Progress(sys.stderr) as bar:
        result = measure(arguments, Steps(bar, PIECES))
    result = finite(result)
    text = tables.everything(result)
    print(text)
    if arguments.quick:
        results = pictures = ROOT / 'runs' / 'bench_contact'
    else:
        results, pictures = ROOT / 'benchmarks' / 'results', ROOT / 'docs'
    results.mkdir(parents=True, exist_ok=True)
    (results / 'contact.json').write_text(as_json(result), 'utf-8')
    try:
        import _contact_charts as charts
    except ImportError as error:
        print(f'no pictures: {error}')
    else:
        charts.draw(result, pictures)
    if not arguments.quick and PAGE.exists():
        before, _, rest = PAGE.read_text('utf-8').partition(BEGIN)
        after = rest.partition(END)[2]
        PAGE.write_text(f'{before}{BEGIN}\n\n{text}\n{END}{after}', 'utf-8')
    return 0


if __name__ == '__main__':
    sys.exit(main())
