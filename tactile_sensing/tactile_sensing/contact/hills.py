"""Whether a picture shows two contacts, told by the picture alone: two hills; all compiled."""

import numpy as np

from tactile_common.kernels import njit
from tactile_sensing.contact.initial_guess import is_spike
from tactile_sensing.contact.outliers import may_be_contact
from tactile_sensing.contact.preprocessing import DETECTION
from tactile_sensing.half_space.layers import first_pressure_layer

SECOND_HILL = 0.05  # of the highest, that the lower of two has at least
VALLEY = 0.735  # of the lower hill, that is left between two (Rayleigh's criterion)


@njit(error_model='numpy')
def _tops(image, least, tops):
    """Flat indices of tactels above a limit that none around is higher than; their number."""
    count = 0
    for r in range(image.shape[0]):
        for c in range(image.shape[1]):
            value = image[r, c]
            is_top = value > least  # false for NaN
            for i in range(max(r - 1, 0), min(r + 2, image.shape[0])):
                for j in range(max(c - 1, 0), min(c + 2, image.shape[1])):
                    is_top = is_top and not image[i, j] > value
            if is_top:
                tops[count] = r * image.shape[1] + c
                count += 1
    return count


@njit(error_model='numpy')
def _are_linked(image, start, goal, level, waiting):
    """Whether tactels of a level and more, or unknown, lead from one to another (flat indices)."""
    rows, columns = image.shape
    seen, count = np.zeros(image.size, np.bool_), 1
    waiting[0], seen[start] = start, True
    while count > 0:
        count -= 1
        if waiting[count] == goal:
            return True
        row, column = divmod(waiting[count], columns)
        for r in range(max(row - 1, 0), min(row + 2, rows)):
            for c in range(max(column - 1, 0), min(column + 2, columns)):
                at = r * columns + c
                if not (seen[at] or image[r, c] < level):  # true for NaN
                    seen[at], waiting[count] = True, at
                    count += 1
    return False


@njit(error_model='numpy')
def _has_two_hills(image, noise, tops, waiting):
    """Whether a valley that is deeper than noise makes one parts a hill from the highest."""
    count, highest = _tops(image, DETECTION * noise, tops), -1
    for at in tops[:count]:
        if highest < 0 or image.flat[at] > image.flat[highest]:
            highest = at
    for at in tops[:count]:
        value = image.flat[at]
        level = min(VALLEY * value, value - DETECTION * noise)
        if value > SECOND_HILL * image.flat[highest] and not _are_linked(
                image, at, highest, level, waiting):
            return True
    return False


@njit(error_model='numpy')
def has_second_hill(stress, sensor, layers):
    """
    Whether the pressure has two hills, as it is or as means over 3x3 tactels.

    The means show weak hills, the tactels narrow ones. A single tactel that stands out as no load
    under a skin makes it is none.
    """
    main = first_pressure_layer(layers)
    image, layer = stress[main].copy(), layers[main]
    tops, waiting = np.empty(image.size, np.int64), np.empty(image.size, np.int64)
    for at in tops[:_tops(image, DETECTION * layer.noise, tops)]:
        row, column = divmod(at, image.shape[1])
        found, known = may_be_contact(image, row, column, sensor, layer)
        if (known and not found) or is_spike(image, row, column):
            image[row, column] = np.nan
    if _has_two_hills(image, layer.noise, tops, waiting):
        return True
    means = np.empty(image.shape)
    for r in range(image.shape[0]):
        for c in range(image.shape[1]):
            means[r, c] = np.nanmean(image[max(r - 1, 0):r + 2, max(c - 1, 0):c + 2])
    return _has_two_hills(means, layer.noise / 3.0, tops, waiting)
