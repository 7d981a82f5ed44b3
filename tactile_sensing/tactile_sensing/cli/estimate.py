"""Command `estimate`: estimate the contact in every frame of a file or bag."""

import argparse
from collections.abc import Callable, Iterator, Sequence
from dataclasses import astuple, replace
from enum import IntEnum, IntFlag
import math
import os
import sys
from textwrap import fill
import time
from typing import Any

import numpy as np

from tactile_common.command_line import between, file_to_write, Parser, reading_bags, run_command
from tactile_common.config import checked
from tactile_common.errors import ConfigurationError
from tactile_common.npz_stream import write_records
from tactile_common.progress import Progress
from tactile_sensing.cli.options import add_pitch, add_shape, counts_reader, is_bag
from tactile_sensing.contact.estimator import (
    ContactEstimator,
    EstimatorConfig,
    METHODS,
    MODELS,
    TACTELS,
)
from tactile_sensing.devices.calibration import load_calibration, pitch_pair
from tactile_sensing.devices.recording import CHUNK, FrameReader, read_whole, stored_scalars
from tactile_sensing.devices.tare import TareRefusedError
from tactile_sensing.types.array import PITCH, TactelArray
from tactile_sensing.types.contact import (
    COLUMNS,
    ContactType,
    INFORMATION,
    REALS,
    Reason,
    RECORD,
    STAMPED,
)
from tactile_sensing.types.image import COMPONENTS, Layer

