"""One tactile image, made ready for estimation, and what is said when it cannot be explained."""

from dataclasses import dataclass

import numpy as np

from tactile_sensing.array import TactelArray
from tactile_sensing.contact import Contact, Reason
from tactile_sensing.moments import Moments


@dataclass(frozen=True, eq=False)
class Frame:
    """
    Conditioned image and what is known of it.

    Attributes
    ----------
    pressure : ndarray, shape (rows, columns)
        First normal layer [Pa]; NaN where a tactel is invalid.
    stress : ndarray, shape (layers, rows, columns)
        Every layer [Pa].
    layers : tuple of point_fit.Layer
        Component, depth and noise of each.
    array : TactelArray
    depth, noise : float
        Of the first normal layer [m, Pa].
    moments : Moments
        Of the first normal layer.
    left_out : Reason
        What the estimate does not use; not a refusal.
    """

    pressure: np.ndarray
    stress: np.ndarray
    layers: tuple
    array: TactelArray
    depth: float
    noise: float
    moments: Moments
    left_out: Reason

    def refuse(self, method, kind, reasons, **known):
        """Return an estimate that is not valid, with its reasons."""
        return Contact(kind, False, Reason(reasons) | self.left_out, method,
                       moments=self.moments, **known)
