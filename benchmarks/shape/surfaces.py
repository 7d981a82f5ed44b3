"""Surfaces of known shape, paths of contacts on them and the noise of real contacts."""
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from tactile_common.polyline import arc_length
from tactile_simulation.surface_objects import Torus as SolidTorus


def value(matrix: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return X' S X at points (..., 3): 0 on the surface, positive inside the object."""
    x = np.insert(points, 3, 1.0, axis=-1)
    return np.einsum('...i,ij,...j', x, matrix, x)


def gradient(matrix: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return 2 L S X (4.12) at points (..., 3), the inward normal but for its length."""
    return 2.0 * np.insert(points, 3, 1.0, axis=-1) @ matrix[:, :3]


class Torus(SolidTorus):
    """A torus with points on it; also plane, cylinder and sphere."""

    @property
    def curvature(self) -> np.ndarray:
        """K at the contact frame's origin, ndarray (2, 2) [1/m]."""
        return np.diag([1.0 / (self.ring + self.tube), 1.0 / self.tube])

    def at(self, along: np.ndarray, across: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """
        Return points and inward normals at arc lengths along and across the ring.

        Parameters
        ----------
        along, across : ndarray, shape (N,)
            Arc lengths [m].

        Returns
        -------
        points, normals : ndarray, shape (N, 3)
        """
        latitude = across / self.tube
        # Outer radius of the ring; all results are finite even if a radius is not.
        outer = self.ring + self.tube
        longitude = along / outer
        sagitta = _sagitta(across, self.tube)
        inward = np.column_stack([
            -np.cos(latitude) * np.sin(longitude), -np.sin(latitude),
            np.cos(latitude) * np.cos(longitude)])
        shrink = 1.0 if np.isinf(outer) else 1.0 - sagitta / outer
        side = along if np.isinf(outer) else shrink * outer * np.sin(longitude)
        height = sagitta if np.isinf(outer) else (
            shrink * _sagitta(along, outer) + sagitta)
        y = across if np.isinf(self.tube) else self.tube * np.sin(latitude)
        return np.column_stack([side, y, height]), inward


PLANE = Torus(np.inf, np.inf)


def cylinder(radius: float) -> Torus:
    """Return a cylinder of a radius [m] with its axis along x."""
    return Torus(np.inf, radius)


def sphere(radius: float) -> Torus:
    """Return a sphere of a radius [m]."""
    return Torus(0.0, radius)


def _sagitta(arc: np.ndarray, radius: float) -> np.ndarray:
    return 0.0 * arc if np.isinf(radius) else 2.0 * radius * np.sin(0.5 * arc / radius)**2


@dataclass(frozen=True)
class Weave:
    """
    Path that swings about a straight course.

    Parameters
    ----------
    amplitude, wavelength : float
        [m]; an amplitude of 0 gives a straight path.
    heading : float
        Heading of the course, from x of the surface [rad].
    speed : float
        Speed along the path [m/s].
    rate : float
        Contacts per second [Hz].
    """

    amplitude: float = 2e-3
    wavelength: float = 16e-3
    heading: float = 0.0
    speed: float = 0.05
    rate: float = 200.0

    def trace(self, surface: Torus, length: float) -> tuple[np.ndarray, np.ndarray]:
        """
        Return contacts along a path that ends approximately at the surface's origin.

        Parameters
        ----------
        surface : Torus
        length : float
            Length of the path [m].

        Returns
        -------
        points, normals : ndarray, shape (N, 3)
        """
        fine = np.linspace(-length, 0.0, max(2, int(length / 2e-5)))
        swing = self.amplitude * np.sin(2.0 * np.pi * fine / self.wavelength)
        travel = arc_length(np.column_stack([fine, swing]))
        count = int(length / self.speed * self.rate)
        wanted = travel[-1] - self.speed / self.rate * np.arange(count)[::-1]
        s, w = np.interp(wanted, travel, fine), np.interp(wanted, travel, swing)
        c, d = np.cos(self.heading), np.sin(self.heading)
        return surface.at(c * s - d * w, d * s + c * w)


def add_noise(
        points: np.ndarray, normals: np.ndarray, rng: np.random.Generator, *,
        position: float = 2e-5, normal: float = 5e-4, location: float = 1.5e-4,
        finger_radius: float = 0.0, alike: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """
    Return contacts as reported by a robot with a tactile pad.

    Parameters
    ----------
    points, normals : ndarray, shape (N, 3)
    rng : np.random.Generator
    position, normal, location : float
        Standard deviations per axis: of the robot's position [m], of the normal [rad] and of the
        contact on the pad [m].
    finger_radius : float
        A round finger derives its normal from the location, so their errors are coupled. 0 = flat
        [m].
    alike : float
        Contacts after which the correlation of errors has fallen to 1/e; 0: independent.

    Returns
    -------
    points, normals : ndarray, shape (N, 3)
    """
    def draw(std: float) -> np.ndarray:
        noise = rng.normal(0.0, std, points.shape)
        if alike:
            kept = np.exp(-1.0 / alike)
            noise[1:] *= np.sqrt(1.0 - kept**2)
            noise = lfilter([1.0], [1.0, -kept], noise, axis=0)
        return noise

    def tangential(std: float) -> np.ndarray:
        noise = draw(std)
        return noise - (noise * normals).sum(axis=1, keepdims=True) * normals

    slip = tangential(location)
    tilt = tangential(normal)
    robot = draw(position)
    if finger_radius:
        centre = points - finger_radius * normals
        turned = normals + tilt + slip / finger_radius
        turned /= np.linalg.norm(turned, axis=1, keepdims=True)
        return centre + finger_radius * turned + robot, turned
    turned = normals + tilt
    turned /= np.linalg.norm(turned, axis=1, keepdims=True)
    return points + slip + robot, turned
