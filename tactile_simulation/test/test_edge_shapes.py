"""Shapes of edges: polygons with fillets, heights, gaps and steps."""
import math

import numpy as np
import pytest
import yaml

from tactile_common.errors import ConfigurationError
from tactile_sensing.types.array import TactelArray
from tactile_simulation.edge_shapes import polygon
from tactile_simulation.edge_world import EdgeWorld
from tactile_simulation.render import render
from tactile_simulation.scene import load_scene
from tactile_simulation.sensor import Skin

SQUARE = [[0.0, 0.0], [0.1, 0.0], [0.1, 0.1], [0.0, 0.1]]
PAD = TactelArray(16, 16, 0.0254 / 16, 0.0254 / 16)


def scene_of(folder, edge, **more):
    path = folder / 'scene.yaml'
    path.write_text(yaml.safe_dump({'name': 'n', 'description': 'd', 'edge': edge, **more}))
    return load_scene(path)


def test_fillets_touch_both_sides_and_keep_their_radius():
    points = polygon([[0, 0], [0.1, 0], [0.1, 0.1]], 0.01, False)
    arc = points[1:-1]
    np.testing.assert_allclose(np.linalg.norm(arc - [0.09, 0.01], axis=1), 0.01, atol=1e-12)
    np.testing.assert_allclose(arc[[0, -1]], [[0.09, 0.0], [0.1, 0.01]], atol=1e-12)


@pytest.mark.parametrize('radius', [0.0, 0.005])
def test_closed_polygon_has_its_length(tmp_path, radius):
    edge = scene_of(tmp_path, {'z': 0.1, 'closed': True, 'polygon': {
        'points': SQUARE, 'radius': radius}}).edge
    assert edge.closed
    assert edge.length == pytest.approx(0.4 - (8 - 2 * math.pi) * radius, rel=1e-5)


@pytest.mark.parametrize('points, radius, words', [
    (SQUARE, 0.06, 'too short for fillets'), ([[0, 0], [0, 0], [1, 1]], 0.0, 'at one place'),
    ([[0, 0], [0.1, 0], [0, 0.0001]], 0.0, 'turns back')])
def test_impossible_polygons_are_refused(points, radius, words):
    with pytest.raises(ConfigurationError, match=words):
        polygon(points, radius, False)


PATH = {'start': [0.3, 0.0, 0.1], 'heading': 0, 'path': [{'straight': 0.2}]}


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
    for edge, words in (
            ({**PATH, 'polygon': {'points': SQUARE}}, 'exactly one'),
            ({**PATH, 'closed': True}, 'must be closed'),
            ({**PATH, 'gaps': [[0.1, 0.3]]}, 'edge.gaps: 0.1 to 0.3'),
            ({**PATH, 'height': [[0.1, 0.0], [0.0, 0.0]]}, 'must not decrease'),
            ({'z': 0.1, 'closed': True, 'polygon': {'points': SQUARE[:2]}}, '3 to 5000 pairs'),
            ({'z': 0.1, 'closed': 1, 'polygon': {'points': SQUARE}}, 'edge.closed is 1')):
        with pytest.raises(ConfigurationError, match=words.replace('.', r'\.')):
            scene_of(tmp_path, edge)


@pytest.mark.parametrize('start, end', [
    ((-0.004, -0.003, -0.001), (0.005, 0.006, -0.0004)), ((0.0, 0.0, -0.001), (0.0, 0.03, -0.002)),
    ((0.0, 0.001, -0.001), (0.0009, 0.001, -0.001))])
def test_the_closed_form_of_a_line_load_is_the_sum_of_its_point_loads(start, end):
    pressure, _ = render(np.array([start, end]), PAD, Skin())
    share = (np.arange(4000) + 0.5) / 4000
    points = np.array(start) + share[:, None] * (np.array(end) - start)
    load = 2e5 * -points[:, 2] * math.dist(start, end) / 4000
    squared = ((PAD.x - points[:, 0, None, None])**2
               + (PAD.y[:, None] - points[:, 1, None, None])**2 + 0.002**2)
    expected = (1.5 / math.pi * 0.002**3 * load[:, None, None] * squared**-2.5).sum(axis=0)
    np.testing.assert_allclose(pressure, expected, atol=1e-4 * expected.max())
