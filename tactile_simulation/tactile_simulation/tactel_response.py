"""What tactels report of the pressure on them."""
import math

import numpy as np

from tactile_sensing.devices.counts import Counts
from tactile_simulation.scene import Sensor


class TactelResponse:
    """
    The tactels of one sensor: their gains, their memory, noise, and unsigned counts.

    Under a load that rests, a reading grows by the share `creep` with the time constant
    `creep_time`, and falls as slowly after it. While a load is taken away it stays what it was,
    until it is higher by the share `hysteresis`. Each of the four neighbours gets the share
    `crosstalk` of it. Flaws are those of this one `specimen`: the
    same at every run, whatever the seed of the noise.
    """

    def __init__(self, sensor: Sensor):
        self._sensor = sensor
        self._counts = Counts(sensor.bits)
        rows_columns = sensor.rows, sensor.columns
        flaws = np.random.default_rng(sensor.specimen)
        gain = 1.0 + sensor.gain_spread * flaws.standard_normal(rows_columns)
        alive = np.ones(gain.size)
        alive[flaws.permutation(alive.size)[:int(sensor.dead)]] = 0.0
        self._gain = gain * alive.reshape(rows_columns)
        self._crept, self._before = np.zeros(rows_columns), -math.inf  # [Pa], [s]
        self._held = np.zeros(rows_columns)  # [Pa]

    def counts(self, pressure: np.ndarray, rng: np.random.Generator, now: float) -> np.ndarray:
        """Return one frame (rows, columns) of the pressure [Pa] at a time [s]."""
        sensor = self._sensor
        if sensor.creep:
            passed = min(max(now - self._before, 0.0), 1e3 * sensor.creep_time)
            if self._before > -math.inf:
                self._crept += -math.expm1(-passed / sensor.creep_time) * (pressure - self._crept)
            self._before = now
            pressure = pressure + sensor.creep * self._crept
        if sensor.hysteresis:
            pressure = self._held = np.clip(
                self._held, pressure, pressure + sensor.hysteresis * np.abs(pressure))
        if sensor.crosstalk:
            pressure = pressure + sensor.crosstalk * _around(pressure)
        noise = sensor.noise_std * rng.standard_normal(pressure.shape)
        counts = np.rint((self._gain * pressure + noise) / sensor.pa_per_count + sensor.baseline)
        return np.clip(counts, 0, self._counts.highest).astype(self._counts.dtype)


def _around(pressure):
    """Sum over the four neighbours of what they have more; none beyond the border."""
    padded = np.pad(pressure, 1, mode='edge')
    return (padded[:-2, 1:-1] + padded[2:, 1:-1] + padded[1:-1, :-2] + padded[1:-1, 2:]
            - 4.0 * pressure)
