"""The thesis' simulation (section 4.5): a zig-zag on a cylinder, from velocities."""
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from benchmarks.shape.motion import (
    finite_contacts,
    printed_contacts,
    RelativeMotion,
    screw_motion,
)
from tactile_common.errors import SurfaceError
from tactile_shape.thesis.matrix_estimator import fit_matrix

RADIUS, FINGER = 0.1, 0.01  # m, Table 4.1
STEPS = 5  # contacts, one per second
NOISE = 0.15  # share of the nominal velocity, uniform
X = np.linspace(-0.01, 0.01, 41)  # m, cross-section of the patch of 20 x 4 mm


class Form(NamedTuple):
    """Function from motion to contacts; `rotation` is True if it gets the finger's rotation."""

    contacts: Callable
    rotation: bool


FORMS = {
    'printed, no rotation (4.38)': Form(printed_contacts, False),
    'printed, with rotation': Form(printed_contacts, True),
    'finite steps': Form(finite_contacts, True)}


def zigzag(along, across, *, rng=None, noisy='', frames_too=False, rotation=True):
    """
    Return the motion of a finger that slides with a fixed point over the cylinder.

    Parameters
    ----------
    along, across : float
        Vx and Vy [m/s]; Vy changes sign with every step.
    rng : np.random.Generator, optional
    noisy : str
        'Vx', 'Vy' or 'v' (of the size of Vx): the value given to the estimator with an error of
        15 %.
    frames_too : bool
        True if the contact frames are also composed from the noisy velocities.
    rotation : bool
        True if the estimator gets the rotation of the finger.
    """
    velocity = np.tile([along, across, 0.0], (STEPS, 1))
    velocity[1::2, 1] *= -1.0
    told, sliding = velocity.copy(), np.zeros((STEPS, 3))
    if noisy:
        error = NOISE * rng.uniform(-1.0, 1.0, STEPS)
        if noisy == 'v':
            sliding[:, 0] = error * along
        else:
            told[:, 'Vx Vy'.split().index(noisy)] *= 1.0 + error
    angular = np.zeros((STEPS, 3))
    angular[:, 1] = -velocity[:, 0] / RADIUS
    source = told if frames_too else velocity
    turns = angular.copy()
    turns[:, 1] = -source[:, 0] / RADIUS
    poses = [np.eye(4)]
    for turn, shift in zip(*screw_motion(source, turns), strict=True):
        step = np.eye(4)
        step[:3, :3], step[:3, 3] = turn, shift
        poses.append(poses[-1] @ step)
    frames = np.linalg.inv(poses[-1]) @ np.array(poses[:-1])
    return RelativeMotion(frames, told, angular if rotation else 0.0 * angular, sliding, 1.0)


def fit(form, motion):
    """Return the MatrixFit of a motion with one of `FORMS`."""
    return fit_matrix(*FORMS[form].contacts(motion, 1.0 / FINGER))


def section(fitted, x=X):
    """
    Return the height of an estimated surface over the cross-section y = 0 [m].

    NaN where the line through x does not meet the surface.
    """
    s = fitted.surface.matrix
    half = s[2, 3] + s[0, 2] * x
    flat = s[0, 0] * x**2 + 2.0 * s[0, 3] * x + s[3, 3]
    root = half**2 - s[2, 2] * flat
    with np.errstate(invalid='ignore', divide='ignore'):
        return -flat / (half + np.sign(half) * np.sqrt(root))


def section_error(fitted, x=X):
    """Return the error of the height over the cross-section [m]."""
    try:
        return section(fitted, x) - (RADIUS - np.sqrt(RADIUS**2 - x**2))
    except SurfaceError:
        return np.full(len(x), np.nan)


def noisy_errors(form, along, across, noisy, trials, rng, frames_too=False):
    """Return errors over the cross-section of many noisy runs, ndarray (trials, X) [m]."""
    return np.array([section_error(fit(form, zigzag(
        along, across, rng=rng, noisy=noisy, frames_too=frames_too,
        rotation=FORMS[form].rotation))) for _ in range(trials)])
