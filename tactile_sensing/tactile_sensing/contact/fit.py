"""
Robust fit of one load to one image: priors, posterior mode, covariance, evidence; compiled.

The model is: reading i = baseline + m_i (1 + gain_i) + noise_i, where m is the pressure of the
load. Errors follow a Student t distribution with variance noise^2 + (g m_i)^2; the scatter g is
marginalised on a grid. A tactel whose reading is likelier without a load is dead: it has no
weight. A saturated reading is a lower bound, a reading at its floor an upper bound (Tobin). Every
parameter may have a Gaussian prior. The shear always has one, as a share of the normal force. The
force is uniform up to that of a load as high as the image, so that the evidence has no unit. The
evidence is Laplace's approximation.
"""

import math

import numpy as np

from tactile_common.kernels import njit
from tactile_sensing.contact.errors import (
    censored,
    cost_of_dead,
    cost_of_error,
    DEAD,
    inverse_of,
    marginal_scatter,
    normal_equations,
    spread_of,
    weigh,
)
from tactile_sensing.contact.records import Beliefs, Fit, Readings
from tactile_sensing.skin.bumps import (
    add_rows,
    add_rows_of_plate,
    add_rows_of_two,
    LINE,
    P,
    Pad,
    PLATE,
    POINT,
    TWO,
)
from tactile_sensing.skin.kernel import MAX_VARIANCE

STEPS = 8, 12  # largest number of steps: Gaussian, robust
ANNEALED, COOLING = 5, 0.3  # steps with inflated variance; factor of its root at each step
PINNED = 1e12  # factor of the information of a parameter at its bound
SETTLED = 0.1  # converged if the last step moved no parameter by more [standard deviations]
DRIFT = 0.05, 20.0  # prior of the baseline: share of the peak, multiple of the noise
CONTRADICTED = 3.0  # a bounded reading that is off by more is an ordinary error [std. deviations]
BROAD = 1.2  # from this half width on tactels are sampled at their centre [pitches]
HALF_SPACE = 2.5  # exponent of a point's bump on a half-space
SHEAR = 0.3, 0.15  # standard deviation of a component of Q / P: known skin, unknown skin
TAPER_SPREAD = 0.5  # standard deviation of taper / force of a line
LONGER, LONGEST = 0.2, 0.6  # standard deviation and largest value of LONG_X and LONG_XY
BLUNTER, BLUNTEST = 0.3, 0.75  # the same of BLUNT
SCATTER = 0.05  # assumed scatter of unknown gains
# Options, see `Beliefs`
POWER, ENDS, ROBUST, PATCH, BASELINE, TAPERED, ELONGATED, BLUNTED = 1, 2, 4, 8, 16, 32, 64, 128
# Log odds of a usual point or a line that crosses the pad: against an elongated or blunt one, two
# points, a line that ends or a border of a plate, which has two.
RARE = 3.0
APART = 0.055  # a higher unexplained pressure away from the load is a second load [of its peak]


@njit(error_model='numpy')
def widest(pad: Pad) -> float:
    """Return the largest half width of a bump that the pad can still recognise [m]."""
    side = min(pad.half_x, pad.half_y)
    if side <= pad.pitch:
        side = max(pad.half_x, pad.half_y)
    return 0.45 * max(side, 1.5 * pad.pitch)


