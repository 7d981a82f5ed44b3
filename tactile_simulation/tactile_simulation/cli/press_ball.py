"""
Command `press_ball`: simulated recordings to calibrate the sensor of a scene.

It writes unloaded.npz, ball.npz and flat.npz, the input files of `calibrate`.
"""
import argparse
from pathlib import Path
import sys

import numpy as np

from tactile_common.command_line import between, Help, Parser, run_command
from tactile_simulation.ball_press import BallPress
from tactile_simulation.scene import describe_scenes, load_scene

UNLOADED, PRESSES, FLAT = 100, 20, 40  # frames without load; presses of ball.npz and flat.npz


def parser() -> argparse.ArgumentParser:
    """Return the command-line parser."""
    arguments = Parser(
        prog='press_ball', formatter_class=Help, epilog=describe_scenes(),
        description='Press a small ball on the sensor of a scene, straight, at random '
        'places that are not recorded: the recordings that `calibrate` takes.')
    add = arguments.add_argument
    add('scene', help='name of a scene, see below, or a YAML file')
    add('--out', required=True, metavar='FOLDER', help='for unloaded.npz, ball.npz, flat.npz')
    add('--radius', type=between(1e-5, 0.1, 'm'), default=0.003, help='of the ball [m]')
    add('--force', type=between(1e-3, 100.0, 'N'), default=0.5,
        help='with which it is pressed [N]')
    add('--seed', type=between(0, 2**32 - 1, kind=int), default=0, help='of places and noise')
    return arguments


def run(options: argparse.Namespace) -> str:
    """Write the recordings; return a text about them."""
    press = BallPress(load_scene(options.scene), options.radius, options.force, options.seed)
    folder = Path(options.out)
    folder.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(folder / 'unloaded.npz', frames=press.unloaded(UNLOADED))
    np.savez_compressed(folder / 'ball.npz', frames=press.frames(PRESSES), force=options.force)
    np.savez_compressed(folder / 'flat.npz', frames=press.frames(FLAT))
    return f'press_ball: {folder}: {UNLOADED} frames without load, {PRESSES} and {FLAT} presses'


def main(argv: list[str] | None = None) -> int:
    """Run the command; exit status 0 if the files were written."""
    return run_command('press_ball', lambda: run(parser().parse_args(argv)))


if __name__ == '__main__':
    sys.exit(main())
