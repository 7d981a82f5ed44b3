"""Command `calibrate`: make a calibration file from recordings of raw counts."""

import argparse
from dataclasses import fields
from pathlib import Path
import sys
from typing import Any

import numpy as np

from tactile_common.command_line import between, FAILED, file_to_write, Parser, PICTURES, refusing
from tactile_common.errors import ConfigurationError
from tactile_common.npz_stream import read_arrays
from tactile_common.progress import Progress
from tactile_sensing.calibration.procedure import calibrate, Known, Procedure
from tactile_sensing.calibration.recorder import Recorder
from tactile_sensing.calibration.report import draw_report, verdict
from tactile_sensing.cli.options import (
    add_pitch,
    add_sensor,
    add_shape,
    counts_reader,
    is_bag,
    opened,
)
from tactile_sensing.devices.calibration import pitch_pair, RESOLUTION, save_calibration
from tactile_sensing.devices.counts import Counts, MAX_BITS
from tactile_sensing.devices.recording import read_whole
from tactile_sensing.types.array import PITCH, TactelArray

RECORDED = {
    'unloaded': 'of the unloaded pad', 'corners': 'of presses in the corners',
    'rolling': 'of anything rolled over the pad: range, threshold and silent tactels are found',
    'ball': 'of presses of a small ball; an array `force` (N,) [N] in it is that of each',
    'flat': 'of presses of the ball all over the pad'}
STEPS = 4  # largest number of steps of the progress bar
DOUBTFUL = FAILED  # exit status of a calibration that cannot be trusted
MOST_NAMED = 8  # largest number of excluded frames to list

EPILOG = """\
Record, each into a file of its own (numpy.savez(FILE, frames=frames) or numpy.save, frames of raw
counts, (N, rows, columns), or a bag of a driver that passes counts through; flat frames and .csv
files with --shape, volts with --resolution); every step is optional, and the file says what was
assumed instead:

  1 unloaded  a hundred frames with nothing on the pad: offset, noise, dead tactels, threshold
  2 corners   four frames, a finger in each corner: first row and column; first row, last column;
              last row and column; last row, first column
  3 ball      twenty presses of a small ball (1 mm radius or so) anywhere, neither hard nor close
              to the border, ten frames of each: the skin; with --force also the gain
  4 flat      forty presses of the same ball evenly all over the pad: the gain of every tactel

Example: a pad of 16 x 16 tactels on one inch, a ball pressed by a weight of 100 g
  ros2 run tactile_sensing calibrate --out pad.yaml --pitch 0.0015875 --unloaded u.npz \\
      --ball b.npz --ball-radius 0.001 --force 0.981 --flat f.npz --report pad.png
  ros2 run tactile_sensing estimate frames.npz --calibration pad.yaml -o contacts.npz

`--live FOLDER` asks for them one by one instead, from the sensor on `--port`, tells which press
was none, and goes on from where it was interrupted.

Frames that are no single press of the ball are named and left out. Without --force there
are places and directions, but no forces. The last line says what the calibration is good for. Exit
status: 0; 1 where the file is written but is not to be trusted: the lines before the last one say
why; 2 after one line that says what is wrong: nothing is written, or only no report."""


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    arguments = Parser(
        prog='calibrate', formatter_class=argparse.RawDescriptionHelpFormatter, epilog=EPILOG,
        description='Calibrate a tactile array: from '
        'recordings of raw counts to the file that driver and `estimate` read.')
    add = arguments.add_argument
    add('--out', required=True, metavar='CAL.yaml', type=file_to_write(), help='file to write')
    add_pitch(arguments, required=True)
    add_shape(arguments)
    add('--live', metavar='FOLDER', help='ask for every recording, take it from the sensor on '
        '--port and keep it in this folder; what is there already stays')
    add_sensor(arguments)
    for name, text in RECORDED.items():
        add(f'--{name}', metavar='FILE', help=f'frames {text}')
    metres, count = between(*PITCH, 'm'), between(-32768, 65536, kind=int)
    add('--namespace', help='of the sensor in bags that have several')
    add('--ball-radius', metavar='M', type=metres, default=0.0, help='of the ball [m]')
    add('--force', metavar='N', type=between(1e-6, 1e6, 'N'),
        help='with which the ball was pressed, each time [N]')
    add('--depth', metavar='M', type=metres, default=0.0,
        help='of the tactels, where it is known [m]')
    add('--thickness', metavar='M', type=metres, default=0.0,
        help='of the skin on its backing, where it is known [m]')
    add('--poisson', metavar='NU', type=between(0.0, 0.5),
        help="Poisson's ratio of the skin, where it is known (else it is found, or assumed)")
    add('--gain', metavar='PA', default=0.0, type=between(1e-9, 1e12, 'Pa'),
        help='pressure of a count, where it is known [Pa]')
    add('--tactel', choices=('area', 'point'), default='area',
        help='a tactel measures the mean over its area, or the stress at its centre '
        '(default: %(default)s)')
    add('--bits', metavar='N', type=between(1, MAX_BITS, kind=int),
        help='of the converter, 1 to 16 (default: from the bag or from counts under load; '
        'needed where only the unloaded pad was recorded, in a file)')
    add('--resolution', metavar='V', type=between(*RESOLUTION), default=1.0,
        help='step of the converter where recordings are volts (or another unit), not counts')
    add('--signed', choices=('yes', 'no'), help='counts (default: as they show)')
    add('--threshold', metavar='COUNT', type=count, help='least count that is reported as '
        'such: smaller ones become the lowest (default: as the counts show)')
    add('--saturation', metavar='COUNT', type=count, help='count from which on a tactel is at '
        'full scale (default: the highest of the converter)')
    add('--report', metavar='FILE.png', type=file_to_write(*PICTURES),
        help='draw noise, gains, and what the fit leaves of the presses')
    return arguments


