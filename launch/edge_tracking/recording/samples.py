"""Statistics of samples; NaN where there are too few."""

import numpy as np

NAN = float('nan')


def span(stamps):
    """Return the time between the first and the last stamp [ns], in seconds."""
    return 1e-9 * float(stamps[-1] - stamps[0]) if len(stamps) > 1 else NAN


def rate(stamps):
    """Return the mean rate of stamps [ns], in Hz."""
    duration = span(stamps)
    return (len(stamps) - 1) / duration if duration > 0.0 else NAN


def rms(values):
    """Return the root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else NAN


def largest(values):
    """Return the largest finite magnitude."""
    values = np.abs(values[np.isfinite(values)])
    return float(values.max()) if len(values) else NAN


def mean(values):
    """Return the mean."""
    return float(np.mean(values)) if len(values) else NAN


def median(values):
    """Return the median."""
    return float(np.median(values)) if len(values) else NAN


def percentile(values, percent):
    """Return a percentile."""
    return float(np.percentile(values, percent)) if len(values) else NAN
