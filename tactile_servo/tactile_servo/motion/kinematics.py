"""
Forward kinematics and Jacobian of a chain of joints, as one kernel.

pinocchio reads the chain, and is what this is tested against; a call of it from Python takes two
to three times as long, and a servo asks for four in a cycle.
"""

import math

import numpy as np
import pinocchio

from tactile_common.kernels import njit


def chain_of(model: pinocchio.Model, frame: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """
    What `place` takes of a model that is one chain of n joints up to a frame.

    Placements (n + 1, 4, 4) of each joint in the one before it, and of the frame in the last;
    axes (n, 3) in the joints' own frames; whether each turns (n,), else it slides.
    """
    tip, data, middle = model.frames[frame], model.createData(), pinocchio.neutral(model)
    placements = [*(one.homogeneous for one in list(model.jointPlacements)[1:]),
                  tip.placement.homogeneous]
    # Twist of each joint in its own frame.
    twists = np.array([  # of one joint alone it is no matrix
        pinocchio.computeJointJacobian(model, data, middle, k + 1).reshape(6, -1)[:, k]
        for k in range(model.nv)])
    turns = np.any(twists[:, 3:] != 0.0, axis=1)
    return (np.array(placements), np.where(turns[:, None], twists[:, 3:], twists[:, :3]), turns)


@njit(cache=True)
def place(placements, axes, turns, order, positions, pose, jacobian):
    """
    Write the pose (4, 4) of the frame in the root's, and its Jacobian (6, n) in the frame itself.

    Joint k of the chain is at positions[order[k]], and in that column of the Jacobian.
    """
    joints = len(axes)
    rotation, point, turned = np.eye(3), np.zeros(3), np.empty((3, 3))
    directions, points = np.empty((joints, 3)), np.empty((joints, 3))
    for k in range(joints + 1):
        for i in range(3):
            for j in range(3):
                turned[i, j] = (rotation[i, 0] * placements[k, 0, j]
                                + rotation[i, 1] * placements[k, 1, j]
                                + rotation[i, 2] * placements[k, 2, j])
                point[i] += rotation[i, j] * placements[k, j, 3]
        rotation[:] = turned
        if k == joints:
            break
        angle = positions[order[k]]
        x, y, z = axes[k]
        for i in range(3):
            directions[k, i] = rotation[i, 0] * x + rotation[i, 1] * y + rotation[i, 2] * z
            points[k, i] = point[i]
            if not turns[k]:
                point[i] += angle * directions[k, i]
        if turns[k]:  # by the formula of Rodrigues
            cos, sin = math.cos(angle), math.sin(angle)
            less = 1.0 - cos
            for i in range(3):
                a, b, c = rotation[i, 0], rotation[i, 1], rotation[i, 2]
                along = less * directions[k, i]
                rotation[i, 0] = cos * a + along * x + sin * (b * z - c * y)
                rotation[i, 1] = cos * b + along * y + sin * (c * x - a * z)
                rotation[i, 2] = cos * c + along * z + sin * (a * y - b * x)
    pose[:3, :3], pose[:3, 3], pose[3], pose[3, 3] = rotation, point, 0.0, 1.0
    for k in range(joints):
        (x, y, z), column = directions[k], order[k]
        if turns[k]:
            a, b, c = point[0] - points[k, 0], point[1] - points[k, 1], point[2] - points[k, 2]
            u, v, w = y * c - z * b, z * a - x * c, x * b - y * a
        else:
            u, v, w = x, y, z
            x = y = z = 0.0
        for i in range(3):
            a, b, c = rotation[0, i], rotation[1, i], rotation[2, i]
            jacobian[i, column] = a * u + b * v + c * w
            jacobian[3 + i, column] = a * x + b * y + c * z
