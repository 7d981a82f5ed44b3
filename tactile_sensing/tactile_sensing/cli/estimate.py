"""Offline command: the contact in every frame of a file."""
import argparse
import math
import os
from pathlib import Path
import sys
import time

import numpy as np

from tactile_common.command_line import Parser
from tactile_common.errors import ConfigurationError, TactileError
from tactile_common.npz_stream import ArrayReader, RecordWriter
from tactile_common.progress import Progress
from tactile_sensing.contact.estimator import (
    ContactEstimator,
    EstimatorConfig,
    METHODS,
    MODELS,
    TACTELS,
)
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import COLUMNS, ContactType, INFORMATION, Reason, RECORD
from tactile_sensing.types.image import COMPONENTS, Layer

MAX_LENGTH = 0.1  # m; a larger pitch or depth was meant in millimetres
CHUNK_BYTES = 1 << 20
MAX_CHUNK = 1024  # frames
QUIET = 1.0  # s without a progress bar
TYPES = {
    ContactType.NONE: 'nothing touches',
    ContactType.POINT: 'a point load',
    ContactType.LINE: 'a line load: an edge',
    ContactType.OTHER: 'a contact that is neither',
}
FLAGS = {
    Reason.NO_CONTACT: 'no significant load',
    Reason.LOW_SNR: 'load seen, but too weak to locate',
    Reason.OFF_PAD: 'the located contact lies outside the array',
    Reason.FEW_TACTELS: 'too few valid tactels',
    Reason.NOT_CONVERGED: 'the fit did not settle',
    Reason.BAD_FIT: 'no model explains the frame',
    Reason.BAD_IMAGE: 'frame malformed',
    Reason.TWO_CONTACTS: 'more than one contact',
    Reason.NOT_TARED: 'not set by this command: it takes frames as tared',
    Reason.SATURATED: 'saturated tactels were left out (can be set with valid)',
    Reason.DEAD_TACTELS: 'invalid tactels were left out (can be set with valid)',
    Reason.FORCE_MISMATCH: 'P and force_windowed disagree (can be set with valid)',
}

EXAMPLE = """\
  python3 -c "
  import numpy as np
  x = (np.arange(16) - 7.5) * 0.001  # tactels 1 mm apart; an edge of 200 N/m at x = 1 mm
  p = 2 * 200 * 0.002**3 / np.pi / ((x - 0.001)**2 + 0.002**2)**2
  np.savez('frames.npz', frames=np.tile(p, (100, 16, 1)) + np.random.normal(0, 630, (100, 16, 16)))
  "
  ros2 run tactile_sensing estimate frames.npz --pitch 0.001 --layers zz@0.002 -o contacts.npz
  python3 -c "import numpy as np; c = np.load('contacts.npz'); print(c['a'].mean(), c['type'][0])"
"""


def _table(rows, width):
    return '\n'.join(f'  {name!s:{width}} {text}' for name, text in rows)


def _shape(name):
    return '(N, 7, 7)' if RECORD[name].shape else '(N,)'


