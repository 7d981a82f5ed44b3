"""Two launches side by side, and where the arguments and the parameter file end up."""

import time

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
from tactile_msgs.msg import ServoStatus  # noqa: E402, I100, I202

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
    """Give a whole launch, and a second sensor and servo on the same robot that stand by."""
    urdf = share('urdf', 'puma260.urdf').read_text(encoding='utf-8')
    return LaunchDescription([
        edge_tracking(namespace='left', port=ports['left'], scene='straight', length='0.02',
                      start='true', robot='mock', robot_description=urdf),
        edge_tracking(namespace='right', port=ports['right'], scene='curve', robot='real',
                      start='false', robot_description=str(share('urdf', 'puma260.urdf'))),
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
        for name, port in ports.items():
            assert parameters(it, f'/{name}/driver', 'port', 'frame_id') == [port, 'tactile_pad']
            scene = str(share('scenes', f'{SCENES[name]}.yaml'))
            assert parameters(it, f'/{name}/mock_sensor', 'port', 'scene') == [port, scene]
            lower, rate = parameters(it, f'/{name}/edge_servo', 'workspace.lower', 'rate')
            of_file = shipped['/**/edge_servo']['ros__parameters']
            assert list(lower) == of_file['workspace.lower']  # not the node's own default
            assert rate == of_file['rate']
        end = time.monotonic() + DEADLINE
        it.graph.spin(lambda: 'track' in processes.exits or time.monotonic() > end)
        assert processes.exits == {'track': 0}, processes.text('track')
        assert 'track: length reached' in processes.text('track')
        # The servo on the right sees the same robot through its own sensor, and stands by.
        it.wait(lambda: right.tared and right.contacts and right.statuses and right.poses,
                'all of the right')
        assert {status.state for status in right.statuses} == {ServoStatus.IDLE}
        assert ServoStatus.TRACK in {status.state for status in it.listener.statuses}
    yield
    assert set(processes.exits.values()) == {0}
