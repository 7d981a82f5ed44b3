"""
Command `press_ball`: what one records of a real array to calibrate it, of a scene's sensor.

It writes unloaded.npz, ball.npz and flat.npz, the files that `calibrate` takes.
"""
import argparse
from pathlib import Path
import sys

import numpy as np

from tactile_common.command_line import between, Parser, run_command
from tactile_common.errors import ConfigurationError
from tactile_sensing.skin.pressure import SkinPressure
from tactile_simulation.scene import load_scene, Scene
from tactile_simulation.tactel_response import TactelResponse

PERIOD = 0.005  # s between frames
HELD, BETWEEN = 0.5, 2.0  # s that a press is held, and that nothing touches before it
KEPT = 10  # frames of each press
CLEAR = 1.6  # pitches from the border of the pad to a press


def parser() -> argparse.ArgumentParser:
    """Command line."""
    arguments = Parser(
        prog='press_ball', formatter_class=argparse.ArgumentDefaultsHelpFormatter,
        description='Press a small ball on the sensor of a scene, straight, at places that '
        'nobody is told: the recordings that `calibrate` takes.')
    add = arguments.add_argument
    add('scene', help='YAML file of the scene')
    add('--out', required=True, metavar='FOLDER', help='for unloaded.npz, ball.npz, flat.npz')
    count = between(1, 10_000, kind=int)
    add('--radius', type=between(1e-5, 0.1, 'm'), default=0.003, help='of the ball [m]')
    add('--force', type=between(1e-3, 100.0, 'N'), default=0.5,
        help='with which it is pressed [N]')
    add('--modulus', type=between(1e3, 1e9, 'Pa'), default=4e5,
        help="Young's modulus of the skin [Pa]")
    add('--presses', type=count, default=20, help='of ball.npz')
    add('--flat', type=count, default=40, help='presses of flat.npz')
    add('--unloaded', type=count, default=100, help='frames of unloaded.npz')
    add('--seed', type=between(0, 2**32 - 1, kind=int), default=0, help='of places and noise')
    return arguments


class Press:
    """A ball on the sensor of a scene."""

    def __init__(self, scene: Scene, radius: float, force: float, modulus: float, seed: int):
        skin, sensor = scene.skin, scene.sensor
        self._array, self._force = sensor.array, force
        # Hertz; a skin on a backing gives way less, but the patch hardly feels it.
        effective = modulus / (1.0 - skin.poisson**2)
        self._patch = (0.75 * force * radius / effective) ** (1.0 / 3.0)
        if not 0.0 < self._patch < min(radius, 1.5 * skin.depth):
            raise ConfigurationError(
                f'a ball of {radius} m and {force} N would touch within {self._patch:.2g} m, must '
                f'be less than its radius and {1.5 * skin.depth:g} m')
        self._pressure = SkinPressure(
            skin.layer, sensor.area * sensor.pitch_x, sensor.area * sensor.pitch_y)
        self._response, self._rng = TactelResponse(sensor), np.random.default_rng(seed)
        self._now = 0.0

    def frames(self, presses: int) -> np.ndarray:
        """Return the last KEPT frames of each press, (presses * KEPT, rows, columns)."""
        array = self._array
        reach = (np.array([array.size_x, array.size_y]) / 2.0
                 - CLEAR * np.array([array.pitch_x, array.pitch_y]))
        pictures: list[np.ndarray] = []
        for a, b in self._rng.uniform(-reach, reach, (presses, 2)):
            self._lasting(np.zeros(array.shape), BETWEEN)
            pictures += self._lasting(self._pressure.point(
                array.x, array.y[:, None], a, b, self._force, radius=self._patch), HELD)[-KEPT:]
        return np.array(pictures)

    def unloaded(self, count: int) -> np.ndarray:
        """Return frames (count, rows, columns) with nothing on the pad."""
        nothing = np.zeros(self._array.shape)
        return np.array([self._lasting(nothing, PERIOD)[-1] for _ in range(count)])

    def _lasting(self, pressure, seconds):
        frames = []
        for _ in range(round(seconds / PERIOD)):
            self._now += PERIOD
            frames.append(self._response.counts(pressure, self._rng, self._now))
        return frames


def run(options: argparse.Namespace) -> str:
    """Write the recordings; returns what was written."""
    press = Press(load_scene(options.scene), options.radius, options.force, options.modulus,
                  options.seed)
    folder = Path(options.out)
    folder.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(folder / 'unloaded.npz', frames=press.unloaded(options.unloaded))
    np.savez_compressed(folder / 'ball.npz', frames=press.frames(options.presses),
                        force=options.force)
    np.savez_compressed(folder / 'flat.npz', frames=press.frames(options.flat))
    return (f'press_ball: {folder}: {options.unloaded} frames without load, {options.presses} '
            f'and {options.flat} presses')


def main(argv: list[str] | None = None) -> int:
    """Run the command; 0 if the files were written."""
    return run_command('press_ball', lambda: run(parser().parse_args(argv)))


if __name__ == '__main__':
    sys.exit(main())
