"""
Golden images of contacts, and their judge: answers of an estimator compared with the truth.

`./ws bench contact golden make FOLDER` writes the sets, one .npz each. `score FOLDER` estimates
all of them, prints the table and, if the run was complete, stores it in
benchmarks/results/golden.json. The default of FOLDER is the environment variable GOLDEN.
"""

import argparse
from itertools import chain
import json
import os
from pathlib import Path
import sys
import time

import numpy as np

from benchmarks.contact import golden_score
from benchmarks.contact.golden_sets import all_sets, made
from benchmarks.contact.real_sets import real_sets
from benchmarks.harness import as_json, finite, ROOT

SEED = 26
NOW = ROOT / 'benchmarks' / 'results' / 'golden.json'
BEFORE = NOW.with_name('golden_before.json')  # families of the previous estimator


def wanted(name: str, sets: str) -> bool:
    """Return True if a set matches comma-separated prefixes; without prefixes all sets match."""
    return not sets or any(name.startswith(prefix) for prefix in sets.split(','))


def stored(folder: Path, sets: str = '') -> list[str]:
    """Return the names of the sets in a folder, `family/variant`."""
    names = (f'{file.parent.name}/{file.stem}' for file in sorted(folder.glob('*/*.npz')))
    return [name for name in names if wanted(name, sets) and _is_set(folder / f'{name}.npz')]


def _is_set(file):
    with np.load(file) as arrays:
        return 'frames' in arrays.files


def load(folder: Path, name: str, share: float = 1.0) -> dict:
    """Return the arrays of a set with the first part of its images."""
    with np.load(folder / f'{name}.npz') as file:
        arrays = {key: file[key] for key in file.files}
    count = len(arrays['frames'])
    keep = max(1, round(share * count))
    return {key: value[:keep] if value.ndim and len(value) == count and key not in (
        'components', 'depths', 'crb_names') else value for key, value in arrays.items()}


def make(arguments):
    """Write the sets."""
    if arguments.recordings and not arguments.recordings.is_dir():
        sys.exit(f'{arguments.recordings}: no such folder')
    drawn = ((name, made(name, max(2, round(arguments.share * count)), maker, arguments.seed))
             for name, (count, maker) in all_sets(arguments.folder).items()
             if wanted(name, arguments.sets))
    real = ((name, arrays) for name, arrays in real_sets(arguments.recordings)
            if wanted(name, arguments.sets)) if arguments.recordings else ()
    total, begin = 0, time.process_time()
    for name, arrays in chain(drawn, real):
        file = arguments.folder / f'{name}.npz'
        file.parent.mkdir(parents=True, exist_ok=True)
        np.savez(file, **arrays)
        total += len(arrays['frames'])
        spent, begin = time.process_time() - begin, time.process_time()
        print(f'{name} {len(arrays["frames"])} {spent:.1f} s', flush=True)
    print(f'{total} images')


def score(arguments):
    """Estimate the sets and print the table."""
    rows = []
    for name in stored(arguments.folder, arguments.sets):
        arrays = load(arguments.folder, name, arguments.share)
        skins = ('known', 'unknown') if arguments.both else (
            ('unknown',) if arguments.unknown else ('known',))
        if not np.isfinite(arrays['depth']):
            skins = ('unknown',)
        elif len(arrays['depths']) > 1:  # the skin cannot be fitted from several layers
            skins = ('known',)
        for skin in skins:
            answers = golden_score.answered(arrays, known=skin == 'known')
            if arguments.save:
                file = arguments.save / f'{name.replace("/", "-")}-{skin}.npz'
                file.parent.mkdir(parents=True, exist_ok=True)
                np.savez(file, records=answers.records, seconds=answers.seconds)
            rows.append({'set': name, 'skin': skin, **golden_score.score(
                arrays, answers.records), **answers.times})
            if sys.stderr.isatty():
                print(f'\r{name:40}', end='', file=sys.stderr)
    print(golden_score.table(rows))
    if arguments.both and not arguments.sets and arguments.share == 1.0:
        # Real recordings may be missing in the folder.
        seen = {row['set'] for row in rows}
        rows += [row for row in json.loads(NOW.read_text('utf-8'))['sets']
                 if row['set'].startswith('real-') and row['set'] not in seen]
        NOW.write_text(as_json(finite({'sets': rows})), 'utf-8')


def families(file: Path) -> list[dict]:
    """Return the rows of the families of sets, as stored by `score`."""
    rows = json.loads(file.read_text('utf-8'))['sets']
    return golden_score.families([{key: np.nan if value is None else value
                                   for key, value in row.items()} for row in rows])


def main(argv: list[str]):
    """Run a command."""
    parser = argparse.ArgumentParser(
        prog='./ws bench contact golden', description=__doc__.strip(),
        formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    for command in (make, score):
        part = commands.add_parser(command.__name__, help=command.__doc__)
        part.set_defaults(run=command)
        part.add_argument('folder', type=Path, nargs='?',
                          default=Path(os.environ.get('GOLDEN', 'runs/golden')))
        part.add_argument('--share', type=float, default=1.0, help='of the pictures')
        part.add_argument('--sets', default='', help='prefixes of names, comma separated')
        if command is make:
            part.add_argument('--seed', type=int, default=SEED)
            part.add_argument('--recordings', type=Path,
                              help='folder of real recordings, see real_sets.py')
        else:
            part.add_argument('--unknown', action='store_true', help='give pitch and noise alone')
            part.add_argument('--both', action='store_true', help='known and unknown skin')
            part.add_argument('--save', type=Path, help='folder for the answers')
    arguments = parser.parse_args(argv)
    arguments.run(arguments)