@njit(error_model='numpy')
def beliefs_of(pad: Pad, scatter: float, kind: int, options: int) -> Beliefs:
    """Return the priors and bounds of a load; `options` is a sum of the constants above."""
    power, ends, robust = options & POWER > 0, options & ENDS > 0, options & ROBUST > 0
    patch, shaped = options & PATCH > 0, options & (ELONGATED + BLUNTED) > 0
    count = P.BASE + pad.depths.size
    mean, information, step = np.zeros(count), np.zeros(count), np.ones(count)
    low, high, fitted = np.full(count, -np.inf), np.full(count, np.inf), np.zeros(count, np.bool_)
    fitted[P.Q0] = fitted[P.Q1] = fitted[P.FORCE] = fitted[P.SHEAR_U] = True
    fitted[P.SHEAR_V] = kind != LINE or options & TAPERED > 0  # that of a line is its taper
    reach = math.hypot(pad.half_x, pad.half_y)
    information[P.Q0] = reach ** -2
    step[P.Q0] = step[P.Q1] = step[P.BEGIN] = step[P.END] = 0.6 * pad.pitch
    volume, flat = 0.0, 0
    if kind == POINT or kind == TWO:
        information[P.Q1] = reach ** -2
        high[P.Q0], high[P.Q1] = 1.25 * pad.half_x, 1.25 * pad.half_y
        low[P.Q0], low[P.Q1] = -high[P.Q0], -high[P.Q1]
    else:
        information[P.Q1] = (2.0 * math.pi) ** -2
        low[P.Q0], high[P.Q0] = -1.25 * reach, 1.25 * reach
        step[P.Q1] = 0.15
    if kind > LINE:
        fitted[P.Q2] = fitted[P.Q3] = fitted[P.SHARE] = True
        information[P.Q2] = information[P.Q3] = reach ** -2
        low[P.Q2], high[P.Q2], low[P.Q3], high[P.Q3] = low[P.Q0], high[P.Q0], low[P.Q1], high[P.Q1]
        low[P.SHARE], high[P.SHARE], step[P.SHARE] = APART, 1.0 - APART, 0.2
        volume += RARE if kind == TWO else 2.0 * RARE
        flat += 1
    if ends:
        fitted[P.BEGIN] = fitted[P.END] = True
        low[P.BEGIN] = low[P.END] = -1.5 * reach
        high[P.BEGIN] = high[P.END] = 1.5 * reach
        volume += 2.0 * math.log(2.0 * reach) + RARE
        flat += 2
    if power:
        fitted[P.WIDTH] = fitted[P.EXPONENT] = True
        mean[P.WIDTH], information[P.WIDTH] = math.log(1.2 * pad.pitch), 0.8 ** -2
        mean[P.EXPONENT], information[P.EXPONENT] = math.log(HALF_SPACE), 0.5 ** -2
        low[P.WIDTH], high[P.WIDTH] = math.log(0.3 * pad.pitch), math.log(widest(pad))
        low[P.EXPONENT], high[P.EXPONENT] = math.log(1.7), math.log(12.0)
        step[P.WIDTH], step[P.EXPONENT] = 0.25, 0.2
        volume += RARE * shaped
        if options & BLUNTED:
            fitted[P.BLUNT], information[P.BLUNT], step[P.BLUNT] = True, BLUNTER ** -2, 0.2
            low[P.BLUNT], high[P.BLUNT] = 0.0, BLUNTEST
        if options & ELONGATED and kind == POINT:
            for p in (P.LONG_X, P.LONG_XY):
                fitted[p], information[p], step[p] = True, LONGER ** -2, 0.2
                low[p], high[p] = -LONGEST, LONGEST
    elif patch:
        fitted[P.WIDTH], low[P.WIDTH], high[P.WIDTH], step[P.WIDTH] = True, 0.0, MAX_VARIANCE, 0.1
        volume += math.log(MAX_VARIANCE)
        flat += 1
    fitted[P.BASE:] = options & BASELINE > 0
    if kind == PLATE:
        fitted[P.END] = fitted[P.EXPONENT] = fitted[P.SHEAR_U] = fitted[P.SHEAR_V] = False
    gain, spread = (scatter, 0.5) if scatter > 0.0 else (SCATTER, 1.0)
    volume -= 0.5 * math.log(2.0 * math.pi) * flat
    return Beliefs(kind, power, shaped, ends, patch, robust, mean, information, low, high, step,
                   np.flatnonzero(fitted), volume, scatter, gain, spread)


@njit(error_model='numpy', inline='always')
def _model(fit: Fit, pad: Pad, beliefs: Beliefs, theta: np.ndarray, coarse: bool,
           every: bool) -> None:
    """Write model and derivatives of a load; `every`: by parameters that are not fitted too."""
    wide = every or beliefs.power or beliefs.patch
    nodes = np.array([[0.0, 0.0, 1.0]]) if coarse else pad.nodes
    if beliefs.kind == TWO:
        add_rows_of_two(beliefs.power, wide, nodes, pad, theta, fit.by, fit.model)
    elif beliefs.kind == PLATE:
        add_rows_of_plate(nodes, pad, theta, fit.by, fit.model)
    else:
        add_rows(beliefs.kind, beliefs.power, beliefs.ends, wide, nodes, pad, theta, fit.by,
                 fit.model)
    for i in range(beliefs.active.size):
        fit.rows[i] = fit.by[beliefs.active[i]]


