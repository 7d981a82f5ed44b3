"""Check that the forces from images agree with the depth to which the pad was pressed."""

from collections import deque

import numpy as np

# Largest allowed unfelt force: a share of the wanted force, and a constant part [N]
UNFELT_SHARE, UNFELT = 0.3, 1.5
DOUBTED = 0.5  # share of the largest allowed unfelt force above which no goal succeeds
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
    summed (CUSUM), in any fixed frame: `unexplained` [m]. The median of three images is used, so
    that a single wrong image has no effect.
    """

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Start again with the next image, because the object may be deeper from here on."""
        self.unexplained, self._seen = 0.0, False
        self._place = self._normal = np.zeros(3)
        self._indentation = 0.0
        self._last: deque[tuple[np.ndarray, np.ndarray, float]] = deque(maxlen=3)

    def see(self, place: np.ndarray, normal: np.ndarray, indentation: float,
            met: bool = True) -> None:
        """
        Process the indentation [m] in an image, and the position (3,) of the pad [m].

        The unit normal (3,) points in the direction of pressing. The sum begins when the force
        was `met` once, because a lightly pressed skin is softer.
        """
        self._last.append((place, normal, indentation))
        if len(self._last) < 3:
            return
        place, normal, _ = self._last[1]
        indentation = sorted(depth for _, _, depth in self._last)[1]
        if self._seen:
            way = place - self._place
            deeper = 0.5 * float((normal + self._normal) @ way) - (indentation - self._indentation)
            # With an error of the normal, the depth seems to grow along the edge.
            deeper -= SLOPE_ERROR * float(np.linalg.norm(way))
            self.unexplained = max(self.unexplained + deeper, 0.0)
        self._seen = self._seen or met
        self._place, self._normal, self._indentation = place, normal, indentation
