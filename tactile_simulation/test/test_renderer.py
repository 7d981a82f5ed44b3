"""The synthetic sensor against closed forms and invariances."""
from dataclasses import replace
import math

import numpy as np
import pytest

from tactile_sensing.devices.calibration import load_calibration
from tactile_sensing.skin.pressure import SkinPressure
from tactile_sensing.thesis.line import pressure as line_pressure
from tactile_sensing.types.array import TactelArray
from tactile_simulation.edge_path import EdgePath
from tactile_simulation.edge_world import EdgeScene, EdgeWorld, Start
from tactile_simulation.render import force_on, render
from tactile_simulation.sensor import SceneSkin, Sensor
from tactile_simulation.world import write_calibration

PITCH = 0.0254 / 16
PAD = TactelArray(16, 16, PITCH, PITCH)
SKIN = SceneSkin(0.002, 2e5)


def segment_pressure(array, depth, start, end, load_start, load_end):
    """
    Pressure under a segment whose load per length runs from one value to another.

    Closed form of the integral of 3/(2 pi) d^3 q(u) / (u^2 + c^2)^(5/2).
    """
    x, y = np.meshgrid(array.x, array.y)
    length = math.dist(start, end)
    tx, ty = (end[0] - start[0]) / length, (end[1] - start[1]) / length
    foot = (x - start[0]) * tx + (y - start[1]) * ty
    c2 = ((x - start[0]) * ty - (y - start[1]) * tx)**2 + depth**2
    slope = (load_end - load_start) / length
    at_foot = load_start + slope * foot

    def primitive(u):
        root = np.sqrt(u**2 + c2)
        constant = u / (3 * c2 * root**3) + 2 * u / (3 * c2**2 * root)
        return at_foot * constant - slope / (3 * root**3)

    return 1.5 / math.pi * depth**3 * (primitive(length - foot) - primitive(-foot))


def line_points(rho, yaw, indentation, reach=0.1):
    foot = np.array([rho * math.cos(yaw), rho * math.sin(yaw), -indentation])
    along = np.array([-math.sin(yaw), math.cos(yaw), 0.0])
    return np.array([foot - reach * along, foot + reach * along])


@pytest.mark.parametrize('depth', [0.001, 0.002, 0.004])
@pytest.mark.parametrize('rho, yaw', [(0, 0), (0.003, 0.3), (-0.006, -0.7), (0.002, 1.5)])
def test_long_straight_edge_is_a_line_load(depth, rho, yaw):
    pressure = render(line_points(rho, yaw, 0.001), PAD, SceneSkin(depth, 2e5))
    expected = line_pressure(PAD.x, PAD.y[:, None], rho, yaw, 200.0, depth)
    np.testing.assert_allclose(pressure, expected, atol=5e-4 * 2 * 200.0 / (math.pi * depth))


def test_five_newton_give_63_kilopascal_and_the_pressure_carries_the_load():
    fine = TactelArray(16, 17, PITCH, PITCH)  # with a column at x = 0
    indentation = 5.0 / (2e5 * 0.0254)
    points = line_points(0, 0, indentation)
    assert force_on(points, fine, SKIN) == pytest.approx(5.0)
    pressure = render(points, fine, SKIN)
    assert pressure.max() == pytest.approx(62.7e3, rel=1e-3)
    wide = TactelArray(64, 64, 0.001, 0.001)
    points = np.array([[-0.004, -0.003, -0.001], [0.005, 0.004, -0.001]])
    pressure, force = render(points, wide, SKIN), force_on(points, wide, SKIN)
    load = 2e5 * 0.001 * math.dist(points[0], points[1])
    assert force == pytest.approx(load)
    assert pressure.sum() * 1e-6 == pytest.approx(load, rel=3e-3)


@pytest.mark.parametrize('yaw, chord', [
    (0.0, 0.0254), (0.3, 0.0254 / math.cos(0.3)), (math.pi / 4, 0.0254 * math.sqrt(2))])
def test_force_counts_the_chord_in_the_array(yaw, chord):
    force = force_on(line_points(0, yaw, 0.001), PAD, SKIN)
    assert force == pytest.approx(200.0 * chord)


@pytest.mark.parametrize('start, end', [
    ((0.001, -0.008), (0.004, 0.006)), ((0.0, 0.0), (0.0, 0.03)), ((-0.02, 0.0), (0.003, 0.0))])
def test_end_of_an_edge(start, end):
    points = np.array([[*start, -0.001], [*end, -0.001]])
    pressure = render(points, PAD, SKIN)
    expected = segment_pressure(PAD, 0.002, start, end, 200.0, 200.0)
    np.testing.assert_allclose(pressure, expected, atol=1e-3 * expected.max())


def test_tilted_pad_lifts_off():
    points = np.array([[0.0, -0.01, -0.001], [0.0, 0.01, 0.001]])
    pressure, force = render(points, PAD, SKIN), force_on(points, PAD, SKIN)
    assert force == pytest.approx(0.5 * 200.0 * math.hypot(0.01, 0.001), rel=1e-9)
    expected = segment_pressure(PAD, 0.002, (0, -0.01), (0, 0), 200.0, 0.0)
    np.testing.assert_allclose(
        pressure, expected * math.hypot(0.01, 0.001) / 0.01, atol=1e-3 * expected.max())


def test_chords_of_one_edge_add_up():
    straight = line_points(0.002, 0.4, 0.001)
    dense = np.linspace(straight[0], straight[1], 941)
    whole, parts = (render(points, PAD, SKIN) for points in (straight, dense))
    np.testing.assert_allclose(parts, whole, atol=5e-4 * whole.max())
    assert force_on(dense, PAD, SKIN) == pytest.approx(force_on(straight, PAD, SKIN))