def parser() -> argparse.ArgumentParser:
    """Command line."""
    arrays = _table(
        ((name, f'{_shape(name):9} {RECORD[name].base.name:8} {column.metadata["unit"]:4} '
          f'{column.metadata["doc"]}') for name, column in COLUMNS.items()), 16)
    types = _table(
        ((int(kind), f'{kind.name.lower()}: {text}') for kind, text in TYPES.items()), 6)
    flags = _table(((int(flag), f'{flag.name}: {text}') for flag, text in FLAGS.items()), 6)
    arguments = Parser(
        prog='estimate', formatter_class=argparse.RawDescriptionHelpFormatter,
        usage='estimate FRAMES.npz --pitch M [M] --layers COMPONENT@DEPTH,... [options] -o OUT',
        description="""\
Estimate the contact in every frame of a file: point or edge, where, and with what force.
A file of any length takes the same memory. The summary goes to standard error.

Input array of FRAMES.npz (from numpy.savez or numpy.savez_compressed)
  frames           (N, rows, columns) or (N, layers, rows, columns), real numbers, in Pa:
                   pressure (compression positive) or shear stress above that of the unloaded pad;
                   x runs along increasing column, y along increasing row, the origin is the
                   centre of the array. NaN and infinity mark invalid tactels.""",
        epilog=f"""\
Output arrays, SI units; NaN where a type does not have a value, and in every real number of a
frame that is not valid:
{arrays}

In a .csv file, each is a column after the number of the frame; of the covariance, the upper
triangle: covariance_0_0, covariance_0_1, ..., covariance_6_6.

Types
{types}

Flags (sum of)
{flags}

Example
{EXAMPLE}
Exit status: 0, or 1 after one line that says what is wrong; then nothing is written.""")
    arguments.add_argument('frames', nargs='?', metavar='FRAMES.npz', help='input')
    arguments.add_argument('--pitch', nargs='+', required=True, metavar='M',
                           help='distance between tactels, or along x and along y [m]')
    arguments.add_argument(
        '--layers', required=True, metavar='COMPONENT@DEPTH,...',
        help=f'stress component ({", ".join(COMPONENTS)}) and depth below the surface of the '
        'skin [m] of each layer in turn, for instance zz@0.002 or zz@0.002,xz@0.002')
    arguments.add_argument('-o', '--out', required=True, metavar='OUT',
                           help='file to write, .npz or .csv; replaced if it exists')
    arguments.add_argument('--method', help=f'estimator: {", ".join(METHODS)} '
                           f'(default: {EstimatorConfig.method})')
    arguments.add_argument('--model', choices=MODELS,
                           help='contact to look for (default: auto)')
    arguments.add_argument('--fit-depth', action='store_true',
                           help='find the depth of the tactels from each frame, near that given')
    arguments.add_argument('--tactel', choices=TACTELS,
                           help='a tactel measures the stress at its centre, or the mean over '
                           'its area (default: point)')
    arguments.add_argument('--dead', default='', metavar='R,C;R,C',
                           help='row and column, from 0, of tactels that are never used (in '
                           'quotes, because of the semicolon)')
    arguments.add_argument('--noise', default='0', metavar='PA',
                           help='standard deviation of one tactel (default: as the finest detail '
                           'of each frame shows)')
    arguments.add_argument('--full-scale', default='0', metavar='PA',
                           help='from here on a tactel is saturated and not used')
    return arguments


def parse(args: list[str] | None = None) -> argparse.Namespace:
    """Parse the command line; the input may also stand behind `--pitch`."""
    options = parser().parse_args(args)
    if options.frames is None and len(options.pitch) > 1:
        options.frames = options.pitch.pop()
    if options.frames is None:
        raise ConfigurationError('FRAMES.npz is missing')
    return options


def number(name: str, text: str, low: float, high: float, unit: str) -> float:
    """Return the number in a text, at least `low` and below `high`."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not low <= value < high:
        raise ConfigurationError(
            f'{name} is {text!r}, must be a number of at least {low:g} and below {high:g} {unit}')
    return value


def parse_layers(text: str) -> tuple[tuple[str, float], ...]:
    """Return the component and depth [m] of each layer of `COMPONENT@DEPTH,...`."""
    layers = []
    for layer in text.split(','):
        component, _, depth = layer.strip().partition('@')
        if component not in COMPONENTS:
            raise ConfigurationError(
                f'--layers: component {component!r} is not one of {", ".join(COMPONENTS)}')
        layers.append((component, number(f'--layers: depth of {component}', depth, 1e-9,
                                         MAX_LENGTH, 'm')))
    if 'zz' not in [component for component, _ in layers]:
        raise ConfigurationError(f'--layers: {text} has no layer of pressure (zz)')
    return tuple(layers)


def parse_dead(text: str, array: TactelArray) -> np.ndarray:
    """Return where the tactels of `R,C;R,C` are, shape `(rows, columns)`, bool."""
    dead = np.zeros(array.shape, bool)
    for pair in filter(None, text.split(';')):
        try:
            row, column = (int(index) for index in pair.split(','))
        except ValueError:
            raise ConfigurationError(f'--dead: {pair!r} is not R,C') from None
        if not (0 <= row < array.rows and 0 <= column < array.columns):
            raise ConfigurationError(
                f'--dead: row {row}, column {column} is outside the array of {array.rows} rows '
                f'and {array.columns} columns (from 0)')
        dead[row, column] = True
    return dead


def make_config(options: argparse.Namespace) -> EstimatorConfig:
    """Return the estimator's configuration with the options that were given."""
    given = {name: getattr(options, name) for name in ('method', 'model', 'tactel')}
    return EstimatorConfig(
        fit_depth=options.fit_depth, **{name: value for name, value in given.items() if value})


