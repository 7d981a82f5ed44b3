"""Angle about its normal by which a sensor is mounted otherwise than its frame says."""

from collections import deque
import math

import numpy as np

UNTURNED = 1.0  # grains, way that the assumption of a sensor mounted as stated counts for
STEADY = 0.15  # grains, largest change of the pad's place beside the ridge within a step
IMAGES = 1000  # largest number of images of a step, if the pad does not move


class YawError:
    """
    Compares the direction of the ridge in images with the way of its point under the pad.

    The robot knows the pad's centre even if the images are turned about it. Along an edge,
    straight or curved, the point under it moves in the mean direction of the ridge. `angle` [rad]
    is how much the images must be turned for that. Steps are one `grain` long, the resolution of
    an image [m]; the mean over the images of a step is compared with that of the step before.
    """

    def __init__(self, grain: float) -> None:
        self.angle, self._grain = 0.0, grain
        self._aside, self._way = 0.0, UNTURNED * grain  # sums of the steps [m]
        self.forget()

    @property
    def turn(self) -> np.ndarray:
        """Rotation (4, 4) of images about the sensor's z."""
        cos, sin = math.cos(self.angle), math.sin(self.angle)
        return np.array([[cos, -sin, 0.0, 0.0], [sin, cos, 0.0, 0.0],
                         [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])

    def forget(self) -> None:
        """Start again with the next image, elsewhere."""
        self._last: tuple[complex, complex] | None = None  # mean place [m], direction
        self._images: deque[tuple[complex, complex, float]] = deque(maxlen=IMAGES)  # of this step

    def see(self, place: complex, direction: complex, left: float) -> None:
        """Process the ridge: place [m], direction in the image as it is, pad to the left [m]."""
        self._images.append((place, direction, left))
        if abs(place - self._images[0][0]) < self._grain:
            return
        places, directions, lefts = zip(*self._images, strict=True)
        if max(lefts) - min(lefts) > STEADY * self._grain:
            self.forget()
            return
        here, along = np.mean(places), np.mean(directions)
        if self._last is not None:
            heading = along + self._last[1]
            step = (here - self._last[0]) * heading.conjugate() / max(abs(heading), 1e-9)
            self._aside, self._way = self._aside + step.imag, self._way + step.real
            self.angle = self._aside / self._way
        self._last, self._images = (here, along), deque([self._images[-1]], IMAGES)
