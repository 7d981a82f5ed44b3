"""Kinematics of a robot arm from a URDF: forward kinematics, Jacobian, inverse kinematics."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pinocchio

from tactile_common.errors import ConfigurationError, UnreachableError
from tactile_servo.motion.inverse import damped_least_squares, ROTATION_LENGTH
from tactile_servo.motion.urdf import chain_to, limits_of, MOVING, parse, pinocchio_model, text_of

# Inverse kinematics: largest residual [m, rad]; random starts, and steps from each start
POSITION_TOLERANCE, ROTATION_TOLERANCE = 1e-8, 1e-7
RESTARTS, ITERATIONS = 40, 100


class RobotModel:
    """
    Kinematics of the serial chain from a URDF's root link to a tip frame (pinocchio).

    Continuous joints are treated as revolute joints without position limits, so that every joint
    has one coordinate.

    The vectors `lower`, `upper` (positions [rad or m], infinite for continuous joints) and
    `velocity_limit` [rad/s or m/s] have the order of `joint_names`, like all joint vectors, and
    `turns`, True for a joint that is not prismatic.
    """

    def __init__(self, xml: str, tip_frame: str):
        robot, self.urdf = parse(xml), xml
        joints, self.root_frame = chain_to(robot, tip_frame)
        moving = [joint for joint in joints if joint.get('type') in MOVING]
        if not moving:
            raise ConfigurationError(
                f'tip_frame {tip_frame!r}: no moving joint between it and the root link '
                f'{self.root_frame!r}')
        self.tip_frame = tip_frame
        self.joint_names = tuple(joint.get('name', '') for joint in moving)
        self.lower, self.upper, self.velocity_limit = np.array(
            [limits_of(joint) for joint in moving]).T.copy()
        self.turns = np.array([joint.get('type') != 'prismatic' for joint in moving])
        self._model = pinocchio_model(robot, joints, self.root_frame)
        self._data = self._model.createData()
        self._frame = self._model.getFrameId(tip_frame)

    @property
    def middle(self) -> np.ndarray:
        """Middle (n,) of the position limits; 0 for a joint without limits [rad or m]."""
        bounded = np.isfinite(self.lower) & np.isfinite(self.upper)
        middle = np.zeros_like(self.lower)
        middle[bounded] = 0.5 * (self.lower[bounded] + self.upper[bounded])
        return middle

    @classmethod
    def from_urdf(cls, urdf: str | Path, tip_frame: str) -> 'RobotModel':
        """
        Read a URDF from a file's path or from the XML itself; joints are ordered root to tip.

        ConfigurationError if the file is missing, the XML is malformed, the tip frame is unknown,
        or a joint is a mimic joint, has another type than those of `MOVING`, or has no limits.
        """
        return cls(text_of(str(urdf)), tip_frame)

    def pose(self, q: np.ndarray) -> np.ndarray:
        """Return the pose (4, 4) of the tip in the root frame [m] at positions (n,) [rad or m]."""
        pinocchio.forwardKinematics(self._model, self._data, self._checked(q))
        return self._placement()

    def jacobian(self, q: np.ndarray) -> np.ndarray:
        """Return the Jacobian (6, n) in the tip frame, rows linear, then angular."""
        return self.place(q)[1]

    def place(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return `pose` and `jacobian` at joint positions (n,) [rad or m]."""
        pinocchio.computeJointJacobians(self._model, self._data, self._checked(q))
        pose = self._placement()
        jacobian = pinocchio.getFrameJacobian(
            self._model, self._data, self._frame, pinocchio.LOCAL,
        ).reshape(6, -1)  # for one joint pinocchio returns a vector
        return pose, np.array(jacobian, order='C')

    def _checked(self, q: np.ndarray) -> np.ndarray:
        """Return positions (n,) as floats; raise a ValueError for another shape."""
        q, joints = np.asarray(q, dtype=float), len(self.joint_names)
        if q.shape != (joints,):
            raise ValueError(f'positions of shape {q.shape}, must be of {joints} joints')
        return q

    def _placement(self) -> np.ndarray:
        """Return the pose (4, 4) of the tip for the last joint positions."""
        placement = pinocchio.updateFramePlacement(self._model, self._data, self._frame)
        return np.ascontiguousarray(placement.homogeneous)

    def bias(self, q: np.ndarray, velocities: np.ndarray) -> np.ndarray:
        """
        Return the acceleration (6,) of the tip frame, in this frame, at constant joint velocities.

        It is the time derivative of the Jacobian times the velocities [m/s^2, rad/s^2].
        """
        pinocchio.forwardKinematics(
            self._model, self._data, q, velocities, np.zeros(len(q)))
        return pinocchio.getFrameAcceleration(
            self._model, self._data, self._frame, pinocchio.LOCAL).vector

    def inverse(self, pose: np.ndarray,
                seed: Sequence[float] | np.ndarray | None = None) -> np.ndarray:
        """
        Return joint positions (n,) within the limits that bring the tip frame to a pose (4, 4).

        The method is Levenberg-Marquardt with Sugihara's damping (IEEE T-RO 27(5), 2011), with
        steps clipped to the limits. It starts from the seed, which selects one of several
        solutions, then from random configurations (the same ones at every call). Without a seed,
        it returns the solution farthest from singularities and limits.

        UnreachableError, with the smallest residual, if no solution is found; ConfigurationError
        if the pose is not a rigid transform, or the seed has a wrong length or is not finite.
        """
        target = _checked_pose(pose)
        best, solutions = (np.inf, np.inf), []
        for start in self._starts(seed):
            q, residual = self._descend(target, start)
            if not _reached(residual):
                best = min(best, residual)
            elif seed is not None:
                return q
            else:
                solutions.append(self._unwound(q))
        if solutions:
            clearances = np.array([self._clearance(q) for q in solutions])
            clear = np.flatnonzero(clearances >= 0.98 * clearances.max())
            return min((solutions[k] for k in clear), key=np.linalg.norm)
        raise UnreachableError(
            f'{self.tip_frame}: no joint positions within the limits reach '
            f'({", ".join(f"{v:.4f}" for v in target.translation)}) m in the wanted orientation; '
            f'closest {best[0] * 1e3:.3g} mm, {np.degrees(best[1]):.3g} deg')

    def _descend(self, target: pinocchio.SE3,
                 q: np.ndarray) -> tuple[np.ndarray, tuple[float, float]]:
        weight = np.repeat([1.0, ROTATION_LENGTH], 3)
        q = np.clip(q, self.lower, self.upper)
        for _ in range(ITERATIONS + 1):
            pose, jacobian = self.place(q)
            here = pinocchio.SE3(pose)
            twist = pinocchio.log6(here.actInv(target)).vector
            found, residual = q, (float(np.linalg.norm(here.translation - target.translation)),
                                  float(np.linalg.norm(twist[3:])))
            if _reached(residual):
                break
            weighted = weight[:, None] * jacobian
            error = weight * twist
            normal = weighted.T @ weighted
            normal.flat[::len(q) + 1] += 0.5 * (error @ error) + 1e-9
            q = np.clip(q + np.linalg.solve(normal, weighted.T @ error), self.lower, self.upper)
        return found, residual

    def _starts(self, seed: Sequence[float] | np.ndarray | None) -> Iterator[np.ndarray]:
        """Yield the seed, if there is one, and random configurations."""
        centre = np.zeros_like(self.lower)
        if seed is not None:
            centre = np.array(seed, dtype=float)
            if centre.shape != self.lower.shape or not np.isfinite(centre).all():
                raise ConfigurationError(
                    f'seed: {len(self.joint_names)} finite joint positions are needed, got {seed}')
            yield centre
        bounded, rng = np.isfinite(self.lower) & np.isfinite(self.upper), np.random.default_rng(0)
        low = np.where(bounded, self.lower, centre - np.pi)
        high = np.where(bounded, self.upper, centre + np.pi)
        for _ in range(RESTARTS):
            yield rng.uniform(low, high)

    def _unwound(self, q: np.ndarray) -> np.ndarray:
        """Return q without full turns, as far as the limits allow."""
        near_zero = np.where(self.turns, q - 2 * np.pi * np.round(q / (2 * np.pi)), q)
        return np.where((near_zero >= self.lower) & (near_zero <= self.upper), near_zero, q)

    def _clearance(self, q: np.ndarray) -> float:
        """Return the smallest weighted singular value [m/rad], less within 30 deg of a limit."""
        _, smallest = damped_least_squares(self.jacobian(q), np.zeros(6))
        margin = np.minimum(q - self.lower, self.upper - q).min()
        return smallest * min(1.0, margin / np.radians(30.0))


def _reached(residual: tuple[float, float]) -> bool:
    return residual[0] <= POSITION_TOLERANCE and residual[1] <= ROTATION_TOLERANCE


def _checked_pose(pose: np.ndarray) -> pinocchio.SE3:
    matrix = np.asarray(pose, dtype=float)
    if matrix.shape != (4, 4) or not np.all(np.isfinite(matrix)):
        raise ConfigurationError(f'pose: a finite (4, 4) transform is needed, got {matrix.shape}')
    rotation = matrix[:3, :3]
    if np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-6 or np.linalg.det(rotation) < 0:
        raise ConfigurationError('pose: the rotation part is no rotation matrix')
    return pinocchio.SE3(rotation, matrix[:3, 3])
