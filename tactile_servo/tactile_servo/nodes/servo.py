"""Servo node: computes joint trajectories from images, contacts and joint states (chapter 5)."""

from collections.abc import Callable, Sequence
from time import perf_counter, thread_time, time_ns
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped, WrenchStamped
import numpy as np
from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data, QoSProfile
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool
from trajectory_msgs.msg import JointTrajectory

from tactile_common.errors import ConfigurationError, TactileError
from tactile_common.parameter_file import parameters_of, refuse_unknown
from tactile_common.ros.cdr import unpacked
from tactile_common.ros.conversions import NS, pose_to_msg, set_stamp, stamp_to_ns
from tactile_common.ros.node import LATCHED, TactileNode
from tactile_common.ros.parameters import declare_from, follow_changes
from tactile_common.ros.runner import run
from tactile_msgs.msg import Contact as ContactMsg
from tactile_msgs.msg import SensorInfo, ServoCalls, ServoStatus, TactileImage
from tactile_msgs.srv import TeachFeatures
from tactile_sensing.conversions import contact_from_msg, image_from_msg, sensor_info_from_msg
from tactile_servo.compile_kernels import compile_kernels
from tactile_servo.config import ServoConfig
from tactile_servo.conversions import (
    joint_positions,
    journal_to_msg,
    status_to_msg,
    touch_to_msg,
    trajectory_to_msg,
)
from tactile_servo.journal import Call
from tactile_servo.law import Teachable
from tactile_servo.laws.registry import law_named, LAWS
from tactile_servo.nodes.goal_server import GoalServer
from tactile_servo.nodes.pace import Pace, StatusTiming
from tactile_servo.reasons import Reason, ReasonCode
from tactile_servo.robot_config import NodeConfig, robot_of
from tactile_servo.supervisor import Supervisor
from tactile_servo.types import State

try:
    from control_msgs.msg import JointTrajectoryControllerState
except ImportError:  # then only the robot's motion shows whether it follows commands
    JointTrajectoryControllerState = None

GUARD_PERIOD = 0.1  # s between checks of the graph
SILENT = 0.2  # s without a state, after which a controller that published states is not active
JOURNAL_LENGTH = 50  # calls in a message: about 10 cycles
_NEWEST = QoSProfile(depth=1, reliability=qos_profile_sensor_data.reliability)