@njit(error_model='numpy')
def _prior(beliefs: Beliefs, force: float, drift: float) -> np.ndarray:
    """Return the prior information of the active parameters; shear, taper scale with `force`."""
    prior = beliefs.information[beliefs.active]
    for i in range(beliefs.active.size):
        p = beliefs.active[i]
        if beliefs.kind == LINE and p == P.TAPER:
            prior[i] = (TAPER_SPREAD * force) ** -2.0
        elif p == P.SHEAR_U or p == P.SHEAR_V:
            prior[i] = (SHEAR[int(beliefs.power)] * force) ** -2.0
        elif p >= P.BASE:
            prior[i] = drift ** -2.0
    return prior


@njit(error_model='numpy', inline='always')
def _begin(fit: Fit, pad: Pad, readings: Readings,
           beliefs: Beliefs) -> tuple[float, float, float]:
    """
    Set forces and baselines at the start by least squares.

    Return the highest reading, or 0 if that fails; the force of a load with this peak; and the
    standard deviation of a baseline.
    """
    theta, known = fit.theta, np.isfinite(readings.value)
    fit.error[:] = np.where(known, readings.value, 0.0)
    peak = max(fit.error.max(), 1e-300)
    drift = DRIFT[0] * peak + DRIFT[1] * np.sqrt(readings.noise2).mean()
    theta[P.FORCE:] = 0.0
    theta[P.FORCE] = 1.0
    _model(fit, pad, beliefs, theta, beliefs.power, False)
    force = peak / max(fit.model.max(), 1e-300)
    fit.weight[:] = known / (readings.noise2 + (0.3 * peak) ** 2 * beliefs.robust)
    first = np.searchsorted(beliefs.active, P.FORCE)
    matrix, right = normal_equations(fit.rows[first:], fit.weight, fit.error)
    matrix += np.diag(_prior(beliefs, force, drift)[first:] + 1e-9 * np.diag(matrix))
    inverse, determinant = inverse_of(matrix)
    if np.isnan(determinant):
        return 0.0, force, drift
    theta[beliefs.active[first:]] = inverse @ right
    theta[P.FORCE] = max(theta[P.FORCE], 1e-3 * force)
    return peak, force, drift


