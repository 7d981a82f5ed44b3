"""
Conversions between messages of the servo and the robot, and core types.

Functions for messages at the control rate can fill an existing message, `into`. This is several
times faster than creating one, and a message can be reused once it has been published.
"""

from array import array
from collections.abc import Callable, Sequence
from dataclasses import fields
from typing import Any, NamedTuple

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, PoseStamped
import numpy as np
from pinocchio import Quaternion
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from tactile_common.errors import Rejected
from tactile_common.ros.conversions import (
    NS,
    pose_to_msg,
    set_stamp,
    stamp_from_ns,
    stamp_to_ns,
    stamp_to_seconds,
)
from tactile_msgs.action import TrackEdge, TrackSurface
from tactile_msgs.msg import ServoCalls, ServoStatus
from tactile_servo.journal import Journal
from tactile_servo.law import Touch
from tactile_servo.laws.surface_goal import SurfaceGoal, SurfaceResult
from tactile_servo.motion.trajectory import Trajectory
from tactile_servo.supervisor import Supervisor
from tactile_servo.types import EdgeGoal, Status, Timing

_FIELDS = ('positions', 'velocities', 'accelerations')
_NUMBERS = ('lateral_error', 'longitudinal_error', 'angle_error', 'normal_force', 'force_target',
            'speed', 'progress', 'limit_scale', 'manipulability')


def trajectory_to_msg(trajectory: Trajectory) -> JointTrajectory:
    """Convert a Trajectory to a JointTrajectory message."""
    message = JointTrajectory(joint_names=list(trajectory.joint_names))
    set_stamp(message.header.stamp, trajectory.stamp_ns)
    for k, time in enumerate(trajectory.times.tolist()):
        point = JointTrajectoryPoint(**{  # an array of doubles is not checked number by number
            name: array('d', rows[k].tobytes()) for name in _FIELDS
            if (rows := getattr(trajectory, name)) is not None})
        set_stamp(point.time_from_start, round(time * NS))
        message.points.append(point)
    return message


def trajectory_from_msg(message: JointTrajectory) -> Trajectory:
    """
    Convert a JointTrajectory message to a Trajectory.

    Rejected if a field's length is not the number of joint names, positions are missing, efforts
    are given, or only some points have a field (a joint_trajectory_controller accepts this, but
    it is certainly a mistake).
    """
    names, points = tuple(message.joint_names), message.points
    values: dict[str, Any] = {}
    for name in _FIELDS:
        rows = [getattr(point, name) for point in points]
        given = any(len(row) for row in rows) or name == 'positions'
        for k, row in enumerate(rows if given else ()):
            if len(row) != len(names):
                raise Rejected(f'point {k} has {len(row)} {name} for {len(names)} joints')
        values[name] = np.array(rows, dtype=float).reshape(len(rows), len(names)) if (
            given) else None
    if any(len(point.effort) for point in points):
        raise Rejected('a point has effort, which a position controller does not take')
    return Trajectory(
        names,
        np.array([stamp_to_seconds(point.time_from_start) for point in message.points]),
        stamp_ns=stamp_to_ns(message.header.stamp), **values)


def joint_state_to_msg(stamp: Time, joint_names: Sequence[str], positions: np.ndarray,
                       velocities: np.ndarray, into: JointState | None = None) -> JointState:
    """Fill a JointState message with positions and velocities (n,) [rad or m, rad/s or m/s]."""
    message = JointState() if into is None else into
    message.name = list(joint_names)
    message.header.stamp = stamp
    message.position = array('d', np.asarray(positions, dtype=float).tobytes())
    message.velocity = array('d', np.asarray(velocities, dtype=float).tobytes())
    return message


def joint_positions(message: JointState, joint_names: Sequence[str]) -> np.ndarray | None:
    """
    Return the positions (n,) of the named joints [rad or m], None if one of them is missing.

    The message may contain other joints, and the joints in any order.
    """
    index = {name: i for i, name in enumerate(message.name)}
    order = [index.get(name, len(message.position)) for name in joint_names]
    if max(order) >= len(message.position):
        return None
    return np.array(message.position)[order]


def edge_goal_from_msg(message: TrackEdge.Goal) -> EdgeGoal:
    """Convert a TrackEdge goal message to an EdgeGoal; direction 0 means +1."""
    return EdgeGoal(**_values(message, EdgeGoal) | {'direction': message.direction or 1})


def _values(message: Any, kind: type) -> dict[str, Any]:
    """Return the values of a message for the fields of a dataclass with the same names."""
    return {field.name: getattr(message, field.name) for field in fields(kind)}


