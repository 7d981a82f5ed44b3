"""Numbers of a run and of a recording against what the made-up run is known to hold."""
import dataclasses
import json
from types import SimpleNamespace

import numpy as np
import pytest
import recorded_run as made

from edge_tracking.recording.summary import (
    describe_recording,
    force_unit,
    latencies,
    loads_of,
    settled_cycles,
    summarise,
    summarise_recording,
    truth,
)
from tactile_common.command_line import to_json
from tactile_servo.reasons import ReasonCode
from tactile_servo.types import State

DESIGN_KEYS = {
    'ok', 'state', 'reason', 'reason_code', 'scene', 'law', 'seed', 'speed',
    'tracked_length', 'edge_length', 'lateral_rms', 'lateral_max', 'lateral_transient_max',
    'force_target', 'force_rms_error', 'force_max', 'overforce', 'joint_acceleration_max',
    'joint_acceleration_rms', 'pad_speed_scatter', 'force_mean', 'lateral_steady',
    'approach_recorded', 'closed',
    'contour_max_error', 'contour_area_error', 'corners', 'sides', 'duration', 'sensor_rate',
    'control_rate', 'missed_cycles', 'cycles', 'speed_mean', 'latency_p50', 'latency_p99',
    'too_busy', 'cpu_per_cycle'}


def changed(run, **statuses):
    """Return the run with columns of its statuses replaced."""
    return dataclasses.replace(run, statuses=made.with_columns(run.statuses, **statuses))


def test_a_recording_without_a_load_or_a_rate_is_described_without_them(run):
    summary = {**summarise_recording(run), 'force_max': 0.0, 'force_max_centre': [np.nan] * 2}
    assert describe_recording(summary).endswith('line')
    assert '16 x 16, 0 lost' in describe_recording({**summary, 'sensor_rate': np.nan})


def test_summary_of_a_run(run, scene):
    summary = summarise(dataclasses.replace(run, parameters={'mock_sensor': {'seed': 3}}), scene)
    assert set(summary) == DESIGN_KEYS
    assert summary['ok'] is True
    assert (summary['state'], summary['reason']) == ('done', 'the edge ended')
    assert summary['reason_code'] == 'edge_ended'
    assert (summary['scene'], summary['law'], summary['seed']) == (
        'straight', 'resolved_rate', 3)
    assert summary['speed'] == made.SPEED
    assert summary['force_target'] == made.FORCE
    for key in ('tracked_length', 'edge_length'):
        assert summary[key] == pytest.approx(made.SPEED * made.TRACK, rel=5e-3)
    assert summary['duration'] == pytest.approx(3.82, abs=0.01)
    assert summary['sensor_rate'] == pytest.approx(200.0)
    assert summary['control_rate'] == pytest.approx(400.0)
    assert summary['missed_cycles'] == 1  # of this goal, not since the node started
    assert summary['too_busy'] is False
    assert summary['cpu_per_cycle'] == pytest.approx(made.CPU_TIME)


def test_each_of_two_goals_settles():
    statuses = SimpleNamespace(
        state=np.repeat([State.APPROACH, State.TRACK, State.APPROACH, State.TRACK], [1, 3, 1, 3]),
        progress=np.array([0.0, 0.0, 0.009, 0.01, 0.0, 0.0, 0.009, 0.01]))
    assert np.flatnonzero(settled_cycles(statuses)[1]).tolist() == [3, 7]


def test_lateral_errors_are_those_of_the_true_edge(run, scene):
    summary = summarise(run, scene)
    settled = np.arange(made.APPROACH + 0.01 / made.SPEED, made.APPROACH + made.TRACK, 1 / 400)
    expected = np.abs(made.lateral_at(settled))
    assert summary['lateral_rms'] == pytest.approx(np.sqrt(np.mean(expected**2)), rel=0.02)
    assert summary['lateral_max'] == pytest.approx(expected.max(), rel=0.05)
    assert summary['lateral_transient_max'] == pytest.approx(3e-3, rel=0.01)
    # What the servo believes does not matter.
    blind = changed(run, lateral_error=np.zeros_like(run.statuses.lateral_error))
    assert summarise(blind, scene) == summary


def test_rebuilt_outline_is_compared_with_the_true_edge(run, empty, scene):
    summary = summarise(run, scene)
    assert summary['contour_max_error'] == pytest.approx(made.CONTOUR_OFF, rel=1e-6)
    assert not summary['closed'] and summary['corners'] == []
    (side,) = summary['sides']
    assert side['kind'] == 'line'
    assert side['length'] == pytest.approx(made.SPEED * made.TRACK, abs=1.1e-3)
    without = summarise(empty, scene)
    assert np.isnan(without['contour_max_error']) and without['sides'] == []


