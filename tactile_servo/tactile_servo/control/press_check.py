"""Whether what images tell of the force agrees with how deep the pad has been pressed."""

from collections import deque

import numpy as np


def most_unfelt(force: float) -> float:
    """Force [N] beyond what images tell, from which a pad presses too hard for a force [N]."""
    return 0.3 * force + 1.5


def doubted(unfelt: float, force: float) -> bool:
    """Whether so much `unfelt` force [N] makes a run with a force [N] no success."""
    return unfelt > 0.5 * most_unfelt(force)


class PressCheck:
    """
    How much deeper a pad was moved than the indentations that its images tell explain.

    What is touched is rigid, so the indentation changes as the pad moves along the normal. If
    images tell less, their sensor has lost gain, or what is touched gives way. A sum of the
    differences (CUSUM), in any one frame, of the median of three images: one that is wrong counts
    nothing.

    Attributes
    ----------
    unexplained : float
        That sum, as of the newest image [m].
    """

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Begin anew with the next image: what is touched may lie deeper from here on."""
        self.unexplained, self._seen = 0.0, False
        self._place = self._normal = np.zeros(3)
        self._indentation = 0.0
        self._last: deque[tuple[np.ndarray, np.ndarray, float]] = deque(maxlen=3)

    def see(self, place: np.ndarray, normal: np.ndarray, indentation: float,
            met: bool = True) -> None:
        """
        Take what an image tells of the indentation at a place (3,) [m].

        In direction of the unit normal (3,) it grows; square to that the pad is moved along what
        it touches. The sum begins once the force was `met`: a lightly pressed skin is softer.
        """
        self._last.append((place, normal, indentation))
        if len(self._last) < 3:
            return
        place, normal, _ = self._last[1]
        indentation = sorted(depth for _, _, depth in self._last)[1]
        if self._seen:
            way = place - self._place
            deeper = 0.5 * float((normal + self._normal) @ way) - (indentation - self._indentation)
            # An error of its slope makes the depth seem to grow along what is tracked.
            deeper -= 0.002 * float(np.linalg.norm(way))
            self.unexplained = max(self.unexplained + deeper, 0.0)
        self._seen = self._seen or met
        self._place, self._normal, self._indentation = place, normal, indentation
