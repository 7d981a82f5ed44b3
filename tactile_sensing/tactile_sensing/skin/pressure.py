"""Pressure at the tactels under point and line loads, on a skin with or without a backing."""

from dataclasses import dataclass, field
import math

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_sensing.skin.kernel import CENTRE, LARGEST_SIDE, MAX_VARIANCE, polynomials
from tactile_sensing.types.skin import Skin

MOST_SQUARES = 24  # along a tactel; each costs as much time as a tactel that samples a point
POINT, LINE, LINE_TURNED = range(3)  # rows of `polynomials`


def split_tactel(pitch_x: float, pitch_y: float, depth: float) -> tuple[float, np.ndarray]:
    """
    Split a rectangular tactel into squares of equal weight.

    Returns
    -------
    side : float
        Side of the squares [m], at most LARGEST_SIDE depths.
    centres : ndarray, shape (N, 2)
        Their centres, from the centre of the rectangle [m].

    Raises
    ------
    ConfigurationError
        If the rectangle is longer than MOST_SQUARES squares of the largest side.
    """
    largest = LARGEST_SIDE * depth
    if max(pitch_x, pitch_y) > MOST_SQUARES * largest:
        raise ConfigurationError(
            f'pitch is {max(pitch_x, pitch_y):g} m, must be at most {MOST_SQUARES * largest:g} m '
            f'for tactels that average over it at a depth of {depth:g} m')
    counts = [max(math.ceil(pitch / largest - 1e-9), 1) for pitch in (pitch_x, pitch_y)]
    sides = [pitch / count for pitch, count in zip((pitch_x, pitch_y), counts, strict=True)]
    side = min(sides)
    axes = []
    for count, length in zip(counts, sides, strict=True):
        middles = (np.arange(count) - 0.5 * (count - 1)) * length
        rest = math.sqrt(max(length**2 - side**2, 0.0) / 12.0)  # two points with the same variance
        axes.append(middles if rest < 1e-3 * side else np.add.outer(
            middles, (-rest, rest)).ravel())
    x, y = np.meshgrid(*axes)
    return side, np.stack([x.ravel(), y.ravel()], -1)


@dataclass(frozen=True)
class SkinPressure:
    """
    Pressure at tactels of a given size in a skin [Pa], compression positive.

    Places, loads and signs are those of `thesis.line`; a point has shear along x and y.
    """

    skin: Skin
    size_x: float = 0.0  # of a tactel [m]; 0: it samples a point
    size_y: float = 0.0
    _nodes: np.ndarray = field(init=False, repr=False, compare=False)
    _coefficients: np.ndarray = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        side, nodes = 0.0, np.zeros((1, 2))
        if self.size_x > 0.0 and self.size_y > 0.0:
            side, nodes = split_tactel(self.size_x, self.size_y, self.skin.depth)
        object.__setattr__(self, '_nodes', nodes)
        object.__setattr__(self, '_coefficients', polynomials(self.skin, side))

    def point(self, x: np.ndarray, y: np.ndarray, a: float, b: float, normal_force: float,
              shear_x: float = 0.0, shear_y: float = 0.0, radius: float = 0.0) -> np.ndarray:
        """
        Return the pressure [Pa] under a point load or a Hertz patch.

        `radius` of the patch [m] is at most 1.5 depths; 0: a point. Forces are in N.
        """
        return self.point_basis(x, y, a, b, radius) @ np.array([normal_force, shear_x, shear_y])

    def point_basis(self, x: np.ndarray, y: np.ndarray, a: float | np.ndarray,
                    b: float | np.ndarray, radius: float | np.ndarray = 0.0) -> np.ndarray:
        """
        Return the pressure per unit of normal force, shear x and shear y, shape (..., 3) [Pa/N].

        a, b and radius may be arrays that broadcast with x and y.
        """
        parts: list = [0.0, 0.0, 0.0]
        for dx, dy in self._nodes:
            u, v = x + dx - a, y + dy - b
            f, g = self._kernel(self._coefficients[POINT], 2, u * u + v * v, radius**2 / 5.0)
            parts = [part + new for part, new in zip(parts, (f, u * g, v * g), strict=True)]
        return np.stack(parts, axis=-1) / len(self._nodes)

    def line(self, x: np.ndarray, y: np.ndarray, rho: float, yaw: float, line_force: float,
             line_shear: float = 0.0, half_width: float = 0.0) -> np.ndarray:
        """
        Return the pressure [Pa] under a line load or a strip with a half ellipse of pressure.

        `half_width` of the strip [m] is at most 1.34 depths; 0: a line. Forces are in N/m.
        """
        coefficients = self._coefficients[LINE] + np.cos(
            4.0 * yaw) * self._coefficients[LINE_TURNED]
        total: np.ndarray | float = 0.0
        for dx, dy in self._nodes:
            v = (x + dx) * np.cos(yaw) + (y + dy) * np.sin(yaw) - rho
            f, g = self._kernel(coefficients, 1, v * v, half_width**2 / 4.0)
            total = total + line_force * f + line_shear * v * g
        return np.asarray(total) / len(self._nodes)

    def _kernel(self, coefficients: np.ndarray, order: int, squared: np.ndarray,
                variance: float | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        depth = self.skin.depth
        t = CENTRE**2 / (squared / depth**2 + CENTRE**2)
        relative = np.minimum(variance / depth**2, MAX_VARIANCE)
        relative = np.reshape(relative, (1,) * (t.ndim - np.ndim(relative)) + np.shape(relative))
        coefficients = np.polynomial.polynomial.polyval(relative, coefficients)
        f, g = np.polynomial.polynomial.polyval(t, coefficients.swapaxes(0, 1), tensor=False)
        scale = depth**-order
        return f * scale, g * scale / depth
