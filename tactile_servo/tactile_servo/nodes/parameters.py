"""Declaration of the servo node's parameters, and creation of its supervisor."""

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
    Refuse parameters that neither the node nor any law has; ignored ones could do silent harm.

    ConfigurationError if there are any; its message names the most similar known parameters.
    """
    known = parameters_of((NodeConfig, ServoConfig, *(
        row.law.config_type for row in LAWS.values())))
    # rclpy has no public access to parameters that were given but not declared.
    refuse_unknown(node._parameter_overrides, [parameter.name for parameter in known])


def declared_supervisor(node: Node) -> tuple[JournaledSupervisor, RobotModel, NodeConfig]:
    """Declare the parameters and create the supervisor from them."""
    refuse_unknown_of(node)
    c, config = declare_from(node, NodeConfig), declare_from(node, ServoConfig)
    law = law_named(c.law).law
    settings = declare_from(node, law.config_type)
    model, limits, box = robot_of(c)
    return JournaledSupervisor(model, limits, law(config, settings), config, box), model, c
