"""Pads of any size, pitch and depth track the same: the lengths are those of the pad itself."""

from dataclasses import replace

import numpy as np
from puma_loop import ROOT
import pytest

from tactile_servo.types import EdgeGoal
from tactile_simulation.closed_loop import Simulation
from tactile_simulation.edge_path import EdgePath
from tactile_simulation.metrics import summarise
from tactile_simulation.scene import load_scene

USUAL = 0.0254  # m, the pad for whose features the shipped scenes are made
DEEP = 1.5  # pitches, the larger one of two
# Rows, columns, pitch of the columns and of the rows [mm]
PADS = [(8, 8, 2.5, 2.5), (16, 16, 1.0, 1.0), (16, 16, 4.0, 4.0), (28, 28, 1.27, 1.27),
        (12, 24, 1.0, 1.5)]


def scene_for(folder, name, rows, columns, pitch_x, pitch_y):
    """
    Scene for a pad, and the depth of its tactels.

    For a pad that is larger than the usual one the shipped edge grows as much: its corner, its
    arc and its end lie closer together than such a pad is long, which shows several at once.
    """
    depth = DEEP * max(pitch_x, pitch_y) * 1e-3
    path = folder / 'scene.yaml'
    path.write_text((ROOT / f'launch/scenes/{name}.yaml').read_text() + f"""
skin: {{depth: {depth}}}
sensor: {{rows: {rows}, columns: {columns}, pitch_x: {pitch_x}e-3, pitch_y: {pitch_y}e-3}}
""")
    scene = load_scene(path)
    factor = max(1.0, max(scene.sensor.array.size_x, scene.sensor.array.size_y) / USUAL)
    first, start = scene.edge.points[0], scene.start
    edge = EdgePath(first + factor * (scene.edge.points - first), scene.edge.solid)
    return replace(scene, edge=edge, start=replace(start, s=factor * start.s)), depth


@pytest.mark.parametrize('pad', PADS, ids=lambda pad: '{}x{}, {} x {} mm'.format(*pad))
@pytest.mark.parametrize('name, speed, seed', [('course', 0.03, 0), ('tape_case', 0.05, 1)])
def test_a_pad_tracks_as_well_as_its_skin_is_fine(tmp_path, pad, name, speed, seed):
    scene, depth = scene_for(tmp_path, name, *pad)
    simulation = Simulation(scene, 'trace', seed=seed)
    goal = EdgeGoal(speed, 5.0, closed=scene.edge.closed)
    status = simulation.run(goal, 60.0)
    summary = summarise(simulation, goal, status, name='', tracker='trace', seed=seed)
    assert summary['ok'], summary['reason']
    begun = 0.0 if scene.edge.closed else scene.start.s
    assert summary['tracked_length'] > 0.98 * (scene.edge.length - begun)
    assert 'hold' not in [entry['state'] for entry in summary['states']]
    assert summary['lateral_rms'] < 0.03 * depth
    assert summary['lateral_max'] < 0.15 * depth
    assert summary['force_max'] < 8.0
    assert np.isfinite(summary['contour_max_error'])
