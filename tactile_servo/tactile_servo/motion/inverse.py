"""
Joint velocities for a twist of the sensor, and the nearest ones within the joints' limits.

`BoundedInverse` minimises ``(q - a - z)^T H (q - a - z)`` over joint velocities q within the
limits (`JointLimits.reach`): `a` is the damped least squares solution of the twist, z moves a
redundant arm away from its limits in its null space. With the weighted Jacobian ``G = W J``, its
singular values s, right singular vectors v and the damping d (the turn about the sensor's normal,
without which a pad feels the same, weighs YIELDING where no joint is to spare for it)

    H = sum of max(s^2, d^2) v v^T + (TAKE_OVER d)^2 (I - sum of v v^T)

so that away from singularities the cost is the squared weighted error of the twist. Where a + z
lies within the bounds it is the solution, for the gradient is zero there.

Else up to three programs follow, each for what the last one gave, w, where that is not within its
bounds. At a limit of position the other joints take over. A limit of velocity is met by going
slower, then one of acceleration by taking longer: with p the velocities until now, errors along
``y = w``, then ``y = w - p``, weigh EASED times as much. That is a task that is scaled,
``q = w - y + share y``, with its share eliminated: a motion begins, turns and ends on its way.
"""

import math
from typing import NamedTuple

import daqp
import numpy as np

from tactile_common.kernels import njit
from tactile_servo.motion.limits import ACCELERATION, JointLimits, Joints, KINDS, Reach, VELOCITY

# Smallest singular value of the weighted Jacobian that is inverted in full [m/rad]: a small arm, a
# PUMA 260, has 0.012 and more where it is well placed (`test_robot.py`).
DAMPING = 0.01
ROTATION_LENGTH = 0.04  # m/rad, of a pad of some 25 mm and the finger that it is mounted on
YIELDING = 0.1  # of its weight, a turn about the sensor's normal by six joints, one at its limit
EASED = 1e-4  # squared errors along a motion that is slowed or delayed, against others
TAKE_OVER = 0.5  # of the damping; weighs the null space, which is free to stand in for a joint
PUSH = 4.0  # rad of a joint at its limit per metre of (weighted) way
PUSH_SPEED = 0.1  # of a joint's velocity limit


def damped_least_squares(jacobian: np.ndarray, twist: np.ndarray, *, damping: float = DAMPING,
                         rotation_length: float = ROTATION_LENGTH) -> tuple[np.ndarray, float]:
    """
    Joint velocities for a twist; exact away from singularities, bounded at them.

    With ``W = diag(1, 1, 1, l, l, l)`` (l = `rotation_length`) and the singular values s of
    ``W J``, this is ``dq = (W J)^T U diag(1 / max(s^2, damping^2)) U^T W twist``: the damping
    factor ``lambda^2 = damping^2 (1 - (s / damping)^2)`` of Chiaverini, Siciliano and Egeland
    (IEEE T-CST 2(2), 1994) with the size of the singular region equal to the damping,
    applied to each singular direction of its own (their numerical filtering). Directions with
    ``s >= damping`` therefore carry no velocity error, and ``|dq| <= |W twist| / damping``
    always. A small rotation_length lets orientation give way before position does.

    Parameters
    ----------
    jacobian : ndarray (6, n)
        Rows linear [m/rad], then angular [rad/rad].
    twist : array_like (6,)
        In the Jacobian's frame [m/s, rad/s].
    damping : float
        Smallest singular value [m/rad] of the weighted Jacobian that is inverted in full.
    rotation_length : float
        Weight of rotation against translation [m/rad].

    Returns
    -------
    dq : ndarray (n,)
        Joint velocities [rad/s or m/s].
    smallest : float
        Smallest singular value of the weighted Jacobian [m/rad].
    """
    return _least_squares(np.ascontiguousarray(jacobian, dtype=float), np.asarray(twist, float),
                          np.zeros(np.shape(jacobian)[1]), damping, rotation_length)


class Solution(NamedTuple):
    """Joint velocities for a twist, and what they leave of it."""

    velocities: np.ndarray  # (n,) [rad/s]
    scale: float  # fraction of the motion that velocity limits let through
    limited_by: str  # the limit that costs most in the first program that is needed, or empty
    smallest: float  # singular value of the weighted Jacobian [m/rad]


