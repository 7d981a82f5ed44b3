"""Parameters of the servo node beside those of supervisor and law."""

from typing import Any

from rclpy.node import Node

from tactile_common.config import built, did_you_mean
from tactile_common.errors import ConfigurationError
from tactile_common.ros.parameters import declare_from
from tactile_servo.config import ServoConfig
from tactile_servo.laws.registry import law_named, LAWS
from tactile_servo.motion.robot import RobotModel
from tactile_servo.robot_config import NodeConfig, robot_of
from tactile_servo.supervisor import Supervisor

OF_ROS = ('use_sim_time', 'qos_overrides', 'start_type_description_service')


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
    model, limits, box = robot_of(c)
    return Supervisor(model, limits, law(config, settings), config, box), model, c