def record(options: argparse.Namespace) -> None:
    """Make the recordings of the options from the sensor on a port."""
    if not options.port:
        raise ConfigurationError('--live needs --port, the serial port of the sensor')
    if options.resolution != 1.0:
        raise ConfigurationError('--resolution is of files, but --live records counts')
    full = np.inf if options.saturation is None else options.saturation
    if options.bits:
        full = Counts(
            options.bits, options.signed == 'yes', saturation=options.saturation).saturation
    with opened(options) as sensor:
        def look() -> np.ndarray:
            return next(sensor).counts.astype(float)

        def ask(text: str) -> str:
            answer = input(text)
            sensor.forget()
            return answer
        rows, columns = options.shape
        array = TactelArray(rows, columns, *options.pitch)
        try:
            Recorder(Path(options.live), array, look, ask, print, full).run()
        except EOFError:
            raise ConfigurationError(
                'no more answers; the same command continues from here') from None
    for name in RECORDED:
        path = Path(options.live, f'{name}.npz')
        if path.exists() and getattr(options, name) is None:
            setattr(options, name, str(path))


def read_recordings(options: argparse.Namespace) -> dict[str, np.ndarray]:
    """Read the files of the options; set missing options for the counts from a bag."""
    found, shape = {}, tuple(options.shape) if options.shape else None
    paths = {name: getattr(options, name) for name in RECORDED if getattr(options, name)}
    if options.namespace is not None and not any(map(is_bag, paths.values())):
        raise ConfigurationError('--namespace needs a bag, no recording is one')
    for name, path in paths.items():
        reader = counts_reader(
            path, options.resolution, shape, options.namespace, source='--shape')
        found[name] = read_whole(path, reader).astype(float)
        if not np.isfinite(found[name]).all():
            raise ConfigurationError(f'{path}: frames holds values that are not finite')
        if is_bag(path) and options.bits is None:
            options.bits = reader.bits
            options.signed = options.signed or ('no', 'yes')[reader.signed]
    return found


def read_force(options: argparse.Namespace, frames: int) -> np.ndarray | None:
    """Return the force of all presses of the ball, or of each frame [N]; None: unknown."""
    if options.force is not None and not options.ball:
        raise ConfigurationError('--force needs --ball')
    if options.force is not None:
        return np.array(options.force)
    if not options.ball or Path(options.ball).suffix.lower() != '.npz':
        return None
    force = read_arrays(options.ball, (), ('force',)).get('force')
    if force is None:
        return None
    if force.dtype.kind not in 'uif' or force.size not in (1, frames) or not (
            np.isfinite(force) & (force > 0.0)).all():
        raise ConfigurationError(
            f'{options.ball}: force is {force.size} of type {force.dtype}, must be one number or '
            f'{frames}, finite and above 0 N')
    return force.ravel()


def describe(outcome: Procedure) -> list[str]:
    """Return lines that list what was found, excluded and assumed."""
    calibration = outcome.calibration
    found = calibration.found
    lines = [f'{name}: {_plain(found[name])}'
             for name in ('unloaded', 'order', 'skin', 'force', 'gains') if name in found]
    lines.append(f'depth {1e3 * calibration.depth:.3f} mm, skin ' + (
        f'{1e3 * calibration.thickness:.3f} mm thick' if calibration.thickness
        else 'without a backing near') + f', unit {calibration.unit}')
    for name, bad in outcome.left_out.items():
        lines += [f'{name}, frame {k} left out: {bad[k]}' for k in list(bad)[:MOST_NAMED]]
        if len(bad) > MOST_NAMED:
            lines.append(f'{name}: and {len(bad) - MOST_NAMED} more')
    return lines + [f'assumed: {text}' for text in found['assumed']]


def _plain(value: Any) -> str:
    if isinstance(value, dict):
        return ', '.join(f'{key} {_plain(item)}' for key, item in value.items() if item != {})
    return str(value)


def run(options: argparse.Namespace) -> bool:
    """Calibrate and print the result; return whether it can be trusted."""
    if options.thickness and not options.depth:
        raise ConfigurationError('--thickness needs --depth')
    options.pitch = pitch_pair(options.pitch)
    if options.live:
        record(options)
    recordings = read_recordings(options)
    force = read_force(options, len(recordings.get('ball', ())))
    same = {item.name for item in fields(Known)} - {'signed', 'force'}
    known = Known(signed=options.signed and options.signed == 'yes', force=force,
                  **{name: getattr(options, name) for name in same})
    with Progress(STEPS) as progress:
        done = iter(range(1, STEPS + 1))
        outcome = calibrate(recordings, known, lambda text: progress.show(
            next(done, STEPS), 'calibrate', text))
        save_calibration(outcome.calibration, options.out)
        if options.report:
            progress.show(STEPS, 'report')
            draw_report(outcome.calibration, outcome.presses, outcome.skin, options.report)
    print(*describe(outcome), f'{options.out} written',
          *(f'doubtful: {text}' for text in outcome.doubts),
          verdict(outcome.calibration, outcome.skin)
          + '; do not trust it' * bool(outcome.doubts), sep='\n', file=sys.stderr)
    return not outcome.doubts


def main(args: list[str] | None = None) -> int:
    """Run the command; exit status 0 if the file was written and can be trusted."""
    with refusing('calibrate') as command:
        command.status = 0 if run(parser().parse_args(args)) else DOUBTFUL
    return command.status


if __name__ == '__main__':
    sys.exit(main())