class BoundedInverse:
    """Joint velocities for a twist within the limits of position, velocity and acceleration."""

    def __init__(self, limits: JointLimits):
        self._limits = limits
        joints, span = len(limits.names), limits.upper - limits.lower
        # At either end of its range, which a redundant arm is moved out of. Without a zone where
        # a joint has no range, an infinite room divided by it is no push.
        self._zone = np.where(np.isfinite(span), 0.15 * span, 1e-300)
        self._no_rows, self._sense = np.empty((0, joints)), np.zeros(joints, np.int32)

    def solve(self, jacobian: np.ndarray, twist: np.ndarray, joints: Joints,
              reach: Reach) -> Solution:
        """
        Joint velocities for a twist (6,), from the state of the joints, within their reach.

        Not within all limits where the solver fails, not finite where twist or Jacobian are not.
        """
        limits, scale, limited_by = self._limits, 1.0, ''
        found, smallest = _least_squares(jacobian, twist, self._push(twist, joints.positions),
                                         DAMPING, ROTATION_LENGTH)
        if limits.keeps(found, reach.least[-1], reach.most[-1]) or not np.isfinite(found).all():
            return Solution(found, scale, limited_by, smallest)
        matrix = hessian(jacobian)
        for row, (kind, least, most) in enumerate(zip(
                KINDS, reach.least, reach.most, strict=True)):
            if limits.keeps(found, least, most):
                continue
            wanted, weights = found, matrix
            if kind == VELOCITY:
                weights = _eased(matrix, wanted)
            elif kind == ACCELERATION:
                weights = _eased(matrix, wanted - joints.velocities)
            self._sense[:] = 0
            found, _, flag, info = daqp.solve(
                weights, -weights @ wanted, self._no_rows, most, least, self._sense)
            if flag != 1 or not np.isfinite(found).all():
                return Solution(wanted, scale, limited_by, smallest)
            found = np.clip(found, least, most)
            if kind == VELOCITY:
                along = matrix @ wanted
                scale = float(np.clip(along @ found / (along @ wanted), 0.0, 1.0))
            if not limited_by:
                joint = np.abs(info['lam']).argmax()
                bounds = (reach.most if info['lam'][joint] > 0.0 else reach.least)[:, joint]
                limited_by = limits.name_of((bounds == bounds[row]).argmax(), joint)
        return Solution(found, scale, limited_by, smallest)

    def _push(self, twist: np.ndarray, positions: np.ndarray) -> np.ndarray:
        """Velocities (n,) out of the zones at the limits, for a redundant arm's null space."""
        limits = self._limits
        if len(positions) <= 6:
            return np.zeros(len(positions))
        way = math.hypot(np.linalg.norm(twist[:3]), ROTATION_LENGTH * np.linalg.norm(twist[3:]))
        low, high = (np.clip(1.0 - room / self._zone, 0.0, 1.0)
                     for room in (positions - limits.lower, limits.upper - positions))
        return np.minimum(PUSH * way, PUSH_SPEED * limits.velocity) * (low - high)


@njit(cache=True)
def agility(jacobian: np.ndarray, acceleration: np.ndarray) -> float:
    """
    Largest acceleration of the sensor in every direction across its normal [m/s^2].

    None of the joints' accelerations (n,) [rad/s^2] is exceeded by it, from rest, without turning
    the sensor or moving it along its normal; inf where a Jacobian (6, n) is not finite.
    """
    none, most, ways = np.zeros(jacobian.shape[1]), np.inf, np.eye(6)
    x, _ = _least_squares(jacobian, ways[0], none, DAMPING, ROTATION_LENGTH)
    y, _ = _least_squares(jacobian, ways[1], none, DAMPING, ROTATION_LENGTH)
    for k in range(len(x)):
        if math.isfinite(x[k]):
            most = min(most, acceleration[k] / max(math.hypot(x[k], y[k]), 1e-12))
    return most


@njit(cache=True)
def _least_squares(jacobian: np.ndarray, twist: np.ndarray, push: np.ndarray, damping: float,
                   rotation_length: float) -> tuple[np.ndarray, float]:
    """Velocities for the twist, with the part of `push` that moves no tip; smallest s."""
    joints, weighted, square = jacobian.shape[1], jacobian.copy(), np.zeros((6, 6))
    weighted[3:] *= rotation_length
    for i in range(6):  # loops: a call of BLAS costs more than this does
        for j in range(6):
            for k in range(joints):
                square[i, j] += weighted[i, k] * weighted[j, k]
    if not math.isfinite(square.sum()):  # LAPACK takes no such matrix
        return np.full(joints, np.nan), np.nan
    squared, left = np.linalg.eigh(square)  # a third of the time of an SVD
    velocities, redundant = push.copy(), joints > 6 and push.any()
    pushed = weighted @ push if redundant else np.zeros(6)
    # Along each left singular vector: share of the twist, less what the push would bring.
    for i in range(6):
        share = less = 0.0
        for j in range(6):
            share += left[j, i] * twist[j] * (rotation_length if j >= 3 else 1.0)
            less += left[j, i] * pushed[j]
        share /= max(squared[i], damping * damping)
        if redundant and squared[i] > 1e-8 * squared[5]:
            share -= less / squared[i]
        for j in range(6):
            for k in range(joints):
                velocities[k] += share * left[j, i] * weighted[j, k]
    return velocities, math.sqrt(max(squared[max(0, 6 - joints)], 0.0))


def _eased(matrix: np.ndarray, way: np.ndarray) -> np.ndarray:
    """Matrix (n, n) of a program in which errors along a way (n,) weigh EASED times as much."""
    along = matrix @ way
    return matrix - (1.0 - EASED) / max(along @ way, 1e-300) * np.outer(along, along)


def hessian(jacobian: np.ndarray) -> np.ndarray:
    """Matrix H (n, n)."""
    weighted = jacobian.copy()
    weighted[3:] *= ROTATION_LENGTH
    if weighted.shape[1] <= 6:  # none is to spare for it
        weighted[5] *= YIELDING
    squared, right = np.linalg.eigh(weighted.T @ weighted)
    weights = np.maximum(squared, DAMPING**2)
    weights[:max(len(weights) - 6, 0)] = (TAKE_OVER * DAMPING)**2
    return (right * weights) @ right.T
