"""The map of an edge from pictures made of line loads: refusals, path, slip, frames, scale."""

from dataclasses import replace
import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tactile_sensing.skin.half_spaces import add_segment
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.image import Layer, TactileImage
from tactile_servo.edge_map.edge_map import EdgeMap, ELSEWHERE, NO_RIDGE, SURE_PICTURES
from tactile_servo.edge_map.path_queries import place_at
from tactile_servo.edge_map.picture import indentation_of, PadScale, read_picture
from tactile_servo.edge_map.records import CLOUD_POINT, joined
from tactile_servo.edge_map.traced_path import PathEnd

PITCH, DEPTH, STIFFNESS, LOAD = 0.0254 / 16, 2e-3, 2e5, 200.0
BASE, LINE = np.eye(4), np.array([(0.0, -0.3), (0.0, 0.3)])


def image_of(edge, place, scale=1.0, noise=100.0, seed=0):
    """Image of a polyline (M, 2) that presses on a pad at a place, x and y along the plane's."""
    array = TactelArray(16, 16, scale * PITCH, scale * PITCH)
    pressure = noise * np.random.default_rng(seed).standard_normal(array.shape)
    for first, last in zip(edge - place, (edge - place)[1:], strict=False):
        # The load grows with the depth, so that the pressure stays.
        add_segment(pressure, array.x, array.y, scale * DEPTH, *first, *last, scale * LOAD,
                    scale * LOAD)
    layer = Layer('zz', scale * DEPTH, pressure, noise_std=noise)
    return TactileImage(seed, seed, (layer,), array, tared=True)


def pose_at(place, base=BASE):
    pose = np.eye(4)
    pose[:2, 3] = place
    return base @ pose


def walk(edge, way, base=BASE, scale=1.0):
    """Edge map after pictures at places (N, 2), which it all must see; and its sights."""
    edge_map, sights = EdgeMap(STIFFNESS), []
    for seed, place in enumerate(way):
        image = image_of(edge, place, scale, seed=seed)
        assert edge_map.see(image, pose_at(place, base)) is None
        sights.append(edge_map.follow(1))
    return edge_map, sights


def straight(count, step=1e-3):
    return np.column_stack([np.full(count, 5e-4), step * np.arange(count)])


def test_pictures_that_cannot_be_used_are_refused():
    good = image_of(LINE, (0.0, 0.0))
    layer = good.layers[0]
    holed = np.where(np.arange(256).reshape(16, 16) % 3 > 0, np.nan, layer.stress)
    cases = {'without pressure': [
        replace(good, layers=()), replace(good, layers=(replace(layer, unit='counts'),)),
        *(replace(good, layers=(replace(layer, depth=bad),)) for bad in (0.0, np.inf, np.nan)),
        replace(good, layers=(replace(layer, stress=np.zeros((3, 3))),))],
        'without tared pressure': [replace(good, tared=False)],
        'too many invalid tactels': [
            replace(good, layers=(replace(layer, stress=holed),))]}
    for problem, images in cases.items():
        for image in images:
            edge_map = EdgeMap(STIFFNESS)
            assert edge_map.see(image, np.eye(4)).text.endswith(problem)
            assert edge_map.picture is None and edge_map.contour() is None
    picture = read_picture(good, np.eye(4), STIFFNESS)
    assert picture.scale == PadScale.of(good.array, DEPTH) and picture.scale.grain == DEPTH
    assert picture.force == pytest.approx(LOAD * 0.0254, rel=0.03)


