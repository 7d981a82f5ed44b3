"""Simulated robot behind the topics of a joint_trajectory_controller."""
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool
from trajectory_msgs.msg import JointTrajectory

from tactile_common.errors import Rejected
from tactile_common.ros.conversions import stamp_from_ns
from tactile_common.ros.node import TactileNode
from tactile_common.ros.parameters import declare_from
from tactile_common.ros.runner import run
from tactile_servo.conversions import joint_state_to_msg, trajectory_from_msg
from tactile_servo.motion.robot import RobotModel
from tactile_simulation.joint_controller import Late, MockController, MockRobotConfig
from tactile_simulation.scene import load_scene


class MockRobotNode(TactileNode):
    """
    Plays trajectories with a mock controller and publishes the joint states.

    `~/activate` switches the controller off and on, as a controller manager does.

    Attributes
    ----------
    rejected, late : int
        Number of rejected trajectories, and of those among them that arrived too late.
    """

    def __init__(self, **kwargs):
        super().__init__('mock_robot', **kwargs)
        config = declare_from(self, MockRobotConfig)
        self.robot = RobotModel.from_urdf(config.robot_description, config.tip_frame)
        self.controller = MockController(
            self.robot.joint_names, self.robot.lower, self.robot.upper,
            self.robot.velocity_limit, initial_positions=_start(config, self.robot),
            rate=config.rate,
            dead_time=config.dead_time, lag=config.lag,
            interpolate_from_desired_state=config.interpolate_from_desired_state)
        self.rejected = self.late = 0
        self._violations = 0
        self._state = JointState()
        self._states = self.create_publisher(JointState, '/joint_states', QoSProfile(depth=10))
        self.create_subscription(
            JointTrajectory, f'{config.controller}/joint_trajectory', self._on_trajectory,
            QoSProfile(depth=10))
        self.create_service(SetBool, '~/activate', self._on_activate)
        self.create_timer(1.0 / config.rate, self._on_timer)

    def _on_trajectory(self, message):
        try:
            self.controller.accept(
                trajectory_from_msg(message), 1e-9 * self.get_clock().now().nanoseconds)
        except Rejected as error:
            self.rejected += 1
            self.late += isinstance(error, Late)
            self.get_logger().error(
                f'trajectory rejected ({self.rejected} so far): {error}',
                throttle_duration_sec=1.0)

    def _on_activate(self, request, response):
        self.controller.activate(request.data)
        response.success = True
        response.message = f'the controller is {"" if request.data else "not "}active'
        return response

    def _on_timer(self):
        now_ns = self.get_clock().now().nanoseconds
        positions, velocities = self.controller.run_to(1e-9 * now_ns)
        self._states.publish(joint_state_to_msg(
            stamp_from_ns(now_ns), self.robot.joint_names, positions, velocities, self._state))
        if self.controller.limit_violations > self._violations:
            self._violations = self.controller.limit_violations
            self.get_logger().warning(
                f'command clamped to a joint limit ({self._violations} steps so far)',
                throttle_duration_sec=1.0)


def _start(config, robot):
    """Return the initial joint positions: given, of the scene's start pose, or the middle."""
    seed = config.initial_positions or None
    if config.scene:
        return robot.inverse(load_scene(config.scene).start_pose(), seed)
    return robot.middle if seed is None else seed


def main(args=None) -> int:
    """Run the node."""
    return run(MockRobotNode, args)
