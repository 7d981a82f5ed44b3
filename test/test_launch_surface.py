"""The launch file with a scene of a surface: a round probe follows it to the end."""
import pytest
import yaml

WHY = 'launch_pytest is not installed: it comes with ROS 2, not as a wheel'
launch_pytest = pytest.importorskip('launch_pytest', reason=WHY)
pytest.importorskip('launch_ros', reason=WHY)

# Only where launch is installed.
from launch import LaunchDescription  # noqa: E402, I100, I202
from tactile_tests.graph import bench  # noqa: E402, I100
from tactile_tests.launching import DEADLINE, edge_tracking, Processes  # noqa: E402, I100

from tactile_msgs.msg import ServoReason, ServoStatus  # noqa: E402, I100, I202
from tactile_simulation.scene import find_scene, load_scene  # noqa: E402, I100, I202


@pytest.fixture
def processes():
    """Give the record of the launched processes."""
    return Processes()


@pytest.fixture
def ball(tmp_path):
    """Give the smaller ball of the thesis, and a skin that is solved before anything starts."""
    path = tmp_path / 'ball.yaml'
    shipped = yaml.safe_load(find_scene('surfaces/sphere_70').read_text('utf-8'))
    path.write_text(yaml.safe_dump(shipped | {'rubber': {'across': 15}}))
    load_scene(path).world()
    return str(path)


@launch_pytest.fixture(auto_shutdown=False)
def following(processes, ball):
    """Give a short way over the ball, and the end of everything with the goal's."""
    return LaunchDescription([
        edge_tracking(scene=ball, speed='0.05', length='0.03', shutdown='true'),
        *processes.handlers(), launch_pytest.actions.ReadyToTest()])


@pytest.mark.launch(fixture=following)
def test_a_ball_is_followed_and_everything_ends_well(processes):
    with bench() as it:
        it.attend(lambda: 'track' in processes.exits, 'the end of the goal', DEADLINE)
        statuses = it.listener.statuses
    assert 'track: length reached' in processes.text('track')
    assert ServoStatus.TRACK in {status.state for status in statuses}
    assert ServoReason.LENGTH_REACHED in {status.reason_code for status in statuses}
    assert all(status.force_target == 5.0 for status in statuses
               if status.state == ServoStatus.TRACK)
    yield  # until launch has shut down, by itself
    assert set(processes.exits.values()) == {0}
