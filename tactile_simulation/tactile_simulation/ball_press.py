"""A ball pressed on the sensor of a scene: simulated recordings for a calibration."""
import math

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_sensing.skin.pressure import SkinPressure
from tactile_simulation.sensor import TactelResponse
from tactile_simulation.world import Scene

PERIOD = 0.005  # s between frames
PAUSE, HELD = 2.0, 0.5  # s that the pad is free before a press; s that the ball presses
CLEARANCE = 1.6  # pitches, smallest distance of a press from the border of the pad
KEPT = 10  # frames of each press
# Young's modulus of a soft skin [Pa]; it affects only the width of the patch.
MODULUS = 4e5


class BallPress:
    """
    Presses a ball perpendicularly on the sensor of a scene, at random places.

    `radius` [m] and `force` [N] determine the contact patch (Hertz). Raises a ConfigurationError
    if the patch is too wide for the ball, or for the model of a patch.
    """

    def __init__(self, scene: Scene, radius: float, force: float, seed: int):
        skin, sensor = scene.skin, scene.sensor
        self._array, self._force = sensor.array, force
        # Hertz; a skin on a backing deforms less, but this hardly changes the patch.
        effective = MODULUS / (1.0 - skin.poisson**2)
        self._patch = (0.75 * force * radius / effective) ** (1.0 / 3.0)
        if not self._patch < min(radius, 1.5 * skin.depth):
            raise ConfigurationError(
                f'a ball of {radius} m and {force} N would touch within {self._patch:.2g} m, must '
                f'be less than its radius and {1.5 * skin.depth:g} m')
        self._pressure = SkinPressure(
            skin.layer, sensor.area * sensor.pitch_x, sensor.area * sensor.pitch_y)
        self._response, self._rng = TactelResponse(sensor), np.random.default_rng(seed)
        self._now, array = 0.0, self._array
        self._reach = (np.array([array.size_x, array.size_y]) / 2.0
                       - CLEARANCE * np.array([array.pitch_x, array.pitch_y]))  # of the ball [m]
        if self._reach.min() < 0.0:
            raise ConfigurationError(
                f'{array.rows} x {array.columns} tactels: the ball stays {CLEARANCE:g} tactels '
                f'from the border, so at least {math.ceil(2.0 * CLEARANCE)} rows and columns are '
                'needed')

    def frames(self, presses: int) -> np.ndarray:
        """
        Return the last KEPT frames of each press, (presses * KEPT, rows, columns).

        The pad is free for `PAUSE`, then the ball presses for `HELD`, at least `CLEARANCE` from
        the border.
        """
        array, reach = self._array, self._reach
        images: list[np.ndarray] = []
        for a, b in self._rng.uniform(-reach, reach, (presses, 2)):
            self.unloaded(round(PAUSE / PERIOD))
            pressure = self._pressure.point(
                array.x, array.y[:, None], a, b, self._force, radius=self._patch)
            images += self._read(pressure, round(HELD / PERIOD))[-KEPT:]
        return np.array(images)

    def unloaded(self, count: int) -> np.ndarray:
        """Return frames (count, rows, columns) of the unloaded pad."""
        return np.array(self._read(np.zeros(self._array.shape), count))

    def _read(self, pressure: np.ndarray, count: int) -> list[np.ndarray]:
        frames = []
        for _ in range(count):
            self._now += PERIOD
            frames.append(self._response.counts(pressure, self._rng, self._now))
        return frames
