"""Shapes of edges: heights, waves, gaps and steps; slips, and flaws of the sensor."""
import math
import re

import numpy as np
import pytest
import yaml

from tactile_common.errors import ConfigurationError
from tactile_sensing.types.array import TactelArray
from tactile_simulation.edge_world import EdgeWorld
from tactile_simulation.scene import load_scene

PAD = TactelArray(16, 16, 0.0254 / 16, 0.0254 / 16)


def scene_of(folder, edge, **more):
    path = folder / 'scene.yaml'
    path.write_text(yaml.safe_dump({'name': 'n', 'description': 'd', 'edge': edge, **more}))
    return load_scene(path)


PATH = {'start': [0.3, 0.0, 0.1], 'heading': 0, 'path': [{'straight': 0.2}]}


def test_a_path_that_ends_where_it_begins_is_closed(tmp_path):
    def rounded(sides):
        path = [part for _ in range(sides) for part in (
            {'straight': 0.09}, {'arc': {'radius': 0.005, 'angle': 90}})]
        return scene_of(tmp_path, {**PATH, 'path': path}).edge

    edge = rounded(4)
    assert edge.closed and (edge.points[0] == edge.points[-1]).all()
    assert edge.length == pytest.approx(0.36 + 2 * math.pi * 0.005, rel=1e-5)
    assert not rounded(3).closed


def test_heights_join_and_step(tmp_path):
    edge = scene_of(tmp_path, {**PATH, 'height': [
        [0.0, 0.0], [0.05, 0.01], [0.1, 0.01], [0.1, -0.003], [0.2, -0.003]]}).edge
    x, z = edge.points[:, 0] - 0.3, edge.points[:, 2] - 0.1
    np.testing.assert_allclose(np.interp(0.025, x, z), 0.005, atol=1e-12)
    np.testing.assert_allclose(z[np.isclose(x, 0.1)], [0.01, -0.003], atol=1e-12)
    assert (~edge.solid).sum() == 1  # the face of the step


def test_wave_has_its_height(tmp_path):
    edge = scene_of(tmp_path, {**PATH, 'wave': {'height': 0.002, 'length': 0.06}}).edge
    assert np.ptp(edge.points[:, 2]) == pytest.approx(0.002, rel=1e-3)


def test_a_gap_presses_nothing(tmp_path):
    scene = scene_of(tmp_path, {**PATH, 'gaps': [[0.09, 0.102]]})
    pose = scene.start_pose()
    pose[:3, 3] = [0.396, 0.0, 0.099]
    assert EdgeWorld(scene).force(pose) == pytest.approx(2e5 * 1e-3 * (0.0254 - 0.012))
    assert scene.edge.nearest([[0.396, 0.001, 0.1]])[0][0] == pytest.approx(0.001)


def test_the_object_slips_once_the_pad_has_come_so_far(tmp_path):
    scene = scene_of(tmp_path, PATH, slip={'s': 0.1, 'offset': 0.005})
    renderer = EdgeWorld(scene)
    pose = scene.start_pose()
    for x, expected in ((0.39, 0.0), (0.41, 0.005), (0.39, 0.005)):
        pose[:3, 3] = [x, 0.0, 0.099]
        renderer.render(pose)
        np.testing.assert_allclose(renderer.shift, [0.0, expected, 0.0], atol=1e-12)


def test_flaws_of_a_sensor_are_its_own(tmp_path):
    scene = scene_of(tmp_path, PATH, sensor={'noise_std': 0.0, 'dead': 3, 'gain_spread': 0.1})
    flawless = scene_of(tmp_path, PATH, sensor={'noise_std': 0.0})
    pose = scene.start_pose()
    pose[:3, 3] = [0.35, 0.0, 0.0992]
    rng = np.random.default_rng(0)
    counts, again = (EdgeWorld(scene).counts(pose, rng).astype(float) - 10 for _ in '12')
    np.testing.assert_array_equal(counts, again)
    true = EdgeWorld(flawless).counts(pose, rng).astype(float) - 10
    loaded = true > 30
    gains = counts[loaded] / true[loaded]
    assert (gains == 0.0).sum() <= 3
    assert np.std(gains[gains > 0.0]) == pytest.approx(0.1, rel=0.4)
    dead = EdgeWorld(scene).counts(pose, rng)[true > 10] == 10
    assert dead.sum() <= 3


def test_bad_shapes_are_named(tmp_path):
    for change, words in (
            ({'gaps': [[0.1, 0.3]]}, 'edge.gaps: must ascend within 0 to 0.2 m'),
            ({'gaps': [[0.1, 0.12], [0.11, 0.13]]}, 'edge.gaps: must ascend'),
            ({'gaps': [[0.1]]}, 'edge.gaps[0] is [0.1], must be a list of 2'),
            ({'wave': {'height': 0.2, 'length': 0.1}}, 'edge.wave.height is 0.2'),
            ({'height': []}, 'edge.height is [], must be a list of pairs'),
            ({'height': [[0.1, 0.0], [0.0, 0.0]]}, 'must not decrease')):
        with pytest.raises(ConfigurationError, match=re.escape(words)):
            scene_of(tmp_path, {**PATH, **change})
