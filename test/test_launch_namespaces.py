"""Two launches side by side, and where the arguments and the parameter file end up."""

import pytest
import yaml

WHY = 'launch_pytest is not installed: it comes with ROS 2, not as a wheel'
launch_pytest = pytest.importorskip('launch_pytest', reason=WHY)
pytest.importorskip('launch_ros', reason=WHY)

# Only where launch is installed.
from launch import LaunchDescription  # noqa: E402, I100, I202
from rclpy.parameter import parameter_value_to_python  # noqa: E402, I100
from rclpy.parameter_client import AsyncParameterClient  # noqa: E402, I100
from tactile_tests.graph import bench  # noqa: E402, I100
from tactile_tests.launching import DEADLINE, edge_tracking, Processes  # noqa: E402, I100

from edge_tracking.resources import share  # noqa: E402, I100, I202
from tactile_msgs.msg import ServoReason, ServoStatus  # noqa: E402, I100, I202

SCENES = {'left': 'straight', 'right': 'curve'}


@pytest.fixture
def processes():
    """Give the record of the launched processes."""
    return Processes()


@pytest.fixture
def ports(tmp_path):
    """Give the ports of the two sensors."""
    return {'left': str(tmp_path / 'left'), 'right': str(tmp_path / 'right')}


@launch_pytest.fixture
def both(processes, ports):
    """Give two robots, each with its sensor and its goal."""
    urdf = share('urdf', 'puma260.urdf').read_text(encoding='utf-8')
    return LaunchDescription([
        *(edge_tracking(namespace=name, port=ports[name], scene=SCENES[name], length='0.02',
                        robot_description=urdf)
          for name in SCENES),
        *processes.handlers(), launch_pytest.actions.ReadyToTest()])


def parameters(it, node, *names):
    """Values of parameters of a launched node."""
    client = AsyncParameterClient(it.listener, node)
    it.wait(client.services_are_ready, f'parameters of {node}', DEADLINE)
    future = client.get_parameters(list(names))
    it.wait(future.done, f'parameters of {node}', DEADLINE)
    return [parameter_value_to_python(value) for value in future.result().values]


@pytest.mark.launch(fixture=both)
def test_two_launches_side_by_side(processes, ports):
    shipped = yaml.safe_load(share('config', 'edge_tracking.yaml').read_text(encoding='utf-8'))
    with bench(namespace='left') as it:
        right = it.graph.add(type(it.listener), namespace='right')
        it.listeners.append(right)
        for name, port in ports.items():
            assert parameters(it, f'/{name}/driver', 'port', 'frame_id') == [port, 'tactile_pad']
            scene = str(share('scenes', f'{SCENES[name]}.yaml'))
            assert parameters(it, f'/{name}/mock_sensor', 'port', 'scene') == [port, scene]
            lower, rate = parameters(it, f'/{name}/edge_servo', 'workspace.lower', 'rate')
            of_file = shipped['/**/edge_servo']['ros__parameters']
            assert list(lower) == of_file['workspace.lower']  # not the node's own default
            assert rate == of_file['rate']
        sides = {'left': it.listener, 'right': right}

        def reached(name):
            codes = {status.reason_code for status in sides[name].statuses}
            return ServoReason.LENGTH_REACHED in codes

        it.attend(lambda: all(map(reached, sides)), 'both ends of the goals', 2 * DEADLINE)
        for name, side in sides.items():
            assert ServoStatus.TRACK in {status.state for status in side.statuses}
            # Each has a robot of its own, whose controller hears its own servo.
            for topic in ('joint_states', 'joint_trajectory_controller/joint_trajectory'):
                assert it.listener.count_publishers(f'/{name}/{topic}') == 1
        for topic in ('/joint_states', '/joint_trajectory_controller/joint_trajectory'):
            assert it.listener.count_publishers(topic) == 0
        processes.wait(lambda: 'track' in processes.exits, 'the end of a client')
    yield
    assert set(processes.exits.values()) == {0}
