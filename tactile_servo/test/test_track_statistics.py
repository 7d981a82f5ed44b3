"""What a goal has achieved so far, and the poses of its contour."""

import numpy as np
import pytest

from tactile_servo.track_statistics import along_contour, TrackStatistics
from tactile_servo.types import TaskError


def pose_at(x, y):
    pose = np.eye(4)
    pose[:2, 3] = x, y
    return pose


def test_contour_takes_orientation_and_stamp_of_the_nearest_pose():
    rng = np.random.default_rng(0)
    poses = [(k, pose_at(*rng.uniform(-1, 1, 2))) for k in range(50)]
    nodes = rng.uniform(-1, 1, (200, 3))
    contour = along_contour(nodes, poses)
    assert len(contour) == len(nodes)
    for node, (stamp, pose) in zip(nodes, contour, strict=True):
        np.testing.assert_array_equal(pose[:3, 3], node)
        distances = [np.linalg.norm(other[:3, 3] - node) for _, other in poses]
        assert stamp == int(np.argmin(distances))
    assert along_contour(nodes, []) == []


def test_only_the_way_along_the_edge_and_each_picture_once_count():
    statistics = TrackStatistics(5.0)
    along = np.array([1.0, 0.0, 0.0])
    for x, y in ((0.0, 0.0), (0.01, 0.005), (0.02, -0.005)):
        statistics.move(pose_at(x, y), along)
    assert statistics.length == pytest.approx(0.02)
    statistics.interrupt()
    statistics.move(pose_at(0.5, 0.0), along)
    assert statistics.length == pytest.approx(0.02)
    for stamp, lateral, force in ((1, 1e-3, 5.5), (1, 9.0, 99.0), (2, -2e-3, 4.5)):
        statistics.see(TaskError(lateral, force=force), pose_at(0.5, 0.0), stamp)
    assert statistics.force_max == 5.5 and statistics.lateral_max == 2e-3
    assert statistics.lateral_rms == pytest.approx(np.sqrt(2.5e-6))
    assert statistics.force_rms_error == pytest.approx(0.5)


def test_what_is_not_on_the_edge_counts_for_the_largest_force_alone():
    statistics, along = TrackStatistics(5.0), np.array([1.0, 0.0, 0.0])
    for stamp, (x, on_edge, lateral, force) in enumerate((
            (0.0, True, 0.0, 0.0), (0.02, True, 1e-4, 5.1), (0.03, False, 3e-3, 7.0),
            (0.04, False, 3e-3, 0.0))):
        statistics.move(pose_at(x, 0.0), along, on_edge)
        statistics.see(TaskError(lateral, force=force), pose_at(x, 0.0), stamp)
    assert statistics.tracked_length == pytest.approx(0.02)
    assert statistics.lateral_rms == statistics.lateral_max == pytest.approx(1e-4)
    assert statistics.force_rms_error == pytest.approx(0.1)
    assert statistics.force_max == 7.0
