"""
Joint velocities for a twist of the sensor, and the nearest ones within the joint limits.

`BoundedInverse` minimises ``(q - a - z)^T H (q - a - z)`` over joint velocities q within the
limits (`JointLimits.reach`). Here `a` is the damped least-squares solution of the twist, and z
moves a redundant arm away from its limits, in its null space. If a + z is within the bounds, it is
the solution. Otherwise up to three quadratic programs follow, one for each kind of limit; see
docs/motion.md.
"""

import math
from typing import NamedTuple

import daqp
import numpy as np

from tactile_common.kernels import njit
from tactile_servo.motion.limits import ACCELERATION, JointLimits, Joints, KINDS, Reach, VELOCITY

# Smallest singular value of the weighted Jacobian that is inverted without damping [m/rad]. A
# small arm, the PUMA 260, has at least 0.012 at a good location (`test_robot.py`).
DAMPING = 0.01
ROTATION_LENGTH = 0.04  # m/rad, for a pad of about 25 mm and the finger that carries it
YIELDING = 0.1  # weight factor of a turn about the normal, for six joints with one at a limit
EASED = 1e-4  # relative weight of squared errors along a motion that is slowed or delayed
TAKE_OVER = 0.5  # relative to the damping: weight of the null space, free to replace a joint
PUSH_ZONE = 0.15  # share of a joint's range at either end, which a redundant arm avoids
PUSH = 4.0  # motion of a joint at its limit per (weighted) metre of the sensor [rad/m]
PUSH_SPEED = 0.1  # largest such velocity, as a share of the joint's velocity limit


def damped_least_squares(jacobian: np.ndarray, twist: np.ndarray, *,
                         damping: float = DAMPING) -> tuple[np.ndarray, float]:
    """
    Return joint velocities for a twist, exact away from singularities and bounded near them.

    With ``W = diag(1, 1, 1, l, l, l)`` (l = `ROTATION_LENGTH`) and the singular values s of
    ``W J``, this is ``dq = (W J)^T U diag(1 / max(s^2, damping^2)) U^T W twist``: the numerical
    filtering of Chiaverini, Siciliano and Egeland (IEEE T-CST 2(2), 1994), for each singular
    direction. Always ``|dq| <= |W twist| / damping``. The rows of the Jacobian (6, n) are linear,
    then angular; `damping` is in m/rad.

    Returns the joint velocities (n,) [rad/s or m/s] and the smallest s [m/rad].
    """
    return _least_squares(np.ascontiguousarray(jacobian, dtype=float), np.asarray(twist, float),
                          np.zeros(np.shape(jacobian)[1]), damping)


class Solution(NamedTuple):
    """Joint velocities for a twist, and their limitation."""

    velocities: np.ndarray  # (n,) [rad/s]
    scale: float  # fraction of the motion that the velocity limits allow
    limited_by: str  # limit with the largest multiplier in the first program, or empty
    smallest: float  # smallest singular value of the weighted Jacobian [m/rad]


class BoundedInverse:
    """Compute joint velocities for a twist within limits of position, velocity, acceleration."""

    def __init__(self, limits: JointLimits):
        self._limits = limits
        joints, span = len(limits.names), limits.upper - limits.lower
        # For a joint without limits the room is infinite, and divided by this small number it
        # gives no push.
        self._zone = np.where(np.isfinite(span), PUSH_ZONE * span, 1e-300)
        self._no_rows, self._sense = np.empty((0, joints)), np.zeros(joints, np.int32)

    def solve(self, jacobian: np.ndarray, twist: np.ndarray, joints: Joints,
              reach: Reach) -> Solution:
        """
        Return joint velocities for a twist (6,), within the reach of the joints.

        If the solver fails, they may violate a limit. If twist or Jacobian is not finite, they
        are not finite.
        """
        limits, scale, limited_by = self._limits, 1.0, ''
        found, smallest = _least_squares(
            jacobian, twist, self._push(twist, joints.positions), DAMPING)
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
        """Return velocities (n,) that move the joints of a redundant arm out of their zones."""
        limits = self._limits
        if len(positions) <= 6:
            return np.zeros(len(positions))
        way = math.hypot(np.linalg.norm(twist[:3]), ROTATION_LENGTH * np.linalg.norm(twist[3:]))
        low, high = (np.clip(1.0 - room / self._zone, 0.0, 1.0)
                     for room in (positions - limits.lower, limits.upper - positions))
        return np.minimum(PUSH * way, PUSH_SPEED * limits.velocity) * (low - high)


