"""Command `record`: show or record the raw counts of a sensor on a serial port."""
import argparse
from collections.abc import Iterable
import sys
import time

import numpy as np

from tactile_common.command_line import between, file_to_write, Parser, run_command
from tactile_common.errors import ConfigurationError, TactileError
from tactile_common.npz_stream import MAX_WHOLE, write_arrays
from tactile_sensing.cli.options import add_pitch, add_sensor, add_shape, opened
from tactile_sensing.devices.calibration import pitch_pair
from tactile_sensing.devices.counts import MAX_BITS
from tactile_sensing.devices.frame_clock import SensorImage

SHADES = ' .:-=+*#%@'
DRAW_PERIOD = 0.2  # time between drawings [s]
MOST = MAX_WHOLE // 2  # bytes of frames that are recorded
CLEAR = '\x1b[H\x1b[J'  # moves the cursor of a terminal to the top left and clears the screen


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    arguments = Parser(
        prog='record', formatter_class=argparse.RawDescriptionHelpFormatter,
        description='Record raw counts of a sensor on a serial port, without a graph: an .npz '
        'that `calibrate` and `estimate` read.\nWithout a file it draws them in the terminal '
        'until Ctrl-C: what changes since the start, dark for more.',
        epilog='Example:\n  ros2 run tactile_sensing record --port /dev/ttyACM0 --shape 8 8\n  '
        'ros2 run tactile_sensing record unloaded.npz --port /dev/ttyACM0 --shape 8 8 --seconds 2')
    arguments.add_argument('file', nargs='?', metavar='FILE.npz', type=file_to_write('.npz'),
                           help='to write')
    add_sensor(arguments, required=True)
    add_shape(arguments, required=True)
    add_pitch(arguments)
    arguments.add_argument('--bits', metavar='N', type=between(1, MAX_BITS, kind=int),
                           help="of the converter (default: as many as the protocol's)")
    arguments.add_argument('--signed', choices=('yes', 'no'), default='no',
                           help='counts, where --bits is given (default: %(default)s)')
    arguments.add_argument('--seconds', type=between(0.1, 3600.0, 's'), default=10.0, metavar='S',
                           help='to record (default: %(default)g)')
    return arguments


def drawing(change: np.ndarray) -> str:
    """Return changes of counts (rows, columns) as lines of shades."""
    # The darkest shade stands for at least ten counts, so that noise stays white.
    level = np.clip(change / max(change.max(), 10.0), 0.0, 1.0) * (len(SHADES) - 1)
    return '\n'.join(''.join(2 * SHADES[int(value)] for value in row) for row in np.rint(level))


def look(images: Iterable[SensorImage]) -> None:
    """Draw the change since the first image, until the images end."""
    first, at, drawn = None, 0.0, 0
    for count, image in enumerate(images):
        first = image.counts.astype(float) if first is None else first
        now = time.monotonic()
        if now - at >= DRAW_PERIOD:
            rate, at, drawn = (count - drawn) / (now - at), now, count
            sys.stdout.write(
                f'{CLEAR}{drawing(image.counts - first)}\n{rate:.0f} Hz, counts '
                f'{image.counts.min()} to {image.counts.max()}; Ctrl-C ends\n')


def record(images: Iterable[SensorImage], seconds: float) -> tuple[dict[str, np.ndarray], int]:
    """
    Record images for some seconds.

    Returns the arrays `frames`, `stamps_ns` and `rate_hz`, and how many images are missing between
    the first and the last one.
    """
    kept: list[SensorImage] = []
    try:
        for image in images:
            kept.append(image)
            if image.stamp_ns - kept[0].stamp_ns >= 1e9 * seconds or (
                    len(kept) * image.counts.nbytes > MOST):
                break
    except KeyboardInterrupt:  # keep the images so far
        pass
    except TactileError as error:  # the same, if there are any
        if len(kept) < 2:
            raise
        print(f'record: ended early: {error}', file=sys.stderr)
    if len(kept) < 2:
        raise ConfigurationError('no image came')
    stamps = np.array([image.stamp_ns for image in kept])
    lost = kept[-1].sequence - kept[0].sequence + 1 - len(kept)
    rate = (len(kept) - 1) / (1e-9 * (stamps[-1] - stamps[0]))
    return {'frames': np.array([image.counts for image in kept]), 'stamps_ns': stamps,
            'rate_hz': np.array(rate)}, lost


def run(options: argparse.Namespace) -> str:
    """Show or record; return the summary."""
    pitch_x, pitch_y = pitch_pair(options.pitch) if options.pitch else (0.0, 0.0)
    if pitch_x != pitch_y:
        raise ConfigurationError(
            f'--pitch is {pitch_x:g} {pitch_y:g}, a recording holds only one length: give both to '
            '`calibrate` or `estimate`')
    with opened(options) as sensor:
        if not options.file:
            look(sensor)
            return ''
        arrays, lost = record(sensor, options.seconds)
    if options.pitch:
        arrays['pitch_m'] = np.array(pitch_x)
    write_arrays(options.file, **arrays)
    return (f'{options.file}: {len(arrays["frames"])} images at {arrays["rate_hz"]:.1f} Hz, '
            f'{lost} lost' + (arrays['frames'].nbytes > MOST) * (
                f'; ended early, as more than {MOST / 1e6:.0f} MB of frames are not recorded'))


def main(args: list[str] | None = None) -> int:
    """Run the command; return the exit status."""
    return run_command('record', lambda: run(parser().parse_args(args)))


if __name__ == '__main__':
    sys.exit(main())
