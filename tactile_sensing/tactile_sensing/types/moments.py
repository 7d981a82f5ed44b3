"""Moments of the pressure on an array."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Moments:
    """Moments of the pressure about the centre of the array, compression positive."""

    m0: float  # [N]
    mx: float  # [N m]
    my: float
    mxx: float  # [N m^2]
    myy: float
    mxy: float

    @property
    def centre_of_pressure(self) -> tuple[float, float]:
        """Centroid (x, y) of the pressure [m]; NaN if the force is not positive."""
        if not self.m0 > 0.0:
            return np.nan, np.nan
        return self.mx / self.m0, self.my / self.m0

    def elongation(self) -> float:
        """
        Return the ratio of the principal second moments about the centroid, >= 1; NaN: no load.

        An edge across the pad has L^2 / (3 d^2), about 13 on a 25 mm pad under 2 mm of rubber. A
        point or a flat surface has 1.
        """
        x, y = self.centre_of_pressure
        if np.isnan(x):
            return np.nan
        cxx, cyy, cxy = self.mxx - x * self.mx, self.myy - y * self.my, self.mxy - x * self.my
        mean, spread = 0.5 * (cxx + cyy), np.hypot(0.5 * (cxx - cyy), cxy)
        return (mean + spread) / (mean - spread) if mean > spread else np.nan
