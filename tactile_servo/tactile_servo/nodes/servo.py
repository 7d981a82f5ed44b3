"""Servo node: images, contacts and joint states in, joint trajectories out (chapter 5)."""

from dataclasses import dataclass
from time import perf_counter
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped
import numpy as np
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.clock import Clock, ClockType
from rclpy.qos import DurabilityPolicy, qos_profile_sensor_data, QoSProfile
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool
from trajectory_msgs.msg import JointTrajectory

from tactile_common.errors import ConfigurationError, TactileError
from tactile_common.ros.conversions import pose_to_msg, stamp_from_ns, stamp_to_ns, unpacked
from tactile_common.ros.node import TactileNode
from tactile_common.ros.parameters import declare_from, follow_changes
from tactile_common.ros.runner import plain, run
from tactile_msgs.msg import Contact as ContactMsg
from tactile_msgs.msg import SensorInfo, ServoStatus, TactileImage
from tactile_sensing.conversions import contact_from_msg, image_from_msg, sensor_info_from_msg
from tactile_servo.compile_kernels import compile_kernels
from tactile_servo.config import ServoConfig
from tactile_servo.conversions import ACTIONS, joint_positions, status_to_msg, trajectory_to_msg
from tactile_servo.laws.registry import law_named
from tactile_servo.motion.limits import JointLimits, WorkspaceBox
from tactile_servo.motion.robot import RobotModel
from tactile_servo.nodes.parameters import NodeConfig, refuse_old_names
from tactile_servo.supervisor import Supervisor
from tactile_servo.types import State

FEEDBACK_PERIOD = 0.05  # s; the status topic has every cycle
_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@dataclass
class Pace:
    """How well the cycles keep their period: steady times [s] and counts."""

    period: float
    first: float | None = None
    last: float = 0.0
    cycles: int = 0
    missed: int = 0
    longest: float = 0.0
    reported: float = -np.inf

    def tick(self, now: float) -> None:
        """Count a cycle that begins."""
        self.first = now if self.first is None else self.first
        due = int((now - self.first) / self.period)
        self.missed = max(self.missed, due - self.cycles)
        self.cycles, self.last = self.cycles + 1, now

    def took(self) -> float:
        """How long the cycle took [s]."""
        duration = perf_counter() - self.last
        self.longest = max(self.longest, duration)
        return duration


@dataclass
class Heard:
    """Newest image and contact that the servo has not seen: message as it came and arrival."""

    image: tuple[Any, float] | None = None
    contact: tuple[Any, float] | None = None


@dataclass(eq=False)
class Execution:
    """A goal of the action, since when it is worked on [s], and whether it has ended."""

    handle: Any
    started: float
    ended: bool = False


def _supervisor(node: TactileNode) -> tuple[Supervisor, RobotModel, NodeConfig]:
    """Declare the parameters and make the servo that they ask for."""
    refuse_old_names(node)
    c, config = declare_from(node, NodeConfig), declare_from(node, ServoConfig)
    law = law_named(c.law).law
    settings = declare_from(node, law.config_type)
    if not c.robot_description:
        raise ConfigurationError(
            'robot_description: no URDF given; pass its text or the path of a file')
    model = RobotModel.from_urdf(c.robot_description, c.tip_frame)
    limits = JointLimits(
        tuple(model.joint_names), model.lower + c.joints.position_margin,
        model.upper - c.joints.position_margin,
        model.velocity_limit * c.joints.velocity_scale,
        np.full(len(model.joint_names), c.joints.acceleration))
    box = WorkspaceBox(c.workspace.lower, c.workspace.upper)
    return Supervisor(model, limits, law(config, settings), config, box), model, c