@njit(error_model='numpy')
def _compare(fit: Fit, size: int, readings: Readings) -> None:
    """Write the errors; a bounded reading that agrees with the model is not `kept`."""
    reading, _, full, floor = readings
    for t in range(reading.size):
        if np.isfinite(reading[t]):
            expected = fit.model[t] + fit.theta[P.BASE + t // size]
            fit.error[t] = error = min(max(reading[t], floor[t]), full[t]) - expected
            fit.kept[t] = floor[t] < reading[t] < full[t]
            if not fit.kept[t]:
                limit = CONTRADICTED * math.sqrt(fit.variance[t])
                fit.kept[t] = error >= limit if reading[t] >= full[t] else error <= -limit


@njit(error_model='numpy')
def _weigh_all(fit: Fit, readings: Readings, heat: float, g: float, robust: bool) -> None:
    """Write variances and weights at a scatter g, and the errors of bounded readings."""
    for t in range(fit.error.size):
        fit.variance[t] = readings.noise2[t] + heat + g * g * fit.square[t]
    weigh(fit.error, fit.variance, fit.kept, robust, fit.weight)
    for t in range(fit.error.size):
        if robust and fit.kept[t]:
            cost = cost_of_error(fit.error[t], fit.variance[t])
            # The first condition is necessary, and saves most exponentials.
            if cost > readings.noise2[t] / DEAD ** 2 and cost > cost_of_dead(
                    fit.model[t] + fit.error[t], readings.noise2[t]):
                fit.weight[t] = 0.0
        elif not fit.kept[t] and np.isfinite(readings.value[t]):
            fit.error[t], fit.weight[t] = censored(
                fit.error[t], math.sqrt(fit.variance[t]), readings.value[t] >= readings.full[t])


@njit(error_model='numpy')
def _step(theta: np.ndarray, step: np.ndarray, inverse: np.ndarray, beliefs: Beliefs) -> float:
    """Take a step within bounds; return the largest change of place or shape [std. deviations]."""
    largest = moved = 0.0
    for i in range(step.size):
        if beliefs.active[i] < P.FORCE:
            largest = max(largest, abs(step[i]) / beliefs.largest_step[beliefs.active[i]])
    shrink = 1.0 / max(1.0, largest)
    for i in range(step.size):
        p = beliefs.active[i]
        was = theta[p]
        theta[p] = min(max(was + shrink * step[i], beliefs.low[p]), beliefs.high[p])
        if p < P.FORCE:
            moved = max(moved, abs(theta[p] - was) / math.sqrt(inverse[i, i]))
    return moved


@njit(error_model='numpy')
def _pin(theta: np.ndarray, beliefs: Beliefs, matrix: np.ndarray, right: np.ndarray) -> None:
    """Keep parameters at a bound that the gradient `right` points beyond."""
    for i in range(right.size):
        p = beliefs.active[i]
        if theta[p] >= beliefs.high[p] and right[i] > 0.0 or (
                theta[p] <= beliefs.low[p] and right[i] < 0.0):
            matrix[i, i] *= PINNED
            right[i] = 0.0


@njit(error_model='numpy')
def unfitted(start: np.ndarray, noise2: np.ndarray, n: int) -> Fit:
    """Return an empty Fit of n parameters, to be filled."""
    tactels = noise2.size
    flat = np.zeros((5, tactels))
    flat[4] = noise2
    return Fit(start.copy(), np.zeros((n, n)), np.zeros((start.size, tactels)),
               np.zeros((n, tactels)), flat[0], flat[1], flat[2], flat[3], flat[4],
               np.zeros(tactels, np.bool_), -np.inf, 0.0, 0)


@njit(error_model='numpy')
def fit_load(pad: Pad, readings: Readings, beliefs: Beliefs, start: np.ndarray) -> Fit:
    """
    Fit one load by Gauss-Newton.

    Parameters
    ----------
    pad : Pad
    readings : Readings
    beliefs : Beliefs
    start : ndarray, shape (parameters,)
        With a force of 0 it is cold: a robust fit is annealed. Its forces are not used otherwise.

    Returns
    -------
    Fit
    """
    robust, n = beliefs.robust, beliefs.active.size
    annealed = ANNEALED * (robust and start[P.FORCE] == 0.0)
    rows, columns = pad.y.size, pad.x.size
    fit = unfitted(start, readings.noise2, n)
    theta = fit.theta
    peak, force, drift = _begin(fit, pad, readings, beliefs)
    if peak == 0.0:
        return fit
    scatter, marginal, moved, was_coarse = 0.0, 0.0, np.inf, False
    g, last = beliefs.gain if robust else beliefs.known, STEPS[1 if robust else 0] - 1
    for iteration in range(last + 1):
        heat = 0.0
        if iteration < annealed:
            heat = (0.3 * peak * COOLING ** iteration) ** 2
        coarse = beliefs.power and (heat > 0.0 or theta[P.WIDTH] > math.log(BROAD * pad.pitch))
        if was_coarse and not coarse:
            moved = np.inf  # that step was of another model
        done = iteration == last or (moved < SETTLED and heat == 0.0)
        _model(fit, pad, beliefs, theta, coarse, done)
        _compare(fit, rows * columns, readings)
        if done or g > 0.0:
            spread_of(fit.model, rows, columns, fit.square)
        prior = _prior(beliefs, max(abs(theta[P.FORCE]), 1e-3 * force), drift)
        if done or (robust and heat == 0.0 and iteration % 2 == 0):
            scatter, marginal = marginal_scatter(
                fit, readings.noise2 + heat, prior, beliefs, done)
            g = scatter if robust else g
        _weigh_all(fit, readings, heat, g, robust)
        matrix, right = normal_equations(fit.rows, fit.weight, fit.error)
        off = theta[beliefs.active] - beliefs.mean[beliefs.active]
        matrix += np.diag(prior)
        right -= prior * off
        _pin(theta, beliefs, matrix, right)
        fit.inverse[:], determinant = inverse_of(matrix)
        if not np.isfinite(determinant):
            return fit
        if done:
            volume = 0.5 * np.log(prior[prior > 0.0]).sum()
            evidence = (marginal - 0.5 * (prior * off * off).sum() + volume - beliefs.volume
                        - math.log(force))
            works = evidence == evidence and theta[P.FORCE] > 0.0
            return Fit(theta, fit.inverse, fit.by, fit.rows, fit.model, fit.square, fit.error,
                       fit.weight, fit.variance, fit.kept, evidence if works else -np.inf,
                       scatter, iteration + 1)
        moved, was_coarse = _step(theta, fit.inverse @ right, fit.inverse, beliefs), coarse
    return fit
