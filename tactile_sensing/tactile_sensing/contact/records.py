"""Records that the parts of the contact estimation exchange; compiled as tuples."""

from typing import NamedTuple

import numpy as np


class Readings(NamedTuple):
    """Readings of one image, flat over layers, rows and columns."""

    value: np.ndarray  # NaN: no reading
    noise2: np.ndarray  # variance of the noise, positive
    full: np.ndarray  # full scale; infinite: none
    floor: np.ndarray  # a reading at or below it is an upper bound only; -infinite: none


class Beliefs(NamedTuple):
    """Parameters to fit, with their priors and bounds."""

    kind: int  # POINT, LINE; rivals: TWO points, a PLATE
    power: bool  # whether a bump of free shape is fitted: the skin is unknown
    shaped: bool  # whether the bump may be blunt, or that of a point longer in one direction
    ends: bool  # whether a line begins and ends
    patch: bool  # whether the load on a known skin is blunt
    robust: bool  # errors are Student-t and annealed; else Gaussian
    mean: np.ndarray  # (parameters,)
    information: np.ndarray  # (parameters,): 1 / variance; 0: flat
    low: np.ndarray  # (parameters,): lower bounds
    high: np.ndarray  # (parameters,): upper bounds
    largest_step: np.ndarray  # (parameters,)
    active: np.ndarray  # (n,): parameters that are fitted; the others keep their start values
    volume: float  # log of the volume of the flat priors
    known: float  # known scatter g, used by a Gaussian fit; 0: unknown
    gain: float  # median of the prior of the scatter g
    gain_spread: float  # standard deviation of its logarithm


class Fit(NamedTuple):
    """A fitted load; arrays over tactels are those of the last step."""

    theta: np.ndarray  # (parameters,)
    inverse: np.ndarray  # (n, n): inverse of the information matrix
    by: np.ndarray  # (parameters, tactels): derivatives of the model
    rows: np.ndarray  # (n, tactels): derivatives by the active parameters
    model: np.ndarray  # (tactels,): pressure of the load, without baselines
    square: np.ndarray  # (tactels,): multiplies g^2 in the variance
    error: np.ndarray  # (tactels,): 0: no reading
    weight: np.ndarray  # (tactels,): 0: no reading
    variance: np.ndarray  # (tactels,): of noise and scatter
    kept: np.ndarray  # (tactels,): whether the reading is an ordinary value, not a bound
    evidence: float  # log evidence; -infinite: the fit failed
    scatter: float
    iterations: int


class Residual(NamedTuple):
    """Sizes of the errors that a fitted load leaves."""

    loudest: float  # largest error of a tactel [standard deviations]
    loud: float  # share of the tactels with an error too large for noise and small misfit
    excess: float  # chi-square of the loaded tactels less its expectation [standard deviations]
    rms: float  # RMS error [standard deviations of the noise]
    left: float  # RMS residual beyond noise, relative to the RMS pressure
    extrapolated: float  # share of the pressure that is above full scale
    silent: int  # number of dead tactels: they read nothing under a clear load


class Misfit(NamedTuple):
    """Errors that neighbouring tactels share."""

    significance: float  # of d, the shared error as share of the pressure [standard deviations]
    hidden: float  # probability of a patch that is not fitted
    along: float  # as `Residual.left`, of the part that only a force varying along a line leaves
    apart: float  # highest unexplained pressure away from the load, relative to its peak


class Hypothesis(NamedTuple):
    """One fitted kind of load, with its residual."""

    beliefs: Beliefs
    fit: Fit
    residual: Residual
    misfit: Misfit
    covariance: np.ndarray  # (n, n): of the active parameters
