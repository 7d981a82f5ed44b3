"""What a picture of the pressure tells by itself."""

import numpy as np

from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.moments import Moments


def image_moments(
        pressure: np.ndarray, array: TactelArray, *, threshold: float = 0.0) -> Moments:
    """
    Moments of a pressure image (rows, columns) [Pa]; NaN counts as zero.

    So do values below the threshold [Pa], the thesis' only preprocessing (3.5).
    """
    p = np.where(pressure >= threshold, pressure, 0.0) if threshold > 0.0 else np.nan_to_num(
        np.asarray(pressure, dtype=float))
    p = p * (array.pitch_x * array.pitch_y)
    by_column, by_row = p.sum(axis=0), p.sum(axis=1)
    x, y = array.x, array.y
    return Moments(
        m0=float(by_column.sum()), mx=float(by_column @ x), my=float(by_row @ y),
        mxx=float(by_column @ x**2), myy=float(by_row @ y**2), mxy=float(y @ p @ x))
