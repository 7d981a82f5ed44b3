"""What passes between the parts of an estimate, each compiled as a plain tuple."""

from typing import NamedTuple

import numpy as np


class Readings(NamedTuple):
    """Readings of one image, flat over layers, rows and columns."""

    value: np.ndarray  # NaN where there is none
    noise2: np.ndarray  # variance of the noise, positive
    full: np.ndarray  # full scale, infinite if there is none
    floor: np.ndarray  # at or below it a reading is only known to be below it; or -infinite


class Beliefs(NamedTuple):
    """What is fitted, and what is believed of it before the image is seen."""

    kind: int  # POINT or LINE
    power: bool  # whether the skin is not known
    ends: bool  # whether a line begins and ends
    patch: bool  # whether the load on a known skin is blunt
    robust: bool  # whether errors are Student-t and annealed, with a baseline; else Gaussian
    mean: np.ndarray  # (parameters,)
    information: np.ndarray  # (parameters,): 1 / variance; 0: flat
    low: np.ndarray  # (parameters,): bounds
    high: np.ndarray
    largest_step: np.ndarray  # (parameters,)
    active: np.ndarray  # (n,): parameters that are fitted; the others stay as they start
    volume: float  # log of what the flat priors extend over
    shear: float  # standard deviation of a component of shear / normal force
    known: float  # scatter g that is known, 0 if none is: what a Gaussian fit weighs
    gain: float  # scatter g, and standard deviation of its logarithm
    gain_spread: float
    unseen: float  # d of `misfit` that a fit may absorb


class Fit(NamedTuple):
    """A load, and what is known of it; arrays over tactels are of the last step."""

    theta: np.ndarray  # (parameters,)
    inverse: np.ndarray  # (n, n): of the information
    by: np.ndarray  # (parameters, tactels)
    rows: np.ndarray  # (n, tactels): of the active parameters
    model: np.ndarray  # (tactels,), without baselines
    square: np.ndarray  # (tactels,): squared pressure whose share scatters
    error: np.ndarray  # (tactels,): 0 where nothing is read
    weight: np.ndarray  # (tactels,): likewise
    variance: np.ndarray  # (tactels,): noise and scatter
    kept: np.ndarray  # (tactels,): whether the reading is an ordinary one
    evidence: float  # minus infinity: the fit did not work
    scatter: float
    iterations: int


class Residual(NamedTuple):
    """Sizes of the errors that a load leaves."""

    loudest: float  # largest error of a tactel [standard deviations]
    loud: float  # share of the tactels that are off by more than noise ever is
    excess: float  # of chi-square of the loaded tactels over what noise leaves, likewise
    rms: float  # [standard deviations of the noise]
    left: float  # RMS of what is left beyond noise, relative to that of the pressure
    extrapolated: float  # share of the pressure that is above full scale
    silent: int  # tactels that plainly should read something, and hardly do


class Misfit(NamedTuple):
    """What the errors of neighbouring tactels have in common."""

    significance: float  # of d, the share of the pressure that neighbours miss [std. deviations]
    hidden: float  # probability of a patch that is not fitted
    second: float  # largest sum over 3 x 3 tactels of what is left [standard deviations]
    apart: float  # highest pressure away from the load that it lacks, relative to its peak
    extra: float  # pressure that a single load lacks, relative to that of the load


class Hypothesis(NamedTuple):
    """One kind of load, fitted, and what it leaves."""

    beliefs: Beliefs
    fit: Fit
    evidence: float  # that of the fit, less what each extra must bring
    residual: Residual
    misfit: Misfit
    covariance: np.ndarray  # (parameters, parameters)