def make_sensor(options: argparse.Namespace, reader: ArrayReader) -> tuple:
    """Array, layers and dead tactels of the options, checked against the input."""
    layers = parse_layers(options.layers)
    if len(options.pitch) > 2:
        raise ConfigurationError(f'--pitch takes one length or two, not {len(options.pitch)}')
    pitch = [number('--pitch', text, 1e-9, MAX_LENGTH, 'm') for text in options.pitch]
    shape = reader.shape
    if len(shape) not in (3, 4) or 0 in shape:
        raise ConfigurationError(
            f'{options.frames}: frames has shape {shape}, must be (N, rows, columns) or (N, '
            'layers, rows, columns), none of them 0')
    if reader.dtype.kind not in 'uif':
        raise ConfigurationError(
            f'{options.frames}: frames is of type {reader.dtype}, must be of real numbers')
    there = 1 if len(shape) == 3 else shape[1]
    if there != len(layers):
        raise ConfigurationError(
            f'--layers names {len(layers)} (of {options.layers}), but frames has shape {shape}: '
            f'{there} layer{"s" * (there > 1)}')
    *_, rows, columns = shape
    array = TactelArray(rows, columns, pitch[0], pitch[-1])
    noise = number('--noise', options.noise, 0.0, 1e9, 'Pa')
    full_scale = number('--full-scale', options.full_scale, 0.0, 1e12, 'Pa')
    return array, [Layer(component, depth, np.empty(0), full_scale, noise)
                   for component, depth in layers], parse_dead(options.dead, array)


class Tally:
    """Counts of what was found."""

    def __init__(self):
        self._types = dict.fromkeys(ContactType, 0)
        self._refusals = dict.fromkeys(Reason, 0)
        self._invalid = 0

    def add(self, records):
        """Count rows of the output."""
        refused = records['flags'][~records['valid']]
        self._invalid += len(refused)
        for kind in self._types:
            self._types[kind] += int(np.count_nonzero(records['type'] == kind))
        for reason in self._refusals:
            if not reason & INFORMATION:
                self._refusals[reason] += int(np.count_nonzero(refused & int(reason)))

    def __str__(self):
        types, reasons = (', '.join(
            f'{count} {str(key.name).lower()}' for key, count in counts.items() if count)
            for counts in (self._types, self._refusals))
        return f'{types}; {self._invalid} not valid' + (f': {reasons}' if reasons else '')


def run(options: argparse.Namespace) -> str:
    """Estimate every frame of the input; returns the summary."""
    config = make_config(options)
    reader = ArrayReader(options.frames, 'frames')
    array, layers, dead = make_sensor(options, reader)
    if Path(options.out).exists() and os.path.samefile(options.frames, options.out):
        raise ConfigurationError(f'{options.out}: is the input as well')
    total = reader.shape[0]
    frame_size = math.prod(reader.shape[1:]) * reader.dtype.itemsize
    chunk = min(max(CHUNK_BYTES // frame_size, 1), MAX_CHUNK)
    tally, done = Tally(), 0
    with RecordWriter(options.out, RECORD, total) as writer:
        estimator = ContactEstimator(config)
        begin = time.perf_counter()
        with Progress(total, QUIET) as progress:
            for frames in reader.chunks(chunk):
                stress = np.array(frames, dtype=np.float64)
                stress[..., dead] = np.nan
                records = estimator.estimate_batch(stress, array, layers)
                done += len(frames)
                progress.show(done, 'estimate', f'{done} of {total} frames')
                tally.add(records)
                writer.append(records)
        rate = total / max(time.perf_counter() - begin, 1e-9)
    return f'{options.out}: {total} frames, {rate:.0f} frames/s; {tally}'


def main(args: list[str] | None = None) -> int:
    """Run the command; exit status 0 if the output was written."""
    try:
        print(f'estimate: {run(parse(args))}', file=sys.stderr)
    except (TactileError, OSError) as error:
        print(f'estimate: {" ".join(str(error).split())}', file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print('estimate: interrupted, nothing written', file=sys.stderr)
        return 130
    return 0
