"""Command line of `estimate`: its help and its options."""

import argparse
from collections.abc import Iterable
from dataclasses import fields
from typing import Any

import numpy as np

from tactile_common.command_line import between, Parser
from tactile_common.errors import ConfigurationError
from tactile_sensing.cli.options import add_pitch, add_shape, is_bag, length
from tactile_sensing.contact.estimator import EstimatorConfig, METHODS, MODELS, TACTELS
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import COLUMNS, ContactType, Reason, RECORD
from tactile_sensing.types.image import COMPONENTS

# Numeric parameters of the estimator; each is an option.
RULES = tuple(item for item in fields(EstimatorConfig)
              if 'range' in item.metadata and item.name != 'noise_std')
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
    Reason.UNCALIBRATED: 'no gain known, forces are NaN (can be set with valid)',
    Reason.TWO_CONTACTS: 'more than one contact',
    Reason.NOT_TARED: 'not set by this command: it takes frames as tared',
    Reason.SATURATED: 'saturated tactels were left out (can be set with valid)',
    Reason.DEAD_TACTELS: 'invalid tactels were left out (can be set with valid)',
    Reason.SKIN_MISMATCH: 'the given skin does not explain the frame: place and direction only '
                          '(can be set with valid)',
}

EXAMPLE = """\
  python3 -c "
  import numpy as np
  x = (np.arange(16) - 7.5) * 0.001  # tactels 1 mm apart; an edge of 200 N/m at x = 1 mm
  p = 2 * 200 * 0.002**3 / np.pi / ((x - 0.001)**2 + 0.002**2)**2
  np.savez('frames.npz', frames=np.tile(p, (100, 16, 1)) + np.random.normal(0, 630, (100, 16, 16)))
  "
  ros2 run tactile_sensing estimate frames.npz --pitch 0.001 --layers zz@0.002 -o contacts.npz
  python3 -c "import numpy as np; c = np.load('contacts.npz'); print(c['x'].mean(), c['type'][0])"

  ros2 run tactile_sensing estimate volts.csv --shape 16 16 --pitch 0.001 --noise 0.01 -o c.npz
"""


DESCRIPTION = """\
Estimate the contact in every frame of a file: point or edge, where, and with what force.
A file of any length takes the same memory. The summary goes to standard error.

Input array of FRAMES.npz (from numpy.savez or numpy.savez_compressed), or the one of FRAMES.npy
  frames           (N, rows, columns) or (N, layers, rows, columns), real numbers, tared:
                   pressure (compression positive) or shear stress above that of the unloaded pad;
                   x runs along increasing column, y along increasing row, the origin is the
                   centre of the array. NaN and infinity mark invalid tactels.
                   (N, rows*columns) with --shape R C.
FRAMES.csv holds a frame a line, rows*columns numbers, row by row; a header line may stand above.

What the numbers mean:
  --calibration    raw counts as they come from the device, or volts where the file has a
                   `resolution`; the file, which the command `calibrate` makes, says all the rest
  --pitch --layers pressure in Pa, or in a unit of --scale Pa: place, direction and force
  --pitch          floats of any unit, linear in the pressure: place and direction, no force
Integers are counts: without a calibration they are refused unless --scale is given.

A BAG is a rosbag2 recording (folder, .mcap or .db3) of the topic image; its pictures say what the
sensor is, and what is told of them is what the node contact_estimator tells with the parameters
that are options here. With --calibration they must be raw counts that the driver passed through.
"""
EPILOG = """\
Output arrays, SI units; NaN where a type does not have a value, in every real number of a frame
that is not valid, and in its forces and patch where force_valid is false:
{arrays}
and of a BAG
  t                (N,)      float64  s    stamp of the picture

In a .csv file, each is a column after the number of the frame; of the covariance, the upper
triangle: covariance_0_0, covariance_0_1, ..., covariance_6_6.

Types
{types}

Flags (sum of)
{flags}

Example
{example}
Exit status: 0, or 2 after one line that says what is wrong; then nothing is written."""


def _table(rows: Iterable[tuple], width: int) -> str:
    return '\n'.join(f'  {name!s:{width}} {text}' for name, text in rows)


