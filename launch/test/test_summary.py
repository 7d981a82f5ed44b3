"""Numbers of a run against what the made-up run is known to hold."""

import dataclasses
import json

import numpy as np
import pytest
from recorded_run import (
    APPROACH,
    ARRAY,
    CONTOUR_OFF,
    CYCLE_TIME,
    FORCE,
    LATENCY,
    lateral_at,
    SPEED,
    START,
    straight_scene,
    TOPICS,
    TRACK,
    write_bag,
)

from edge_tracking.run_data import read_run
from edge_tracking.summary import (
    force_series,
    latencies,
    presses,
    summarise,
    summarise_recording,
    to_json,
    truth,
)
from tactile_servo.servo_types import State

DESIGN_KEYS = {
    'ok', 'state', 'reason', 'scene', 'controller', 'seed', 'speed', 'tracked_length',
    'lateral_rms', 'lateral_max', 'lateral_transient_max', 'force_target', 'force_rms_error',
    'force_max', 'closed', 'contour_max_error', 'contour_area_error', 'corners', 'sides',
    'duration', 'sensor_rate', 'control_rate', 'missed_cycles', 'latency_p50',
    'latency_p99', 'cpu_per_cycle'}


@pytest.fixture(scope='module')
def scene():
    """Scene of the run."""
    return straight_scene()


@pytest.fixture(scope='module')
def run(tmp_path_factory, scene):
    """Run read from a bag."""
    return read_run(write_bag(tmp_path_factory.mktemp('bags') / 'run', scene).path)


@pytest.fixture(scope='module')
def empty(tmp_path_factory, scene):
    """Run of which only the diagnostics were recorded."""
    return read_run(write_bag(
        tmp_path_factory.mktemp('bags') / 'empty', scene, topics=TOPICS[6:7]).path)


def changed(run, **statuses):
    """Return the run with columns of its statuses replaced."""
    return dataclasses.replace(run, statuses=dataclasses.replace(run.statuses, **statuses))


def test_summary_of_a_run(run, scene):
    summary = summarise(run, scene, success=True, seed=3)
    assert set(summary) == DESIGN_KEYS
    assert summary['ok'] is True
    assert (summary['state'], summary['reason']) == ('done', 'the edge ended')
    assert (summary['scene'], summary['controller'], summary['seed']) == (
        'straight', 'resolved_rate', 3)
    assert summary['speed'] == SPEED
    assert summary['force_target'] == FORCE
    assert summary['tracked_length'] == pytest.approx(SPEED * TRACK, rel=2e-3)
    assert summary['duration'] == pytest.approx(3.82, abs=0.01)
    assert summary['sensor_rate'] == pytest.approx(200.0)
    assert summary['control_rate'] == pytest.approx(400.0)
    assert summary['missed_cycles'] == 1  # of this goal, not since the node started
    assert summary['cpu_per_cycle'] == pytest.approx(CYCLE_TIME)


def test_lateral_errors_are_those_of_the_true_edge(run, scene):
    summary = summarise(run, scene, success=True)
    settled = np.arange(APPROACH + 0.01 / SPEED, APPROACH + TRACK, 1 / 400)
    expected = np.abs(lateral_at(settled))
    assert summary['lateral_rms'] == pytest.approx(np.sqrt(np.mean(expected**2)), rel=0.02)
    assert summary['lateral_max'] == pytest.approx(expected.max(), rel=0.05)
    assert summary['lateral_transient_max'] == pytest.approx(3e-3, rel=0.01)
    # What the servo believes does not matter.
    blind = changed(run, lateral_error=np.zeros_like(run.statuses.lateral_error))
    assert summarise(blind, scene, success=True) == summary


def test_rebuilt_outline_is_compared_with_the_true_edge(run, empty, scene):
    summary = summarise(run, scene, success=True)
    assert summary['contour_max_error'] == pytest.approx(CONTOUR_OFF, rel=1e-6)
    assert not summary['closed'] and summary['corners'] == []
    (side,) = summary['sides']
    assert side['kind'] == 'line'
    assert side['length'] == pytest.approx(SPEED * TRACK, abs=1.1e-3)
    without = summarise(empty, scene, success=True)
    assert np.isnan(without['contour_max_error']) and without['sides'] == []


def test_forces_are_those_on_the_pad(run, scene):
    summary = summarise(run, scene, success=True)
    assert summary['force_max'] == pytest.approx(FORCE, rel=1e-3)
    assert summary['force_rms_error'] < 2e-3
    doubled = summarise(run, scene, success=True, force=2.0 * FORCE)
    assert doubled['force_rms_error'] == pytest.approx(FORCE, rel=1e-3)


def test_force_error_leaves_out_where_the_edge_ends_under_the_pad(run, scene):
    real = truth(run, scene)
    assert real.whole_edge[real.settled].all()
    poses = run.poses.matrix.copy()
    poses[:, 1, 3] += 0.195 - 0.11  # ends 5 mm before the end of the edge
    shifted = dataclasses.replace(run, poses=dataclasses.replace(run.poses, matrix=poses))
    real = truth(shifted, scene)
    short = real.settled & ~real.whole_edge
    assert short.any() and real.force[short].min() < 0.8 * FORCE
    assert summarise(shifted, scene, success=True)['force_rms_error'] < 2e-3


