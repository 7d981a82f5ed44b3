"""Pads of any size, pitch and depth track the same: the lengths are those of the pad itself."""

from dataclasses import replace

import numpy as np
from puma_loop import ROOT, summary_of
import pytest
from scipy.spatial.transform import Rotation

from tactile_servo.types import EdgeGoal
from tactile_simulation import closed_loop
from tactile_simulation.closed_loop import Simulation
from tactile_simulation.edge_world import EdgeScene
from tactile_simulation.scene import load_scene

DEEP = 1.5  # pitches, the larger one of two
# Rows, columns, pitch of the columns and of the rows [mm]
PADS = [(8, 8, 2.5, 2.5), (16, 16, 1.0, 1.0), (16, 16, 4.0, 4.0), (28, 28, 1.27, 1.27),
        (12, 24, 1.0, 1.5)]


def on_an_edge(folder, path, skin, sensor, start):
    """Scene of an edge along base y with a path, skin, sensor and start in YAML."""
    file = folder / 'scene.yaml'
    file.write_text(f"""
name: pad
description: An edge.
edge: {{start: [0.36, -0.08, 0.15], heading: 90, path: [{path}]}}
skin: {{{skin}}}
sensor: {{{sensor}}}
start: {{{start}}}
""")
    return load_scene(file)


def size(tactels, pitch):
    """Sensor of a square pad, in YAML; its pitch in mm."""
    return f'rows: {tactels}, columns: {tactels}, pitch_x: {pitch}e-3, pitch_y: {pitch}e-3'


@pytest.mark.parametrize('name, speed, pad', [
    ('tape_case', 0.1, PADS[0]),
    *(pytest.param('course', 0.07, pad, marks=pytest.mark.long) for pad in PADS),
    pytest.param('tape_case', 0.1, PADS[4], marks=pytest.mark.long)])
def test_a_pad_tracks_as_well_as_its_skin_is_fine(tmp_path, pad, name, speed):
    rows, columns, pitch_x, pitch_y = pad
    depth = DEEP * max(pitch_x, pitch_y) * 1e-3
    path = tmp_path / 'scene.yaml'
    path.write_text((ROOT / f'launch/scenes/{name}.yaml').read_text() + f"""
skin: {{depth: {depth}}}
sensor: {{rows: {rows}, columns: {columns}, pitch_x: {pitch_x}e-3, pitch_y: {pitch_y}e-3}}
""")
    scene = load_scene(path)
    summary = summary_of(Simulation(scene, 'trace', seed=1),
                         EdgeGoal(speed, 5.0, closed=scene.edge.closed), 60.0)
    assert summary['ok'], summary['reason']
    begun = 0.0 if scene.edge.closed else scene.start.s
    # From first contact to where the edge is last seen, up to a quarter of the pad less.
    assert summary['edge_length'] > scene.edge.length - begun - 0.25e-3 * rows * pitch_y
    assert 'hold' not in [entry['state'] for entry in summary['states']]
    assert summary['lateral_rms'] < 0.04 * depth
    assert summary['lateral_max'] < 0.15 * depth
    assert summary['force_max'] < 8.0
    assert np.isfinite(summary['contour_max_error'])


@pytest.mark.parametrize('pad, skin, sensor, start', [
    ((8, 2.0), 'depth: 0.003, stiffness: 300000.0, thickness: 0.004, poisson: 0.49',
     'creep: 0.08, noise_std: 2000.0', 'yaw: 173'),
    ((16, 1.6), 'depth: 0.001, stiffness: 200000.0, thickness: 0.002, poisson: 0.49',
     'hysteresis: 0.1, noise_std: 600.0', 'yaw: 132, offset: -0.002')],
    ids=['creep', 'hysteresis, on a bone'])
def test_a_skin_with_a_memory_ends_where_the_edge_ends(tmp_path, pad, skin, sensor, start):
    """What it keeps of the edge beyond the end is no edge; a bone under it is no fault."""
    scene = on_an_edge(tmp_path, '{straight: 0.2}', skin, f'{size(*pad)}, {sensor}',
                       f's: 0.06, height: 0.004, {start}')
    summary = summary_of(Simulation(scene, 'trace', seed=30),
                         EdgeGoal(0.03, 5.0, direction=-1), 40.0)
    assert summary['ok'] and summary['reason'] == 'the edge ended', summary['reason']
    assert summary['force_max'] < 7.0


@pytest.mark.parametrize('creep, force', [
    (0.25, 5.0), *(pytest.param(*it, marks=pytest.mark.long) for it in (
        (0.12, 5.0), (0.12, 8.0), (0.25, 8.0)))])
