"""
Send one goal to the servo and follow it to its end.

Exit status: 0 the goal was met, 1 it was not met, 2 it was refused or a parameter is wrong, 3
sensor or servo were not ready, 4 the servo became silent, 130 interrupted.
"""
from collections.abc import Callable
from enum import IntEnum
import math
from operator import attrgetter
import os
import signal
import subprocess
import sys
import time
from typing import Any

from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient
from rclpy.qos import qos_profile_sensor_data
from std_srvs.srv import SetBool
from unique_identifier_msgs.msg import UUID

from edge_tracking.goals import feedback_text, goal_message, TrackConfig
from edge_tracking.launch_interrupt import PREFIX
from tactile_common.ros.node import LATCHED, TactileNode
from tactile_common.ros.parameters import declare_from
from tactile_common.ros.runner import run
from tactile_msgs.msg import Contact, SensorInfo, ServoReason, ServoStatus
from tactile_servo.conversions import ACTIONS
from tactile_servo.reasons import ReasonCode

ASK_AGAIN = 1.0  # s between requests to resume, while the servo still holds
BEATS = 5  # heartbeats per client timeout
SILENCE = 5.0  # s without a word from the servo that has the goal, after which it is given up
RECORD = 'import sys; from edge_tracking.executables import record_bag; sys.exit(record_bag())'
WRITTEN = 3.0  # s for a recorder to end; a node must be destroyed within 3.5 s
RESUMES = 100  # for a mock robot on a slow machine


class Exit(IntEnum):
    """Exit status of a goal."""

    TRACKED = 0
    NOT_TRACKED = 1
    REFUSED = 2
    NOT_READY = 3
    SILENT = 4


