"""The mock robot as other nodes see it."""

from pathlib import Path
from time import monotonic

import numpy as np
import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from tactile_common.errors import UnreachableError
from tactile_common.ros.runner import make_executor
from tactile_servo.conversions import trajectory_to_msg
from tactile_servo.motion.trajectory import Trajectory
from tactile_simulation.nodes.mock_robot import MockRobotNode
from tactile_simulation.scene import load_scene

ROOT = Path(__file__).resolve().parents[2]
PUMA = str(ROOT / 'launch/urdf/puma260.urdf')
TIMEOUT = 20.0  # s
CONTROLLER = '/mock_robot_test_controller'  # nobody else's


def overrides(**values):
    values = {'robot_description': PUMA, 'controller': CONTROLLER} | values
    return [Parameter(name, value=value) for name, value in values.items()]


class Bench:
    """The mock robot and a client in one executor."""

    def __init__(self, context, **parameters):
        self.robot = MockRobotNode(
            context=context, parameter_overrides=overrides(**parameters),
            cli_args=['--ros-args', '-r', '/joint_states:=/mock_robot_test_joint_states'])
        self.client = Node('client', context=context)
        self.executor = make_executor(context)
        self.states = []
        self.client.create_subscription(
            JointState, '/mock_robot_test_joint_states', self.states.append,
            QoSProfile(depth=100))
        self.publisher = self.client.create_publisher(
            JointTrajectory, f'{CONTROLLER}/joint_trajectory', QoSProfile(depth=10))
        for node in (self.robot, self.client):
            self.executor.add_node(node)
        self.wait(lambda: self.states and self.publisher.get_subscription_count())

    def wait(self, condition):
        deadline = monotonic() + TIMEOUT
        while not condition():
            assert monotonic() < deadline, 'nothing happened in time'
            self.executor.spin_once(timeout_sec=0.05)

    def send(self, times, positions, **more):
        positions = np.atleast_2d(positions)
        self.publisher.publish(trajectory_to_msg(Trajectory(
            self.robot.robot.joint_names, np.array(times), positions,
            np.zeros_like(positions), **more)))

    def close(self):
        for node in (self.robot, self.client):
            node.destroy_node()
        self.executor.shutdown()


@pytest.fixture
def bench(context):
    benches = []

    def make(**parameters):
        benches.append(Bench(context, **parameters))
        return benches[-1]

    yield make
    for each in benches:
        each.close()


def test_states_are_named_stamped_and_fast(bench):
    robot = bench()
    robot.wait(lambda: len(robot.states) > 300)
    stamps = [s.header.stamp.sec + 1e-9 * s.header.stamp.nanosec for s in robot.states]
    assert np.all(np.diff(stamps) > 0.0)
    assert np.median(np.diff(stamps)) < 1.0 / 400.0
    now = 1e-9 * robot.client.get_clock().now().nanoseconds
    assert 0.0 < now - stamps[-1] < 5.0
    assert list(robot.states[-1].name) == [f'joint_{i}' for i in range(1, 7)]
    np.testing.assert_allclose(robot.states[-1].position, robot.robot.robot.middle)
    np.testing.assert_array_equal(robot.states[-1].velocity, np.zeros(6))


def test_trajectory_is_played_to_its_end(bench):
    robot = bench()
    home = robot.robot.robot.middle
    goal = home + 0.05
    robot.send([0.2], goal)
    robot.wait(lambda: np.allclose(robot.states[-1].position, goal, atol=1e-4))
    way = np.array([s.position for s in robot.states])
    assert np.all(np.diff(way, axis=0) >= -1e-12)
    assert max(s.velocity[0] for s in robot.states) > 0.2
    assert robot.robot.controller.limit_violations == 0 and robot.robot.rejected == 0


def test_rejected_trajectory_is_counted_and_the_active_one_goes_on(bench):
    robot = bench()
    home = robot.robot.robot.middle
    goal = home + 0.05
    robot.send([1.0], goal)
    robot.send([0.1, 0.1], [home, home])
    robot.publisher.publish(JointTrajectory())
    robot.wait(lambda: robot.robot.rejected == 2)
    assert robot.robot.late == 0
    now_ns = robot.client.get_clock().now().nanoseconds
    robot.send([0.1], home, stamp_ns=now_ns - 10 * 10**9)
    robot.wait(lambda: robot.robot.rejected == 3)
    assert robot.robot.late == 1
    robot.wait(lambda: np.allclose(robot.states[-1].position, goal, atol=1e-4))


def test_starts_at_the_start_pose_of_the_scene(bench):
    path = str(ROOT / 'launch/scenes/straight.yaml')
    robot = bench(scene=path)
    np.testing.assert_allclose(
        robot.robot.robot.pose(np.array(robot.states[-1].position)),
        load_scene(path).start_pose(), atol=1e-6)


@pytest.mark.parametrize('parameters, message', [
    ({'robot_description': ''}, 'empty'),
    ({'tip_frame': 'hand'}, "'hand'"),
    ({'rate': 0.0}, 'rate'),
    ({'scene': '/nowhere.yaml'}, 'nowhere.yaml'),
])
def test_bad_parameters_get_one_line(context, parameters, message):
    with pytest.raises(ValueError, match=message) as caught:
        MockRobotNode(context=context, parameter_overrides=overrides(**parameters))
    assert '\n' not in str(caught.value)


def test_scene_out_of_reach_gets_one_line(context, tmp_path):
    text = (ROOT / 'launch/scenes/straight.yaml').read_text(encoding='utf-8').splitlines()
    far = tmp_path / 'far.yaml'
    far.write_text('\n'.join(
        '  start: [3.0, 0.0, 0.1]' if line.startswith('  start: [') else line for line in text))
    with pytest.raises(UnreachableError, match='no joint positions within the limits'):
        MockRobotNode(context=context, parameter_overrides=overrides(scene=str(far)))
