"""The calibration that fits the sensor of a scene, as a file for the driver."""
from pathlib import Path

import yaml

from tactile_simulation.scene import Scene


def write_calibration(scene: Scene, path: Path, **values) -> Path:
    """
    Write what the driver must know of the sensor that a scene describes; returns the path.

    Parameters
    ----------
    scene : Scene
    path : Path
        YAML file to write, in the format of `tactile_sensing.devices.calibration`.
    **values
        Further keys of that format.
    """
    sensor, skin = scene.sensor, scene.skin
    path.write_text(yaml.safe_dump({
        'model': 'mock', 'rows': sensor.rows, 'columns': sensor.columns,
        'pitch': [sensor.pitch_x, sensor.pitch_y], 'unit': 'Pa', 'gain': sensor.pa_per_count,
        'baseline': sensor.baseline, 'depth': skin.depth, 'skin_stiffness': skin.stiffness,
        'max_load': 40.0, 'acquisition_delay': 0.0025, 'nominal_rate': 200.0} | values), 'utf-8')
    return path
