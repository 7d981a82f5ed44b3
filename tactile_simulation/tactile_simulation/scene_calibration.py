"""The calibration that fits the sensor of a scene."""
from dataclasses import replace
from pathlib import Path

import numpy as np

from tactile_sensing.devices.calibration import Calibration
from tactile_sensing.devices.calibration_file import load_calibration, save_calibration
from tactile_simulation.world import Scene


def calibration_of(scene: Scene, **values) -> Calibration:
    """
    Return what is known of the sensor that a scene describes, and further fields.

    That is what the calibration says that the scene names, or else all of it.
    """
    sensor, skin = scene.sensor, scene.skin
    values = {'model': 'mock', 'skin_stiffness': skin.stiffness, **values}
    if scene.calibration:
        return replace(load_calibration(scene.calibration), **values)
    return Calibration(
        sensor.array, gain=np.array(sensor.pa_per_count), baseline=np.array(sensor.baseline),
        bits=sensor.bits,
        depth=skin.depth, thickness=skin.thickness, poisson=skin.poisson, **values)


def write_calibration(scene: Scene, path: Path, **values) -> Path:
    """
    Write what the driver must know of the sensor that a scene describes; returns the path.

    Parameters
    ----------
    scene : Scene
    path : Path
        YAML file to write, in the format of `tactile_sensing.devices.calibration_file`.
    **values
        Further fields of `Calibration`.
    """
    save_calibration(calibration_of(scene, **{
        'max_load': 40.0, 'acquisition_delay': 0.0025, 'nominal_rate': 200.0, **values}), path)
    return path