class EdgeServoNode(TactileNode):
    """
    Tracks an edge or a surface by touch.

    Subscribes to `sensor_info`, `image`, `contact` and `/joint_states`. Sends windows to the joint
    trajectory controller while a goal of the law's action is active. Publishes `servo_status`,
    `sensor_pose` at every joint state, `/diagnostics`, and `surface_contact` if the law maps a
    surface. `~/pause` holds and resumes; `~/teach` stores features if the law is `Teachable`.
    Parameters: `NodeConfig`, `ServoConfig`, and those of the law.

    A cycle begins with an image (or a contact, if the law sees no images), see `Pace`. It
    processes only the newest image and contact, so that a fast sensor does not delay it.
    """

    def __init__(self, **kwargs: Any):
        self._server: GoalServer | None = None  # created after the parameters have been checked
        self._stopping: Reason | None = None
        super().__init__('edge_servo', **kwargs)
        _refuse_unknown(self)
        config, servo_config = declare_from(self, NodeConfig), declare_from(self, ServoConfig)
        law = law_named(config.law).law
        law_config = declare_from(self, law.config_type)
        self._model, limits, box = robot_of(config)
        self._servo = Supervisor(
            self._model, limits, law(servo_config, law_config), servo_config, box)
        follow_changes(self, law.config_type, self._servo.retune)
        self.texts = {'robot_description': self._model.urdf}
        compile_kernels()
        self._pace = Pace(1.0 / servo_config.rate)
        # Newest unprocessed inputs with arrival times [s]; image and contact are serialized.
        self._pending: dict[str, tuple[Any, float]] = {}
        self._status_msg, self._pose_msg = ServoStatus(), PoseStamped()
        self._status_timing = StatusTiming()
        self._status_msg.header.frame_id = config.tip_frame
        self._pose_msg.header.frame_id = self._model.root_frame

        self._trajectory = self.create_publisher(
            JointTrajectory, f'{config.controller}/joint_trajectory', 1)
        self._status = self.create_publisher(ServoStatus, 'servo_status', 10)
        self._pose = self.create_publisher(PoseStamped, 'sensor_pose', qos_profile_sensor_data)
        self._calls = self.create_publisher(ServoCalls, 'servo_calls', 100)
        self._touches = self.create_publisher(
            PoseStamped, 'surface_contact', 10) if law_named(config.law).maps_surface else None
        self.create_subscription(SensorInfo, 'sensor_info', self._on_sensor, LATCHED)
        self.create_subscription(ContactMsg, 'contact', self._on_contact, _NEWEST, raw=True)
        self.create_subscription(  # for every law, because an image also gives the load
            TactileImage, 'image', self._on_image, _NEWEST, raw=True)
        self.create_subscription(
            JointState, '/joint_states', self._on_joints, qos_profile_sensor_data, raw=True)
        self._wrist = self._listen_to_wrist(config.wrist) if config.wrist else None
        self.create_service(SetBool, '~/pause', self._on_pause)
        if isinstance(self._servo.law, Teachable):
            self.create_service(TeachFeatures, '~/teach', self._on_teach)
        self._server = GoalServer(self, self._servo, law_named(config.law).action,
                                  self._model.root_frame, self._check_surroundings)
        self._timer = self.create_timer(self._pace.period, self._on_timer, clock=self.steady)
        # Time of the node's clock; for the system clock, time_ns is several times faster.
        self._now_ns = time_ns if not self.get_parameter('use_sim_time').value else (
            lambda: self.get_clock().now().nanoseconds)
        self._guard = GraphGuard(
            self, ('image', 'contact', '/joint_states', self._trajectory.topic),
            config.shared_topics, config.controller, self._on_reference)
        self.create_timer(GUARD_PERIOD, self._check_surroundings, clock=self.steady)
        self.add_on_set_parameters_callback(_keep_the_clock)

    def _check_surroundings(self) -> None:
        wrist, servo = self._wrist, self._servo
        silent = Reason(ReasonCode.NO_WRENCH, wrist.topic_name) if (
            wrist is not None and not servo.inputs.wrist.heard) else None
        servo.around = self._stopping or self._guard.problem() or silent

    def stop(self) -> None:
        """Stop within the robot's limits and end the goal; afterwards `stopped` is true."""
        self._stopping = Reason(ReasonCode.SHUTDOWN)
        self._servo.cancel(ReasonCode.SHUTDOWN)

    @property
    def stopped(self) -> bool:
        """Whether the node was asked to stop and the result of its goal has been sent."""
        return self._stopping is not None and self._server is not None and self._server.all_sent

    def _check_frame(self, msg: Any) -> None:
        tip = self._status_msg.header.frame_id
        if msg.header.frame_id != tip:
            self._servo.inputs.refuse(Reason(
                ReasonCode.WRONG_FRAME, f'{msg.header.frame_id!r}, must be tip_frame, {tip!r}'))

    def _on_sensor(self, msg: SensorInfo) -> None:
        try:
            self._check_frame(msg)
            self._servo.see_sensor(sensor_info_from_msg(msg))
        except TactileError as error:
            self._warn(f'sensor_info ignored: {error}')

    def _on_joints(self, raw: bytes) -> None:
        try:
            msg = unpacked(raw, JointState)
        except TactileError as error:
            self._warn(f'joint state ignored: {error}')
            return
        positions = joint_positions(msg, self._model.joint_names)
        if positions is None:
            self._warn('joint state without all of ' + ', '.join(self._model.joint_names))
            return
        stamp_ns = stamp_to_ns(msg.header.stamp)
        try:
            self._servo.see_joints(positions, stamp_ns, perf_counter())
        except ValueError as error:
            self._warn(str(error))
            return
        pose_to_msg(self._servo.inputs.pose, self._pose_msg.pose)
        set_stamp(self._pose_msg.header.stamp, stamp_ns)
        self._pose.publish(self._pose_msg)

    def _on_reference(self, msg: JointState) -> None:
        positions = joint_positions(msg, self._model.joint_names)
        if positions is not None:
            self._servo.see_reference(positions, stamp_to_ns(msg.header.stamp))

    def _listen_to_wrist(self, topic: str) -> Any:
        wrist = self.create_subscription(WrenchStamped, topic, self._on_wrench, _NEWEST)
        if wrist.topic_name == self.resolve_topic_name('wrench'):
            raise ConfigurationError(
                f"wrist: {topic!r} is the force of the pad itself; the topic of the robot's "
                'sensor is needed, such as /force_torque_sensor_broadcaster/wrench')
        return wrist

    def _on_wrench(self, msg: WrenchStamped) -> None:
        force = msg.wrench.force
        self._pending['force'] = np.array([force.x, force.y, force.z]), perf_counter()

    def _on_contact(self, raw: bytes) -> None:
        self._on_input('contact', raw, not self._servo.law.sees_images)

    def _on_image(self, raw: bytes) -> None:
        self._on_input('image', raw, self._servo.law.sees_images)

    def _on_input(self, name: str, raw: bytes, starts_cycle: bool) -> None:
        arrival = perf_counter()
        self._pending[name] = raw, arrival
        if starts_cycle and self._pace.hear(arrival):
            self._on_cycle()

    def _process_inputs(self) -> None:
        """Unpack the newest inputs and pass them to the servo."""
        # The image first, because a law refines an image that it has processed by its contact.
        pending, self._pending = self._pending, {}
        if 'image' in pending:
            raw, arrival = pending['image']
            try:
                image = image_from_msg(unpacked(raw, TactileImage))
                self._servo.see_image(image, arrival)
                touch = self._servo.law.touch
                if self._touches and touch and touch.stamp_ns == image.stamp_ns:
                    self._touches.publish(touch_to_msg(touch, self._model.root_frame))
            except TactileError as error:
                self._servo.inputs.refused = getattr(
                    error, 'reason', Reason(ReasonCode.BAD_IMAGE, str(error)))
                self._warn(f'image ignored: {error}')
        if 'force' in pending:
            self._servo.see_wrench(*pending['force'])
        if 'contact' in pending:
            raw, arrival = pending['contact']
            try:
                msg = unpacked(raw, ContactMsg)
                self._check_frame(msg)
                self._servo.see_contact(
                    contact_from_msg(msg), stamp_to_ns(msg.header.stamp), arrival)
            except TactileError as error:
                self._warn(f'contact ignored: {error}')

    def _on_timer(self) -> None:
        # A call that the executor queued before the timer was reset comes too early.
        if self._pace.is_due(perf_counter()):
            self._on_cycle()

    def _on_cycle(self) -> None:
        now, begin, pace = perf_counter(), thread_time(), self._pace
        pace.begin(now)
        self._process_inputs()
        now_ns = self._now_ns()
        status, trajectory = self._servo.cycle(now, now_ns)
        if trajectory is not None and not self._servo.motion.in_time(
                trajectory, (self._now_ns() - now_ns) / NS):
            trajectory = None  # too late: the process got no processor time
            self._servo.journal.add(Call.LATE)
        if trajectory is not None:
            self._trajectory.publish(trajectory_to_msg(trajectory))
        sent = perf_counter()
        self._status_timing.record_image(status.contact_stamp_ns, trajectory is not None,
                          now_ns + NS * (sent - now))
        if self._status_timing.due(sent, status):
            msg = status_to_msg(status, self._servo.law.name,
                                pace.timing(sent, self._status_timing.latency), self._status_msg)
            set_stamp(msg.header.stamp, now_ns)
            self._status.publish(msg)
            self._servo.journal.add(Call.STATUS)
        if self._server is not None:
            self._server.report(self._status_msg)
        if len(self._servo.journal.call) >= JOURNAL_LENGTH:
            self._publish_calls(now_ns)
        # The timer starts the next cycle if no image does so before.
        wait = pace.end(perf_counter(), thread_time() - begin)
        self._timer.timer_period_ns = round(NS * wait)
        self._timer.reset()

    def _publish_calls(self, now_ns: int) -> None:
        self._calls.publish(journal_to_msg(
            self._servo.journal.take(), now_ns, self._status_msg.header.frame_id))

    def _on_pause(self, request: Any, response: Any) -> Any:
        answer = self._servo.pause(request.data, perf_counter())
        response.success = answer.code in (ReasonCode.PAUSED, ReasonCode.RESUMED)
        response.message = answer.text if response.success else f'not done: {answer.text}'
        return response

    def _on_teach(self, request: Any, response: Any) -> Any:
        try:
            response.message, response.success = self._servo.teach(request.name), True
        except TactileError as error:
            response.message = str(error)
        return response

    def _on_diagnose(self) -> None:
        servo, pace = self._servo, self._pace
        late = pace.longest > pace.period
        self.diagnose(
            DiagnosticStatus.WARN if late or servo.state == State.HOLD else DiagnosticStatus.OK,
            f'{servo.state.name.lower()}: {servo.reason.text}',
            {'missed_cycles': pace.missed, 'longest_cycle_s': f'{pace.longest:.6f}'}, name='servo')
        pace.longest = 0.0

    def destroy_node(self) -> None:
        """Publish the remaining calls; destroy the action server and the node."""
        if self._server is not None:
            self._server.destroy()
            if self.context.ok():
                self._publish_calls(self._now_ns())
        super().destroy_node()