@pytest.mark.parametrize('points', [
    [[0, -0.1, 0.0], [0, 0.1, 0.0]], [[0, -0.1, 0.01], [0, 0.1, 0.02]],
    [[0.05, -0.1, -0.001], [0.05, 0.1, -0.001]]])
def test_no_touch_no_pressure(points):
    assert not render(np.array(points), PAD, SKIN).any()
    assert force_on(np.array(points), PAD, SKIN) == 0.0


def test_scales_with_stiffness_and_size():
    points = line_points(0.001, 0.2, 0.001)
    once, force = render(points, PAD, SKIN), force_on(points, PAD, SKIN)
    twice = points, PAD, SceneSkin(0.002, 4e5)
    np.testing.assert_allclose(render(*twice), 2 * once)
    assert force_on(*twice) == pytest.approx(2 * force)
    small = 0.5 * points, TactelArray(16, 16, PITCH / 2, PITCH / 2), SceneSkin(0.001, 2e5)
    np.testing.assert_allclose(render(*small), once)
    assert force_on(*small) == pytest.approx(force / 4)


def a_scene(noise_std=0.0, baseline=10.0):
    edge = EdgePath(np.array([[0.3, -0.1, 0.12], [0.3, 0.02, 0.12], [0.25, 0.1, 0.12]]))
    return EdgeScene('test', 'An edge.', edge, Start(0.05, 0.003, -0.001, 6.0), skin=SKIN,
                     sensor=Sensor(noise_std, baseline))


def moved(scene, transform):
    points = scene.edge.points @ transform[:3, :3].T + transform[:3, 3]
    return replace(scene, edge=EdgePath(points))


def test_only_the_relative_pose_matters():
    scene = a_scene()
    pose = scene.start_pose()
    axis = np.array([1.0, 2.0, -0.5]) / math.sqrt(5.25)
    skew = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    transform = np.eye(4)
    transform[:3, :3] += math.sin(0.7) * skew + (1 - math.cos(0.7)) * skew @ skew
    transform[:3, 3] = [0.1, -0.2, 0.3]
    here, there = EdgeWorld(scene), EdgeWorld(moved(scene, transform))
    np.testing.assert_allclose(there.render(transform @ pose), here.render(pose), rtol=1e-9)
    assert there.force(transform @ pose) == pytest.approx(here.force(pose))


def test_sensor_x_points_left_of_the_edge():
    scene = a_scene()
    pressure = EdgeWorld(scene).render(scene.start_pose())
    centroid = (pressure.sum(axis=0) * PAD.x).sum() / pressure.sum()
    assert centroid < -0.0015  # the pad stands 3 mm to the left, so the edge lies at -x


def test_noise_has_its_size_and_repeats_with_the_seed():
    scene = a_scene(noise_std=6300.0, baseline=100.0)
    renderer = EdgeWorld(scene)
    first, again, other = (
        np.stack([renderer.counts(None, rng) for _ in range(40)])
        for rng in map(np.random.default_rng, (5, 5, 6)))
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()
    assert first.std() * scene.sensor.pa_per_count == pytest.approx(6300.0, rel=0.03)
    assert first.mean() == pytest.approx(100.0, abs=0.3)


@pytest.mark.parametrize('thickness, area', [(0.0, 1.0), (0.004, 0.0), (0.004, 1.0)])
def test_edge_on_a_backing_with_area_tactels_is_a_line(thickness, area):
    skin = SceneSkin(0.002, thickness=thickness, poisson=0.45)
    pressure = render(line_points(1e-3, 0.3, 0.001), PAD, skin, area=area)
    expected = SkinPressure(skin.layer, area * PAD.pitch_x, area * PAD.pitch_y).line(
        PAD.x, PAD.y[:, None], 1e-3, 0.3, 0.001 * skin.stiffness)
    assert np.abs(pressure - expected).max() < 3e-3 * expected.max()


def test_a_deep_backing_is_none():
    points = line_points(-2e-3, 0.6, 0.001)
    without, thick = (render(points, PAD, SceneSkin(0.002, thickness=it)) for it in (0.0, 1.0))
    np.testing.assert_allclose(thick, without, atol=1e-3 * without.max())


def told(**sensor):
    edge = EdgePath([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]])
    return EdgeScene('pad', '', edge, skin=SceneSkin(0.003, 1e5), start=Start(height=-0.001),
                 sensor=Sensor(noise_std=0.0, **sensor))


@pytest.mark.parametrize('sensor', [
    {}, {'rows': 12, 'columns': 24, 'pitch_x': 0.001, 'pitch_y': 0.0015},
    {'pa_per_count': 2000.0, 'baseline': 30.0}])
def test_counts_become_the_pressure_that_was_rendered(tmp_path, sensor):
    it = told(**sensor)
    calibration = load_calibration(write_calibration(it, tmp_path / 'pad.yaml'))
    assert calibration.array == it.sensor.array
    assert (calibration.depth, calibration.skin_stiffness) == (0.003, 1e5)
    renderer, pose = EdgeWorld(it), it.start_pose()
    layer, saturated = calibration.converter()(
        renderer.counts(pose, np.random.default_rng(0)))
    assert saturated == 0
    np.testing.assert_allclose(
        layer.stress, renderer.render(pose), atol=0.51 * it.sensor.pa_per_count)