@njit(cache=True)
def _least_squares(jacobian: np.ndarray, twist: np.ndarray, push: np.ndarray,
                   damping: float) -> tuple[np.ndarray, float]:
    """Return velocities for the twist plus the null-space part of `push`, and the smallest s."""
    joints, weighted, square = jacobian.shape[1], jacobian.copy(), np.zeros((6, 6))
    weighted[3:] *= ROTATION_LENGTH
    for i in range(6):  # loops are faster here than a call of BLAS
        for j in range(6):
            for k in range(joints):
                square[i, j] += weighted[i, k] * weighted[j, k]
    if not math.isfinite(square.sum()):  # LAPACK needs finite values
        return np.full(joints, np.nan), np.nan
    squared, left = np.linalg.eigh(square)  # a third of the time of an SVD
    velocities, redundant = push.copy(), joints > 6 and push.any()
    pushed = weighted @ push if redundant else np.zeros(6)
    # For each left singular vector: its share of the twist, minus the twist of the push.
    for i in range(6):
        share = less = 0.0
        for j in range(6):
            share += left[j, i] * twist[j] * (ROTATION_LENGTH if j >= 3 else 1.0)
            less += left[j, i] * pushed[j]
        share /= max(squared[i], damping * damping)
        if redundant and squared[i] > 1e-8 * squared[5]:
            share -= less / squared[i]
        for j in range(6):
            for k in range(joints):
                velocities[k] += share * left[j, i] * weighted[j, k]
    return velocities, math.sqrt(max(squared[max(0, 6 - joints)], 0.0))


@njit(cache=True)
def allowed_acceleration(jacobian: np.ndarray, acceleration: np.ndarray, first: int,
                         end: int) -> float:
    """
    Return the acceleration of the sensor that is possible in any direction of some of its axes.

    It is computed [m/s^2 or rad/s^2] for a start from rest, with no other motion of the sensor, so
    that no joint exceeds its acceleration (n,) [rad/s^2]. It is infinite if the Jacobian (6, n) is
    not finite. The axes are the indices of a twist from `first` to before `end`.
    """
    still, squared, least = np.zeros(acceleration.size), np.zeros(acceleration.size), np.inf
    for axis in range(first, end):
        twist = np.zeros(6)
        twist[axis] = 1.0
        rates, _ = _least_squares(jacobian, twist, still, DAMPING)
        squared += rates * rates
    for joint in range(acceleration.size):
        possible = acceleration[joint] / max(math.sqrt(squared[joint]), 1e-12)
        if possible < least:  # false for NaN
            least = possible
    return least


def _eased(matrix: np.ndarray, way: np.ndarray) -> np.ndarray:
    """Return the matrix (n, n) with the weight of errors along `way` (n,) reduced to EASED."""
    along = matrix @ way
    return matrix - (1.0 - EASED) / max(along @ way, 1e-300) * np.outer(along, along)


def hessian(jacobian: np.ndarray) -> np.ndarray:
    """
    Return the matrix H (n, n) = sum of max(s^2, d^2) v v^T + (TAKE_OVER d)^2 (I - sum of v v^T).

    Here s are the singular values of the weighted Jacobian, v its right singular vectors and d the
    damping: away from singularities the cost is the squared weighted error of the twist.
    """
    weighted = jacobian.copy()
    weighted[3:] *= ROTATION_LENGTH
    if weighted.shape[1] <= 6:  # no redundancy
        weighted[5] *= YIELDING
    squared, right = np.linalg.eigh(weighted.T @ weighted)
    weights = np.maximum(squared, DAMPING**2)
    weights[:max(len(weights) - 6, 0)] = (TAKE_OVER * DAMPING)**2
    return (right * weights) @ right.T
