"""Action server of a servo: every accepted goal gets a result."""

from collections.abc import Callable
from time import perf_counter
from typing import Any

from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.node import Node
from unique_identifier_msgs.msg import UUID

from tactile_msgs.msg import ServoStatus
from tactile_servo.conversions import ACTIONS
from tactile_servo.reasons import Reason, Refused
from tactile_servo.supervisor import Supervisor

FEEDBACK_PERIOD = 0.05  # s; the status topic is faster


class GoalServer:
    """
    Action server of a servo.

    The execute callback runs only after a goal has ended, and creates the result. During the goal
    it would have to block or to await, and rclpy's executors poll an awaiting callback without a
    pause, which takes a whole core.
    """

    def __init__(self, node: Node, servo: Supervisor, name: str, base_frame: str,
                 check_surroundings: Callable[[], None]):
        self._check_surroundings = check_surroundings  # called before a goal is checked
        self._logger, self._servo, self._base_frame = node.get_logger(), servo, base_frame
        self._action = ACTIONS[name]
        self._goal: Any = None  # handle of the active goal
        self._ended = True  # whether the servo has ended it
        self._started = self._reported = float('-inf')  # steady times of start and feedback [s]
        self.all_sent = True  # whether the results of all accepted goals have been sent
        self._refusals: dict[bytes, Reason] = {}  # by id, of accepted goals that could not start
        self._server = ActionServer(
            node, self._action.type, name, self._finish, goal_callback=self._on_goal,
            handle_accepted_callback=self._on_accepted, cancel_callback=self._on_cancel)
        node.create_subscription(UUID, '~/heartbeat', self._on_heartbeat, 1)

    def report(self, msg: ServoStatus) -> None:
        """Publish feedback after a cycle, and end the goal if the servo has ended it."""
        self.all_sent = self._goal is None  # it ended a cycle ago, so the result has been sent
        if self._ended:
            return
        now = perf_counter()
        if not self._servo.active:
            self._ended = True
            self._goal.execute()
        elif now - self._reported >= FEEDBACK_PERIOD:
            self._reported = now
            self._goal.publish_feedback(self._action.feedback_to_msg(msg))

    def _on_goal(self, request: Any) -> GoalResponse:
        self._check_surroundings()
        refusal = self._servo.check(self._action.goal_from_msg(request))
        if refusal is None:
            return GoalResponse.ACCEPT
        self._logger.error(refusal.text)
        self._servo.note(refusal)
        return GoalResponse.REJECT

    def _on_cancel(self, goal_handle: Any) -> CancelResponse:
        if not self._is_active(goal_handle.goal_id):
            return CancelResponse.REJECT
        self._servo.cancel()
        return CancelResponse.ACCEPT

    def _on_heartbeat(self, goal_id: UUID) -> None:
        if self._is_active(goal_id):
            self._servo.hear_client()

    def _is_active(self, goal_id: UUID) -> bool:
        return self._goal is not None and self._goal.goal_id == goal_id

    def _on_accepted(self, goal_handle: Any) -> None:
        now = perf_counter()
        try:
            self._servo.start(self._action.goal_from_msg(goal_handle.request), now)
        except Refused as refused:  # the situation has changed since the check
            self._refusals[bytes(goal_handle.goal_id.uuid)] = refused.reason
            goal_handle.execute()
        else:
            self._goal, self._started, self._reported = goal_handle, now, now - FEEDBACK_PERIOD
            self._ended = self.all_sent = False
            if not self._servo.inputs.wrist.heard:
                self._logger.info(
                    'goal accepted; without a force at the wrist (parameter wrist) a pad that '
                    'feels nothing from the start is noticed after approach.distance alone')

    def _finish(self, goal_handle: Any) -> Any:
        refusal = self._refusals.pop(bytes(goal_handle.goal_id.uuid), None)
        if refusal is not None:
            goal_handle.abort()
            return self._action.type.Result(reason_code=int(refusal.code), reason=refusal.text)
        servo, self._goal = self._servo, None
        result = self._action.result_to_msg(
            servo, perf_counter() - self._started, self._base_frame)
        if goal_handle.is_cancel_requested:
            goal_handle.canceled()
        elif servo.success:
            goal_handle.succeed()
        else:
            goal_handle.abort()
        self._logger.info(f'goal ended: {result.reason}')
        servo.finish()
        return result

    def destroy(self) -> None:
        """Destroy the action server."""
        self._server.destroy()
