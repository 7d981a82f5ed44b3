"""Point of an edge under the pad, from the ridge in its image; also at bends, corners, ends."""
import math

import numpy as np

from tactile_sensing.contact.ridge import ridge_points
from tactile_sensing.types.image import TactileImage

QUALITY = 0.5  # smallest quality of a ridge point on a line; on a round spot it is less
FEWEST = 3  # smallest number of such points that show an edge
END = 0.5  # share of the pressure along an edge that remains at its end


def edge_point(image: TactileImage) -> tuple[float, float] | None:
    """
    Return the point x, y [m] of an edge that is nearest to the pad's centre.

    Returns None if the image shows no edge or is not a tared pressure.
    """
    layer = next((layer for layer in image.layers if layer.component == 'zz'), None)
    if layer is None or layer.unit != 'Pa' or not layer.depth > 0.0 or not image.tared:
        return None
    points = ridge_points(layer.stress, image.array, float(layer.noise_std), layer.depth)
    peak = points['pressure'].max(initial=0)
    strong = points[(points['quality'] > QUALITY) & (points['pressure'] > END * peak)]
    if len(strong) < FEWEST:
        return None
    # One ridge point is accurate to a hundredth of a millimetre at 40 dB. A mean is not needed,
    # and would include the turn of a nearby corner.
    nearest = strong[(strong['x']**2 + strong['y']**2).argmin()]
    x, y, tx, ty = (float(nearest[name]) for name in ('x', 'y', 'tx', 'ty'))
    along = -(x * tx + y * ty)  # to the point of the line nearest to the centre
    if along < 0.0:
        along, tx, ty = -along, -tx, -ty
    ahead = (points['x'] - x) * tx + (points['y'] - y) * ty
    onward = np.argsort(ahead)[np.count_nonzero(ahead <= 0.0):]
    along = min(along, _reach(
        ahead[onward], points['pressure'][onward], nearest['pressure'],
        END * np.median(strong['pressure']), max(image.array.pitch_x, image.array.pitch_y)))
    return x + along * tx, y + along * ty


def _reach(ahead: np.ndarray, pressures: np.ndarray, here: float, half: float,
           pitch: float) -> float:
    """Return how far a ridge continues [m]: until its pressure is half, or the ridge ends."""
    reach = 0.0
    for place, pressure in zip([*ahead, math.inf], [*pressures, 0.0], strict=True):
        if place - reach > 2.0 * pitch:
            place, pressure = reach + pitch, 0.0
        if pressure < half:
            return reach + (place - reach) * max(here - half, 0.0) / (here - pressure)
        reach, here = place, pressure
    return reach