@pytest.mark.parametrize('yaw', [0.0, 0.8, -1.2])
def test_the_indentation_rises_along_the_edge_alone(yaw):
    """Where places and pressures of points err together, it was extrapolated across the edge."""
    at, rise = (3e-3, 0.0), 0.05
    points = read_picture(image_of(LINE, at, noise=1.0), np.eye(4), STIFFNESS).points
    wrong = np.where(np.arange(len(points)) % 2, 1.0, -1.0)
    x, y = points['x'] + 2e-4 * wrong, points['y'].copy()
    points['x'] = x * np.cos(yaw) - y * np.sin(yaw)
    points['y'] = x * np.sin(yaw) + y * np.cos(yaw)
    depths = LOAD / STIFFNESS * (1.0 + 0.1 * wrong) + rise * y
    points['z'] = -depths
    found, depth, way = indentation_of(points, np.eye(4), 8 * PITCH)
    assert found and depth == pytest.approx(LOAD / STIFFNESS, rel=0.05)
    assert way / way[2] == pytest.approx(
        [-rise * np.sin(yaw), rise * np.cos(yaw), 1.0], abs=0.01)


def test_a_coarse_array_tells_apart_no_more_than_its_pitch():
    scale = PadScale.of(TactelArray(8, 10, 2e-3, 4e-3), 2e-3)
    assert scale.grain == pytest.approx(5e-3) and scale.half == pytest.approx(16e-3)


def test_a_straight_edge_is_mapped_in_the_base_frame():
    base = np.eye(4)
    base[:3, :3] = Rotation.from_rotvec([2.9, 0.4, -0.3]).as_matrix()
    base[:3, 3] = [0.4, -0.2, 0.1]
    edge_map, sights = walk(LINE, straight(20), base)
    assert sights == [(None, True), *[(None, False)] * 19]
    # A path begins at the ridge point nearest to the pad, of which every row has one.
    assert edge_map.station == pytest.approx(19e-3, abs=0.51 * PITCH)
    contour = edge_map.contour() @ base[:3, :3] - base[:3, 3] @ base[:3, :3]
    np.testing.assert_allclose(contour[:, 0], 0.0, atol=0.02e-3)
    # As high as the load tells: the indentation of the skin, away from the sensor's z.
    np.testing.assert_allclose(contour[:, 2], -LOAD / STIFFNESS, atol=0.05e-3)
    lateral, angle, length, rise = edge_map.at_picture(1, edge_map.station)
    assert lateral == pytest.approx(-5e-4, abs=0.02e-3)  # the edge lies on the left
    assert angle == pytest.approx(0.0, abs=0.02) and rise == pytest.approx(0.0, abs=0.02)
    assert length == pytest.approx(0.0254, rel=1e-3)
    turned_back = edge_map.at_picture(-1, edge_map.station)
    assert turned_back[0] == pytest.approx(-lateral)
    assert abs(turned_back[1] - angle) == pytest.approx(np.pi)
    assert edge_map.path.end is PathEnd.VIEW and not edge_map.closed


def test_where_the_pad_is_on_the_path():
    base = np.eye(4)
    base[:3, :3] = Rotation.from_rotvec([2.9, 0.4, -0.3]).as_matrix()
    base[:3, 3] = [0.3, -0.2, 0.4]
    edge_map, _ = walk(LINE, straight(20), base)
    ahead = pose_at((5e-4, 21e-3), base)
    place = edge_map.locate(pose_at((5e-4, 19e-3), base), ahead, edge_map.station,
                            edge_map.station, (0.0, 4e-3))
    # The plane is the first pad's, 5e-4 m beside the edge.
    assert place.here == pytest.approx(edge_map.station, abs=1e-6)
    assert place.ahead == pytest.approx(place.here + 2e-3, abs=1e-5)
    assert place.aside == pytest.approx((-5e-4, 0.0), abs=0.02e-3)
    np.testing.assert_allclose(place.there, edge_map.plane @ ahead, atol=1e-12)
    assert place.way == pytest.approx((0.0, 1.0), abs=0.02)
    np.testing.assert_allclose(edge_map.way_in_base(*place.along), base[:3, 1], atol=0.02)
    # Beyond what was seen the edge goes straight on.
    assert place.length == pytest.approx(0.0254, rel=1e-3)


