"""Check that the rows and columns of images have the order that the sensor's frame says."""

import math

import numpy as np

from tactile_sensing.types.contact import Contact, ContactType
from tactile_servo.edge_map.picture import PadScale
from tactile_servo.reasons import Reason, ReasonCode

STEP = 0.25  # grains, motion of the pad across an edge after which two images are compared
ALONG = 2.0  # largest way along the edge, relative to that motion: the edge may be curved
MOVED = 1.0  # grains^2, sum of squares above which the edge has moved in the base frame
BETTER = 0.25  # share of that sum below which another order explains the images
# Each order of the images, with the signs of a line's offset and yaw in them.
ORDERS = {'as stated': (1.0, 1.0), 'columns reversed': (-1.0, -1.0), 'rows reversed': (1.0, -1.0),
          'rows and columns reversed': (-1.0, 1.0)}


class ImageOrder:
    """
    Compares how an edge moves in images with how the pad moves.

    The edge is at rest in the base frame. If the columns are reversed, it seems to move by twice
    the motion of the pad across it, and is at rest with the images reversed. While it stays in the
    middle of the pad, all orders are alike.
    """

    def __init__(self) -> None:
        self._moved = [0.0] * len(ORDERS)  # sums of squares of the edge's motion [grains^2]
        # Pose (4, 4) of the pad, offset [m] and yaw [rad] of the line that it saw there
        self._last: tuple[np.ndarray, float, float] | None = None

    def see(self, contact: Contact, pose: np.ndarray | None, scale: PadScale) -> None:
        """Process a contact, and the pad's pose (4, 4) in the base frame at its stamp."""
        if pose is None or not contact.valid or contact.type != ContactType.LINE:
            self._last = None  # what follows may be another edge
            return
        if self._last is not None:
            last_pose, last_offset, last_yaw = self._last
            x, y = last_pose[:3, :2].T @ (pose[:3, 3] - last_pose[:3, 3])
            turn = math.atan2(*(last_pose[:3, 1] @ pose[:3, :2]))
            across = math.hypot(x, scale.half * turn)
            if max(across, abs(y) / ALONG) < STEP * scale.grain:
                return
            if abs(y) < ALONG * across:
                for k, (side, sense) in enumerate(ORDERS.values()):
                    yaw = sense * last_yaw
                    aside = side * (contact.offset - last_offset) + (
                        x * math.cos(yaw) + y * math.sin(yaw))
                    askew = scale.half * math.sin(sense * contact.yaw - yaw + turn)
                    self._moved[k] += (aside**2 + askew**2) / scale.grain**2
        self._last = pose, contact.offset, contact.yaw

    def problem(self) -> Reason | None:
        """Return which orders explain the images if the stated one does not, or None."""
        stated = self._moved[0]
        names = [name for name, moved in zip(ORDERS, self._moved, strict=True)
                 if moved < BETTER * stated]
        if stated <= MOVED or not names:
            return None
        return Reason(ReasonCode.WRONG_ORDER, f"their order seems to be {' or '.join(names)}")
