"""Noise of one tactel, from a single picture, where nobody tells it; all compiled."""

import math

import numpy as np

from tactile_common.kernels import njit

# To a neighbour: rows and columns. Edges of any angle run within some degrees of one of them.
DIRECTIONS = (0, 1), (1, 0), (1, 1), (1, -1), (1, 2), (2, 1), (1, -2), (2, -1)
FEWEST = 9  # second differences that tell noise
OF_NOISE = 0.6745 * math.sqrt(6.0)  # median absolute second difference of noise of 1
PARAMETERS = 5  # of a load without extras
LESS = 0.9  # of what was taken for noise: worth another fit
LEAST, TINY = 1e-6, 1e-37  # of the peak, Pa: noise is never 0


@njit(error_model='numpy')
def _second_differences(image, dr, dc, n, second):
    """Absolute second differences in a direction, behind n others; how many there are then."""
    side = abs(dc)
    for r in range(dr, image.shape[0] - dr):
        for c in range(side, image.shape[1] - side):
            value = image[r - dr, c - dc] + image[r + dr, c + dc] - 2.0 * image[r, c]
            if np.isfinite(value):
                second[n] = abs(value)
                n += 1
    return n


@njit(error_model='numpy')
def noise_from_image(pressure):
    """
    Noise of one tactel, from the picture alone [Pa]; NaN if no tactel is left.

    Median absolute second difference, in the direction where it is least: an edge is smooth along
    itself. On few tactels a contact's own curvature makes it too large, see `measure_noise`.
    """
    second, best = np.empty(pressure.size), np.nan
    for dr, dc in DIRECTIONS:
        n = _second_differences(pressure, dr, dc, 0, second)
        if n > 0:
            level = np.median(second[:n]) / OF_NOISE
            best = level if np.isnan(best) else min(best, level)
    return best


@njit(error_model='numpy')
def _noise_left(left, censored):
    """
    Noise of one tactel [Pa], from what a load leaves; infinite where too little is left.

    Median absolute second difference in all directions: of what a wrong load leaves they see
    less than chi-square does.
    """
    rest, live = left.copy(), 0
    for i in range(rest.size):
        if censored.flat[i]:
            rest.flat[i] = np.nan
        live += np.isfinite(rest.flat[i])
    second, n = np.empty(len(DIRECTIONS) * rest.size), 0
    for dr, dc in DIRECTIONS:
        n = _second_differences(rest, dr, dc, n, second)
    if n < FEWEST or live <= PARAMETERS:
        return np.inf
    return np.median(second[:n]) / OF_NOISE * np.sqrt(live / (live - PARAMETERS))


@njit(error_model='numpy')
def _hidden_noise(floor, below, above):
    """
    Noise that leaves so many tactels below a floor above 0, at most [Pa]; inf if there are few.

    Those above are what noise has raised of a pad without any load, or fewer.
    """
    share, low, high = above / max(below + above, 1), 0.0, 10.0
    if not (floor > 0.0 and share < 0.5):
        return np.inf
    for _ in range(40):  # bisection of share = Q(z)
        z = 0.5 * (low + high)
        if 0.5 * math.erfc(0.7071067811865476 * z) > share:
            low = z
        else:
            high = z
    return floor / high


@njit(error_model='numpy')
def noise_of(image, given, floor, censored):
    """Noise of a layer [Pa]: as given, or as it shows; never 0, not even of a perfect picture."""
    noise = given
    if not noise > 0.0:
        seen, below, live = image.copy(), 0, 0
        for i in range(seen.size):
            live += np.isfinite(seen.flat[i])
            if censored.flat[i]:
                seen.flat[i] = np.nan
                below += 1
        noise = noise_from_image(seen)
        if below > 0:
            noise = min(noise, _hidden_noise(floor, below, live - below))
    largest = 0.0
    for value in image.flat:
        if abs(value) > largest:  # false for NaN
            largest = abs(value)
    least = max(LEAST * largest, TINY)
    return max(noise, least) if np.isfinite(noise) else least


@njit(error_model='numpy')
def measure_noise(layers, memory):
    """
    Noise that the load leaves, where nobody tells it, if it is the least so far.

    What a patch or an end would explain is not noise, also where it is too weak to be kept.
    """
    noise = math.sqrt(1.0 - memory.state[0].unexplained)
    for k in range(layers.size):
        if not layers[k].given_noise > 0.0:
            left = max(noise * _noise_left(memory.left[k], memory.censored[k]),
                       LEAST * np.abs(memory.model[k]).max(), TINY)
            memory.noise[k] = min(memory.noise[k], left)


@njit(error_model='numpy')
def lower_noise(layers, left):
    """Take a noise that a load has left, where it is told by the picture; whether it is less."""
    lower = False
    for k in range(layers.size):
        if not layers[k].given_noise > 0.0 and left[k] < LESS * layers[k].noise:
            layers[k].noise, lower = left[k], True
    return lower
