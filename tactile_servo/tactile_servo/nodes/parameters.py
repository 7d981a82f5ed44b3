"""Parameters of the servo node beside those of supervisor and law."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from rclpy.node import Node

from tactile_common.config import bounded, built, did_you_mean, one_of
from tactile_common.errors import ConfigurationError
from tactile_common.ros.parameters import declare_from
from tactile_servo.config import ServoConfig
from tactile_servo.laws.registry import DEFAULT, law_named, LAWS
from tactile_servo.motion.limits import JointLimits, WorkspaceBox
from tactile_servo.motion.robot import RobotModel
from tactile_servo.supervisor import Supervisor

OF_ROS = ('use_sim_time', 'qos_overrides', 'start_type_description_service')


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
    joints: JointsConfig = field(default_factory=JointsConfig)
    workspace: WorkspaceConfig = field(default_factory=WorkspaceConfig)


def refuse_unknown(node: Node) -> None:
    """
    Look for parameters that neither node nor any law has: passed over, they do harm silently.

    ConfigurationError if there are some; its message names the nearest that there are.
    """
    known: dict[str, Any] = {}
    for config in (NodeConfig, ServoConfig, *(row.law.config_type for row in LAWS.values())):
        built(config, lambda name, default, *_: known.setdefault(name, default))
    # rclpy has no public way to what was given and is not declared.
    for name in node._parameter_overrides:
        if name not in known and name.split('.')[0] not in OF_ROS:
            raise ConfigurationError(f'no parameter {name}{did_you_mean(name, known)}')


def declared_supervisor(node: Node) -> tuple[Supervisor, RobotModel, NodeConfig]:
    """Declare the parameters and make the servo that they ask for."""
    refuse_unknown(node)
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
