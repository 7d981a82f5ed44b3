"""Edge servo node: contacts and joint states in, joint trajectories out (chapter 5)."""

from dataclasses import dataclass, field
from time import perf_counter

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseStamped
import numpy as np
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool
from trajectory_msgs.msg import JointTrajectory

from tactile_common.errors import ConfigurationError, TactileError
from tactile_common.ros.conversions import pose_to_msg, stamp_from_ns, stamp_to_ns, unpacked
from tactile_common.ros.parameters import declare_from
from tactile_common.ros.runner import plain, run
from tactile_msgs.action import TrackEdge
from tactile_msgs.msg import Contact as ContactMsg
from tactile_msgs.msg import ServoStatus, TactileImage
from tactile_sensing.conversions import contact_from_msg, image_from_msg
from tactile_servo.conversions import (
    goal_from_msg,
    joint_positions,
    result_to_msg,
    status_to_msg,
    trajectory_to_msg,
)
from tactile_servo.laws.registry import check_name, DEFAULT, make_tracker, TRACKERS
from tactile_servo.motion.limits import JointLimits, WorkspaceBox
from tactile_servo.motion.robot import RobotModel
from tactile_servo.supervisor import EdgeServo
from tactile_servo.types import EdgeServoConfig, State
from tactile_simulation.warm_up import warm_up

FEEDBACK_PERIOD = 0.05  # s; the status topic has every cycle


@dataclass(frozen=True)
class RobotConfig:
    """Robot that the servo moves, and the limits it must keep beyond those of its URDF."""

    robot_description: str = field(default='', metadata={
        'doc': 'URDF of the robot with the sensor: its text, or the path of a file'})
    tracker: str = field(default=DEFAULT, metadata={
        'doc': 'how the edge is followed: ' + ' or '.join(TRACKERS)})
    tip_frame: str = field(default='tactile_pad', metadata={
        'doc': 'frame of the sensor: x along columns, y along rows, z out of the skin'})
    controller: str = field(default='/joint_trajectory_controller', metadata={
        'doc': 'name of the joint trajectory controller'})
    velocity_scale: float = field(default=1.0, metadata={
        'doc': "fraction of the URDF's joint velocities that may be used",
        'range': (0.01, 1.0)})
    joint_acceleration: float = field(default=10.0, metadata={
        'doc': 'largest acceleration of every joint', 'unit': 'rad/s^2', 'range': (0.1, 1e3)})
    position_margin: float = field(default=0.05, metadata={
        'doc': "distance kept from the URDF's joint limits", 'unit': 'rad',
        'range': (0.0, 1.0)})
    workspace_lower: tuple[float, ...] = field(default=(-10.0, -10.0, -10.0), metadata={
        'doc': 'corner of the box that the sensor stays in, in the base frame', 'unit': 'm'})
    workspace_upper: tuple[float, ...] = field(default=(10.0, 10.0, 10.0), metadata={
        'doc': 'opposite corner', 'unit': 'm'})


