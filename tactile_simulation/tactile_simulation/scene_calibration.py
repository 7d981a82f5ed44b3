"""Calibration of the sensor of a scene."""
from dataclasses import replace
from pathlib import Path

import numpy as np

from tactile_sensing.devices.calibration import Calibration, load_calibration, save_calibration
from tactile_simulation.world import Scene

ACQUISITION_DELAY = 0.0025  # s, from the instant that a frame shows to its last byte
MAX_LOAD = 40.0  # N, that the sensor bears


def calibration_of(scene: Scene) -> Calibration:
    """Return the calibration file that a scene names, or else one derived from the scene."""
    sensor, skin = scene.sensor, scene.skin
    found = load_calibration(scene.calibration) if scene.calibration else Calibration(
        sensor.array, gain=np.array(sensor.pa_per_count), baseline=np.array(sensor.baseline),
        bits=sensor.bits, depth=skin.depth, thickness=skin.thickness, poisson=skin.poisson)
    return replace(found, model='mock', skin_stiffness=skin.stiffness)


def write_calibration(scene: Scene, path: Path) -> Path:
    """Write the calibration file that the driver needs for a scene's sensor; return its path."""
    save_calibration(replace(
        calibration_of(scene), max_load=MAX_LOAD, acquisition_delay=ACQUISITION_DELAY,
        nominal_rate=200.0), path)
    return path