class EdgeServoNode(TactileNode):
    """
    Track something by touch.

    Subscribes to `sensor_info`, `contact` and `/joint_states`, and to `image` if the law sees
    images; streams windows to the joint trajectory controller while a goal of the law's action
    is active; publishes `servo_status` every cycle, `sensor_pose` at every joint state and
    `/diagnostics`; `~/pause` holds and resumes. Parameters: `NodeConfig`, `ServoConfig`, and
    those of the law. A cycle looks at the newest contact and the newest image alone, so that a
    fast sensor takes no time from it. Most of its attributes are ROS entities.
    """

    def __init__(self, **kwargs):
        self._server = None  # until the parameters have proved right
        super().__init__('edge_servo', **kwargs)
        self._servo, self._model, config = _supervisor(self)
        follow_changes(self, self._servo.law.config_type, self._servo.law.retune)
        compile_kernels()
        self._pace, self._heard = Pace(1.0 / self._servo.config.rate), Heard()
        self._execution: Execution | None = None
        self._status_msg, self._pose_msg = ServoStatus(), PoseStamped()
        self._trajectory_msg = JointTrajectory()
        self._status_msg.header.frame_id = config.tip_frame
        self._pose_msg.header.frame_id = self._model.root_frame

        self._trajectory = self.create_publisher(
            JointTrajectory, f'{config.controller}/joint_trajectory', 1)
        self._status = self.create_publisher(ServoStatus, 'servo_status', 10)
        self._pose = self.create_publisher(PoseStamped, 'sensor_pose', qos_profile_sensor_data)
        self.create_subscription(SensorInfo, 'sensor_info', self._on_sensor, _LATCHED)
        self.create_subscription(
            ContactMsg, 'contact', self._on_contact, qos_profile_sensor_data, raw=True)
        if self._servo.law.sees_images:
            self.create_subscription(
                TactileImage, 'image', self._on_image, qos_profile_sensor_data, raw=True)
        self.create_subscription(
            JointState, '/joint_states', self._on_joints, qos_profile_sensor_data)
        self.create_service(SetBool, '~/pause', self._on_pause)
        name = law_named(config.law).action
        self._action = ACTIONS[name]
        self._server = ActionServer(
            self, self._action.type, name, self._finish, goal_callback=self._on_goal,
            handle_accepted_callback=self._on_accepted, cancel_callback=self._on_cancel)
        # Steady, so that the watchdogs run even where simulated time stands still.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(self._pace.period, plain(self._on_cycle), clock=steady)

    def _warn(self, text):
        self.get_logger().warning(text, throttle_duration_sec=5.0)

    def _check_frame(self, msg):
        tip = self._status_msg.header.frame_id
        if msg.header.frame_id != tip:
            raise TactileError(f'its frame is {msg.header.frame_id!r}, must be tip_frame, {tip!r}')

    def _on_sensor(self, msg):
        try:
            self._check_frame(msg)
            self._servo.see_sensor(sensor_info_from_msg(msg))
        except TactileError as error:
            self._warn(f'sensor_info passed over: {error}')

    def _on_joints(self, msg):
        positions = joint_positions(msg, self._model.joint_names)
        if positions is None:
            self._warn('joint state without all of ' + ', '.join(self._model.joint_names))
            return
        try:
            self._servo.see_joints(positions, stamp_to_ns(msg.header.stamp), perf_counter())
        except ValueError as error:
            self._warn(str(error))
            return
        pose_to_msg(self._servo.inputs.pose, self._pose_msg.pose)
        self._pose_msg.header.stamp = msg.header.stamp
        self._pose.publish(self._pose_msg)

    def _on_contact(self, raw):
        self._heard.contact = raw, perf_counter()

    def _on_image(self, raw):
        self._heard.image = raw, perf_counter()

    def _look(self):
        """Unpack the newest image and the newest contact and give them to the servo."""
        # The image first: what a contact tells the law belongs to an image it has seen.
        heard, self._heard = self._heard, Heard()
        if heard.image is not None:
            raw, arrival = heard.image
            try:
                self._servo.see_image(image_from_msg(unpacked(raw, TactileImage)), arrival)
            except TactileError as error:
                self._warn(f'image passed over: {error}')
        if heard.contact is not None:
            raw, arrival = heard.contact
            try:
                msg = unpacked(raw, ContactMsg)
                self._check_frame(msg)
                self._servo.see_contact(
                    contact_from_msg(msg), stamp_to_ns(msg.header.stamp), arrival)
            except TactileError as error:
                self._warn(f'contact passed over: {error}')

    def _on_cycle(self):
        now, pace = perf_counter(), self._pace
        pace.tick(now)
        self._look()
        now_ns = self.get_clock().now().nanoseconds
        status, trajectory = self._servo.cycle(now, now_ns)
        if trajectory is not None:
            self._trajectory.publish(trajectory_to_msg(trajectory, self._trajectory_msg))
        msg = status_to_msg(status, self._servo.law.name, pace.took(), pace.missed,
                            self._status_msg)
        msg.header.stamp = stamp_from_ns(now_ns)
        self._status.publish(msg)
        if self._execution is not None and not self._execution.ended:
            self._report(status, msg)

    def _report(self, status, msg):
        handle = self._execution.handle
        if status.state == State.DONE:
            self._execution.ended = True
            handle.execute()
        elif self._pace.last - self._pace.reported >= FEEDBACK_PERIOD:
            self._pace.reported = self._pace.last
            handle.publish_feedback(self._action.feedback_to_msg(msg))

    def _on_goal(self, request):
        refusal = self._servo.check(self._action.goal_from_msg(request))
        if refusal is None:
            return GoalResponse.ACCEPT
        self.get_logger().error(refusal.text)
        self._servo.note(refusal)
        return GoalResponse.REJECT

    def _on_cancel(self, _):
        self._servo.cancel()
        return CancelResponse.ACCEPT

    def _on_accepted(self, goal_handle):
        """
        Start a goal; it is executed, in the action server's sense, when it has ended.

        An execute callback would have to block or to await, and rclpy's executors poll a
        callback that awaits without a pause, at the cost of a whole core.
        """
        self._execution = Execution(goal_handle, perf_counter())
        self._servo.start(self._action.goal_from_msg(goal_handle.request), self._execution.started)

    def _finish(self, goal_handle):
        servo = self._servo
        result = self._action.result_to_msg(
            servo, perf_counter() - self._execution.started, self._model.root_frame)
        self._execution = None
        if goal_handle.is_cancel_requested:
            goal_handle.canceled()
        elif servo.success:
            goal_handle.succeed()
        else:
            goal_handle.abort()
        self.get_logger().info(f'goal ended: {result.reason}')
        servo.finish()
        return result

    def _on_pause(self, request, response):
        response.success = self._servo.pause(request.data, perf_counter())
        response.message = (
            ('paused' if request.data else 'resumed') if response.success else 'no active goal')
        return response

    def _on_diagnose(self):
        servo, pace = self._servo, self._pace
        late = pace.longest > pace.period
        self.diagnose(
            DiagnosticStatus.WARN if late or servo.state == State.HOLD else DiagnosticStatus.OK,
            f'{servo.state.name.lower()}: {servo.reason.text}',
            {'missed_cycles': pace.missed, 'longest_cycle_s': f'{pace.longest:.6f}'}, name='servo')
        pace.longest = 0.0

    def destroy_node(self):
        """Release the action server with the node."""
        if self._server is not None:
            self._server.destroy()
        super().destroy_node()


def main(args=None):
    """Run the edge servo node."""
    return run(EdgeServoNode, args)
