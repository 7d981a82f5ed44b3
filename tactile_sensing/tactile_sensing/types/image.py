"""One picture of a tactile array, as the core passes it around."""
from dataclasses import dataclass

import numpy as np

from tactile_sensing.types.array import TactelArray

COMPONENTS = ('zz', 'xz', 'yz')


@dataclass(frozen=True, eq=False)
class Layer:
    """
    One stress component, sampled at one depth below the surface of the skin.

    Parameters
    ----------
    component : str
        'zz' (pressure, compression positive), 'xz' or 'yz' (shear, see TactileLayer.msg).
    depth : float
        Depth of the tactels below the surface of the skin [m].
    stress : np.ndarray
        Values in `unit`, shape `(rows, columns)`, float32; NaN = invalid tactel.
    full_scale : float
        Largest value that the tactels can report, in `unit`; 0 = unknown.
    noise_std : float
        Standard deviation of one tactel without load, in `unit`; 0 = unknown.
    unit : str
        'Pa', or 'counts' if uncalibrated.
    """

    component: str
    depth: float
    stress: np.ndarray
    full_scale: float = 0.0
    noise_std: float = 0.0
    unit: str = 'Pa'


@dataclass(frozen=True, eq=False)
class TactileImage:
    """
    Every layer of one sensor at one instant.

    Parameters
    ----------
    stamp_ns : int
        Middle of the acquisition [ns].
    sequence : int
        Frames since the driver started, lost ones included.
    layers : tuple of Layer
        One per stress component and depth.
    array : TactelArray
        Geometry of the array.
    tared : bool
        Whether the no-load picture has been subtracted.
    saturated : int
        Tactels at full scale, over all layers (NaN in the stress).
    frame_id : str
        Sensor frame.
    sensor : str
        Name of the sensor.
    """

    stamp_ns: int
    sequence: int
    layers: tuple
    array: TactelArray
    tared: bool = False
    saturated: int = 0
    frame_id: str = ''
    sensor: str = ''


@dataclass(frozen=True, eq=False)
class SensorInfo:
    """
    What a driver knows of its sensor; units and meaning as in SensorInfo.msg.

    `stamp_ns` and `tared_at_ns` are times [ns] (0 = never tared), `layers` hold no stress,
    `dead_tactels` are row-major indices.
    """

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
    layers: tuple
    dead_tactels: tuple
    calibration: str
    tared_at_ns: int
