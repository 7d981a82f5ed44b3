"""Simple robot for simulations that can move a pad anywhere: a gantry with a wrist."""
import numpy as np

from tactile_servo.motion.limits import JointLimits
from tactile_servo.motion.robot import RobotModel

TURN_RATE = 4.0  # rad/s

_JOINT = """
  <joint name="{name}" type="{type}">
    <parent link="{parent}"/><child link="{name}_link"/>
    <origin xyz="0 0 0" rpy="{rpy}"/><axis xyz="{axis}"/>
    <limit lower="-{reach}" upper="{reach}" velocity="{speed}" effort="1"/>
  </joint>
  <link name="{name}_link"/>"""
_AXES = {'x': '1 0 0', 'y': '0 1 0', 'z': '0 0 1'}
_SLIDE = {'type': 'prismatic', 'reach': 1.0, 'speed': 0.5}  # m, m/s


def gantry_urdf(turn_rate=TURN_RATE):
    """Return the URDF: three slides along the base's axes, then yaw, pitch and roll of the pad."""
    parent, joints = 'base', ''
    for name in ('slide_x', 'slide_y', 'slide_z', 'turn_z', 'turn_y', 'turn_x'):
        # At zero the pad looks down, far from the singularity at a pitch of 90 degrees.
        joints += _JOINT.format(
            name=name, parent=parent, axis=_AXES[name[-1]],
            rpy=f'{np.pi} 0 0' if name == 'turn_z' else '0 0 0',
            **(_SLIDE if name.startswith('slide') else
               {'type': 'revolute', 'reach': 20.0, 'speed': turn_rate}))
        parent = f'{name}_link'
    return f"""<robot name="gantry"><link name="base"/>{joints}
  <joint name="pad" type="fixed"><parent link="{parent}"/><child link="tactile_pad"/></joint>
  <link name="tactile_pad"/></robot>"""


def gantry(acceleration, turn_rate=TURN_RATE):
    """
    Return the RobotModel and JointLimits of the gantry.

    `acceleration` [m/s^2] is that of the slides, `turn_rate` [rad/s] that of the wrist, which
    accelerates with 20 rad/s^2. The limits exclude the last 10 mm, or 0.01 rad, of the travel.
    """
    model = RobotModel.from_urdf(gantry_urdf(turn_rate), 'tactile_pad')
    limits = JointLimits(
        model.joint_names, model.lower + 0.01, model.upper - 0.01, model.velocity_limit,
        np.array([acceleration] * 3 + [20.0] * 3))
    return model, limits