class GraphGuard:
    """
    Checks that no topic has a second publisher, and that the robot's controller is active.

    The state of the `controller` is subscribed to if control_msgs is installed; `see_reference`
    then receives the positions that it commands at its stamp. Topics in `shared` may have several
    publishers.
    """

    def __init__(self, node: Node, topics: Sequence[str], shared: Sequence[str],
                 controller: str, see_reference: Callable[[JointState], None]):
        self._node, self._see_reference = node, see_reference
        self._topics = sorted({*map(node.resolve_topic_name, topics)}
                              - {*map(node.resolve_topic_name, shared)})
        self._state_arrival: float | None = None  # steady time of the controller's last state [s]
        if JointTrajectoryControllerState is not None:
            node.create_subscription(
                JointTrajectoryControllerState, f'{controller}/controller_state', self._on_state,
                qos_profile_sensor_data)

    def _on_state(self, msg: Any) -> None:
        self._state_arrival = perf_counter()
        self._see_reference(JointState(
            header=msg.header, name=msg.joint_names, position=msg.reference.positions))

    def problem(self) -> Reason | None:
        """Return what is wrong now, or None."""
        for topic in self._topics:
            count = self._node.count_publishers(topic)
            if count > 1:
                return Reason(ReasonCode.SEVERAL_PUBLISHERS, f'{topic} has {count}')
        if self._state_arrival is not None and perf_counter() - self._state_arrival > SILENT:
            return Reason(ReasonCode.CONTROLLER_INACTIVE, f'no state for {SILENT:g} s')
        return None


def _refuse_unknown(node: EdgeServoNode) -> None:
    """
    Refuse parameters that neither the node nor any law has; ignored ones could do silent harm.

    ConfigurationError if there are any; its message names the most similar known parameters.
    """
    known = parameters_of((NodeConfig, ServoConfig, *(
        row.law.config_type for row in LAWS.values())))
    # rclpy has no public access to parameters that were given but not declared.
    refuse_unknown(node._parameter_overrides, [parameter.name for parameter in known])


def _keep_the_clock(parameters: Any) -> SetParametersResult:
    """Refuse a change of the stamps' clock while the servo runs."""
    refused = any(parameter.name == 'use_sim_time' for parameter in parameters)
    return SetParametersResult(
        successful=not refused, reason='use_sim_time is set at the start' if refused else '')


def main(args: list[str] | None = None) -> int:
    """Run the edge servo node."""
    return run(EdgeServoNode, args, lambda node: node.stopped, EdgeServoNode.stop)
