"""Command `estimate`: estimate the contact in every frame of a file or bag."""

import argparse
from collections.abc import Sequence
from enum import IntEnum, IntFlag
import os
import sys
from textwrap import fill
import time

import numpy as np

from tactile_common.command_line import between, file_to_write, Parser, run_command
from tactile_common.errors import ConfigurationError
from tactile_common.npz_stream import write_records
from tactile_common.progress import Progress
from tactile_sensing.cli.estimate_sources import source_of
from tactile_sensing.cli.options import add_pitch, add_shape, is_bag
from tactile_sensing.contact.estimator import (
    ContactEstimator,
    EstimatorConfig,
    METHODS,
    MODELS,
    TACTELS,
)
from tactile_sensing.types.contact import COLUMNS, ContactType, INFORMATION, Reason, RECORD
from tactile_sensing.types.image import COMPONENTS

QUIET = 1.0  # time before the progress bar appears [s]
MANY = 0.5  # a larger share of unexplained loads may be due to wrong options
REFUSALS = [reason for reason in Reason if not reason & INFORMATION]
DESCRIPTION = """\
Estimate the contact in every frame of a file: point or edge, where, and with what force.
A file of any length takes the same memory. The summary goes to standard error.

Input array of FRAMES.npz (from numpy.savez or numpy.savez_compressed), or the one of FRAMES.npy
  frames           (N, rows, columns) or (N, layers, rows, columns), real numbers, tared:
                   pressure (compression positive) or shear stress above that of the unloaded pad;
                   x runs along increasing column, y along increasing row, the origin is the
                   centre of the array. NaN and infinity mark invalid tactels.
                   (N, rows*columns) with --shape R C.
FRAMES.csv or .txt holds a frame a line, rows*columns numbers, row by row, below a header or none.

What the numbers mean:
  --calibration    raw counts as they come from the device, or volts where the file has a
                   `resolution`; the file, which the command `calibrate` makes, says all the rest
  --pitch --layers pressure in Pa, or in a unit of --scale Pa: place, direction and force
  --pitch          floats of any unit, linear in the pressure: place and direction, no force
Integers are counts: without a calibration they are refused unless --scale is given.

A BAG is a rosbag2 recording (folder, .mcap or .db3) of the topic image; its images describe the
sensor. They are estimated as by the node contact_estimator with the same parameters. With
--calibration they must be raw counts that the driver passed through.
"""
EPILOG = """\
Output arrays, SI units; NaN where a type does not have a value, in every real number of a frame
that is not valid, and in its forces and patch where force_valid is false:
{arrays}
and of a BAG
  t                (N,)      float64  s    stamp of the image

In a .csv file, each is a column after the number of the frame; of the covariance, the upper
triangle: covariance_0_0, covariance_0_1, ..., covariance_6_6.

Types: {types}
Flags, of which a sum is written: {flags}

Examples
  ros2 run tactile_sensing estimate frames.npz --pitch 0.001 --layers zz@0.002 -o contacts.npz
  ros2 run tactile_sensing estimate volts.csv --shape 16 16 --pitch 0.001 --noise 0.01 -o c.npz
Exit status: 0, or 2 after one line that says what is wrong; then nothing is written."""


def _epilog() -> str:
    arrays = []
    for name, column in COLUMNS.items():
        kind, about = RECORD[name], column.metadata
        shape = f'({", ".join(("N", *map(str, kind.shape)))})'.replace('(N)', '(N,)')
        arrays.append(f'  {name:16} {shape:9} {kind.base.name:8} {about["unit"]:4} {about["doc"]}')
    types, flags = (fill(', '.join(f'{it.name}={int(it)}' for it in kind), 90,
                         subsequent_indent='  ') for kind in (ContactType, Reason))
    return EPILOG.format(arrays='\n'.join(arrays), types=types, flags=flags)


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
    add('frames', metavar='FRAMES.npz|.npy|.csv|.txt|BAG', help='input')
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
    add('-o', '--out', required=True, metavar='OUT', type=file_to_write('.npz', '.csv'),
        help='file to write, .npz or .csv; replaced if it exists')
    add('--method',
        help=f'estimator: {", ".join(METHODS)} (default: {EstimatorConfig.method})')
    add('--model', choices=MODELS, help='contact to look for (default: auto)')
    add('--tactel', choices=TACTELS, help='a tactel measures the stress at its centre, or the '
        'mean over its area (default: as the calibration says, or area)')
    add('--noise', metavar='SD', type=between(0.0, 1e9, 'Pa'), help='standard deviation of one '
        'tactel, in Pa, or without --layers and --scale in the unit of the frames; if unloaded '
        'tactels always read 0, that of loaded ones while nothing moves (default: estimated from '
        'the finest detail of each frame)')
    return arguments


def parse(args: list[str] | None = None) -> argparse.Namespace:
    """Parse the command line."""
    options = parser().parse_args(args)
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


def make_config(options: argparse.Namespace, tactel: str | None = None) -> EstimatorConfig:
    """Return the estimator's configuration from the options and a default for `tactel`."""
    given = {'method': options.method, 'model': options.model, 'tactel': options.tactel or tactel}
    return EstimatorConfig(**{name: value for name, value in given.items() if value is not None})


def _counted(names: Sequence[IntEnum | IntFlag], counts: np.ndarray) -> str:
    return ', '.join(f'{count} {str(name.name).lower()}'
                     for name, count in zip(names, counts.tolist(), strict=True) if count)


def run(options: argparse.Namespace) -> str:
    """Estimate every frame of the input; return the summary."""
    source = source_of(options)
    estimator = ContactEstimator(make_config(options, source.tactel))
    if options.out.exists() and os.path.samefile(options.frames, options.out):
        raise ConfigurationError(f'{options.out}: is the input as well')
    total, done = source.total, 0
    rows, begin = np.zeros(total, source.dtype), time.perf_counter()
    with Progress(total, QUIET) as progress:
        for records in source.records(estimator):
            rows[done:done + len(records)] = records
            done += len(records)
            progress.show(done, 'estimate', f'{done} of {total} frames')
    rate = total / max(time.perf_counter() - begin, 1e-9)
    write_records(options.out, rows)
    reasons = rows['reasons'][~rows['valid']]
    types = np.bincount(rows['type'], minlength=len(ContactType))
    refusals = np.array([np.count_nonzero(reasons & int(it)) for it in REFUSALS])
    why = _counted(REFUSALS, refusals)
    unexplained = np.count_nonzero(reasons & int(Reason.BAD_FIT))
    if unexplained > MANY * np.count_nonzero(rows['type'] != ContactType.NONE):
        why += ('; most loads are neither a point nor a line: check rows and columns, pitch, and '
                'that compression is positive')
    return (f'{options.out}: {total} frames, {rate:.0f} frames/s; '
            f'{_counted(list(ContactType), types)}; {len(reasons)} not valid'
            + f': {why}' * bool(why))


def main(args: list[str] | None = None) -> int:
    """Run the command; exit status 0 if the output was written."""
    return run_command('estimate', lambda: f'estimate: {run(parse(args))}')


if __name__ == '__main__':
    sys.exit(main())
