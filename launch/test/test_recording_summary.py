"""Numbers of a recording against what the made-up run is known to hold."""

import dataclasses
import json

import numpy as np
import pytest
from recorded_run import ARRAY, FORCE, START, TRACK

from edge_tracking.recording.frames_summary import force_series, presses, summarise_recording
from tactile_simulation.metrics import to_json


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


def test_empty_recording_has_a_summary_that_is_not_ok(empty):
    summary = summarise_recording(empty)
    assert not summary['ok']
    json.loads(to_json(summary))


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
    series = force_series(bare)
    assert series.unit == 'counts m^2'
    np.testing.assert_allclose(series.force, ARRAY.size_x * ARRAY.size_y)
    np.testing.assert_allclose(series.centre_of_pressure, 0.0, atol=1e-12)
    assert series.stamp_ns[0] == START
