"""Scenes: shape of the edge, pose at the start, slips, and every way to get a file wrong."""
import math
from pathlib import Path

import numpy as np
import pytest
import yaml

from tactile_common.errors import ConfigurationError
from tactile_sensing.types.array import TactelArray
from tactile_simulation.edge_path import ARC_STEP, EdgePath
from tactile_simulation.edge_world import EdgeWorld
from tactile_simulation.scene import load_scene

SCENES = Path(__file__).parents[2] / 'launch' / 'scenes'
TREE = {
    'name': 'test',
    'description': 'An edge.',
    'edge': {'start': [0.3, -0.1, 0.12], 'heading': 90, 'path': [{'straight': 0.2}]},
    'skin': {'depth': 0.002, 'stiffness': 2e5},
    'sensor': {'noise_std': 630.0, 'baseline': 10, 'pa_per_count': 627.45},
    'start': {'s': 0.02, 'offset': 0.003, 'height': 0.004, 'yaw': 0},
}


def write(folder, tree):
    path = folder / 'scene.yaml'
    path.write_text(tree if isinstance(tree, str) else yaml.safe_dump(tree))
    return path


def scene_of(folder, path, **sections):
    tree = {**TREE, **sections, 'edge': {**TREE['edge'], 'path': path}}
    return load_scene(write(folder, tree))


def edge_of(folder, **shape):
    """Edge of 200 mm along base y with another shape."""
    return load_scene(write(folder, {**TREE, 'edge': {**TREE['edge'], **shape}})).edge


@pytest.mark.parametrize('name, length, heading', [
    ('straight', 0.2, 90), ('two_segments', 0.2, 120), ('curve', 0.06 + 0.03 * math.pi, 180)])
def test_shipped_scenes(name, length, heading):
    scene = load_scene(SCENES / f'{name}.yaml')
    assert scene.name == name
    assert scene.edge.length == pytest.approx(length, abs=1e-6)
    heading = math.radians(heading)
    expected = [math.cos(heading), math.sin(heading), 0.0]
    np.testing.assert_allclose(scene.edge.tangent_at(length), expected, atol=1e-9)


