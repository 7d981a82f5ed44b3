"""The point of an edge under the pad, from the ridge in its picture: bends, corners, ends."""
from tactile_sensing.contact.ridge import ridge_points
from tactile_sensing.types.image import TactileImage

STRAIGHT = 0.5  # quality from which a ridge point is of a line, not of a round spot
FEWEST = 3  # of them that make an edge
END = 0.5  # of the pressure along an edge is left where it ends


def edge_point(image: TactileImage) -> tuple[float, float] | None:
    """
    Point x, y [m] of an edge under the pad that is nearest to the pad's centre.

    None where the picture shows no edge, or is no tared pressure.
    """
    layer = next((layer for layer in image.layers if layer.component == 'zz'), None)
    if layer is None or layer.unit != 'Pa' or not layer.depth > 0.0 or not image.tared:
        return None
    points = ridge_points(layer.stress, image.array, float(layer.noise_std), layer.depth)
    peak = points['pressure'].max(initial=0)
    points = points[(points['quality'] > STRAIGHT) & (points['pressure'] > END * peak)]
    if len(points) < FEWEST:
        return None
    # One point of a ridge is good for a hundredth of a millimetre at 40 dB: it needs no mean,
    # which would take in the turn of a corner nearby.
    point = points[(points['x']**2 + points['y']**2).argmin()]
    x, y = point['x'], point['y']
    along = x * point['tx'] + y * point['ty']
    if abs(along) < max(image.array.pitch_x, image.array.pitch_y):  # else the edge ends there
        x, y = x - along * point['tx'], y - along * point['ty']
    return float(x), float(y)
