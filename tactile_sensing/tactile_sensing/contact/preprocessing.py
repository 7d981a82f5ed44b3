"""What is done to a frame before anything is fitted to it; all compiled."""

import numpy as np

from tactile_common.kernels import njit

IMPOSSIBLE = 1e12  # Pa; a tactel that reports more, or no number, is not read
CENSORED = 0.25  # share of exact zeros, with nothing below them, that shows a threshold
THRESHOLD_STD = 4.0  # standard deviations of noise at which a threshold is set (3.5)


@njit(error_model='numpy')
def noise_from_image(pressure):
    """
    Noise of one tactel, from the picture alone [Pa].

    Median absolute second difference, along the axis where it is smaller: an edge is
    smooth along itself. NaN tactels are left out; NaN if nothing is left.
    """
    rows, columns = pressure.shape
    second = np.empty(rows * columns)
    best = np.nan
    for axis in range(2):
        n = 0
        for r in range(1 - axis, rows - 1 + axis):
            for c in range(axis, columns - axis):
                value = (pressure[r - 1 + axis, c - axis] + pressure[r + 1 - axis, c + axis]
                         - 2.0 * pressure[r, c])
                if np.isfinite(value):
                    second[n] = abs(value)
                    n += 1
        if n > 0:
            level = np.median(second[:n]) / (0.6745 * np.sqrt(6.0))
            best = level if np.isnan(best) else min(best, level)
    return best


@njit(error_model='numpy')
def drop_unusable(image, full_scale, both_signs):
    """
    Set to NaN, in place, what cannot be read: impossible, saturated or thresholded away.

    Returns
    -------
    missing, saturated : int
        Tactels without a possible number, and at full scale.
    threshold : float
        Least value above the zeros that were dropped [Pa]; 0 if none were.
    """
    missing = saturated = zeros = live = 0
    negative = False
    least = largest = 0.0
    for r in range(image.shape[0]):
        for c in range(image.shape[1]):
            value = image[r, c]
            if not abs(value) < IMPOSSIBLE:
                image[r, c] = np.nan
                missing += 1
            elif full_scale > 0.0 and (
                    value >= full_scale or (both_signs and value <= -full_scale)):
                image[r, c] = np.nan
                saturated += 1
            else:
                live += 1
                zeros += value == 0.0
                negative |= value < 0.0
                largest = max(largest, value)
                if value > 0.0 and (least == 0.0 or value < least):
                    least = value
    if negative or zeros < CENSORED * live or not 0.0 < least < largest:
        return missing, saturated, 0.0
    for r in range(image.shape[0]):
        for c in range(image.shape[1]):
            if image[r, c] == 0.0:
                image[r, c] = np.nan
    return missing, saturated, least


@njit(error_model='numpy')
def noise_of(image, given, threshold):
    """Noise of a layer [Pa]: as given, or as it shows; never 0, not even of a perfect picture."""
    noise = given
    if not noise > 0.0:
        noise = threshold / THRESHOLD_STD if threshold > 0.0 else noise_from_image(image)
    largest = 0.0
    for value in image.flat:
        if abs(value) > largest:  # false for NaN
            largest = abs(value)
    floor = max(1e-6 * largest, 1e-37)
    return max(noise, floor) if np.isfinite(noise) else floor


@njit(error_model='numpy')
def survey(image, x, y, area, moments):
    """
    Moments (m0, mx, my, mxx, myy, mxy), live tactels and peak of the pressure.

    NaN tactels count as zero in the moments.
    """
    m0 = mx = my = mxx = myy = mxy = 0.0
    live = 0
    peak = -np.inf
    for r in range(image.shape[0]):
        row = row_x = row_xx = 0.0
        for c in range(image.shape[1]):
            value = image[r, c]
            if value == value:  # not NaN
                live += 1
                peak = max(peak, value)
                row += value
                row_x += value * x[c]
                row_xx += value * x[c] * x[c]
        m0 += row
        mx += row_x
        mxx += row_xx
        my += row * y[r]
        myy += row * y[r] * y[r]
        mxy += row_x * y[r]
    moments[0], moments[1], moments[2] = m0 * area, mx * area, my * area
    moments[3], moments[4], moments[5] = mxx * area, myy * area, mxy * area
    return live, peak


@njit(error_model='numpy')
def ridge_shape(image, x, y, level):
    """Spread [m^2] and elongation, see `Moments`, of the tactels at or above a level."""
    m = mx = my = mxx = myy = mxy = 0.0
    for r in range(image.shape[0]):
        for c in range(image.shape[1]):
            value = image[r, c]
            if value >= level:  # false for NaN
                value = min(value, 2.0 * level)  # a stuck tactel counts as the peak
                m += value
                mx += value * x[c]
                my += value * y[r]
                mxx += value * x[c] * x[c]
                myy += value * y[r] * y[r]
                mxy += value * x[c] * y[r]
    if not m > 0.0:
        return 0.0, np.nan
    cxx, cyy, cxy = mxx / m - (mx / m)**2, myy / m - (my / m)**2, mxy / m - mx * my / m**2
    mean, half = 0.5 * (cxx + cyy), np.hypot(0.5 * (cxx - cyy), cxy)
    return cxx + cyy, (mean + half) / (mean - half) if mean > half else np.nan