class EdgeServoNode(Node):
    """
    Track an edge by touch.

    Subscribes to `contact` and `/joint_states`; streams windows to the joint trajectory
    controller while a goal of the action `track_edge` is active; publishes `servo_status` every
    cycle, `sensor_pose` at every joint state and `diagnostics`; `~/pause` holds and resumes.
    Parameters: `RobotConfig`, `EdgeServoConfig`, and those of the tracker, `ResolvedRateConfig`
    or `TraceConfig`; the latter's tracker subscribes to `image` as well. A cycle looks at the
    newest contact and the newest image alone, so that a fast sensor takes no time from it.
    """

    def __init__(self, **kwargs):
        self._action = None  # until the parameters have proved right
        super().__init__('edge_servo', **kwargs)
        robot, config = declare_from(self, RobotConfig), declare_from(self, EdgeServoConfig)
        tracker = check_name(robot.tracker)
        settings = declare_from(self, tracker.config_type)
        if not robot.robot_description:
            raise ConfigurationError(
                'robot_description: no URDF given; pass its text or the path of a file')
        model = RobotModel.from_urdf(robot.robot_description, robot.tip_frame)
        limits = JointLimits(
            tuple(model.joint_names), model.lower + robot.position_margin,
            model.upper - robot.position_margin, model.velocity_limit * robot.velocity_scale,
            np.full(len(model.joint_names), robot.joint_acceleration))
        self._model, self._base_frame = model, model.root_frame
        self._servo = EdgeServo(
            model, limits, config, make_tracker(robot.tracker, config, settings),
            WorkspaceBox(robot.workspace_lower, robot.workspace_upper))
        warm_up(robot.tracker)
        self._goal_handle, self._started = None, 0.0
        self._first_tick, self._cycles, self._missed = None, 0, 0
        self._longest, self._last_tick = 0.0, None
        self._raw_contact = self._raw_image = None  # message and arrival of the newest
        self._reported, self._tip_frame = None, robot.tip_frame
        self._period = 1.0 / config.rate
        self._trajectory_msg, self._status_msg = JointTrajectory(), ServoStatus()
        self._pose_msg = PoseStamped()
        self._pose_msg.header.frame_id = self._base_frame
        self._status_msg.header.frame_id = self._tip_frame

        self._trajectory = self.create_publisher(
            JointTrajectory, f'{robot.controller}/joint_trajectory', 1)
        self._status = self.create_publisher(ServoStatus, 'servo_status', 10)
        self._pose = self.create_publisher(PoseStamped, 'sensor_pose', qos_profile_sensor_data)
        self._diagnostics = self.create_publisher(DiagnosticArray, 'diagnostics', 10)
        self.create_subscription(
            ContactMsg, 'contact', self._on_contact, qos_profile_sensor_data, raw=True)
        if self._servo.tracker.sees_images:
            self.create_subscription(
                TactileImage, 'image', self._on_image, qos_profile_sensor_data, raw=True)
        self.create_subscription(
            JointState, '/joint_states', self._on_joints, qos_profile_sensor_data)
        self.create_service(SetBool, '~/pause', self._on_pause)
        self._action = ActionServer(
            self, TrackEdge, 'track_edge', self._finish, goal_callback=self._on_goal,
            handle_accepted_callback=self._on_accepted, cancel_callback=self._on_cancel)
        # Steady, so that the watchdogs run even where simulated time stands still.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(self._period, plain(self._on_cycle), clock=steady)
        self.create_timer(1.0, self._on_diagnose, clock=steady)

    def _on_joints(self, msg):
        positions = joint_positions(msg, self._model.joint_names)
        if positions is None:
            self.get_logger().warning(
                'joint state without all of ' + ', '.join(self._model.joint_names),
                throttle_duration_sec=5.0)
            return
        try:
            self._servo.see_joints(positions, stamp_to_ns(msg.header.stamp), perf_counter())
        except ValueError as error:
            self.get_logger().warning(str(error), throttle_duration_sec=5.0)
            return
        pose_to_msg(self._servo.pose, self._pose_msg.pose)
        self._pose_msg.header.stamp = msg.header.stamp
        self._pose.publish(self._pose_msg)

    def _on_contact(self, raw):
        self._raw_contact = raw, perf_counter()

    def _on_image(self, raw):
        self._raw_image = raw, perf_counter()

    def _look(self):
        """Unpack the newest image and the newest contact and give them to the servo."""
        # The image first: what a contact tells the tracker belongs to a picture it has seen.
        if self._raw_image is not None:
            (raw, arrival), self._raw_image = self._raw_image, None
            try:
                image = image_from_msg(unpacked(raw, TactileImage))
            except TactileError as error:
                self.get_logger().warning(
                    f'image passed over: {error}', throttle_duration_sec=5.0)
            else:
                self._servo.see_image(image, arrival)
        if self._raw_contact is not None:
            (raw, arrival), self._raw_contact = self._raw_contact, None
            try:
                msg = unpacked(raw, ContactMsg)
                if msg.header.frame_id != self._tip_frame:
                    raise TactileError(
                        f'its frame is {msg.header.frame_id!r}, must be tip_frame, '
                        f'{self._tip_frame!r}')
                contact = contact_from_msg(msg)
            except TactileError as error:
                self.get_logger().warning(
                    f'contact passed over: {error}', throttle_duration_sec=5.0)
            else:
                self._servo.see_contact(contact, stamp_to_ns(msg.header.stamp), arrival)

    def _on_cycle(self):
        now = perf_counter()
        if self._first_tick is None:
            self._first_tick = now
        due = int((now - self._first_tick) / self._period)
        self._missed = max(self._missed, due - self._cycles)
        self._cycles, self._last_tick = self._cycles + 1, now
        self._look()
        now_ns = self.get_clock().now().nanoseconds
        status, trajectory = self._servo.cycle(now, now_ns)
        if trajectory is not None:
            self._trajectory.publish(trajectory_to_msg(trajectory, self._trajectory_msg))
        took = perf_counter() - now
        self._longest = max(self._longest, took)
        msg = status_to_msg(status, self._servo.tracker.name, took, self._missed,
                            self._status_msg)
        msg.header.stamp = stamp_from_ns(now_ns)
        self._status.publish(msg)
        if self._goal_handle is not None:
            self._report(status, msg)

    # Action ------------------------------------------------------------------------------

    def _on_goal(self, request):
        why = self._servo.check(goal_from_msg(request))
        if why:
            self.get_logger().error(f'track_edge goal rejected: {why}')
            self._servo.note(f'goal rejected: {why}')
            return GoalResponse.REJECT
        return GoalResponse.ACCEPT

    def _on_cancel(self, _):
        self._servo.cancel()
        return CancelResponse.ACCEPT

    def _on_accepted(self, goal_handle):
        """
        Start a goal; it is executed, in the action server's sense, when it has ended.

        An execute callback would have to block or to await, and rclpy's executors poll a
        callback that awaits without a pause, at the cost of a whole core.
        """
        self._goal_handle, self._started = goal_handle, perf_counter()
        self._servo.start(goal_from_msg(goal_handle.request), self._started)

    def _finish(self, goal_handle):
        servo = self._servo
        result = result_to_msg(servo, perf_counter() - self._started, self._base_frame)
        if goal_handle.is_cancel_requested:
            goal_handle.canceled()
        elif servo.success:
            goal_handle.succeed()
        else:
            goal_handle.abort()
        self.get_logger().info(f'track_edge ended: {result.reason}')
        servo.finish()
        return result

    def _report(self, status, msg):
        if status.state == State.DONE:
            goal_handle, self._goal_handle = self._goal_handle, None
            goal_handle.execute()
            return
        if self._reported is not None and self._last_tick - self._reported < FEEDBACK_PERIOD:
            return
        self._reported = self._last_tick
        self._goal_handle.publish_feedback(TrackEdge.Feedback(
            state=msg.state, reason=msg.reason, progress=msg.progress,
            lateral_error=msg.lateral_error, angle_error=msg.angle_error,
            normal_force=msg.normal_force))

    def _on_pause(self, request, response):
        response.success = self._servo.pause(request.data, perf_counter())
        response.message = (
            ('paused' if request.data else 'resumed') if response.success else 'no active goal')
        return response

    def _on_diagnose(self):
        servo = self._servo
        late = self._longest > self._period
        status = DiagnosticStatus(
            name=f'{self.get_fully_qualified_name()}: servo',
            level=DiagnosticStatus.WARN if late or servo.state == State.HOLD
            else DiagnosticStatus.OK,
            message=f'{servo.state.name.lower()}: {servo.reason}',
            values=[KeyValue(key='missed_cycles', value=str(self._missed)),
                    KeyValue(key='longest_cycle_s', value=f'{self._longest:.6f}')])
        self._longest = 0.0
        msg = DiagnosticArray(status=[status])
        msg.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(msg)

    def destroy_node(self):
        """Release the action server with the node."""
        if self._action is not None:
            self._action.destroy()
        super().destroy_node()


def main(args=None):
    """Run the edge servo node."""
    return run(EdgeServoNode, args)
