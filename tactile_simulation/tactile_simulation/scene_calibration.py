"""Calibration of the sensor of a scene."""
from dataclasses import replace
from pathlib import Path

import numpy as np

from tactile_sensing.devices.calibration import Calibration
from tactile_sensing.devices.calibration_file import load_calibration, save_calibration
from tactile_simulation.world import Scene


def calibration_of(scene: Scene, **values) -> Calibration:
    """
    Return the calibration of the sensor of a scene; `values` are additional fields.

    It is read from the calibration file named by the scene, or else derived from the scene.
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
    Write the calibration that the driver needs for a scene's sensor; return the path.

    Parameters
    ----------
    scene : Scene
    path : Path
        YAML file to write, in the format of `tactile_sensing.devices.calibration_file`.
    **values
        Additional fields of `Calibration`.
    """
    save_calibration(calibration_of(scene, **{
        'max_load': 40.0, 'acquisition_delay': 0.0025, 'nominal_rate': 200.0, **values}), path)
    return path