def _epilog() -> str:
    def shape(name: str) -> str:
        return f'({", ".join(("N", *map(str, RECORD[name].shape)))})'.replace('(N)', '(N,)')
    return EPILOG.format(
        arrays=_table(
            ((name, f'{shape(name):9} {RECORD[name].base.name:8} {column.metadata["unit"]:4} '
              f'{column.metadata["doc"]}') for name, column in COLUMNS.items()), 16),
        types=_table(((int(kind), f'{kind.name.lower()}: {text}')
                      for kind, text in TYPES.items()), 6),
        flags=_table(((int(flag), f'{flag.name}: {text}') for flag, text in FLAGS.items()), 6),
        example=EXAMPLE)


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    arguments = Parser(
        formatter_class=argparse.RawDescriptionHelpFormatter, prog='estimate',
        usage='estimate FRAMES|BAG --calibration CAL.yaml [options] -o OUT\n       estimate '
              'FRAMES --pitch M [M] --layers COMPONENT@DEPTH,... [options] -o OUT\n       '
              'estimate FRAMES --pitch M [M] [--noise SD] [options] -o OUT\n       '
              'estimate BAG [options] -o OUT',
        description=DESCRIPTION, epilog=_epilog())
    add = arguments.add_argument
    add('frames', nargs='?', metavar='FRAMES.npz|.npy|.csv|BAG', help='input')
    add('--calibration', metavar='CAL.yaml',
        help='what turns counts into pressure: size, pitch, gains, noise, skin')
    add('--namespace', help='of the sensor in a bag that has several')
    add('--tare', metavar='U.npz', help='frames (n, rows, columns) of the unloaded pad in counts, '
        'taken close to those to estimate (default: the baseline of the calibration)')
    add_pitch(arguments)
    add_shape(arguments)
    add('--scale', metavar='PA', type=between(1e-12, 1e12, 'Pa'),
        help='pressure of one unit of tared frames: Pa per volt or count (default: 1)')
    add('--layers', metavar='COMPONENT@DEPTH,...',
        help=f'stress component ({", ".join(COMPONENTS)}) and depth below the surface of the '
        'skin [m] of each layer in turn, for instance zz@0.002 or zz@0.002,xz@0.002 (default: '
        'pressure under a skin of which nothing is known)')
    add('-o', '--out', required=True, metavar='OUT',
        help='file to write, .npz or .csv; replaced if it exists')
    add('--method',
        help=f'estimator: {", ".join(METHODS)} (default: {EstimatorConfig.method})')
    add('--model', choices=MODELS, help='contact to look for (default: auto)')
    add('--tactel', choices=TACTELS, help='a tactel measures the stress at its centre, or the '
        'mean over its area (default: as the calibration says, or area)')
    add('--dead', default='', metavar='R,C;R,C', help='row and column, from 0, of tactels that '
        'are never used (in quotes, because of the semicolon)')
    add('--noise', metavar='SD', type=between(0.0, 1e9, 'Pa'), help='standard deviation of one '
        'tactel, in Pa, or without --layers and --scale in the unit of the frames, as the next '
        'two (default: estimated from the finest detail of each frame)')
    add('--full-scale', metavar='PA', type=between(0.0, 1e12, 'Pa'),
        help='from here on a tactel is saturated and not used')
    add('--floor', metavar='PA', type=between(-1e12, 1e12, 'Pa'), help='a tactel at or below it '
        'is only known to be below it: clipped, or under a threshold (default: all are measured)')
    for item in RULES:
        low, high = item.metadata['range']
        unit = f' [{item.metadata["unit"]}]' * bool(item.metadata['unit'])
        add(f'--{item.name.replace("_", "-")}', metavar='X', type=float, help=(
            f'{item.metadata["doc"]}{unit}, {low:g} to {high:g} (default: {item.default:g})'))
    return arguments


def parse(args: list[str] | None = None) -> argparse.Namespace:
    """Parse the command line; the input may also follow the values of `--pitch`."""
    options = parser().parse_args(args)
    if options.frames is None and options.pitch and len(options.pitch) > 1:
        options.frames = options.pitch.pop()
    if options.frames is None:
        raise ConfigurationError('FRAMES.npz is missing')
    bag = is_bag(options.frames)
    for name in ('pitch', 'layers', 'shape', 'scale'):
        given = getattr(options, name) is not None
        if given and (options.calibration or bag):
            raise ConfigurationError(
                f'--{name} is given by the {"calibration" if options.calibration else "bag"}')
    if not (options.pitch or options.calibration or bag):
        raise ConfigurationError('--calibration is missing, or --pitch')
    if options.tare and not options.calibration:
        raise ConfigurationError('--tare needs --calibration: it is of frames in counts')
    return options


def parse_layers(text: str) -> tuple[tuple[str, float], ...]:
    """Return the component and depth [m] of each layer of `COMPONENT@DEPTH,...`."""
    layers = []
    for layer in text.split(','):
        component, _, depth = layer.strip().partition('@')
        if component not in COMPONENTS:
            raise ConfigurationError(
                f'--layers: component {component!r} is not one of {", ".join(COMPONENTS)}')
        layers.append((component, length(f'--layers: depth of {component}', depth)))
    if 'zz' not in [component for component, _ in layers]:
        raise ConfigurationError(f'--layers: {text} has no layer of pressure (zz)')
    return tuple(layers)


def parse_dead(text: str, array: TactelArray) -> np.ndarray:
    """Return a mask `(rows, columns)` of the tactels of `R,C;R,C`."""
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


def make_config(options: argparse.Namespace, tactel: str | None = None) -> EstimatorConfig:
    """Return the estimator's configuration from the options and a default for `tactel`."""
    given = {name: getattr(options, name)
             for name in ('method', 'model', *(item.name for item in RULES))}
    given['tactel'] = options.tactel or tactel
    return EstimatorConfig(**{name: value for name, value in given.items() if value is not None})


def layer_values(options: argparse.Namespace) -> dict[str, Any]:
    """Return the fields of `Layer` for noise and range that the options give."""
    values = {'noise_std': options.noise, 'full_scale': options.full_scale, 'floor': options.floor}
    return {name: value for name, value in values.items() if value is not None}
