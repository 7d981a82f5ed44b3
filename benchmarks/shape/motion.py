"""
Points and normals of contacts from a finger's motion (thesis, 4.19 to 4.31).

Contact frame C(t): origin at the contact, z the object's inward unit normal. The finger is on the
other side: its own inward normal is (0, 0, -1), the centre of a round finger (0, 0, -radius).
"""
from dataclasses import dataclass

import numpy as np

from tactile_common.errors import ConfigurationError


@dataclass(frozen=True, eq=False)
class RelativeMotion:
    """
    N steps of a finger relative to an object, the oldest first.

    Parameters
    ----------
    to_current : array_like, shape (N, 4, 4)
        Transform from the contact frame at the beginning of each step to the current one, the
        frame at the end of the last step.
    velocity, angular, sliding : array_like, shape (N, 3)
        In the contact frame at the beginning of each step: velocity V [m/s] of the finger's
        contact point relative to the object, angular velocity [rad/s] of the finger, velocity v
        [m/s] of the contact along the finger's surface.
    period : float
        Duration of a step [s].

    Raises
    ------
    ConfigurationError
        A shape is wrong, a number is not finite or the period is not positive.
    """

    to_current: np.ndarray
    velocity: np.ndarray
    angular: np.ndarray
    sliding: np.ndarray
    period: float

    def __post_init__(self):
        frames = np.asarray(self.to_current, dtype=float)
        if frames.ndim != 3 or frames.shape[1:] != (4, 4) or not len(frames):
            raise ConfigurationError(
                f'to_current has shape {frames.shape}, must be (N, 4, 4) with N of at least 1')
        object.__setattr__(self, 'to_current', frames)
        for name in ('velocity', 'angular', 'sliding'):
            values = np.asarray(getattr(self, name), dtype=float)
            if values.shape != (len(frames), 3):
                raise ConfigurationError(
                    f'{name} has shape {values.shape}, must be ({len(frames)}, 3)')
            object.__setattr__(self, name, values)
        if not all(np.isfinite(value).all() for value in (
                frames, self.velocity, self.angular, self.sliding)):
            raise ConfigurationError('motion: a number is not finite')
        if not 0.0 < self.period < np.inf:
            raise ConfigurationError(f'period is {self.period}, must be above 0 s')


def printed_contacts(
        motion: RelativeMotion,
        finger_curvature: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """
    Return contacts after each step to first order, as printed in the thesis (4.30, 4.31).

    The normal turns by (w x n) dt and by v dt / radius, the contact moves by (V + v) dt. Errors
    grow with the square of the step.

    Parameters
    ----------
    motion : RelativeMotion
    finger_curvature : float
        1 / radius of a spherical finger [1/m], 0 for a flat one.

    Returns
    -------
    points, normals : ndarray, shape (N, 3)
        In the current contact frame: y_i of (4.31) without its 1, and -2 x_i of (4.30), the
        object's inward normal, whose length is not exactly 1.
    """
    up = np.array([0.0, 0.0, 1.0])
    moved = (motion.velocity + motion.sliding) * motion.period
    # Seen from the object the finger's normal is -up. The normal of a sphere tilts with the
    # sliding; for a finger that rolls on a plane this compensates its rotation.
    turned = up + motion.period * (
        np.cross(motion.angular, up) + finger_curvature * motion.sliding)
    return _in_current(motion.to_current, moved, turned)


def finite_contacts(
        motion: RelativeMotion,
        finger_curvature: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """
    Return contacts after each step, exactly; same interface as `printed_contacts`.

    The velocities are those of a screw motion, constant in the finger's frame during a step. The
    contact slides along a great circle of the finger.
    """
    turn, shift = screw_motion(motion.velocity * motion.period, motion.angular * motion.period)
    slide = motion.sliding * motion.period
    length = np.linalg.norm(slide, axis=1, keepdims=True)
    heading = np.divide(slide, length, out=np.zeros_like(slide), where=length > 0.0)
    angle = finger_curvature * length
    up = np.array([0.0, 0.0, 1.0])
    outward = np.cos(angle) * up + np.sin(angle) * heading  # from the finger's centre
    # radius * sin and radius * (cos - 1), also valid for a flat finger
    on_finger = length * (np.sinc(angle / np.pi) * heading
                          - 0.5 * angle * np.sinc(0.5 * angle / np.pi)**2 * up)
    moved = np.einsum('nij,nj->ni', turn, on_finger) + shift
    return _in_current(motion.to_current, moved, np.einsum('nij,nj->ni', turn, outward))


def screw_motion(shift: np.ndarray, turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """
    Return the finite motion of constant velocities.

    Parameters
    ----------
    shift, turn : ndarray, shape (N, 3)
        Velocity and angular velocity times duration [m, rad], in the moving frame.

    Returns
    -------
    rotations : ndarray, shape (N, 3, 3)
    displacements : ndarray, shape (N, 3)
        [m], in the frame before the motion.
    """
    angle = np.linalg.norm(turn, axis=1)[:, None, None]
    cross = np.zeros((len(turn), 3, 3))
    cross[:, [2, 0, 1], [1, 2, 0]] = turn
    cross[:, [1, 2, 0], [2, 0, 1]] = -turn
    square = cross @ cross
    sine = np.sinc(angle / np.pi)  # sin(a) / a
    cosine = 0.5 * np.sinc(0.5 * angle / np.pi)**2  # (1 - cos a) / a^2
    small = angle < 1e-2
    safe = np.where(small, 1.0, angle)
    rest = np.where(small, 1.0 / 6.0 - angle**2 / 120.0 + angle**4 / 5040.0,
                    (1.0 - np.sin(safe) / safe) / safe**2)
    rotations = np.eye(3) + sine * cross + cosine * square
    average = np.eye(3) + cosine * cross + rest * square
    return rotations, np.einsum('nij,nj->ni', average, shift)


def _in_current(frames, points, normals):
    rotations = frames[:, :3, :3]
    return (np.einsum('nij,nj->ni', rotations, points) + frames[:, :3, 3],
            np.einsum('nij,nj->ni', rotations, normals))
