"""What a goal has achieved so far: length, errors, contour."""

import numpy as np

SETTLING_LENGTH = 0.01  # m after first contact that the error statistics leave out
CONTOUR_SPACING = 0.001  # m between poses of the contour


class TrackStatistics:
    """
    Running statistics of one goal, from measured poses and contacts.

    Parameters
    ----------
    force : float
        Set-point of the normal force [N].
    direction : int
        +1 or -1 along the sensor's y.

    Attributes
    ----------
    length : float
        Way of the sensor since first contact [m].
    force_max : float
        Largest measured force [N].
    contour : list of (int, ndarray)
        Stamp [ns] of the image and pose (4, 4) of the sensor in the base frame, moved onto
        the edge.
    """

    def __init__(self, force, direction):
        self.force, self.direction = force, direction
        self.length = 0.0
        self.force_max = 0.0
        self.lateral_max = 0.0
        self.contour = []
        self._touched = False
        self._last_position = None
        self._last_stamp = None
        self._contour_length = -np.inf
        self._count = 0
        self._lateral_square = self._force_square = 0.0

    def touch(self):
        """First contact: lengths count from here."""
        self._touched = True

    def move(self, pose, tracking):
        """Take the measured pose of the sensor (4, 4); the way counts while tracking."""
        position = pose[:3, 3]
        if self._touched and tracking and self._last_position is not None:
            # Along the edge only: the way across it, the sensor's x and z, is correction.
            way = float((position - self._last_position) @ pose[:3, 1])
            self.length += self.direction * way
        self._last_position = position.copy()

    def see(self, features, pose, stamp_ns):
        """Take the features of one image, once."""
        if stamp_ns == self._last_stamp:
            return
        self._last_stamp = stamp_ns
        self.force_max = max(self.force_max, features.force)
        if self.length >= self._contour_length + CONTOUR_SPACING:
            on_edge = pose.copy()
            on_edge[:3, 3] += pose[:3, 0] * features.lateral
            self.contour.append((stamp_ns, on_edge))
            self._contour_length = self.length
        if self.length >= SETTLING_LENGTH:
            self._count += 1
            self._lateral_square += features.lateral**2
            self._force_square += (features.force - self.force)**2
            self.lateral_max = max(self.lateral_max, abs(features.lateral))

    @property
    def lateral_rms(self):
        """RMS of the measured lateral error after settling [m]; NaN before."""
        return float(np.sqrt(self._lateral_square / self._count)) if self._count else np.nan

    @property
    def force_rms_error(self):
        """RMS of measured force - set-point after settling [N]; NaN before."""
        return float(np.sqrt(self._force_square / self._count)) if self._count else np.nan
