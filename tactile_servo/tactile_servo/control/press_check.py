"""Check that the forces from images agree with the depth to which the pad was pressed."""

from collections import deque
import math

import numpy as np

# Largest allowed unfelt force: a share of the wanted force, and a constant part [N]
UNFELT_SHARE, UNFELT = 0.3, 1.5
DOUBTED = 0.5  # share of the largest allowed unfelt force above which no goal succeeds
IMAGES = 5  # number of images whose median is used
# Allowed growth of the depth per distance along the edge [m/m], for an error of the normal
SLOPE_ERROR = 0.002
# Share of the drift's variation that its growth along the way explains if it comes from a tilt
STEADY = 0.8
SEEN = 0.01  # ratio of mean squares of two ways above which growth along both is known


def most_unfelt(force: float) -> float:
    """Return the largest allowed unfelt force [N] when a force [N] is wanted."""
    return UNFELT_SHARE * force + UNFELT


def most_doubted(force: float) -> float:
    """Return the largest unfelt force [N] with which a goal of a force [N] may succeed."""
    return DOUBTED * most_unfelt(force)


class PressCheck:
    """
    Computes how much deeper a pad has moved than the indentations in its images explain.

    The object is rigid, so the indentation must change by the motion along the normal. If images
    show a smaller change, the sensor has lost gain, or the object gives way. The differences are
    summed (CUSUM), in any fixed frame: `unexplained` [m]. The median of the last sums is used, so
    that one or two images with a wrong indentation or stamp have no effect.

    A sensor that is mounted with a tilt against its frame shows such a difference too, in
    proportion to its way. `learn` finds the tilt, for a sensor that a test then proves.
    """

    def __init__(self) -> None:
        self._growth = np.zeros(2)  # of the depth per way along x, y of the pad, by a tilt [m/m]
        self.forget()

    @property
    def tilt(self) -> np.ndarray:
        """Rotation (2,) about x, y by which the sensor seems to be mounted [rad]."""
        return np.array([self._growth[1], -self._growth[0]])

    def forget(self) -> None:
        """Start again with the next image, because the object may be deeper from here on."""
        self.unexplained, self._least, self._met = 0.0, math.inf, False
        self.drift, self._start = 0.0, 0.0  # sum of the differences since the force was met [m]
        self.path, self.way = 0.0, np.zeros(2)  # since then; along x, y of the pad [m]
        # Sums over the path of the products of x, y and drift, for a regression of the drift
        self._products = np.zeros((3, 3))
        self._last: tuple[np.ndarray, np.ndarray, float] | None = None
        self._sums: deque[float] = deque([0.0], maxlen=IMAGES)

    @property
    def steady(self) -> bool:
        """Whether the drift grows with the way, as with a tilt; on a rim it comes at once."""
        explained = self._growth_along_way() @ self._products[:2, 2]
        return bool(explained > STEADY * self._products[2, 2])

    def _growth_along_way(self) -> np.ndarray:
        return np.linalg.lstsq(self._products[:2, :2], self._products[:2, 2], SEEN)[0]

    def learn(self) -> None:
        """Explain a steady drift by a tilt of the sensor, and start again."""
        if self.steady:
            self._growth += self._growth_along_way()
        self.forget()

    def see(self, pose: np.ndarray, place: np.ndarray, normal: np.ndarray, indentation: float,
            met: bool = True) -> None:
        """
        Process the indentation [m] in an image at a pose (4, 4), and the pad's position (3,) [m].

        The unit normal (3,) points in the direction of pressing. The sum begins when the force
        was `met` once, because a lightly pressed skin is softer.
        """
        step = 0.0
        if self._last is not None:
            last_place, last_normal, last_indentation = self._last
            way = place - last_place
            own = pose[:3, :2].T @ way
            deeper = (0.5 * float((normal + last_normal) @ way) - float(self._growth @ own)
                      - (indentation - last_indentation))
            self._sums.append(self._sums[-1] + deeper)
            step = float(np.linalg.norm(way))
            self.path, self.way = self.path + step, self.way + own
        self._last = place, normal, indentation
        if len(self._sums) < IMAGES:
            return
        present = sorted(self._sums)[IMAGES // 2]
        if not self._met:
            self._start = self._least = present
            self.path, self.way, self._products = 0.0, np.zeros(2), np.zeros((3, 3))
        # With an error of the normal, the depth seems to grow along the edge.
        hidden = present - SLOPE_ERROR * self.path
        self._least = min(self._least, hidden)
        self._met = self._met or met
        self.drift, self.unexplained = present - self._start, hidden - self._least
        row = np.array([*self.way, self.drift])
        self._products += step * np.outer(row, row)