def edge_result_to_msg(servo: Supervisor, duration: float, base_frame: str) -> TrackEdge.Result:
    """Create the TrackEdge result of a servo whose goal has ended after `duration` [s]."""
    track = servo.statistics
    message = TrackEdge.Result(
        tracked_length=track.tracked_length, lateral_rms=track.lateral_rms,
        lateral_max=track.lateral_max, closed=servo.result().closed, **_outcome(servo, duration))
    for stamp_ns, pose in servo.contour():
        stamped = PoseStamped(pose=pose_to_msg(pose))
        stamped.header.stamp, stamped.header.frame_id = stamp_from_ns(stamp_ns), base_frame
        message.contour.append(stamped)
    return message


def _outcome(servo: Supervisor, duration: float) -> dict[str, Any]:
    """Return the fields that the results of all actions have."""
    return {'success': servo.success, 'reason_code': int(servo.reason.code),
            'reason': servo.reason.text, 'duration': duration,
            'force_rms_error': servo.statistics.force_rms_error,
            'force_max': servo.statistics.force_max}


def _feedback(status: ServoStatus, message: Any) -> Any:
    """Fill the fields of feedback that a status has too."""
    for name in message.get_fields_and_field_types():
        setattr(message, name, getattr(status, name, getattr(message, name)))
    return message


def surface_goal_from_msg(message: TrackSurface.Goal) -> SurfaceGoal:
    """Convert a TrackSurface goal message to a SurfaceGoal."""
    return SurfaceGoal(**_values(message, SurfaceGoal) | {
        'direction': _xyz(message.direction), 'size': tuple(message.size.tolist()),
        'points': np.array([_xyz(point) for point in message.points]).reshape(-1, 3)})


def _xyz(vector: Any) -> tuple[float, float, float]:
    return vector.x, vector.y, vector.z


def surface_result_to_msg(servo: Supervisor, duration: float,
                          base_frame: str) -> TrackSurface.Result:
    """Create the TrackSurface result of a servo whose goal has ended after `duration` [s]."""
    felt = servo.result()
    assert isinstance(felt, SurfaceResult)
    message = TrackSurface.Result(
        tracked_length=servo.statistics.length, contact_kept=felt.contact_kept,
        centre_rms=felt.centre_rms, **_outcome(servo, duration))
    if felt.contour is not None and felt.normals is not None:
        message.contacts = [touch_to_msg(Touch(0, point, inward), base_frame)
                            for point, inward in zip(felt.contour, felt.normals, strict=True)]
    return message


def touch_to_msg(touch: Touch, base_frame: str) -> PoseStamped:
    """Convert a Touch to a PoseStamped: z along the outward normal, by the smallest rotation."""
    pose = np.eye(4)
    pose[:3, :3] = Quaternion.FromTwoVectors(pose[2, :3], -touch.normal).toRotationMatrix()
    pose[:3, 3] = touch.point
    message = PoseStamped(pose=pose_to_msg(pose))
    set_stamp(message.header.stamp, touch.stamp_ns)
    message.header.frame_id = base_frame
    return message


class Action(NamedTuple):
    """An action of the servo: its type, and the conversions of goal, result and feedback."""

    type: Any
    goal_from_msg: Callable
    result_to_msg: Callable
    feedback_to_msg: Callable


# Keys: names of the actions in the registry of laws.
ACTIONS = {
    'track_edge': Action(
        TrackEdge, edge_goal_from_msg, edge_result_to_msg,
        lambda status: _feedback(status, TrackEdge.Feedback())),
    'track_surface': Action(
        TrackSurface, surface_goal_from_msg, surface_result_to_msg,
        lambda status: _feedback(status, TrackSurface.Feedback(contact_error=Point(
            x=status.lateral_error, y=status.longitudinal_error))))}


def journal_to_msg(journal: Journal, now_ns: int, frame: str) -> ServoCalls:
    """Convert a Journal to a ServoCalls message with a stamp [ns] and the sensor's frame."""
    message = ServoCalls(first=journal.first, call=journal.call, time=journal.time,
                         value=journal.value, texts=journal.texts)
    set_stamp(message.header.stamp, now_ns)
    message.header.frame_id = frame
    return message


def status_to_msg(status: Status, controller: str, timing: Timing,
                  into: ServoStatus | None = None) -> ServoStatus:
    """Convert a Status to a ServoStatus message; the header is not filled."""
    message = ServoStatus() if into is None else into
    message.controller, message.state = controller, int(status.state)
    message.reason_code, message.reason = int(status.reason.code), status.reason.text
    set_stamp(message.contact_stamp, status.contact_stamp_ns)
    message.contact_fresh, message.joints_fresh = status.contact_fresh, status.joints_fresh
    for name in _NUMBERS:
        setattr(message, name, float(getattr(status, name)))
    message.limited_by = status.limited_by
    (message.latency, message.cycle_time, message.cpu_time,
     message.cycles, message.missed_cycles) = timing
    linear, angular = message.twist.linear, message.twist.angular
    linear.x, linear.y, linear.z, angular.x, angular.y, angular.z = status.twist.tolist()
    return message