def test_latency_runs_from_the_last_byte_to_the_end_of_the_cycle(run, scene):
    stamps, values = latencies(run)
    np.testing.assert_allclose(values, LATENCY, atol=1e-6)
    assert len(stamps) == pytest.approx(TRACK * 200, abs=2)
    assert (np.diff(stamps) == 5_000_000).all()
    late = run.statuses.stamp_ns + 1_500_000 * (run.statuses.progress > 0.5 * SPEED * TRACK)
    summary = summarise(changed(run, stamp_ns=late), scene, success=True)
    assert summary['latency_p50'] == pytest.approx(LATENCY + 0.00075, abs=0.0008)
    assert summary['latency_p99'] == pytest.approx(LATENCY + 0.0015, abs=1e-5)


def test_ok_needs_the_action_and_the_edge(run, scene):
    assert not summarise(run, scene, success=False, reason='overload')['ok']
    away = run.poses.matrix.copy()
    away[:, 0, 3] += 0.004
    lost = dataclasses.replace(run, poses=dataclasses.replace(run.poses, matrix=away))
    summary = summarise(lost, scene, success=True)
    assert not summary['ok'] and 'not led along the edge' in summary['reason']


def test_ok_needs_the_way_that_the_servo_claims(run, scene):
    boast = changed(run, progress=2.0 * run.statuses.progress)
    assert not summarise(boast, scene, success=True)['ok']


def test_run_that_never_touched(run, scene):
    summary = summarise(
        changed(run, state=np.full_like(run.statuses.state, State.APPROACH)), scene,
        success=False, reason='no contact within 0.03 m')
    assert not summary['ok'] and summary['state'] == 'approach'
    assert np.isnan(summary['lateral_rms']) and summary['tracked_length'] == 0.0


def test_empty_recording_gives_a_summary(empty, scene):
    summary = summarise(empty, scene, success=False)
    assert set(summary) == DESIGN_KEYS and not summary['ok']
    assert not summarise_recording(empty)['ok']
    for each in (summary, summarise_recording(empty)):
        json.loads(to_json(each))


def test_json_is_one_object_without_nan():
    text = to_json({'a': float('nan'), 'b': [np.float64(1.5), np.inf], 'c': np.int64(2),
                    'd': {'e': np.bool_(True)}, 'f': np.array([1.0, np.nan])})
    assert '\n' not in text
    assert json.loads(text) == {
        'a': None, 'b': [1.5, None], 'c': 2, 'd': {'e': True}, 'f': [1.0, None]}


# --- recordings ---------------------------------------------------------------------------------

def bumps(*centres, noise=0.0):
    """Return a force of 1 at the centres [samples], 20 wide, over 200 samples."""
    index = np.arange(200)
    force = sum(np.exp(-((index - centre) / 8.0)**4) for centre in centres)
    return 0.1 + force + noise * np.random.default_rng(0).standard_normal(200)


def test_presses_are_counted_with_hysteresis():
    force = bumps(30, 90, 150, noise=0.02)
    found = presses(force)
    assert [peak == pytest.approx(centre, abs=7)
            for (_, peak, _), centre in zip(found, (30, 90, 150), strict=True)]
    for begin, peak, end in found:
        assert begin <= peak < end
        assert force[peak] == force[begin:end].max()


def test_noise_at_the_threshold_splits_no_press():
    index = np.arange(400)
    ramp = np.clip(np.minimum(index, 399 - index) / 150.0, 0.0, 1.0)
    noisy = ramp + 0.015 * np.random.default_rng(0).standard_normal(400)
    assert len(presses(noisy)) == 1


@pytest.mark.parametrize('force', [
    np.empty(0), np.full(50, np.nan), np.full(50, 2.0), np.zeros(50)])
def test_no_presses_without_a_change(force):
    assert presses(force) == []


def test_press_at_the_end_and_gaps_are_kept():
    force = bumps(30, 195)
    force[32] = np.nan
    assert [(begin < 30 < end, end) for begin, _, end in presses(force)] == [
        (True, pytest.approx(39, abs=3)), (False, 200)]


def test_summary_of_a_recording(run):
    summary = summarise_recording(run)
    assert summary['ok'] and summary['presses'] == 1
    assert (summary['force_unit'], summary['sensor']) == ('N', 'pad')
    assert summary['force_max'] == pytest.approx(FORCE, rel=0.1)
    assert summary['sensor_rate'] == pytest.approx(200.0)
    assert summary['frames'] == len(run.images.stamp_ns) == sum(
        summary['contact_types'].values())
    assert summary['lost_frames'] == 0
    assert summary['press_durations'][0] == pytest.approx(TRACK, rel=0.05)


def test_lost_frames_are_jumps_of_the_sequence(run):
    keep = np.ones(len(run.images.stamp_ns), bool)
    keep[[10, 50, 51]] = False
    images = dataclasses.replace(
        run.images, **{name: getattr(run.images, name)[keep]
                       for name in ('stamp_ns', 'received_ns', 'sequence', 'frames')})
    assert summarise_recording(dataclasses.replace(run, images=images))['lost_frames'] == 3


def test_without_estimates_the_pictures_give_the_force(run, empty):
    bare = dataclasses.replace(run, contacts=empty.contacts, images=dataclasses.replace(
        run.images, unit='counts', frames=np.ones_like(run.images.frames)))
    series = force_series(bare)
    assert series.unit == 'counts m^2'
    np.testing.assert_allclose(series.force, ARRAY.size_x * ARRAY.size_y)
    np.testing.assert_allclose(series.centre_of_pressure, 0.0, atol=1e-12)
    assert series.stamp_ns[0] == START
