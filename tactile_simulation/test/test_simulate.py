"""The command `simulate`: its summary, its exit status and its errors."""

import json

import numpy as np
from puma_loop import ROOT
import pytest

from tactile_simulation.cli.simulate import main
from tactile_simulation.edge_path import EdgePath
from tactile_simulation.edge_world import area_of, contour_errors

STRAIGHT = str(ROOT / 'launch/scenes/straight.yaml')
KEYS = {
    'ok', 'state', 'reason', 'scene', 'law', 'seed', 'speed', 'tracked_length',
    'edge_length', 'lateral_rms', 'lateral_max', 'lateral_transient_max', 'force_target',
    'force_rms_error', 'force_max', 'joint_acceleration_max', 'joint_acceleration_rms',
    'pad_speed_scatter', 'closed', 'contour_max_error', 'contour_area_error', 'duration',
    'real_time_factor', 'sensor_rate', 'control_rate', 'latency_p50', 'latency_p99',
    'cpu_per_cycle'}


@pytest.mark.parametrize('controller', ['resolved_rate', 'trace'])
def test_summary_is_one_json_object(controller, capsys, tmp_path):
    plot = tmp_path / 'plot.png'
    status = main([STRAIGHT, '--law', controller, '--length', '0.03', '--json',
                   '--seed', '3', '--latency', '0.005', '--plot', str(plot)])
    summary = json.loads(capsys.readouterr().out)
    assert status == 0 and set(summary) >= KEYS
    assert summary['law'] == controller and summary['latency_p50'] == 0.005
    assert summary['tracked_length'] == pytest.approx(0.03, abs=0.002)
    assert summary['states'][-1]['state'] == 'done'
    assert plot.read_bytes().startswith(b'\x89PNG')


def test_the_same_seed_gives_the_same_run(capsys):
    runs = []
    for seed in ('1', '1', '2'):
        main([STRAIGHT, '--length', '0.003', '--json', '--seed', seed])
        runs.append(json.loads(capsys.readouterr().out)['force_max'])
    assert runs[0] == runs[1] != runs[2]


def test_failure_is_told_by_the_exit_status(capsys, tmp_path):
    scene = tmp_path / 'far.yaml'
    scene.write_text((ROOT / 'launch/scenes/straight.yaml').read_text().replace(
        'height: 0.004  #', 'height: 0.4  #'))
    assert main([str(scene)]) == 1
    assert 'no contact' in capsys.readouterr().out
    assert main([str(tmp_path / 'none.yaml')]) == 2
    assert 'No such file' in capsys.readouterr().err
    assert main([STRAIGHT, '--speed', '-1']) == 2
    assert 'speed' in capsys.readouterr().err


def test_a_parameter_file_gives_law_and_bounds(capsys, tmp_path):
    path = tmp_path / 'own.yaml'

    def run(text):
        path.write_text(f'/**/edge_servo: {{ros__parameters: {{{text}}}}}')
        return main([STRAIGHT, '--length', '0.02', '--json', '--parameters', str(path)])
    assert run('law: resolved_rate, forse.gain: 1.0') == 2
    assert 'did you mean force.gain?' in capsys.readouterr().err
    assert run('law: resolved_rate') == 0
    assert json.loads(capsys.readouterr().out)['law'] == 'resolved_rate'
    assert run('speed.max: 0.02') == 2
    assert 'speed is 0.03, must be between 0.0001 and 0.02 m/s' in capsys.readouterr().err
    assert run('law: tactile_jacobian') == 2
    assert 'works on goals of track_surface' in capsys.readouterr().err


SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 0]], dtype=float)


def test_contour_errors_look_both_ways():
    edge = EdgePath(SQUARE)
    grown = (SQUARE[:-1] - [0.5, 0.5, 0]) * 1.02 + [0.5, 0.5, 0]
    largest, area = contour_errors(grown, edge)
    assert largest == pytest.approx(0.01 * np.sqrt(2), rel=1e-3)
    assert area == pytest.approx(1.02**2 - 1)
    cut = np.delete(SQUARE[:-1], 2, axis=0)  # every point of it is on the edge, a corner is not
    assert contour_errors(cut, edge)[0] == pytest.approx(np.sqrt(0.5), rel=1e-3)
    assert area_of(SQUARE + 7.0) == pytest.approx(1.0)
    for few in (SQUARE[:0], SQUARE[:1], SQUARE[[1, 1, 1]]):
        assert np.isnan(contour_errors(few, edge)).all()
        assert np.isnan(contour_errors(few, EdgePath(SQUARE[:3]))).all()
