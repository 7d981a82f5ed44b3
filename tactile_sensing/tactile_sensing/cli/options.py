"""Options that commands share: lengths, frames of counts, the sensor on a port."""

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from tactile_common.command_line import between, reading_bags
from tactile_common.errors import ConfigurationError
from tactile_sensing.devices.counts import Counts
from tactile_sensing.devices.recording import FrameReader, Shape
from tactile_sensing.devices.registry import options_of, protocol_named, PROTOCOLS
from tactile_sensing.devices.stream import open_sensor, SensorStream
from tactile_sensing.types.array import MAX_SIDE, PITCH

BAGS = ('.mcap', '.db3', '.bag')  # endings of bag files; a bag may also be a folder


def add_pitch(arguments: argparse.ArgumentParser, required: bool = False) -> None:
    """Add the option for the pitch, one length or two."""
    arguments.add_argument('--pitch', nargs='+', metavar='M', required=required,
                           type=between(*PITCH, 'm'),
                           help='distance between tactels, or along x and along y [m]')


def add_shape(arguments: argparse.ArgumentParser, required: bool = False) -> None:
    """Add the option for rows and columns, which flat frames need."""
    arguments.add_argument(
        '--shape', nargs=2, metavar=('R', 'C'), required=required,
        type=between(1, MAX_SIDE, kind=int),
        help='rows and columns of the sensor, or of frames that lie flat: (N, rows*columns), .csv')


def add_sensor(arguments: argparse.ArgumentParser, required: bool = False) -> None:
    """Add the options that `opened` reads, except `--shape`, `--bits` and `--signed`."""
    add = arguments.add_argument
    add('--port', required=required, metavar='PORT', help='serial port of the sensor, for '
        'instance /dev/ttyUSB0')
    add('--protocol', choices=PROTOCOLS, default='csv_lines',
        help='byte protocol (default: %(default)s)')
    add('--options', default='', metavar='TEXT', help='of the protocol, for instance '
        "'stamp=us checksum=true'")
    add('--rate', type=between(0.1, 10e3, 'Hz'), default=0.0, metavar='HZ',
        help='images a second, about (default: unknown)')
    add('--baud', type=between(0, 12_000_000, 'bit/s', int), default=0, metavar='BAUD',
        help="line speed (default: the protocol's)")


def opened(options: argparse.Namespace) -> SensorStream:
    """Open the sensor of the options; raise the errors of `open_sensor`."""
    if not options.shape:
        raise ConfigurationError('--shape R C is missing: rows and columns of the sensor')
    (rows, columns), kind = options.shape, protocol_named(options.protocol).kind
    if options.bits:
        counts = Counts(options.bits, options.signed == 'yes').dtype
        kind = kind if np.can_cast(counts, kind) else counts  # lines of text carry any counts
    return open_sensor(options.port, options.protocol, rows, columns, options.rate,
                       baud=options.baud, kind=kind,
                       **options_of(options.protocol, options.options))


def is_bag(path: str) -> bool:
    """Return whether a path is that of a bag, not of a file of arrays."""
    return Path(path).suffix in BAGS or Path(path).is_dir()


def counts_reader(path: str, resolution: float, shape: Shape | None = None,
                  namespace: str | None = None, source: str = 'the calibration') -> Any:
    """
    Return a reader of frames in counts, (N, rows, columns).

    It is a FrameReader, or RecordedCounts for a bag, which has the same `shape` and `chunks`;
    `resolution` is the size of a count in a file. Raises a ConfigurationError if the frames do
    not have the given shape; `source` names its origin.
    """
    if is_bag(path):
        with reading_bags():
            from tactile_sensing.observations import RecordedCounts
        reader: Any = RecordedCounts(path, namespace)
    else:
        reader = FrameReader(path, shape, source, resolution)
    there = reader.shape
    if len(there) != 3 or (shape is not None and there[1:] != shape):
        wanted = f'{shape[0]}, {shape[1]}) as {source} says' if shape else 'rows, columns)'
        raise ConfigurationError(f'{path}: frames has shape {there}, must be (N, {wanted}')
    return reader
