"""One image of a tactile array."""
from dataclasses import dataclass
import math

import numpy as np

from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.skin import Skin

COMPONENTS = ('zz', 'xz', 'yz')


@dataclass(eq=False)  # not frozen, to be faster: one is created for every image
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
    gain_spread: float = 0.0  # relative standard deviation of the tactels' gains; 0 = unknown
    # A reading at or below the floor is only an upper bound, in `unit`; 0 = no floor.
    floor: float = 0.0
    # Relative standard deviation that the forces of all contacts have in common; 0 = unknown.
    force_std: float = 0.0

    @property
    def skin(self) -> Skin:
        """The skin of this layer; raises a ConfigurationError if it is impossible."""
        return Skin(self.depth, self.thickness, self.poisson)


@dataclass(eq=False)  # not frozen, for the same reason
class TactileImage:
    """All layers of one sensor at one instant."""

    stamp_ns: int  # middle of the acquisition [ns]
    sequence: int  # frames since the driver was activated; of a port, lost ones too
    layers: tuple  # of Layer, one per stress component and depth
    array: TactelArray
    tared: bool = False  # whether the unloaded image has been subtracted
    saturated: int = 0  # number of tactels at full scale in all layers (NaN in the stress)
    frame_id: str = ''  # sensor frame
    sensor: str = ''  # name of the sensor


@dataclass(frozen=True, eq=False)
class SensorInfo:
    """Properties of a sensor, published by its driver; fields and units as in SensorInfo.msg."""

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