def test_forces_are_those_on_the_pad(run, scene):
    summary = summarise(run, scene)
    assert summary['force_max'] == pytest.approx(made.FORCE, rel=1e-3)
    assert summary['force_rms_error'] < 2e-3
    doubled = summarise(changed(
        run, force_target=2.0 * run.statuses.force_target), scene)
    assert doubled['force_rms_error'] == pytest.approx(made.FORCE, rel=1e-3)


def test_force_error_leaves_out_where_the_edge_ends_under_the_pad(run, scene):
    real = truth(run, scene)
    assert real.on_target[real.settled].all()
    poses = run.poses.matrix.copy()
    poses[:, 1, 3] += 0.195 - 0.11  # ends 5 mm before the end of the edge
    shifted = dataclasses.replace(run, poses=made.with_columns(run.poses, matrix=poses))
    real = truth(shifted, scene)
    short = real.settled & ~real.on_target
    assert short.any() and real.force[short].min() < 0.8 * made.FORCE
    assert summarise(shifted, scene)['force_rms_error'] < 2e-3


def test_a_pad_that_coasts_beyond_the_end_is_not_beside_the_edge(run, scene):
    poses = run.poses.matrix.copy()
    poses[:, 1, 3] += 0.2 - 0.1  # comes 10 mm beyond the end of the edge
    shifted = dataclasses.replace(run, poses=made.with_columns(run.poses, matrix=poses))
    assert summarise(shifted, scene)['lateral_max'] < 2e-3


def test_latency_runs_from_the_last_byte_to_the_command(run, scene):
    values = latencies(run)
    np.testing.assert_allclose(values, made.LATENCY, atol=1e-6)
    assert len(values) == pytest.approx(made.TRACK * 200, abs=2)  # each image once
    late = run.statuses.latency + 0.0015 * (run.statuses.progress > 0.5 * made.SPEED * made.TRACK)
    summary = summarise(changed(run, latency=late), scene)
    assert summary['latency_p50'] == pytest.approx(made.LATENCY + 0.00075, abs=0.0008)
    assert summary['latency_p99'] == pytest.approx(made.LATENCY + 0.0015, abs=1e-5)


def test_ok_needs_the_action_the_edge_and_the_way_that_the_servo_claims(run, scene):
    refused = changed(run, reason_code=np.full_like(
        run.statuses.reason_code, ReasonCode.CANCELLED))
    assert not summarise(refused, scene)['ok']
    away = run.poses.matrix.copy()
    away[:, 0, 3] += 0.004
    lost = dataclasses.replace(run, poses=made.with_columns(run.poses, matrix=away))
    summary = summarise(lost, scene)
    assert not summary['ok'] and 'not led along the edge' in summary['reason']
    boast = changed(run, progress=2.0 * run.statuses.progress)
    assert not summarise(boast, scene)['ok']


def test_run_that_never_touched(run, scene):
    summary = summarise(
        changed(run, state=np.full_like(run.statuses.state, State.APPROACH)), scene)
    assert not summary['ok'] and summary['state'] == 'approach'
    assert np.isnan(summary['lateral_rms']) and summary['tracked_length'] == 0.0


def test_empty_recording_gives_a_summary_that_is_not_ok(empty, scene):
    summary = summarise(empty, scene)
    assert set(summary) == DESIGN_KEYS and not summary['ok']
    json.loads(to_json(summary))
    summary = summarise_recording(empty)
    assert not summary['ok']
    json.loads(to_json(summary))


def test_summary_of_a_recording(run):
    summary = summarise_recording(run)
    assert summary['ok']
    assert (summary['force_unit'], summary['sensor']) == ('N', 'pad')
    assert summary['force_max'] == pytest.approx(made.FORCE, rel=0.1)
    assert summary['sensor_rate'] == pytest.approx(200.0)
    assert summary['frames'] == len(run.images.stamp_ns) == sum(
        summary['contact_types'].values())
    assert summary['lost_frames'] == 0


def test_lost_frames_are_jumps_of_the_sequence(run):
    keep = np.ones(len(run.images.stamp_ns), bool)
    keep[[10, 50, 51]] = False
    images = dataclasses.replace(
        run.images, **{name: getattr(run.images, name)[keep]
                       for name in ('stamp_ns', 'sequence', 'frames')})
    assert summarise_recording(dataclasses.replace(run, images=images))['lost_frames'] == 3


def test_without_estimates_the_pictures_give_the_force(run, empty):
    bare = dataclasses.replace(run, contacts=empty.contacts, images=dataclasses.replace(
        run.images, unit='counts', frames=np.ones_like(run.images.frames)))
    series = loads_of(bare)
    assert force_unit(bare) == 'counts m^2'
    np.testing.assert_allclose(series.m0, made.ARRAY.size_x * made.ARRAY.size_y)
    np.testing.assert_allclose(series.centre_of_pressure, 0.0, atol=1e-12)
    assert series.stamp_ns[0] == made.START
