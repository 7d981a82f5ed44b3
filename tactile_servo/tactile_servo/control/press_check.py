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


def most_unfelt(force: float) -> float:
    """Return the largest allowed unfelt force [N] when a force [N] is wanted."""
    return UNFELT_SHARE * force + UNFELT


def doubted(unfelt: float, force: float) -> bool:
    """Return whether an `unfelt` force [N] prevents the success of a goal of a force [N]."""
    return unfelt > DOUBTED * most_unfelt(force)


class PressCheck:
    """
    Computes how much deeper a pad has moved than the indentations in its images explain.

    The object is rigid, so the indentation must change by the motion along the normal. If images
    show a smaller change, the sensor has lost gain, or the object gives way. The differences are
    summed (CUSUM), in any fixed frame: `unexplained` [m]. The median of the last sums is used, so
    that one or two images with a wrong indentation or stamp have no effect.
    """

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Start again with the next image, because the object may be deeper from here on."""
        self.unexplained, self._least, self._met = 0.0, math.inf, False
        self._last: tuple[np.ndarray, np.ndarray, float] | None = None
        self._sums: deque[float] = deque([0.0], maxlen=IMAGES)

    def see(self, place: np.ndarray, normal: np.ndarray, indentation: float,
            met: bool = True) -> None:
        """
        Process the indentation [m] in an image, and the position (3,) of the pad [m].

        The unit normal (3,) points in the direction of pressing. The sum begins when the force
        was `met` once, because a lightly pressed skin is softer.
        """
        if self._last is not None:
            last_place, last_normal, last_indentation = self._last
            way = place - last_place
            deeper = 0.5 * float((normal + last_normal) @ way) - (indentation - last_indentation)
            # With an error of the normal, the depth seems to grow along the edge.
            self._sums.append(
                self._sums[-1] + deeper - SLOPE_ERROR * float(np.linalg.norm(way)))
        self._last = place, normal, indentation
        if len(self._sums) == IMAGES:
            hidden = sorted(self._sums)[IMAGES // 2]
            self._least = min(self._least, hidden) if self._met else hidden
            self._met = self._met or met
            self.unexplained = hidden - self._least