def test_straight_is_exact_and_a_corner_is_a_vertex_that_turns_left(tmp_path):
    edge = scene_of(tmp_path, [{'straight': 0.2}]).edge
    np.testing.assert_allclose(edge.points, [[0.3, -0.1, 0.12], [0.3, 0.1, 0.12]], atol=1e-15)
    np.testing.assert_allclose(edge.point_at(0.05), [0.3, -0.05, 0.12], atol=1e-15)
    assert edge.point_at(np.array([0.0, 0.1, 0.2])).shape == (3, 3)
    np.testing.assert_allclose(edge.point_at(0.5), edge.points[-1])
    edge = scene_of(tmp_path, [{'straight': 0.1}, {'turn': 30}, {'straight': 0.1}]).edge
    np.testing.assert_allclose(edge.points[1], [0.3, 0.0, 0.12], atol=1e-15)
    np.testing.assert_allclose(edge.tangent_at(0.0999), [0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(
        edge.tangent_at(0.1001), [-0.5, math.sqrt(0.75), 0], atol=1e-12)


@pytest.mark.parametrize('angle', [90, -90, 360])
def test_arc_stays_on_its_circle(tmp_path, angle):
    edge = scene_of(tmp_path, [{'arc': {'radius': 0.06, 'angle': angle}}]).edge
    centre = np.array([0.3 - math.copysign(0.06, angle), -0.1, 0.12])
    np.testing.assert_allclose(np.linalg.norm(edge.points - centre, axis=1), 0.06, atol=1e-12)
    assert np.diff(edge.arclength).max() <= ARC_STEP
    assert edge.length == pytest.approx(0.06 * math.radians(abs(angle)), rel=1e-5)


def test_nearest_is_positive_on_the_left(tmp_path):
    edge = scene_of(tmp_path, [{'straight': 0.2}]).edge
    lateral, s = edge.nearest([[0.29, 0.0, 0.2], [0.31, -0.05, 0.1], [0.30, 0.13, 0.12]])
    np.testing.assert_allclose(lateral, [0.01, -0.01, 0.03], atol=1e-15)
    np.testing.assert_allclose(s, [0.1, 0.05, 0.2], atol=1e-15)
    assert edge.beside(s).tolist() == [True, True, False]  # the last is beyond the end


def test_nearest_inverts_point_and_offset(tmp_path):
    edge = scene_of(tmp_path, [{'straight': 0.03}, {'arc': {'radius': 0.06, 'angle': 90}}]).edge
    rng = np.random.default_rng(3)
    expected_s = rng.uniform(0.0, edge.length, 50)
    expected = rng.uniform(-0.01, 0.01, 50)
    tangent = edge.tangent_at(expected_s)
    left = np.stack([-tangent[:, 1], tangent[:, 0], np.zeros(50)], axis=1)
    lateral, s = edge.nearest(edge.point_at(expected_s) + expected[:, None] * left)
    np.testing.assert_allclose(lateral, expected, atol=5e-7)
    np.testing.assert_allclose(s, expected_s, atol=5e-5)


@pytest.mark.parametrize('turn', [30, 120, 170, -30, -120, -170])
def test_nearest_knows_the_outside_of_a_corner(tmp_path, turn):
    edge = scene_of(tmp_path, [{'straight': 0.1}, {'turn': turn}, {'straight': 0.1}]).edge
    corner = edge.points[1]
    normals = np.cross([0, 0, 1], [edge.tangent_at(0.05), edge.tangent_at(0.15)])
    for share in (0.01, 0.3, 0.5, 0.7, 0.99):
        left = (1 - share) * normals[0] + share * normals[1]
        outside = -math.copysign(1.0, turn) * left / np.linalg.norm(left)
        lateral, s = edge.nearest([corner + 0.005 * outside])
        assert lateral[0] == pytest.approx(-math.copysign(0.005, turn))
        assert s[0] == pytest.approx(0.1, abs=1e-9)


def test_start_pose_looks_down_beside_the_edge_and_yaws_right_handed(tmp_path):
    pose = scene_of(tmp_path, [{'straight': 0.2}]).start_pose()
    np.testing.assert_allclose(pose[:3, 2], [0, 0, -1])
    np.testing.assert_allclose(pose[:3, 1], [0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(pose[:3, 0], [-1, 0, 0], atol=1e-15)
    np.testing.assert_allclose(pose[:3, 3], [0.297, -0.08, 0.124], atol=1e-12)
    scene = scene_of(tmp_path, [{'straight': 0.2}], start={'yaw': 20})
    pose = scene.start_pose()
    np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-15)
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1.0)
    edge_in_pad = pose[:3, :3].T @ scene.edge.tangent_at(0.02)
    yaw = math.atan2(-edge_in_pad[0], edge_in_pad[1])
    assert math.degrees(yaw) == pytest.approx(-20.0)


def test_a_path_that_ends_where_it_begins_is_closed(tmp_path):
    def rounded(sides):
        return edge_of(tmp_path, path=[part for _ in range(sides) for part in (
            {'straight': 0.09}, {'arc': {'radius': 0.005, 'angle': 90}})])

    edge = rounded(4)
    assert edge.closed and (edge.points[0] == edge.points[-1]).all()
    assert edge.length == pytest.approx(0.36 + 2 * math.pi * 0.005, rel=1e-5)
    assert not rounded(3).closed


def test_heights_join_and_step_and_a_wave_has_its_height(tmp_path):
    edge = edge_of(tmp_path, height=[
        [0.0, 0.0], [0.05, 0.01], [0.1, 0.01], [0.1, -0.003], [0.2, -0.003]])
    along, z = edge.points[:, 1] + 0.1, edge.points[:, 2] - 0.12
    np.testing.assert_allclose(np.interp(0.025, along, z), 0.005, atol=1e-12)
    np.testing.assert_allclose(z[np.isclose(along, 0.1)], [0.01, -0.003], atol=1e-12)
    assert (~edge.solid).sum() == 1  # the face of the step
    edge = edge_of(tmp_path, wave={'height': 0.002, 'length': 0.06})
    assert np.ptp(edge.points[:, 2]) == pytest.approx(0.002, rel=1e-3)


def test_a_gap_presses_nothing(tmp_path):
    edge = {**TREE['edge'], 'gaps': [[0.09, 0.102]]}
    scene = load_scene(write(tmp_path, {**TREE, 'edge': edge}))
    pose = scene.start_pose()
    pose[:3, 3] = [0.3, -0.004, 0.119]
    assert EdgeWorld(scene).force(pose) == pytest.approx(2e5 * 1e-3 * (0.0254 - 0.012))
    assert scene.edge.nearest([[0.299, -0.004, 0.12]])[0][0] == pytest.approx(0.001)


def test_the_object_slips_once_the_pad_has_come_so_far(tmp_path):
    world = EdgeWorld(scene_of(tmp_path, [{'straight': 0.2}], slip={'s': 0.1, 'offset': 0.005}))
    pose = world.scene.start_pose()
    for y, expected in ((-0.01, 0.0), (0.01, -0.005), (-0.01, -0.005)):
        pose[:3, 3] = [0.3, y, 0.119]
        world.render(pose)
        np.testing.assert_allclose(world.shift, [expected, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize('offset', [0.0, 0.004])
def test_a_slip_is_as_long_as_it_says_also_on_a_slope(tmp_path, offset):
    slope = {**TREE['edge'], 'path': [{'straight': 0.2}], 'height': [[0.0, 0.0], [0.2, 0.2]]}
    world = EdgeWorld(load_scene(write(tmp_path, {
        **TREE, 'edge': slope, 'slip': {'s': 0.1, 'offset': offset}})))
    pose = world.scene.start_pose()
    pose[:3, 3] = world.scene.edge.point_at(0.15) - [0.0, 0.0, 1e-3]
    for _ in range(2):
        world.render(pose)
        assert np.linalg.norm(world.shift) == pytest.approx(offset)


def changed(path, value):
    """Return TREE with one value replaced, or removed if it is KeyError."""
    tree = yaml.safe_load(yaml.safe_dump(TREE))
    node = tree
    for key in path[:-1]:
        node = node[key]
    if value is KeyError:
        del node[path[-1]]
    else:
        node[path[-1]] = value
    return tree


@pytest.mark.parametrize('path, value, words', [
    (('name',), KeyError, "'name' is missing"),
    (('edge',), [1], 'edge: is [1]'),
    (('edge', 'start'), [0.3, 0.1], 'edge.start is [0.3, 0.1]'),
    (('edge', 'start'), [0.3, 0.0, math.nan], 'edge.start[2] is nan'),
    (('edge', 'path'), [], 'edge.path is []'),
    (('edge', 'path'), [{'turn': 30}], 'edge.path is 0 m long, must be above 0'),
    (('edge', 'path'), [{'straight': 200}], 'edge.path[0].straight is 200'),
    (('edge', 'path'), [{'straight': 0.1}, {'turn': 180}], 'edge.path[1].turn is 180'),
    (('edge', 'path'), [{'straight': 1, 'turn': 1}], 'edge.path[0] has 2 of straight, turn, arc'),
    (('edge', 'path'), [{'arc': {'radius': 0, 'angle': 9}}], 'arc.radius is 0'),
    (('edge', 'gaps'), [[0.1, 0.3]], 'edge.gaps: must ascend within 0 to 0.2 m'),
    (('edge', 'gaps'), [[0.1]], 'edge.gaps[0] is [0.1], must be a list of 2'),
    (('edge', 'wave'), {'height': 0.2, 'length': 0.1}, 'edge.wave.height is 0.2'),
    (('edge', 'height'), [], 'edge.height is [], must be a list of pairs'),
    (('edge', 'height'), [[0.1, 0.0], [0.0, 0.0]], 'must not decrease'),
    (('skin', 'thickness'), 0.001, 'skin.thickness is 0.001'),
    (('skin', 'stiffness'), 10**400, 'skin.stiffness is 1000'),
    (('sensor', 'baseline'), 256, 'sensor.baseline is 256'),
    (('sensor', 'columns'), 8.5, 'sensor.columns is 8.5, must be an integer'),
    (('slip',), {'s': 0.1}, "slip: key 'offset' is missing"),
    (('slip',), {'s': 0.3, 'offset': 0.01}, 'slip.s is 0.3, must be at most the length'),
    (('start', 's'), 0.21, 'start.s is 0.21, must be at most the length of the edge, 0.2 m'),
])
def test_wrong_values_are_named_in_one_line(tmp_path, path, value, words):
    with pytest.raises(ConfigurationError) as error:
        load_scene(write(tmp_path, changed(path, value)))
    text = str(error.value)
    assert words in text
    assert 'scene.yaml' in text
    assert '\n' not in text


def test_a_scene_names_its_array(tmp_path):
    def sensor(values, depth=0.002):
        tree = {**TREE, 'sensor': values, 'skin': {'depth': depth}}
        return load_scene(write(tmp_path, tree)).sensor
    usual = sensor({})
    assert usual.array == TactelArray(16, 16, 0.0254 / 16, 0.0254 / 16)
    assert sensor({'rows': 16}) == usual
    other = sensor({'rows': 12, 'columns': 24, 'pitch_x': 0.001, 'pitch_y': 0.0015})
    assert other.array == TactelArray(12, 24, 0.001, 0.0015)
    # A shorter edge under the pad has more load per length, a deeper tactel less pressure.
    assert other.noise_std / usual.noise_std == pytest.approx(0.0254 / 0.018)
    deep = sensor({'pitch_y': 0.004}, 0.006)
    assert deep.pa_per_count / usual.pa_per_count == pytest.approx(0.0254 / 0.064 / 3.0)
    assert sensor({'pitch_y': 0.004, 'noise_std': 600.0}).noise_std == 600.0


def test_an_exponent_that_yaml_takes_for_a_text_is_a_number(tmp_path):
    text = yaml.safe_dump(TREE).replace('200000.0', '3e5')
    assert load_scene(write(tmp_path, text)).skin.stiffness == 3e5


@pytest.mark.parametrize('text', [
    '', '[1, 2', 'a: b: c', '- 1', '\t- x', '&a [*a]', 'when: 2024-99-99',
    'x: !!python/name:os.x'])
def test_malformed_yaml_is_refused_in_one_line(tmp_path, text):
    with pytest.raises(ConfigurationError) as error:
        load_scene(write(tmp_path, text))
    assert '\n' not in str(error.value)


def test_unreadable_files_are_refused(tmp_path):
    with pytest.raises(ConfigurationError, match='No such file'):
        load_scene(tmp_path / 'none.yaml')
    with pytest.raises(ConfigurationError, match='Is a directory'):
        load_scene(tmp_path)
    (tmp_path / 'latin.yaml').write_bytes(b'name: \xff')
    with pytest.raises(ConfigurationError, match='UTF-8'):
        load_scene(tmp_path / 'latin.yaml')


@pytest.mark.parametrize('points', [
    [[0, 0, 0]], [[0, 0], [1, 1]], [[0, 0, 0], [0, 0, 0]], [[0, 0, 0], [math.nan, 0, 0]]])
def test_edge_path_refuses_what_is_no_polyline(points):
    with pytest.raises(ConfigurationError):
        EdgePath(np.array(points, dtype=float))
