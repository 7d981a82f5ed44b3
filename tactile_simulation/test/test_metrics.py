"""The table of numbers: what follows from the truth, and how it is shown."""

import numpy as np
import pytest

from tactile_simulation import metrics
from tactile_simulation.edge_path import EdgePath
from tactile_simulation.edge_world import EdgeScene
from tactile_simulation.world import Course

NONE, NOTHING = np.zeros(4, bool), np.zeros((0, 3))
SCENE = EdgeScene('edge', '', EdgePath(np.array([[0.0, 0.0, 0.0], [9.0, 0.0, 0.0]])))


def truth(**changes):
    """Four poses: one on the way, one that settles, two that are settled."""
    columns = {
        'time': np.arange(4.0), 'lateral': np.array([9.0, 4.0, -3.0, 1.0]),
        'along': np.arange(4.0), 'force': np.array([0.0, 1.0, 6.0, 8.0]),
        'progress': np.arange(4.0), 'tracking': np.array([0, 1, 1, 1], bool),
        'settled': np.array([0, 0, 1, 1], bool), 'on_target': np.array([0, 0, 1, 0], bool),
        'poses': np.full((4, 4, 4), np.nan), 'shift': np.zeros((4, 3))}
    return Course(**columns | changes)


def numbers(real, felt=NOTHING, acceleration=NOTHING):
    return {**metrics.measure(real, 5.0, acceleration), **SCENE.numbers(real, felt, 5.0)}


def test_errors_count_where_their_masks_say():
    found = numbers(truth(), np.array([[1.0, 0.1, 0.0], [2.0, 0.1, 0.0]]))
    assert found['lateral_rms'] == pytest.approx(np.sqrt(5.0))
    assert found['lateral_max'] == 3.0
    assert found['lateral_transient_max'] == 4.0
    assert found['edge_length'] == 2.0
    assert found['force_rms_error'] == 1.0
    assert found['force_max'] == 8.0
    assert found['contour_max_error'] == pytest.approx(0.1)


def test_what_never_happened_is_not_known():
    found = numbers(truth(tracking=NONE, settled=NONE, on_target=NONE))
    unknown = {key for key, value in found.items() if np.isnan(value)}
    assert unknown == set(found) - {'force_target', 'force_max', 'overforce'}


@pytest.mark.parametrize('force, ok', [
    ((99.0, 1.0, 6.0, 12.4), True), ((99.0, 1.0, 6.0, 12.6), False),
    ((15.0, 15.0, 13.0, 6.0), True), ((15.0, 15.0, 6.0, 13.0), False)])
def test_a_run_along_an_edge_with_too_much_true_force_is_not_ok(force, ok):
    """The servo reports success: its sensor did not feel this force."""
    found = numbers(truth(force=np.array(force), lateral=np.zeros(4)))
    found |= {'tracked_length': 2.0, 'reason': 'the edge ended'}
    summary = metrics.judged(found, True, SCENE)
    assert summary['ok'] == ok and ('true force' in summary['reason']) != ok


def test_roughness_of_a_known_motion():
    """Joint 1 swings as a sin(wt): its acceleration is w^2 times that."""
    time, rate = 0.002 * np.arange(2000), 20.0
    joints = np.column_stack([np.zeros_like(time), 0.1 * np.sin(rate * time)])
    found = numbers(truth(), acceleration=metrics.accelerations(time, joints))
    assert found['joint_acceleration_max'] == pytest.approx(0.1 * rate**2, rel=1e-3)
    assert found['joint_acceleration_rms'] == pytest.approx(
        0.1 * rate**2 / np.sqrt(2.0), rel=2e-2)
    assert len(metrics.accelerations(time[:2], joints[:2])) == 0


def test_scatter_of_a_speed_is_what_is_left_of_its_trend():
    time = 0.002 * np.arange(1500)
    way = 0.03 * time + 0.05 * time**2  # it speeds up evenly, in steps of 2 mm/s up and down
    way[1::2] += 0.001 * 0.002
    place = np.column_stack([way, np.zeros((1500, 2))])
    speed = metrics.speeds(time, place)
    assert metrics.scatter(time, speed, np.ones(1500, bool)) == pytest.approx(1e-3, rel=0.03)
    smooth = metrics.speeds(time, np.column_stack([0.05 * time**2, 0 * time, 0 * time]))
    assert metrics.scatter(time, smooth, np.ones(1500, bool)) < 1e-9
    # A step where nothing is chosen does not count; nor does a stretch shorter than the trend.
    smooth[700:] += 1.0
    chosen = np.abs(np.arange(1500) - 700) > 5
    assert metrics.scatter(time, smooth, chosen) < 1e-9
    assert np.isnan(metrics.scatter(time, smooth, np.arange(1500) < 20))


def test_numbers_are_shown_in_their_units_if_they_are_known():
    summary = {'force_max': None, 'cycles': 3, 'lateral_rms': 1.23456e-5, 'duration': metrics.NAN}
    assert list(metrics.shown(summary)) == [('lateral error, RMS', '0.012', 'mm'),
                                    ('control cycles', '3', '')]


def test_text_tells_verdict_numbers_and_outline():
    text = metrics.describe({
        'scene': 'square', 'law': 'law', 'ok': False, 'reason': 'lost',
        'lateral_rms': 1.26e-5, 'lateral_max': metrics.NAN,
        'sides': [{'kind': 'arc', 'length': 0.02, 'radius': 0.005}],
        'corners': [[0.1, 0.2, 0.3]],
        'states': [{'time': 1.5, 'state': 'hold', 'reason': 'stale'}]})
    assert text.splitlines() == [
        'square with law, NOT TRACKED: lost',
        '  lateral error, RMS             0.013 mm',
        '  side 1: arc of 20.00 mm, radius 5.00 mm',
        '  corner 1 at (100.00, 200.00, 300.00) mm',
        '   1.500 s  hold: stale']


def test_a_machine_that_is_too_busy_is_told():
    counts = {'cycles': 96, 'missed_cycles': 4, 'sensor_rate': 202.7}
    for idle in (counts, {}, {'cycles': 0, 'missed_cycles': None}):
        assert metrics.busy(idle) == ''
    assert '24 of 120 control cycles' in metrics.busy(counts | {'missed_cycles': 24})
    assert '203 images' in metrics.busy(counts | {'missed_cycles': 24})
