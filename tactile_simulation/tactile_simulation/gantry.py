"""Simple robot for simulations that can move a pad anywhere: a gantry with a wrist."""
import numpy as np

from tactile_servo.motion.limits import JointLimits
from tactile_servo.motion.robot import RobotModel

TURN_RATE = 4.0  # rad/s
TURN_ACCELERATION = 20.0  # rad/s^2

_JOINT = """
  <joint name="{name}" type="{type}">
    <parent link="{parent}"/><child link="{name}_link"/>
    <origin xyz="0 0 0" rpy="{roll} 0 0"/><axis xyz="{axis}"/>
    <limit lower="-{reach}" upper="{reach}" velocity="{speed}" effort="1"/>
  </joint>
  <link name="{name}_link"/>"""
_AXES = {'x': '1 0 0', 'y': '0 1 0', 'z': '0 0 1'}


def gantry(acceleration: float, turn_rate: float = TURN_RATE) -> tuple[RobotModel, JointLimits]:
    """
    Return a robot of three slides along the base's axes, then yaw, pitch and roll of the pad.

    `acceleration` [m/s^2] is that of the slides, `turn_rate` [rad/s] that of the wrist, which
    accelerates with `TURN_ACCELERATION`.
    """
    slide = {'type': 'prismatic', 'reach': 1.0, 'speed': 0.5}  # m, m/s
    turn = {'type': 'revolute', 'reach': 20.0, 'speed': turn_rate}  # rad, rad/s
    parent, joints = 'base', ''
    for name in ('slide_x', 'slide_y', 'slide_z', 'turn_z', 'turn_y', 'turn_x'):
        # At zero the pad looks down, far from the singularity at a pitch of 90 degrees.
        joints += _JOINT.format(
            name=name, parent=parent, axis=_AXES[name[-1]],
            roll=np.pi if name == 'turn_z' else 0.0,
            **(slide if name.startswith('slide') else turn))
        parent = f'{name}_link'
    model = RobotModel.from_urdf(f"""<robot name="gantry"><link name="base"/>{joints}
  <joint name="pad" type="fixed"><parent link="{parent}"/><child link="tactile_pad"/></joint>
  <link name="tactile_pad"/></robot>""", 'tactile_pad')
    limits = JointLimits(
        model.joint_names, model.lower, model.upper, model.velocity_limit,
        np.array([acceleration] * 3 + [TURN_ACCELERATION] * 3))
    return model, limits
