"""Statistics of a goal: length, errors, contour."""

from collections.abc import Sequence

import numpy as np

from tactile_servo.types import TaskError

CONTOUR_SPACING = 0.001  # m, least travel between poses of the contour
SETTLING_LENGTH = 0.01  # m after first contact that the error statistics exclude
BESIDE = 0.1  # largest share of images beside the tracked feature for a success


class TrackStatistics:
    """Running statistics of one goal, from measured poses and contacts."""

    def __init__(self, force: float, near: float = np.inf):
        self.force = force  # set-point of the normal force [N]
        self._near, self._beside = near, 0  # lateral error above which an image is beside [m]
        self.length = 0.0  # travel since first contact, including searches and stops [m]
        self.tracked_length = 0.0  # `length` at the place where the edge was last followed [m]
        self.force_max = self.lateral_max = 0.0  # largest measured values [N], [m]
        # Stamps of images [ns] and poses (4, 4) of the sensor in the base, shifted onto the edge.
        self.contour: list[tuple[int, np.ndarray]] = []
        self._last_position: list[float] | None = None
        self._last_stamp: int | None = None
        self._contour_length = -np.inf
        self._count, self._on_edge = 0, True
        self._lateral_square = self._force_square = 0.0

    def move(self, pose: np.ndarray, heading: Sequence[float], on_edge: bool = True) -> None:
        """
        Process the measured pose of the sensor (4, 4) and its direction along the edge (3,).

        Travel that is not `on_edge` (a search or a stop) counts as tracked only after tracking
        has continued.
        """
        position = pose[:3, 3].tolist()
        if self._last_position is not None:
            # Only along the edge: motion across it is correction.
            self.length += sum((new - last) * along for new, last, along in zip(
                position, self._last_position, heading, strict=True))
        self._last_position, self._on_edge = position, on_edge
        if on_edge:
            self.tracked_length = self.length

    def interrupt(self) -> None:
        """Do not count the distance from here to the place where tracking continues."""
        self._last_position = None

    def see(self, error: TaskError, pose: np.ndarray, stamp_ns: int) -> None:
        """
        Process the error of one image, once.

        Off the edge, and before settling, it counts only for `force_max` and `contour`.
        """
        if stamp_ns == self._last_stamp:
            return
        self._last_stamp = stamp_ns
        self.force_max = max(self.force_max, error.force)
        if self.length >= self._contour_length + CONTOUR_SPACING:
            on_edge = pose.copy()
            on_edge[:3, 3] += pose[:3, 0] * error.lateral
            self.contour.append((stamp_ns, on_edge))
            self._contour_length = self.length
        if self._on_edge and self.length >= SETTLING_LENGTH:
            self._count += 1
            self._lateral_square += error.lateral**2
            self._force_square += (error.force - self.force)**2
            self.lateral_max = max(self.lateral_max, abs(error.lateral))
            self._beside += abs(error.lateral) > self._near

    def objection(self) -> str:
        """Return why the errors are no success, '' if they are one."""
        beside = self._beside / max(self._count, 1)
        return f"but {100.0 * beside:.0f} % of the images saw it beside the pad's centre" if (
            beside > BESIDE) else ''

    @property
    def lateral_rms(self) -> float:
        """RMS of the measured lateral error after settling [m]; NaN before."""
        return float(np.sqrt(self._lateral_square / self._count)) if self._count else np.nan

    @property
    def force_rms_error(self) -> float:
        """RMS of measured force - set-point after settling [N]; NaN before."""
        return float(np.sqrt(self._force_square / self._count)) if self._count else np.nan


def along_contour(nodes: np.ndarray, poses: list) -> list[tuple[int, np.ndarray]]:
    """
    Return stamps [ns] and poses (4, 4) on a reconstructed contour.

    Positions are the nodes (N, 3) of the contour in the base frame [m]. Orientation and stamp are
    those of the nearest of `poses`, which are stamps [ns] and poses (4, 4) of the sensor.
    """
    if not poses:
        return []
    places, contour = np.array([pose[:3, 3] for _, pose in poses]), []
    for node in nodes:
        stamp, pose = poses[((places - node)**2).sum(axis=1).argmin()]
        contour.append((stamp, np.block([[pose[:3, :3], node[:, None]], [pose[3:]]])))
    return contour
