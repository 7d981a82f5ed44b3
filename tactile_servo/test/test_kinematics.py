"""Pose and Jacobian of a chain are those that pinocchio gives."""

from xml.etree import ElementTree

import numpy as np
import pinocchio
import pytest

from tactile_servo.motion.kinematics import chain_of, place
from tactile_servo.motion.robot import RobotModel
from tactile_servo.motion.urdf import chain_to, pinocchio_model


def random_chain(rng, joints):
    """URDF of joints about and along skew axes, with fixed ones between them."""
    parts = ['<link name="link_0"/>']
    for k in range(2 * joints):
        kind = 'fixed' if k % 2 else rng.choice(['revolute', 'prismatic'])
        xyz, rpy, axis = (' '.join(map(str, rng.normal(size=3))) for _ in range(3))
        parts.append(
            f'<link name="link_{k + 1}"/><joint name="joint_{k}" type="{kind}">'
            f'<parent link="link_{k}"/><child link="link_{k + 1}"/><axis xyz="{axis}"/>'
            f'<origin xyz="{xyz}" rpy="{rpy}"/>'
            '<limit lower="-3" upper="3" velocity="1" effort="1"/></joint>')
    return f'<robot name="chain">{"".join(parts)}</robot>', f'link_{2 * joints}'


@pytest.mark.parametrize('joints', [1, 6, 7])
def test_a_chain_is_where_pinocchio_has_it(joints):
    rng = np.random.default_rng(joints)
    for _ in range(20):
        urdf, tip = random_chain(rng, joints)
        robot = ElementTree.fromstring(urdf)
        model = pinocchio_model(robot, *chain_to(robot, tip))
        data, frame = model.createData(), model.getFrameId(tip)
        pose, jacobian = np.empty((4, 4)), np.empty((6, joints))
        order, q = rng.permutation(joints), rng.uniform(-3.0, 3.0, joints)
        place(*chain_of(model, frame), order, q, pose, jacobian)
        expected = pinocchio.computeFrameJacobian(model, data, q[order], frame, pinocchio.LOCAL)
        pinocchio.framesForwardKinematics(model, data, q[order])
        np.testing.assert_allclose(pose, data.oMf[frame].homogeneous, rtol=0, atol=1e-13)
        np.testing.assert_allclose(  # of one joint pinocchio gives no matrix
            jacobian[:, order], expected.reshape(6, -1), rtol=0, atol=1e-12)


def test_positions_of_other_joints_are_refused():
    urdf, tip = random_chain(np.random.default_rng(0), 6)
    with pytest.raises(ValueError, match=r'shape \(7,\), must be of 6 joints'):
        RobotModel.from_urdf(urdf, tip).place(np.zeros(7))