CHUNK_BYTES = 1 << 20
Estimates = tuple[np.ndarray, Iterator[np.ndarray]]  # zeros to fill; the records, in chunks
MANY = 0.5  # a larger share of unexplained loads may be due to wrong options
REFUSALS = [reason for reason in Reason if not reason & INFORMATION]
DESCRIPTION = """\
Estimate the contact in every frame of a file: point or edge, where, and with what force.
Frames are read in parts. The summary goes to standard error.

Input array of FRAMES.npz (from numpy.savez or numpy.savez_compressed), or the one of FRAMES.npy
  frames           (N, rows, columns) or (N, layers, rows, columns), real numbers, tared:
                   pressure (compression positive) or shear stress above that of the unloaded pad;
                   x runs along increasing column, y along increasing row, the origin is the
                   centre of the array. NaN and infinity mark invalid tactels.
                   (N, rows*columns) with --shape R C.
  pitch_m          distance between tactels [m], of an .npz without --pitch; optional
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
        stored = stored_scalars(options.frames, 'pitch_m')
        if not stored:
            raise ConfigurationError('--calibration is missing, or --pitch')
        options.pitch = [checked(f'{options.frames}: pitch_m', stored['pitch_m'], float,
                                 {'range': PITCH, 'unit': 'm'})]
    if options.tare and not options.calibration:
        raise ConfigurationError('--tare needs --calibration: it is of frames in counts')
    if options.namespace is not None and not any(
            is_bag(path) for path in (options.frames, options.tare) if path):
        raise ConfigurationError(f'--namespace needs a bag, {options.frames} is none')
    return options


def estimates_of(options: argparse.Namespace) -> Estimates:
    """Return an array for the records of all frames, and an iterator over its contents."""
    if options.calibration:
        return _calibrated(options)
    return _images(options) if is_bag(options.frames) else _plain(options)


def estimator_of(options: argparse.Namespace) -> ContactEstimator:
    """Return the estimator that the options configure."""
    given = {name: getattr(options, name) for name in ('method', 'model', 'tactel')}
    return ContactEstimator(EstimatorConfig(
        **{name: value for name, value in given.items() if value is not None}))


def _frames(options: argparse.Namespace, reader: Any, array: TactelArray, layers: list[Layer],
            to_stress: Callable[[np.ndarray, int], np.ndarray]) -> Estimates:
    """Estimate the frames of a reader; `to_stress` takes frames and the number of the first."""
    estimator = estimator_of(options)

    def records() -> Iterator[np.ndarray]:
        frame_size, done = math.prod(reader.shape[1:]) * reader.dtype.itemsize, 0
        for frames in reader.chunks(min(max(CHUNK_BYTES // frame_size, 1), CHUNK)):
            stress = to_stress(frames, done)
            done += len(frames)
            yield estimator.estimate_batch(stress, array, layers)
    return np.zeros(reader.shape[0], RECORD), records()


def _images(options: argparse.Namespace) -> Estimates:
    """Estimate the images of a bag; they contain the properties of their sensor."""
    with reading_bags():
        from tactile_sensing.observations import RecordedImages
    images, estimator = RecordedImages(options.frames, options.namespace), estimator_of(options)

    def records() -> Iterator[np.ndarray]:
        for image in images:
            if options.noise is not None:
                image = replace(image, layers=tuple(
                    replace(layer, noise_std=options.noise) for layer in image.layers))
            contact = estimator.estimate(image)
            values = {name: getattr(contact, name) for name in COLUMNS}
            values['moments'] = astuple(contact.moments)
            if not contact.valid:
                values |= dict.fromkeys(REALS, np.nan)
            yield np.array([(*values.values(), 1e-9 * image.stamp_ns)], STAMPED)
    return np.zeros(images.total, STAMPED), records()


def parse_layers(text: str) -> tuple[tuple[str, float], ...]:
    """Return the component and depth [m] of each layer of `COMPONENT@DEPTH,...`."""
    layers = []
    for layer in text.split(','):
        component, _, depth = layer.strip().partition('@')
        if component not in COMPONENTS:
            raise ConfigurationError(
                f'--layers: component {component!r} is not one of {", ".join(COMPONENTS)}')
        name = f'--layers: depth of {component}'
        try:
            value = float(depth)
        except ValueError:
            raise ConfigurationError(f'{name} is {depth!r}, must be a number') from None
        layers.append((component, checked(name, value, float, {'range': PITCH, 'unit': 'm'})))
    if 'zz' not in [component for component, _ in layers]:
        raise ConfigurationError(f'--layers: {text} has no layer of pressure (zz)')
    return tuple(layers)


def _plain(options: argparse.Namespace) -> Estimates:
    """Estimate frames of stress from a sensor that the options describe."""
    reader = FrameReader(options.frames, options.shape and tuple(options.shape))
    if reader.dtype.kind != 'f' and options.scale is None:
        raise ConfigurationError(
            f'{options.frames}: frames are counts ({reader.dtype}): --calibration CAL.yaml says '
            'what a count means; or subtract the unloaded image and save floats, or, if that is '
            'done, give --scale PA_PER_COUNT (without --layers 1 will do)')
    # A depth of 0 means an unknown skin; then there are no forces.
    unit = 'Pa' if options.layers is not None else 'counts'
    layers = (('zz', 0.0),) if options.layers is None else parse_layers(options.layers)
    there = 1 if len(reader.shape) == 3 else reader.shape[1]
    if there != len(layers):
        raise ConfigurationError(
            f'--layers names {len(layers)} (of {options.layers or "zz"}), but frames has shape '
            f'{reader.shape}: {there} layer{"s" * (there > 1)}')
    if options.layers is None and options.method in METHODS[1:]:
        raise ConfigurationError(f'--method {options.method} needs --layers: a closed form of the '
                                 'thesis takes the depth of the tactels')
    scale, (rows, columns) = options.scale or 1.0, reader.shape[-2:]
    return _frames(
        options, reader, TactelArray(rows, columns, *pitch_pair(options.pitch)),
        [Layer(*layer, np.empty(0), unit=unit, noise_std=options.noise or 0.0)
         for layer in layers],
        lambda frames, first: scale * frames.astype(np.float64))


def _calibrated(options: argparse.Namespace) -> Estimates:
    """Estimate frames of counts from a sensor that a calibration describes."""
    calibration, tare = load_calibration(options.calibration), None

    def reader_of(path: str) -> Any:
        return counts_reader(
            path, calibration.resolution, calibration.raw_shape, options.namespace)
    reader = reader_of(options.frames)
    if options.tare:
        unloaded = read_whole(options.tare, reader_of(options.tare))
        try:
            tare = calibration.make_tare(unloaded)
        except TareRefusedError as error:
            raise ConfigurationError(f'--tare {options.tare}: {error}') from error
    options.tactel = options.tactel or calibration.tactel or None
    layer, limits = calibration.layer(tare), calibration.counts
    if options.noise is not None:
        layer = replace(layer, noise_std=options.noise)

    def to_stress(frames: np.ndarray, first: int) -> np.ndarray:
        counts = frames.astype(np.float64)
        outside = limits.outside(counts) & np.isfinite(counts)
        if outside.any():
            k, row, column = np.argwhere(outside)[0]
            raise ConfigurationError(
                f'{options.frames}: frame {first + k}, row {row}, column {column} reads '
                f'{counts[k, row, column]:.6g} counts, but `bits: {limits.bits}` of '
                f'{options.calibration} allows {limits.lowest} to {limits.highest}: set `bits` '
                'and `signed` there as the sensor has them')
        stress = calibration.stress(counts, tare)
        # Saturated, not dead (NaN).
        stress[calibration.full(calibration.arrange(counts))] = layer.full_scale
        return stress
    return _frames(options, reader, calibration.array, [layer], to_stress)


def _counted(names: Sequence[IntEnum | IntFlag], counts: np.ndarray) -> str:
    return ', '.join(f'{count} {str(name.name).lower()}'
                     for name, count in zip(names, counts.tolist(), strict=True) if count)


def run(options: argparse.Namespace) -> str:
    """Estimate every frame of the input; return the summary."""
    rows, chunks = estimates_of(options)
    for path in (options.frames, options.tare):
        if path and options.out.exists() and os.path.samefile(path, options.out):
            raise ConfigurationError(f'{options.out}: is the input as well')
    total, done, begin = len(rows), 0, time.perf_counter()
    with Progress(total) as progress:
        for records in chunks:
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
