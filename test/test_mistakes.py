"""Typical mistakes on a command line: one line names value, bound and unit; nothing is written."""

from pathlib import Path
import shlex
import subprocess

import numpy as np
import pytest

from edge_tracking import composed, demo
from edge_tracking.report import page as report
from tactile_common.command_line import REFUSED
from tactile_sensing.cli import estimate
from tactile_shape.cli import fit
from tactile_simulation.cli import simulate

ROOT = Path(__file__).resolve().parents[1]
SCENE = ROOT / 'launch/scenes/straight.yaml'
CALIBRATION = ROOT / 'tactile_sensing/config/flexitac_16x16.yaml'
PARAMETERS = ROOT / 'launch/config/edge_tracking.yaml'
EDITED = {  # file: what it is a copy of, and what a user changed in it
    'metre.yaml': (SCENE, 'straight: 0.2', 'straight: 200'),
    'key.yaml': (SCENE, 'skin:', 'skn:'),
    'type.yaml': (SCENE, 'rows: 16', 'rows: sixteen'),
    'pitch.yaml': (CALIBRATION, 'pitch: 0.0015875', 'pitch: 1.5875'),
    'depth.yaml': (CALIBRATION, 'depth: 0.002', 'depth: 2'),
    'rate.yaml': (PARAMETERS, 'rate: 406.0', 'rate: -406.0'),
    'box.yaml': (PARAMETERS, 'workspace.upper: [0.45', 'workspace.upper: [0.3'),
    'tab.yaml': (PARAMETERS, '  ros__parameters:', '\tros__parameters:'),
}
SPEED = 'must be between 0.0001 and 0.2 m/s'
MISTAKES = [
    # (command, its arguments, what the line says)
    (demo, '--scene strait', "scene 'strait' is unknown; did you mean straight? shipped are"),
    (demo, '--scene sphere_70', 'did you mean surfaces/sphere_70? shipped are'),
    (demo, '--pattern raster', '--pattern does not apply to track_edge, but to track_surface'),
    (demo, '--pitch 0.001', '--pitch does not apply to track_edge, but to a --recording'),
    (composed, '--sensor flexitac', 'unrecognized arguments: --sensor flexitac'),
    (demo, '--scene metre.yaml',
     'straight is 200.0, must be between 0.0001 and 10 m; did you mean 0.2?'),
    (demo, '--scene key.yaml', "unknown key 'skn', must be one of name, description, edge, skin"),
    (demo, '--scene type.yaml', "sensor.rows is 'sixteen', must be an integer"),
    (demo, '--speed 30', f'speed is 30.0, {SPEED}; did you mean 0.03?'),
    (demo, '--speed nan', f'speed is nan, {SPEED}'),
    (demo, '--speed fast', "argument --speed: invalid float value: 'fast'"),
    (demo, '--force 5000', 'force is 5000.0, must be between 0.6 and 8 N'),
    (demo, '--law tracing', "invalid choice: 'tracing' (choose from"),
    (demo, '--seed -1', 'argument --seed: value is -1, must be between 0 and'),
    (demo, '--parameters none.yaml', 'parameter file none.yaml: cannot be read: No such file'),
    (demo, '--parameters rate.yaml', 'rate is -406.0, must be between'),
    (demo, '--parameters tab.yaml', 'parameter file tab.yaml: is not YAML'),
    (demo, '--recording frames.npz --scene nonsense',
     '--scene does not apply to a --recording, but to track_edge and track_surface'),
    (demo, '--recording frames.npz --law trace', '--law does not apply to a --recording'),
    (demo, '--recording frames.npz --seed 3', '--seed does not apply to a --recording'),
    (demo, '--recording frames.npz --speed 0.01', '--speed does not apply to a --recording'),
    (demo, '--recording frames.npz', 'no pitch_m in the file; give --pitch'),
    (demo, '--recording frames.npz --pitch 1.27',
     'pitch_x is 1.27, must be between 1e-06 and 0.1 m; did you mean 0.00127?'),
    (demo, '--recording frames.npz --calibration pitch.yaml', 'did you mean 0.0015875?'),
    (demo, '--recording frames.npz --calibration depth.yaml',
     'depth is 2.0, must be between 0 and 0.1 m; did you mean 0.002?'),
    (demo, '--recording none.npz', 'none.npz'),
    (demo, '--recording other.npz --pitch 0.001',
     "array 'frames' is missing, there are ['pictures']"),
    (demo, '--out /proc/nowhere', '--out /proc/nowhere: No such file or directory'),
    (simulate, '', 'arguments are required: scene'),
    (simulate, f'{SCENE} --length 100',
     'argument --length: value is 100.0, must be between 0 and 10 m; did you mean 0.1?'),
    (simulate, f'{SCENE} --latency 10', '--latency: value is 10.0, must be between 0 and 1 s'),
    (simulate, f'{SCENE} --robot none.urdf', "robot description 'none.urdf': No such file"),
    (simulate, f'{SCENE} --plot nowhere/plot.png', '--plot: nowhere/plot.png: there is no such'),
    (simulate, f'{SCENE} --plot x.foo', '--plot: x.foo: must end in .png or'),
    (simulate, f'{SCENE} --pattern raster', '--pattern does not apply to straight'),
    (simulate, 'strait', 'did you mean straight?'),
    (simulate, 'surfaces/plane --direction -1', '--direction does not apply to plane'),
    (simulate, 'surfaces/plane --size 0.02 0.02', '--size does not apply to the pattern line'),
    (simulate, 'surfaces/plane --step-over 0.01', '--step-over does not apply to the pattern'),
    (simulate, 'surfaces/plane --pattern raster --length 0.02', '--length does not apply to the'),
    (simulate, f'{SCENE} --tip pad', '--tip does not apply to the gantry; name a --robot'),
    (simulate, f'{SCENE} --start 0 0 0 0 0 0', '--start does not apply to the gantry'),
    (simulate, f'{SCENE} --parameters box.yaml', 'outside of workspace.lower and'),
    (estimate, 'frames.npz --pitch 1.27 --layers zz@0.002 -o out.npz',
     '--pitch: value is 1.27, must be between 1e-06 and 0.1 m; did you mean 0.00127?'),
    (demo, '--recording table.csv --shape 4 4 --pitch 0.001', "'rate_hz' is missing: --rate HZ"),
    (demo, '--recording table.csv --rate 0', '--rate: value is 0.0, must be between 0.001 and'),
    (fit, 'frames.npz -o out.npz', "array 't' is missing, there are ['frames', 'rate_hz']"),
    (report, 'none -o page.html', 'bag none: there is no such bag'),
    (report, 'text.txt -o page.html', 'bag text.txt: is not a rosbag2 recording'),
    (report, 'none -o page.txt', 'page.txt: must end in .html'),
    (report, 'none -o nowhere/page.html', 'nowhere/page.html: there is no such folder'),
    (report, 'a b c -o page.html', '3 recordings; one or two are shown'),
    (report, 'none -o page.html --scene strait', 'did you mean straight?'),
]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Give a folder to stand in, with files of a user in it."""
    np.savez(tmp_path / 'frames.npz', frames=np.zeros((50, 16, 16)), rate_hz=100.0)
    np.savez(tmp_path / 'other.npz', pictures=np.zeros((5, 4, 4)))
    np.savetxt(tmp_path / 'table.csv', np.zeros((5, 16)))
    (tmp_path / 'text.txt').write_text('1 2 3')
    for name, (path, old, new) in EDITED.items():
        text = path.read_text()
        assert old in text
        (tmp_path / name).write_text(text.replace(old, new))
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize('command, arguments, text', MISTAKES, ids=[
    f'{command.__name__.rpartition(".")[2]} {arguments.replace(str(ROOT), "")}'
    for command, arguments, _ in MISTAKES])
def test_a_mistake_ends_in_one_line_before_anything_begins(
        folder, monkeypatch, capsys, command, arguments, text):
    def started(*_, **__):
        raise AssertionError('a process was started')

    monkeypatch.setattr(subprocess, 'Popen', started)
    before = sorted(folder.rglob('*'))
    assert command.main(shlex.split(arguments)) == REFUSED
    printed, told = capsys.readouterr()
    assert printed == ''
    lines = [line for line in told.splitlines() if line]
    assert len(lines) == 1 and text in lines[0], told
    assert sorted(folder.rglob('*')) == before
