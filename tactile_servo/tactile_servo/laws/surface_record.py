"""Record of the contacts with a surface during one goal."""
from dataclasses import dataclass, field
import math

import numpy as np

from tactile_servo.law import Touch
from tactile_servo.laws.surface_config import ProbeConfig
from tactile_servo.laws.surface_features import Felt
from tactile_servo.laws.surface_goal import SurfaceResult

TOUCH_SPACING = 2.5e-4  # m, least distance between the recorded contacts
LEAST_IMAGES = 20  # images of the whole print after which its mean area is accurate enough
AREA_WEIGHT = 0.02  # weight of the newest area in the running mean
# m^2, by which the area from an image is smaller than that from the pressure on the skin; computed
# by finite elements for the default probe
BLURRED_AREA = 2.0e-6


@dataclass
class Record:
    """Contacts measured during the whole goal."""

    probe: ProbeConfig
    touches: list[Touch] = field(default_factory=list)
    cycles: int = 0  # control cycles of tracking
    touching: int = 0  # those whose newest image shows a contact
    kept: int = 0  # recorded images with contact
    pressed: int = 0  # images with the whole print on the pad
    area: float = 0.0  # running mean of `Felt.area` [m^2]
    square: float = 0.0  # sum of the squared distances of the contact from its wanted place [m^2]

    def keep(self, stamp_ns: int, felt: Felt, off: float, normal: np.ndarray,
             whole: bool) -> Touch | None:
        """
        Record a contact, and return it if its position on the surface is accurate.

        `off` is the squared distance from its wanted place [m^2], `normal` (3,) the filtered
        inward normal. `whole` is True if the whole print is measured.
        """
        self.kept += 1
        self.square += off
        if not whole:
            return None
        self.pressed += 1
        self.area += max(AREA_WEIGHT, 1.0 / self.pressed) * (felt.area - self.area)
        if self.pressed < LEAST_IMAGES:
            return None
        # On an elastic foundation P = pi / 2 k d a b, with the half axes a and b of the patch. The
        # variances of its pressure are a^2 / 6 and b^2 / 6.
        indentation = felt.force / (3.0 * math.pi * self.probe.modulus
                                    * (self.area + BLURRED_AREA))
        point = felt.centre + (self.probe.skin_radius - indentation) * normal
        touch = Touch(stamp_ns, point, normal.copy())
        if not self.touches or np.linalg.norm(point - self.touches[-1].point) >= TOUCH_SPACING:
            self.touches.append(touch)
        return touch

    def result(self) -> SurfaceResult:
        """Return the recorded contacts."""
        if not self.touches:
            return SurfaceResult()
        _, points, normals = zip(*self.touches, strict=True)
        return SurfaceResult(
            contour=np.array(points), normals=np.array(normals),
            contact_kept=self.touching / max(self.cycles, 1),
            centre_rms=math.sqrt(self.square / max(self.kept, 1)))
