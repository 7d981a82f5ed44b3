"""The launch file with its defaults: the loop closes and every process ends well."""

import pytest

WHY = 'launch_pytest is not installed: it comes with ROS 2, not as a wheel'
launch_pytest = pytest.importorskip('launch_pytest', reason=WHY)
pytest.importorskip('launch_ros', reason=WHY)

# Only where launch is installed.
from launch import LaunchDescription  # noqa: E402, I100, I202
from tactile_tests.graph import bench  # noqa: E402, I100
from tactile_tests.launching import DEADLINE, edge_tracking, Processes  # noqa: E402, I100

NODES = ('driver', 'contact_estimator', 'shape_estimator', 'edge_servo', 'mock_sensor',
         'mock_robot', 'track')


@pytest.fixture
def processes():
    """Give the record of the launched processes."""
    return Processes()


@launch_pytest.fixture(auto_shutdown=False)
def tracking(processes):
    """Give the defaults, a short way, and the end of everything with the goal's."""
    return LaunchDescription([
        edge_tracking(shutdown='true', length='0.03'),
        *processes.handlers(),
        launch_pytest.actions.ReadyToTest()])


@pytest.mark.launch(fixture=tracking)
def test_defaults_track_the_edge_and_end_cleanly(processes):
    with bench() as it:
        it.attend(lambda: 'track' in processes.exits, 'the end of the goal', DEADLINE)
    assert 'track: length reached' in processes.text('track')
    yield  # until launch has shut down, by itself
    assert processes.exits == dict.fromkeys(NODES, 0)
    assert not any('Traceback' in processes.text(name) for name in NODES)
