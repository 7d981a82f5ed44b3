"""Parameters of the robot that a servo moves, and of its limits."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tactile_common.config import bounded, documented, one_of
from tactile_common.errors import ConfigurationError
from tactile_servo.laws.registry import DEFAULT, LAWS
from tactile_servo.motion.limits import JointLimits, WorkspaceBox
from tactile_servo.motion.robot import RobotModel

# Distances kept from the URDF's limits of revolute [rad] and prismatic joints [m]: a joint that
# brakes late stays within the limits, which some controllers check themselves.
TURN_MARGIN, SLIDE_MARGIN = 0.05, 0.005


@dataclass(frozen=True)
class NodeConfig:
    """Parameters of the node: robot, law and topics."""

    robot_description: str = documented(
        '', 'URDF of the robot with the sensor: its text, or the path of a file')
    law: str = one_of(DEFAULT, 'servo law', LAWS)
    tip_frame: str = documented(
        'tactile_pad', 'frame of the sensor: x along columns, y along rows, z out of the skin')
    controller: str = documented(
        '/joint_trajectory_controller', 'name of the joint trajectory controller')
    wrist: str = documented(
        '', 'topic (WrenchStamped) of a force sensor at the wrist, which the pad is compared '
        'with; empty: there is none')
    shared_topics: tuple[str, ...] = documented(
        (), 'those among image, contact, /joint_states and the topic of the trajectories that '
        'may have several publishers; for all others the servo holds')
    velocity_scale: float = bounded(
        1.0, "fraction of the URDF's joint velocities that may be used", '', 0.01, 1.0,
        name='joints.velocity_scale')
    acceleration: tuple[float, ...] = documented(
        (10.0,), "largest acceleration: one for all joints, or one each in the URDF's order",
        'rad/s^2', range=(0.1, 1e3), one_for_all=True, name='joints.acceleration')
    lower: tuple[float, ...] = bounded(
        (-10.0, -10.0, -10.0), 'corner of the box that the sensor stays in, in the base frame',
        'm', -10.0, 10.0, name='workspace.lower')
    upper: tuple[float, ...] = bounded(
        (10.0, 10.0, 10.0), 'opposite corner', 'm', -10.0, 10.0, name='workspace.upper')


def robot_of(config: NodeConfig) -> tuple[RobotModel, JointLimits, WorkspaceBox]:
    """Create model, limits and box of the robot; ConfigurationError without a valid URDF."""
    if not config.robot_description:
        raise ConfigurationError(
            'robot_description: no URDF given; pass its text or the path of a file')
    model = RobotModel.from_urdf(config.robot_description, config.tip_frame)
    margin = np.where(model.turns, TURN_MARGIN, SLIDE_MARGIN)
    limits = JointLimits(
        tuple(model.joint_names), model.lower + margin, model.upper - margin,
        model.velocity_limit * config.velocity_scale,
        _each(config.acceleration, model.joint_names))
    return model, limits, box_of(config)


def _each(values: tuple[float, ...], names: Sequence[str]) -> np.ndarray:
    """Return values (n,) of the joints, from one value for all or one for each."""
    if len(values) not in (1, len(names)):
        raise ConfigurationError(
            f'joints.acceleration has {len(values)} values for {len(names)} joints; give one for '
            f'all, or one each of {", ".join(names)}')
    return np.full(len(names), values)


def box_of(config: NodeConfig) -> WorkspaceBox:
    """Create the box of a configuration."""
    return WorkspaceBox(np.array(config.lower), np.array(config.upper))
