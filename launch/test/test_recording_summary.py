"""Numbers of a recording against what the made-up run is known to hold."""

import dataclasses
import json

import numpy as np
import pytest
from recorded_run import ARRAY, FORCE, START

from edge_tracking.recording.frames_summary import force_series, summarise_recording
from tactile_simulation.metrics import to_json


def test_summary_of_a_recording(run):
    summary = summarise_recording(run)
    assert summary['ok']
    assert (summary['force_unit'], summary['sensor']) == ('N', 'pad')
    assert summary['force_max'] == pytest.approx(FORCE, rel=0.1)
    assert summary['sensor_rate'] == pytest.approx(200.0)
    assert summary['frames'] == len(run.images.stamp_ns) == sum(
        summary['contact_types'].values())
    assert summary['lost_frames'] == 0


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
