"""Pads of any size, pitch and depth track the same: the lengths are those of the pad itself."""

import numpy as np
from puma_loop import ROOT
import pytest

from tactile_servo.types import EdgeGoal
from tactile_simulation.closed_loop import Simulation
from tactile_simulation.scene import load_scene

DEEP = 1.5  # pitches, the larger one of two
# Rows, columns, pitch of the columns and of the rows [mm]
PADS = [(8, 8, 2.5, 2.5), (16, 16, 1.0, 1.0), (16, 16, 4.0, 4.0), (28, 28, 1.27, 1.27),
        (12, 24, 1.0, 1.5)]


@pytest.mark.parametrize('name, speed, pad', [
    ('course', 0.07, PADS[4]), ('tape_case', 0.1, PADS[0]),
    *(pytest.param('course', 0.07, pad, marks=pytest.mark.long) for pad in PADS[:4]),
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
    simulation = Simulation(scene, 'trace', seed=1)
    goal = EdgeGoal(speed, 5.0, closed=scene.edge.closed)
    simulation.run(goal, 60.0)
    summary = simulation.summary(goal)
    assert summary['ok'], summary['reason']
    begun = 0.0 if scene.edge.closed else scene.start.s
    # From first contact to where the edge is last seen, up to a quarter of the pad less.
    assert summary['edge_length'] > scene.edge.length - begun - 0.25e-3 * rows * pitch_y
    assert 'hold' not in [entry['state'] for entry in summary['states']]
    assert summary['lateral_rms'] < 0.04 * depth
    assert summary['lateral_max'] < 0.15 * depth
    assert summary['force_max'] < 8.0
    assert np.isfinite(summary['contour_max_error'])
