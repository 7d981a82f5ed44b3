"""Parameters of the servo node beside those of supervisor and law, and what older ones became."""

from dataclasses import dataclass, field

import numpy as np
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node

from tactile_common.config import bounded, one_of
from tactile_common.errors import ConfigurationError
from tactile_common.ros.parameters import declare_from
from tactile_servo.config import ServoConfig
from tactile_servo.laws.registry import DEFAULT, law_named, LAWS
from tactile_servo.motion.limits import JointLimits, WorkspaceBox
from tactile_servo.motion.robot import RobotModel
from tactile_servo.supervisor import Supervisor

# What a flat name of former parameter files became.
RENAMED = {
    'tracker': 'law',
    'array_half_width': 'nothing: the size of the array comes from sensor_info',
    'velocity_scale': 'joints.velocity_scale', 'joint_acceleration': 'joints.acceleration',
    'position_margin': 'joints.position_margin', 'workspace_lower': 'workspace.lower',
    'workspace_upper': 'workspace.upper', 'max_speed': 'speed.max', 'max_force': 'force.max',
    'max_load': 'force.max_load', 'press_depth': 'force.press_depth',
    'contact_force': 'approach.contact_force', 'approach_speed': 'approach.speed',
    'soft_touch': 'approach.soft_touch', 'approach_distance': 'approach.distance',
    'retreat_distance': 'retreat.distance', 'stale_image': 'input.stale_image',
    'stale_joints': 'input.stale_joints', 'max_stamp_age': 'input.max_stamp_age',
    'edge_lost': 'input.lost_after', 'following_error': 'input.following_error',
    'resume_within': 'hold.resume_within', 'give_up': 'hold.give_up', 'damping': 'motion.damping',
    'rotation_length': 'motion.rotation_length', 'stiffness': 'force.stiffness',
    'skin_stiffness': 'force.skin_stiffness', 'force_gain': 'force.gain',
    'force_integral': 'force.integral_gain', 'press_acceleration': 'force.press_acceleration',
    'max_normal_speed': 'force.max_speed', 'force_segment_time': 'force.segment_time',
    'acceleration': 'speed.acceleration', 'max_acceleration': 'speed.acceleration',
    'blind_speed': 'speed.blind', 'search_speed': 'speed.search',
    'unseen': 'speed.unseen, in lengths that an image resolves',
    'lateral_gain': 'path.lateral_gain', 'corner_cut': 'path.corner_cut',
    'corner_settle': 'path.corner_settle',
    'max_lateral_speed': 'path.max_lateral_speed (trace), position.max_speed (resolved_rate)',
    'turn_gain': 'attitude.gain', 'turn_acceleration': 'attitude.acceleration',
    'max_turn': 'attitude.max_turn',
    'max_turn_rate': 'attitude.max_rate (trace), position.max_rate (resolved_rate)',
    'coast': 'search.coast, in halves of the pad', 'stall_time': 'search.stall_time',
    'search_distance': 'search.distance, in halves of the pad',
    'segment_time': 'position.segment_time', 'tilt_segment_time': 'tilt.segment_time',
    'max_tilt_rate': 'tilt.max_rate', 'uneven': 'edge.uneven', 'end_of_edge': 'edge.end',
    'min_elongation': 'edge.min_elongation', 'max_yaw': 'edge.max_yaw',
}


@dataclass(frozen=True)
class JointsConfig:
    """Limits that the joints must keep beyond those of the URDF."""

    velocity_scale: float = bounded(
        1.0, "fraction of the URDF's joint velocities that may be used", '', 0.01, 1.0)
    acceleration: float = bounded(10.0, 'largest acceleration of every joint', 'rad/s^2', 0.1, 1e3)
    position_margin: float = bounded(
        0.05, "distance kept from the URDF's joint limits", 'rad', 0.0, 1.0)


@dataclass(frozen=True)
class WorkspaceConfig:
    """Box that the sensor stays in."""

    lower: tuple[float, ...] = field(default=(-10.0, -10.0, -10.0), metadata={
        'doc': 'corner of the box that the sensor stays in, in the base frame', 'unit': 'm'})
    upper: tuple[float, ...] = field(default=(10.0, 10.0, 10.0), metadata={
        'doc': 'opposite corner', 'unit': 'm'})


@dataclass(frozen=True)
class NodeConfig:
    """Robot that the servo moves, and the law that it follows."""

    robot_description: str = field(default='', metadata={
        'doc': 'URDF of the robot with the sensor: its text, or the path of a file'})
    law: str = one_of(DEFAULT, 'servo law', LAWS)
    tip_frame: str = field(default='tactile_pad', metadata={
        'doc': 'frame of the sensor: x along columns, y along rows, z out of the skin'})
    controller: str = field(default='/joint_trajectory_controller', metadata={
        'doc': 'name of the joint trajectory controller'})
    shared_topics: tuple[str, ...] = field(default=(), metadata={
        'doc': 'those among image, contact, /joint_states and the topic of the trajectories that '
               'may have several publishers; for all others the servo holds'})
    status_rate: float = bounded(
        100.0, 'messages on servo_status, beside those of a change of state or reason', 'Hz',
        1.0, 2000.0)
    joints: JointsConfig = field(default_factory=JointsConfig)
    workspace: WorkspaceConfig = field(default_factory=WorkspaceConfig)


def refuse_old_names(node: Node) -> None:
    """
    Look for parameters that have another name now: passed over, they would do harm silently.

    ConfigurationError if there are some; its message says what each became.
    """
    given = []
    for old, new in RENAMED.items():
        # An override shows only where the parameter is declared.
        node.declare_parameter(old, descriptor=ParameterDescriptor(dynamic_typing=True))
        if node.get_parameter(old).value is not None:
            given.append(f'{old} is now {new}')
        node.undeclare_parameter(old)
    if given:
        raise ConfigurationError('parameters have been renamed: ' + '; '.join(given))


def declared_supervisor(node: Node) -> tuple[Supervisor, RobotModel, NodeConfig]:
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
