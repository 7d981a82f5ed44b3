"""What the driver is told of a scene's sensor is what the renderer does."""

import numpy as np
import pytest

from tactile_sensing.devices.calibration_file import load_calibration
from tactile_simulation.edge_path import EdgePath
from tactile_simulation.edge_world import EdgeScene, EdgeWorld, Start
from tactile_simulation.scene_calibration import write_calibration
from tactile_simulation.sensor import Sensor, Skin


def scene(**sensor):
    edge = EdgePath([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]])
    return EdgeScene('pad', '', edge, skin=Skin(0.003, 1e5), start=Start(height=-0.001),
                 sensor=Sensor(noise_std=0.0, **sensor))


@pytest.mark.parametrize('sensor', [
    {}, {'rows': 12, 'columns': 24, 'pitch_x': 0.001, 'pitch_y': 0.0015},
    {'pa_per_count': 2000.0, 'baseline': 30.0}])
def test_counts_become_the_pressure_that_was_rendered(tmp_path, sensor):
    it = scene(**sensor)
    calibration = load_calibration(write_calibration(it, tmp_path / 'pad.yaml'))
    assert calibration.array == it.sensor.array
    assert (calibration.depth, calibration.skin_stiffness) == (0.003, 1e5)
    renderer, pose = EdgeWorld(it), it.start_pose()
    layer, saturated = calibration.converter()(
        renderer.counts(pose, np.random.default_rng(0)))
    assert saturated == 0
    np.testing.assert_allclose(
        layer.stress, renderer.render(pose), atol=0.51 * it.sensor.pa_per_count)


def test_further_fields_are_those_of_a_calibration(tmp_path):
    path = write_calibration(scene(), tmp_path / 'pad.yaml', nominal_rate=100.0)
    assert load_calibration(path).nominal_rate == 100.0
