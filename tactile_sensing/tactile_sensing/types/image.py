"""One picture of a tactile array, as the core passes it around."""
from dataclasses import dataclass
import math

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.skin import Skin

COMPONENTS = ('zz', 'xz', 'yz')


@dataclass(eq=False)  # not frozen: one is made of every image
class Layer:
    """One stress component, sampled at one depth below the surface of the skin."""

    component: str  # 'zz' (pressure, compression positive), 'xz' or 'yz' (see TactileLayer.msg)
    depth: float  # of the tactels below the surface of the skin [m]
    stress: np.ndarray  # in `unit`, shape (rows, columns), float32; NaN = invalid tactel
    full_scale: float = 0.0  # largest value that a tactel can report, in `unit`; 0 = unknown
    noise_std: float = 0.0  # of one tactel without load, in `unit`; 0 = unknown
    unit: str = 'Pa'  # or 'counts' if uncalibrated
    thickness: float = math.inf  # of the skin on a rigid backing [m]; infinite: a half-space
    poisson: float = 0.5  # Poisson's ratio of the skin
    gain_spread: float = 0.0  # standard deviation of the tactels' gains, relative; 0 = unknown
    # A tactel at or below it is only known to be below it, in `unit`; 0 = all are measured.
    floor: float = 0.0
    # Standard deviation that the forces of all contacts have in common, relative; 0 = unknown.
    force_std: float = 0.0

    @property
    def skin(self) -> Skin:
        """The skin; a ConfigurationError where it is impossible."""
        return Skin(self.depth, self.thickness, self.poisson)


@dataclass(eq=False)  # not frozen, likewise
class TactileImage:
    """Every layer of one sensor at one instant."""

    stamp_ns: int  # middle of the acquisition [ns]
    sequence: int  # frames since the driver started, lost ones included
    layers: tuple  # of Layer, one per stress component and depth
    array: TactelArray
    tared: bool = False  # whether the no-load picture has been subtracted
    saturated: int = 0  # tactels at full scale, over all layers (NaN in the stress)
    frame_id: str = ''  # sensor frame
    sensor: str = ''  # its name

    def raw_counts(self) -> tuple[np.ndarray, int]:
        """Return counts (rows, columns) that a driver passed through; how many are full scale."""
        layer = self.layers[0]
        if layer.unit != 'counts' or self.tared:
            raise ConfigurationError(
                'no raw counts in the pictures: start the driver with tare_at_start:=false and a '
                'calibration of `rows`, `columns`, `pitch`, `bits`, `unit: counts` and `gain: 1` '
                'alone')
        full = np.isnan(layer.stress)
        return np.where(full, layer.full_scale, layer.stress), int(full.sum())


@dataclass(frozen=True, eq=False)
class SensorInfo:
    """What a driver knows of its sensor; units and meaning as in SensorInfo.msg."""

    stamp_ns: int
    frame_id: str
    sensor: str
    model: str
    serial_number: str
    array: TactelArray
    nominal_rate: float
    acquisition_delay: float
    skin_stiffness: float
    max_load: float
    layers: tuple  # of Layer without stress
    dead_tactels: tuple  # row-major indices
    calibration: str
    tared_at_ns: int  # 0 = never
