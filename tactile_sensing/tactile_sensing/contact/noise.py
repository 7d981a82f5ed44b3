"""Estimate an unknown noise or full scale of the tactels from a single image; compiled."""

import math
from typing import Any

import numpy as np

from tactile_common.kernels import njit

# Steps to a neighbour: rows, columns. Any edge is parallel to one of them within some degrees.
DIRECTIONS = (0, 1), (1, 0), (1, 1), (1, -1), (1, 2), (2, 1), (1, -2), (2, -1)
OF_NOISE = 0.6745 * math.sqrt(6.0)  # median absolute second difference of unit noise
LEAST, TINY = 1e-6, 1e-37  # smallest noise: share of the peak, absolute [unit of the readings]
COARSE = 30  # with fewer steps of the converter up to the peak, rounding explains equal readings
# Fewer equal highest readings are due to rounding if its step is above this share of the noise.
CUT_OFF, FINE = 4, 0.25
LOADED, FINEST = 0.1, 1e-6  # shares of the peak: tactels that count; resolution of readings
# Rounding explains equal lowest readings if more than this share of the others is within NEAR of
# them. Of a load on a half-space a fifth and more is.
TAIL, NEAR = 0.1, 2.5  # share; steps of the converter
UNEVEN = 0.2  # with a larger deviation from multiples of a step, the step is smaller [steps]


@njit(cache=True, error_model='numpy')
def noise_of_image(image: np.ndarray, smooth: bool) -> float:
    """
    Estimate the noise of one tactel from second differences of three tactels in line.

    Parameters
    ----------
    image : ndarray, shape (rows, columns)
        NaN: no reading.
    smooth : bool
        True if the image contains the load: then the direction with the smallest differences is
        used, for instance along an edge. False for a residual: all directions are used together.
    """
    second, count, peak = np.empty(8 * image.size), 0, 0.0
    best: Any = np.inf
    for dr, dc in DIRECTIONS:
        begin, side = count, abs(dc)
        for r in range(dr, image.shape[0] - dr):
            for c in range(side, image.shape[1] - side):
                value = image[r - dr, c - dc] + image[r + dr, c + dc] - 2.0 * image[r, c]
                if np.isfinite(value):
                    second[count] = abs(value)
                    count += 1
        if smooth and count > begin:
            best = min(best, np.median(second[begin:count]))
    if not smooth and count > 0:
        best = np.median(second[:count])
    for value in image.flat:
        if abs(value) > peak:  # false for NaN
            peak = abs(value)
    least = max(LEAST * peak, TINY)
    return max(best / OF_NOISE, least) if np.isfinite(best) else least


@njit(error_model='numpy')
def noise_of_rounding(image: np.ndarray) -> float:
    """Return the noise of rounded readings: all of them differ by multiples of a step; or 0."""
    flat, step, peak = image.ravel(), np.inf, 0.0
    for value in flat:  # comparisons with NaN are false
        if abs(value) > peak:
            peak = abs(value)
    for i in range(flat.size - 1):
        size = abs(flat[i + 1] - flat[i])
        if FINEST * peak < size < step:
            step = size
    i = 0
    while i < flat.size - 1 and step > FINEST * peak:
        steps = (flat[i + 1] - flat[i]) / step
        off = abs(steps - np.rint(steps))
        i += 1
        if off > UNEVEN:  # Euclid's algorithm
            step, i = off * step, 0
    return step / math.sqrt(12.0) if FINEST * peak < step < np.inf else 0.0


@njit(error_model='numpy')
def _end_of_scale(image: np.ndarray, noise: float) -> tuple[bool, float]:
    """
    Return whether the highest readings are cut off, and how many steps of the converter lie below.

    Readings that are not cut off have as many just below their end as at it, due to noise and
    rounding. Without noise, symmetry makes other readings equal too.
    """
    unit = FINEST * np.nanmax(np.abs(image))
    readings = np.sort(np.rint(image.ravel() / unit))  # NaN at the end
    values, counts, kinds = np.empty(image.size), np.zeros(image.size), 0
    for value in readings:
        if np.isnan(value):
            break
        if kinds == 0 or value != values[kinds - 1]:
            values[kinds] = value
            kinds += 1
        counts[kinds - 1] += 1.0
    steps = values[1:kinds] - values[:kinds - 1]
    resolution, lowest, highest = np.inf, values[0], values[kinds - 1]
    if kinds > 1:
        resolution = steps.min()
    if counts[kinds - 1] < CUT_OFF and resolution > FINE * noise / unit:
        return False, 0.0
    near, most = 0.0, 0.0
    for k in range(kinds - 1):
        if values[k] >= highest - 2.0 * max(noise / unit, resolution):
            near += counts[k]
        if values[k] - lowest > LOADED * (highest - lowest):
            most = max(most, counts[k])
    if noise / unit <= np.median(steps):
        near = max(near, most)
    return counts[kinds - 1] > 2.0 * near, highest / resolution


@njit(error_model='numpy')
def hidden_scale(image: np.ndarray, noise: float) -> float:
    """Return the full scale of an image (rows, columns) if it is saturated, else infinity."""
    cut_off, steps = _end_of_scale(image, noise)
    # With few steps, rounding alone makes readings equal.
    return np.nanmax(image) if cut_off and steps >= COARSE else np.inf


@njit(error_model='numpy')
def hidden_floor(image: np.ndarray, noise: float) -> float:
    """
    Return the reading of an image (rows, columns) below which all are cut off, or -infinity.

    A sensor may suppress all below a threshold: a reading that is cut off is anything below the
    lowest of the others. A tail that rounding alone makes equal has many readings within two
    steps above.
    """
    low, step, lowest = np.nanmin(image), noise_of_rounding(image) * math.sqrt(12.0), np.inf
    above = near = 0
    for value in image.flat:  # comparisons with NaN are false
        above += value > low
        near += low < value < low + NEAR * step
        if low < value < lowest:
            lowest = value
    if near > TAIL * above or not _end_of_scale(-image, noise)[0]:
        return -np.inf
    return lowest - 0.5 * step