class TrackNode(TactileNode):
    """
    Waits until sensor and servo are ready, sends a goal and reports its progress.

    `finished` is True when the goal has ended, was not accepted, or the servo became silent.
    `exit`, `reason`, `reason_code` and `result` then describe the end. `feedback` is the newest
    feedback, initially None. Most other attributes are ROS entities, which exist as long as they
    are referenced.
    """

    def __init__(self, on_feedback: Callable[[Any], None] | None = None, **kwargs: Any):
        super().__init__('track', **kwargs)
        self.config = declare_from(self, TrackConfig)
        self.finished, self.exit, self.reason, self.reason_code = False, Exit.NOT_READY, '', 0
        self.result: Any = None
        self.feedback: Any = None
        self._on_feedback = on_feedback or self._log_feedback
        self._handle: Any = None
        self.cancelled = False
        self._pause = self.create_client(SetBool, 'edge_servo/pause')
        self._heartbeat = self.create_publisher(UUID, 'edge_servo/heartbeat', 1)
        self._resumed, self._asked = 0, -math.inf  # number of requests, and time of the last [s]
        self._sent = self._tared = self._seen = self._robot = self._felt = False
        action = self.config.action
        self._client = ActionClient(self, ACTIONS[action].type, action)
        self.create_subscription(SensorInfo, 'sensor_info', self._on_info, LATCHED)
        self._contacts = self.create_subscription(
            Contact, 'contact', self._on_contact, qos_profile_sensor_data)
        self._statuses = self.create_subscription(
            ServoStatus, 'servo_status', self._on_status, 1)
        self._ready_timer = self.create_timer(0.05, self._try_to_start, clock=self.steady)
        self._deadline = time.monotonic() + self.config.wait
        if self.config.client_timeout:
            self.create_timer(self.config.client_timeout / BEATS, self._beat, clock=self.steady)
        self._heard = 0.0  # steady time [s] of the servo's last message
        self.create_timer(0.2 * SILENCE, self._check_silence, clock=self.steady)
        # In a separate process group: Ctrl-C ends the goal first, and then its recording.
        self._recorder = subprocess.Popen(
            [*PREFIX.split(), sys.executable, '-c', RECORD, self.config.record, '--namespace',
             self.get_namespace()], preexec_fn=os.setpgrp) if self.config.record else None

    @property
    def success(self) -> bool:
        """True if the goal was met."""
        return self.exit == Exit.TRACKED

    def _on_info(self, msg: SensorInfo) -> None:
        self._tared = msg.tared_at.sec > 0

    def _on_contact(self, _: Contact) -> None:
        self._seen = True
        self.destroy_subscription(self._contacts)

    def _on_status(self, msg: ServoStatus) -> None:
        self._robot |= msg.joints_fresh
        self._felt |= msg.contact_fresh
        if self._robot and self._felt:
            self.destroy_subscription(self._statuses)

    def destroy_node(self) -> None:
        """End the recording, then destroy the node."""
        if self._recorder and self._recorder.poll() is None:
            self._recorder.send_signal(signal.SIGTERM)
            try:
                self._recorder.wait(WRITTEN)
            except subprocess.TimeoutExpired:
                self._recorder.kill()  # the written part is readable
        super().destroy_node()

    def _missing(self) -> str:
        heard = not self._recorder or self.count_subscribers('servo_calls')
        waits = ((self._seen, 'no contact estimates arrive: is the sensor connected?'),
                 (self._tared, 'the sensor is not tared: is the pad free? See its diagnostics'),
                 (self._client.server_is_ready(), f'no servo offers {self.config.action}'),
                 (self._robot, 'the servo gets no joint states: is the robot running?'),
                 (self._heartbeat.get_subscription_count(), 'the servo receives no heartbeat'),
                 (self._felt, 'the servo gets no contacts, or no sensor_info'),
                 (heard, 'the recorder does not listen'))
        return next((text for ready, text in waits if not ready), '')

    def _try_to_start(self) -> None:
        if self._recorder and self._recorder.poll() is not None:
            self._end(Exit.REFUSED, f'record: {self.config.record} is not recorded, see above')
        if self.finished or self._sent:
            return
        if missing := self._missing():
            if time.monotonic() > self._deadline:
                self._end(Exit.NOT_READY, f'{missing} (waited {self.config.wait:g} s)')
            return
        self._sent, self._heard = True, time.monotonic()
        self._ready_timer.cancel()
        self._client.send_goal_async(
            goal_message(self.config), feedback_callback=self._take_feedback) \
            .add_done_callback(self._on_response)

    def _beat(self) -> None:
        if self._handle is not None and not self.finished:
            self._heartbeat.publish(self._handle.goal_id)

    def _check_silence(self) -> None:
        silent = time.monotonic() - self._heard
        if not self._sent or self.finished or silent < SILENCE:
            return
        if self._handle is not None:
            self._handle.cancel_goal_async()  # in case the servo recovers
        self._end(Exit.SILENT, f'the servo has said nothing for {silent:.1f} s: is it still '
                  'running?')

    def _on_response(self, future: Any) -> None:
        self._heard = time.monotonic()
        self._handle = future.result()
        if not self._handle.accepted:
            # A rejection contains no reason, but the status does.
            self.create_subscription(ServoStatus, 'servo_status', self._on_refusal, 1)
            return
        if self.cancelled:
            self._handle.cancel_goal_async()
        self._handle.get_result_async().add_done_callback(self._on_result)

    def _on_refusal(self, status: ServoStatus) -> None:
        code, reason = status.reason_code, status.reason
        if status.state != ServoStatus.IDLE:  # then they are those of another goal
            code, reason = ReasonCode.BUSY, ReasonCode.BUSY.text
        self._end(Exit.REFUSED, reason, code)

    def _on_result(self, future: Any) -> None:
        status, self.result = future.result().status, future.result().result
        tracked = status == GoalStatus.STATUS_SUCCEEDED and self.result.success
        self._end(Exit.TRACKED if tracked else Exit.NOT_TRACKED,
                  self.result.reason or 'the servo does not know the goal any more',
                  self.result.reason_code)

    def _take_feedback(self, msg: Any) -> None:
        self._heard = time.monotonic()
        self.feedback = msg.feedback
        self._on_feedback(msg.feedback)
        self._resume(msg.feedback)

    def _resume(self, feedback: Any) -> None:
        offered = (feedback.state, feedback.reason_code) == (
            ServoStatus.HOLD, ServoReason.INPUT_BACK)
        # A request has no effect if another fault occurs at that moment, so repeat it.
        due = time.monotonic() - self._asked > ASK_AGAIN
        if offered and due and self._resumed < self.config.resumes:
            self._resumed, self._asked = self._resumed + 1, time.monotonic()
            self.get_logger().warning(
                f'asked to continue ({self._resumed} of {self.config.resumes}): {feedback.reason}')
            self._pause.call_async(SetBool.Request(data=False))
        if not offered:
            self._asked = -math.inf

    def _log_feedback(self, feedback: Any) -> None:
        if feedback.state == ServoStatus.HOLD:
            self.get_logger().warning(feedback.reason, throttle_duration_sec=1.0)
        else:
            self.get_logger().info(feedback_text(feedback), throttle_duration_sec=1.0)

    def _end(self, how: Exit, reason: str, code: int = 0) -> None:
        if not self.finished:
            self.finished, self.exit, self.reason, self.reason_code = True, how, reason, code

    def cancel(self) -> None:
        """Ask the servo to stop; a goal that was not sent is dropped."""
        self.cancelled = True
        if self._handle is not None:
            self._handle.cancel_goal_async()
        elif not self._sent:
            self._end(Exit.NOT_TRACKED, 'cancelled')


def main(args: list[str] | None = None) -> int:
    """Track once and return the exit status, see above; an interrupt cancels the goal."""
    def status_of(node: TrackNode) -> int:
        if node.cancelled or not node.finished:
            raise KeyboardInterrupt
        print(f'track: {node.reason}', file=sys.stderr)
        return int(node.exit)

    return run(TrackNode, args, attrgetter('finished'), TrackNode.cancel, status_of)