def test_a_skin_that_keeps_much_ends_where_the_edge_ends(creep, force):
    """Beyond the end it still reads up to a fifth of the force, along the edge that it left."""
    scene = load_scene('straight')
    scene = replace(scene, sensor=replace(scene.sensor, creep=creep, creep_time=1.0))
    summary = summary_of(Simulation(scene, 'trace', seed=1), EdgeGoal(0.05, force))
    assert summary['ok'] and summary['reason'] == 'the edge ended', summary['reason']
    assert summary['force_max'] < 1.1 * force


def test_a_pad_that_is_still_lightly_on_the_edge_slides_off_it(monkeypatch):
    """The calibration gives too small a depth and stiffness: the edge seems to end early."""
    right = closed_loop.calibration_of

    def wrong(scene):
        known = right(scene)
        return replace(known, depth=0.76 * known.depth, skin_stiffness=0.75 * known.skin_stiffness)
    monkeypatch.setattr(closed_loop, 'calibration_of', wrong)
    summary = summary_of(Simulation(load_scene('straight'), 'trace', seed=81),
                         EdgeGoal(0.02, 8.0), 25.0)
    assert summary['reason'] == 'the edge ended'


@pytest.mark.parametrize('path', [
    pytest.param('{straight: 0.16}', marks=pytest.mark.long),
    '{straight: 0.06}, {turn: 40}, {straight: 0.1}'])
def test_an_edge_does_not_end_where_a_coarse_pad_sees_no_ridge(tmp_path, path):
    """Ridges of 5 x 5 tactels are within 8 of 12.5 mm: the edge seemed to end there."""
    scene = on_an_edge(tmp_path, path, 'depth: 0.001, stiffness: 100000.0', size(5, '5.0'),
                       's: 0.03, height: 0.004, yaw: -2, offset: 0.002')
    summary = summary_of(Simulation(scene, 'trace', seed=1), EdgeGoal(0.03, 5.0, length=0.08))
    assert summary['ok'], summary['reason']
    assert summary['lateral_rms'] < 1e-3 and summary['force_max'] < 8.0


def test_a_leg_that_few_images_of_few_tactels_show_is_no_end(tmp_path):
    """8 x 8 tactels see the end of the first leg in eight images; they refuse its corner."""
    scene = on_an_edge(tmp_path, '{straight: 0.1}, {turn: 135}, {straight: 0.1}', 'depth: 0.002',
                       size(8, '3.0'), 's: 0.02')
    summary = summary_of(Simulation(scene, 'trace', seed=1), EdgeGoal(0.2, 5.0))
    assert not summary['ok'] and 'too sharp' in summary['reason']


@pytest.mark.parametrize('stiffness', [5e4, 6e5])
def test_the_unfelt_force_is_that_of_the_skin(stiffness):
    """What a pad that is .1 mm deeper than the images show presses in addition."""
    scene = load_scene('straight')
    scene = replace(scene, skin=replace(scene.skin, stiffness=stiffness))
    simulation = Simulation(scene, 'trace', seed=1)
    simulation.run(EdgeGoal(0.03, 5.0), 10.0, lambda status: status.progress > 0.02)
    pose, law, world = simulation.log[-1].pose, simulation.servo.law, scene.world()
    deeper = pose.copy()
    deeper[:3, 3] += 1e-4 * pose[:3, 2]
    law.sight.press.unexplained = 1e-4
    assert law.unfelt == pytest.approx(world.force(deeper) - world.force(pose), rel=0.1)


@pytest.mark.parametrize('tilt, tactels, pitch, stiffness', [
    (-4.0, 16, 1.6, 5e5), (4.0, 8, 4.0, 2e5),
    *(pytest.param(*it, marks=pytest.mark.long) for it in (
        (4.0, 16, 1.6, 5e5), (0.0, 16, 1.6, 5e5), (-4.0, 8, 4.0, 2e5), (0.0, 8, 4.0, 2e5)))])
def test_a_tilted_pad_turns_onto_the_edge(tmp_path, monkeypatch, tilt, tactels, pitch, stiffness):
    """It touches with one end alone; with its rear it sees the ridge end before its centre."""
    scene = on_an_edge(
        tmp_path, '{straight: 0.1}', f'depth: 0.002, stiffness: {stiffness}',
        size(tactels, pitch), 's: 0.03, height: 0.006, offset: 0.001')
    pose = scene.start_pose()
    pose[:3, :3] @= Rotation.from_euler('x', tilt, degrees=True).as_matrix()
    monkeypatch.setattr(EdgeScene, 'start_pose', lambda _: pose)
    simulation = Simulation(scene, 'trace', seed=2)
    summary = summary_of(simulation, EdgeGoal(0.05, 2.0), 30.0)
    assert summary['ok'] and summary['reason'] == 'the edge ended', summary['reason']
    assert summary['lateral_rms'] < 0.03e-3 and summary['force_max'] < 2.8
    along = simulation.pose[:3, :3] @ [0.0, 1.0, 0.0]
    assert abs(np.degrees(np.arcsin(along[2]))) < 0.5
