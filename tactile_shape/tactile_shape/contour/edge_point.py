"""The point of an edge under the pad, from the ridge in its picture: bends, corners, ends."""

from tactile_sensing.contact.ridge import ridge_points
from tactile_sensing.types.image import TactileImage

STRAIGHT = 0.5  # quality from which a ridge point is of a line, not of a round spot
FEWEST = 3  # of them that make an edge
END = 0.5  # of the pressure along an edge is left where it ends


def edge_point(image: TactileImage) -> tuple[float, float] | None:
    """
    Point of an edge under the pad that is nearest to the pad's centre.

    Parameters
    ----------
    image : tactile_sensing.types.image.TactileImage

    Returns
    -------
    (float, float) or None
        x, y [m]; None where the picture shows no edge, or is no tared pressure.
    """
    layer = next((layer for layer in image.layers if layer.component == 'zz'), None)
    if layer is None or layer.unit != 'Pa' or not layer.depth > 0.0 or not image.tared:
        return None
    points = ridge_points(layer.stress, image.array, float(layer.noise_std), layer.depth)
    points = points[(points[:, 5] > STRAIGHT) & (points[:, 4] > END * points[:, 4].max(initial=0))]
    if len(points) < FEWEST:
        return None
    # One point of a ridge is good for a hundredth of a millimetre at 40 dB: it needs no mean,
    # which would take in the turn of a corner nearby.
    place, way = points[(points[:, :2]**2).sum(axis=1).argmin()][:4].reshape(2, 2)
    along = place @ way
    if abs(along) < max(image.array.pitch_x, image.array.pitch_y):  # else the edge ends there
        place = place - along * way
    return float(place[0]), float(place[1])
