"""Parameters of the servo node beside those of supervisor and law."""

from rclpy.node import Node

from tactile_common.parameter_file import parameters_of, refuse_unknown
from tactile_common.ros.parameters import declare_from
from tactile_servo.config import ServoConfig
from tactile_servo.journal import JournaledSupervisor
from tactile_servo.laws.registry import law_named, LAWS
from tactile_servo.motion.robot import RobotModel
from tactile_servo.robot_config import NodeConfig, robot_of


def refuse_unknown_of(node: Node) -> None:
    """
    Look for parameters that neither node nor any law has: passed over, they do harm silently.

    ConfigurationError if there are some; its message names the nearest that there are.
    """
    known = parameters_of((NodeConfig, ServoConfig, *(
        row.law.config_type for row in LAWS.values())))
    # rclpy has no public way to what was given and is not declared.
    refuse_unknown(node._parameter_overrides, [parameter.name for parameter in known])


def declared_supervisor(node: Node) -> tuple[JournaledSupervisor, RobotModel, NodeConfig]:
    """Declare the parameters and make the servo that they ask for."""
    refuse_unknown_of(node)
    c, config = declare_from(node, NodeConfig), declare_from(node, ServoConfig)
    law = law_named(c.law).law
    settings = declare_from(node, law.config_type)
    model, limits, box = robot_of(c)
    return JournaledSupervisor(model, limits, law(config, settings), config, box), model, c