def test_a_corner_is_found_ahead_of_the_pad():
    edge = np.array([(0.0, -0.1), (0.0, 0.03), (0.1, 0.03)])
    edge_map, _ = walk(edge, straight(26))
    (corner,) = edge_map.path.corners
    np.testing.assert_allclose(corner.shape.vertex, np.array([0.0, 0.03]) - straight(1)[0],
                               atol=0.15e-3)
    assert corner.shape.turn == pytest.approx(-0.5 * np.pi, abs=0.05)
    assert edge_map.corner_at(0.5 * (corner.entry + corner.leave)) is corner
    assert edge_map.corner_at(corner.entry - 1e-3) is None


def test_the_end_of_a_ridge_is_told_from_the_end_of_the_view():
    edge_map, _ = walk(np.array([(0.0, -0.1), (0.0, 0.02)]), straight(16))
    assert edge_map.path.end is PathEnd.RIDGE
    assert place_at(edge_map.path.nodes, edge_map.path.tip)[1] == pytest.approx(0.02, abs=0.6e-3)


@pytest.mark.parametrize('weight', [0.2, 1.0])
def test_a_path_does_not_begin_at_a_single_point(weight):
    """Noise makes points that are no ridge; one was nearer to the pad than the edge."""
    edge_map, at = EdgeMap(STIFFNESS), (4e-3, 0.0)
    assert edge_map.see(image_of(LINE, at), pose_at(at)) is None
    picture = edge_map.picture
    single = picture.points[:1].copy()
    single['x'], single['y'], single['weight'] = *picture.place, weight
    picture.points = joined([picture.points, single], CLOUD_POINT)
    assert edge_map.follow(1) == (None, True)
    assert edge_map.path.nodes['point'][:, 0] == pytest.approx(-4e-3, abs=0.05e-3)


@pytest.mark.parametrize('angle', [65.0, 90.0, -75.0])
def test_the_angle_of_an_edge_across_the_pad_is_named(angle):
    turn = np.radians(angle)
    across = LINE @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    edge_map, ((problem, begun),) = walk(across, [(0.0, 0.0)])
    assert not begun and edge_map.path is None
    angles = re.match(r"it is (\d+) degrees off .* \(at the start the pad's y\)", problem.detail)
    assert float(angles[1]) == pytest.approx(abs(angle), abs=3.0)


def test_no_ridge_and_an_edge_elsewhere_are_told_and_a_slip_begins_a_path():
    edge_map, _ = walk(LINE, straight(10))
    place = straight(11)[-1]
    blank = image_of(LINE + 1.0, place)
    assert edge_map.see(blank, pose_at(place)) is None
    assert edge_map.follow(1)[0] is NO_RIDGE
    slipped = LINE + [6e-3, 0.0]
    for seed in range(SURE_PICTURES):
        edge_map.see(image_of(slipped, place, seed=seed), pose_at(place))
        problem, begun = edge_map.follow(1)
        if seed < SURE_PICTURES - 1:
            assert problem is ELSEWHERE
    assert begun and problem is None
    x, _, _ = place_at(edge_map.path.nodes, edge_map.station)
    assert x == pytest.approx(6e-3 - 5e-4, abs=0.05e-3)
    assert not edge_map.path.may_close  # its start is not that of the contour


@pytest.mark.parametrize('scale', [0.4, 3.0])
def test_a_larger_pad_on_a_larger_edge_draws_the_same_larger(scale):
    edge = np.array([(0.0, -0.1), (0.0, 0.02), (0.05, 0.05)])
    usual, _ = walk(edge, straight(20))
    other, _ = walk(scale * edge, scale * straight(20), scale=scale)
    np.testing.assert_allclose(other.path.nodes['place'], scale * usual.path.nodes['place'],
                               atol=1e-6 * scale)
    (corner,), (larger,) = usual.path.corners, other.path.corners
    assert larger.shape.turn == pytest.approx(corner.shape.turn, abs=1e-4)
