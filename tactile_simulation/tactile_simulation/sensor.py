"""Sensor of a scene: its skin, its array, and the conversion of pressure to counts."""
from dataclasses import dataclass
import math

import numpy as np

from tactile_common.config import bounded, check_fields
from tactile_common.errors import ConfigurationError
from tactile_sensing.devices.counts import Counts
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.skin import Skin


@dataclass(frozen=True)
class SceneSkin:
    """Soft layer above the tactels."""

    depth: float = bounded(0.002, 'of the tactels below the surface', 'm', 1e-5, 0.1)
    stiffness: float = bounded(2e5, 'force per length of edge and indentation', 'N/m^2', 1.0, 1e9)
    thickness: float = bounded(
        0.0, 'from the surface to a rigid backing; 0: there is none', 'm', 0.0, 1.0)
    poisson: float = bounded(0.5, "Poisson's ratio; nothing depends on it without a backing", '',
                             0.0, 0.5)

    def __post_init__(self) -> None:
        check_fields(self, 'skin.')
        try:
            _ = self.layer
        except ConfigurationError as error:
            raise ConfigurationError(f'skin.{error}') from error

    @property
    def layer(self) -> Skin:
        """The skin without its stiffness."""
        return Skin(self.depth, self.thickness or math.inf, self.poisson)


@dataclass(frozen=True)
class Sensor:
    """The array, and how its tactels convert pressure to unsigned counts."""

    # 40 dB below the peak of a line load of 5 N on a pad of 25.4 mm.
    noise_std: float = bounded(630.0, 'standard deviation of one tactel', 'Pa', 0.0, 1e7)
    baseline: float = bounded(10.0, 'without load', 'counts', 0.0, 65535.0)
    pa_per_count: float = bounded(627.45, 'pressure of one count', 'Pa', 1e-3, 1e7)
    bits: int = bounded(8, 'of the converter', '', 4, 16)
    area: float = bounded(
        1.0, 'side of what a tactel averages over; 0: it samples its centre', 'pitches', 0.0, 1.0)
    gain_spread: float = bounded(
        0.0, "standard deviation of a tactel's gain that nobody calibrated", '', 0.0, 0.3)
    creep: float = bounded(
        0.0, 'share by which a reading grows under a load that rests', '', 0.0, 0.3)
    creep_time: float = bounded(5.0, 'time constant of that', 's', 0.01, 1e4)
    hysteresis: float = bounded(
        0.0, 'share by which a reading is higher while its load is taken away', '', 0.0, 0.3)
    crosstalk: float = bounded(
        0.0, 'share of a reading that each of the four neighbours gets', '', 0.0, 0.2)
    dead: int = bounded(
        0, 'tactels that always report the baseline, unknown to the driver', 'tactels', 0, 64)
    specimen: int = bounded(
        1, 'which of the sensors of this kind, each with gains and dead tactels of its own', '',
        0, 2**31 - 1)
    rows: int = bounded(16, "along the pad's y", 'tactels', 3, 256)
    columns: int = bounded(16, "along the pad's x", 'tactels', 3, 256)
    pitch_x: float = bounded(0.0254 / 16, 'distance of the columns', 'm', 1e-5, 0.1)
    pitch_y: float = bounded(0.0254 / 16, 'distance of the rows', 'm', 1e-5, 0.1)

    def __post_init__(self) -> None:
        check_fields(self, 'sensor.')
        if self.baseline >= 1 << self.bits:
            raise ConfigurationError(f'sensor.baseline is {self.baseline}, must be below '
                                     f'{1 << self.bits} = 2^bits')

    @property
    def array(self) -> TactelArray:
        """Geometry of the array."""
        return TactelArray(self.rows, self.columns, self.pitch_x, self.pitch_y)


class TactelResponse:
    """
    Response of the tactels of one sensor: gains, memory, noise and unsigned counts.

    Under a constant load, a reading grows by the share `creep` with the time constant
    `creep_time`, and it decreases equally slowly afterwards. While a load is removed, the reading
    stays constant until it is too high by the share `hysteresis`. Each of the four neighbours gets
    the share `crosstalk` of a reading. Gains and dead tactels depend only on `specimen`, not on
    the seed of the noise.
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
        self._crept, self._before = np.zeros(rows_columns), math.inf  # [Pa], [s]
        self._held = np.zeros(rows_columns)  # [Pa]

    def counts(self, pressure: np.ndarray, rng: np.random.Generator, now: float) -> np.ndarray:
        """Return one frame (rows, columns) of the pressure [Pa] at a time [s]."""
        sensor = self._sensor
        if sensor.creep:
            passed = max(now - self._before, 0.0)
            self._crept -= math.expm1(-passed / sensor.creep_time) * (pressure - self._crept)
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


def _around(pressure: np.ndarray) -> np.ndarray:
    """Sum the differences of the four neighbours to each tactel; none beyond the border."""
    padded = np.pad(pressure, 1, mode='edge')
    return (padded[:-2, 1:-1] + padded[2:, 1:-1] + padded[1:-1, :-2] + padded[1:-1, 2:]
            - 4.0 * pressure)
