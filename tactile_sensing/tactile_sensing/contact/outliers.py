"""Faults of the sensor in a frame that a load explains: drift, outliers, depth; all compiled."""

import numpy as np

from tactile_common.kernels import njit
from tactile_sensing.contact.gauss_newton import fit_load, MODEL
from tactile_sensing.contact.goodness_of_fit import compare
from tactile_sensing.contact.preprocessing import fill_censored
from tactile_sensing.contact.variable_projection import TUKEY
from tactile_sensing.half_space.layers import PRESSURE

DRIFT_EVIDENCE = 4.0  # standard errors of the median that are a drift
MAX_DRIFT = 0.12  # of the peak: a tenth, as a load that knows of none leaves it; more is a load
UNLOADED = 0.02  # of the peak: what presses less shows the baseline
MIN_UNLOADED = 8  # tactels that a median is taken of
AROUND_EVIDENCE = 2.5  # standard deviations by which the tactels around one must tell
OUTLIER = 5.0  # standard deviations, model error included, that no tactel may be off
MAX_OUTLIERS = 0.25  # of the loaded tactels; more is a contact of another kind
MAX_OUTLIERS_AROUND = 3  # of the eight around one; likewise
MANY_OFF = 12  # tactels that one broken one may make contradict the load
MAX_CENSORED = 0.1  # share of censored tactels beside which drift shows
CENSORED_LOOKS = 3  # each fills in what the last load expects below the floor
DEPTH_STEPS = 0.05, 0.02, 0.01  # relative differences by which the depth is searched
LONGEST_DEPTH_STEP = 0.15


@njit(error_model='numpy')
def _unloaded_median(left, model, limit, values):
    """Median and number of what is left where the load presses less than a limit."""
    n = 0
    for i in range(left.size):
        rest = left.flat[i]
        if abs(model.flat[i]) <= limit and np.isfinite(rest):
            values[n] = rest
            n += 1
    return (np.median(values[:n]) if n >= MIN_UNLOADED else 0.0), n


@njit(error_model='numpy')
def _share(flags):
    count = 0
    for flag in flags.flat:
        count += flag
    return count / flags.size


@njit(error_model='numpy')
def take_off_drift(layers, first, spread, memory):
    """
    Subtract from every layer the median of its unloaded tactels; whether it did.

    The first time only where that is more than noise, and than a load that does not fit leaves:
    the spread is what it leaves over what is expected. On a small pad a blunt load that is taken
    for a sharp one leaves something of its own where a sharp one hardly presses.
    """
    stress, left, model, censored = memory.stress, memory.left, memory.model, memory.censored
    values, found = memory.tactels.by[MODEL], False
    for k in range(stress.shape[0]):
        if layers[k].floor != 0.0 and _share(censored[k]) > MAX_CENSORED:
            continue  # the median of what is left of the noise is no drift
        noise, largest = layers[k].noise, max(model[k].max(), -model[k].min())
        median, n = _unloaded_median(left[k], model[k], max(noise, UNLOADED * largest), values)
        error = 1.2533 * noise * spread / np.sqrt(max(n, 1))
        enough = DRIFT_EVIDENCE * error if first else error
        if enough < abs(median) <= MAX_DRIFT * largest:
            for r in range(stress.shape[1]):
                for c in range(stress.shape[2]):
                    stress[k, r, c] -= median
            found = True
    return found


@njit(error_model='numpy')
def _is_off(left, model, noise, model_error):
    allowed = model_error * model
    return left * left > OUTLIER * OUTLIER * (noise * noise + allowed * allowed)


@njit(error_model='numpy')
def _allowance(rules):
    """What tactels may be off, as a share of the pressure."""
    return np.hypot(rules.model_error, rules.gain_spread)


@njit(error_model='numpy')
def any_off(left, model, layers, rules):
    """Whether a tactel contradicts the load."""
    model_error = _allowance(rules)
    for k in range(left.shape[0]):
        for r in range(left.shape[1]):
            for c in range(left.shape[2]):
                if _is_off(left[k, r, c], model[k, r, c], layers[k].noise, model_error):
                    return True
    return False


@njit(error_model='numpy')
def may_be_contact(left, row, column, sensor, layer):
    """
    Whether what is left around a high tactel is that of a load on it, and whether that shows.

    No load under a skin presses one tactel alone: its neighbours have a share, by their distance.
    """
    share = around = 0.0
    count = 0
    for r in range(max(row - 1, 0), min(row + 2, left.shape[0])):
        for c in range(max(column - 1, 0), min(column + 2, left.shape[1])):
            if (r != row or c != column) and np.isfinite(left[r, c]):
                distance = np.hypot((r - row) * sensor.pitch_y, (c - column) * sensor.pitch_x)
                share += (1.0 + (distance / layer.depth) ** 2) ** -2.5
                around += left[r, c]
                count += 1
    expected, noise = share * left[row, column], layer.noise * np.sqrt(max(count, 1))
    known = expected > 2.0 * AROUND_EVIDENCE * noise
    return known and around > 0.5 * expected, known


@njit(error_model='numpy')
def _is_fault(left, row, column, sensor, layer, state):
    """Whether a tactel that is off is broken: not a high one that is, or may be, a contact."""
    if not left[row, column] > 0.0 or layer.component != PRESSURE:
        return True
    found, known = may_be_contact(left, row, column, sensor, layer)
    if found or not known:
        state.second = found
        return False
    return True


@njit(error_model='numpy')
def _leave_out_outliers(sensor, layers, rules, memory):
    """
    Set tactels that contradict the load to NaN; whether it did.

    Not where they are many or close together: then it is the load that is wrong; nor where what
    is around a high one says that it is a contact (second), or cannot say that it is none.
    """
    stress, left, model, state = memory.stress, memory.left, memory.model, memory.state[0]
    model_error = _allowance(rules)
    off = loaded = 0
    for k in range(left.shape[0]):
        for r in range(left.shape[1]):
            for c in range(left.shape[2]):
                wrong = _is_off(left[k, r, c], model[k, r, c], layers[k].noise, model_error)
                off += wrong
                loaded += wrong or abs(model[k, r, c]) > OUTLIER * layers[k].noise
                if not wrong:
                    continue
                around = -1
                for i in range(max(r - 1, 0), min(r + 2, left.shape[1])):
                    for j in range(max(c - 1, 0), min(c + 2, left.shape[2])):
                        around += _is_off(
                            left[k, i, j], model[k, i, j], layers[k].noise, model_error)
                if around > MAX_OUTLIERS_AROUND:
                    return False
                if not _is_fault(left[k], r, c, sensor, layers[k], state):
                    return False
    if off == 0 or off > MAX_OUTLIERS * loaded:
        return False
    for k in range(left.shape[0]):
        for r in range(left.shape[1]):
            for c in range(left.shape[2]):
                if _is_off(left[k, r, c], model[k, r, c], layers[k].noise, model_error):
                    stress[k, r, c] = np.nan
    return True


@njit(error_model='numpy')
def leave_out_worst(sensor, layers, rules, memory):
    """
    Set the tactel that contradicts the load most to NaN; whether it did.

    Not where many do, which is a wrong load; nor a high one that is a contact (second), or of
    which nothing around says that it is none.
    """
    stress, left, model, state = memory.stress, memory.left, memory.model, memory.state[0]
    model_error, worst, k, r, c = _allowance(rules), OUTLIER * OUTLIER, -1, -1, -1
    count = 0
    for i in range(left.shape[0]):
        for j in range(left.shape[1]):
            for m in range(left.shape[2]):
                allowed = model_error * model[i, j, m] / layers[i].noise
                off = (left[i, j, m] / layers[i].noise) ** 2 / (1.0 + allowed * allowed)
                count += off > OUTLIER * OUTLIER  # false for NaN
                if off > worst:
                    worst, k, r, c = off, i, j, m
    if not 0 < count <= MANY_OFF:
        return False
    if not _is_fault(left[k], r, c, sensor, layers[k], state):
        return False
    stress[k, r, c] = np.nan
    return True


@njit(error_model='numpy')
def leave_out_top(image, top):
    """Mark the highest readings, NaN from now on if several are equal; what they read, or inf."""
    highest, count = 0.0, 0
    for value in image.flat:
        if value > highest:  # false for NaN
            highest, count = value, 0
        count += value == highest
    top[:] = image == highest
    if count < 2:
        return np.inf
    for i in range(image.size):
        if top.flat[i]:
            image.flat[i] = np.nan
    return highest


@njit(error_model='numpy')
def is_cut_off(top, model, reading):
    """Whether a load that was fitted without the highest readings is above all of them."""
    for i in range(top.size):
        if top.flat[i] and not model.flat[i] > reading:
            return False
    return True


@njit(error_model='numpy')
def scale_depths(layers, factor, scaled):
    """Layers with all depths multiplied; the given full scale is not needed."""
    for k in range(layers.size):
        old, new = layers[k], scaled[k]
        new.depth, new.noise, new.floor = old.depth * factor, old.noise, old.floor
        new.component, new.given_noise = old.component, old.given_noise
        new.gz, new.gx, new.gy = old.gz, old.gx / factor, old.gy / factor


@njit(error_model='numpy')
def fit_depth(kind, stress, sensor, layers, scaled, forces, rules, tactels, fit, slope):
    """
    Factor on all depths that leaves least, its variance, and how the load moves with it (slope).

    The squared error is a parabola about its least; three fits give it. NaN if it has none.
    """
    factor, variance = 1.0, np.inf
    errors = np.empty(3)
    for step in DEPTH_STEPS:
        for i in range(3):
            scale_depths(layers, factor + (i - 1) * step, scaled)
            if not fit_load(kind, stress, sensor, scaled, forces, rules.model_error, np.inf,
                            rules.gain_spread, tactels, fit):
                return np.nan, np.inf
            errors[i] = fit.squared_error
            for j in range(5):  # at last the slope between the outer two
                if i == 0:
                    slope[j] = fit.vector[j]
                elif i == 2:
                    slope[j] = (fit.vector[j] - slope[j]) / (2.0 * step)
        below, middle, above = errors
        curvature = (below - 2.0 * middle + above) / step**2
        if not curvature > 0.0:
            return np.nan, np.inf
        variance = 2.0 / curvature
        move = -(above - below) / (2.0 * step) / curvature
        factor += min(max(move, -LONGEST_DEPTH_STEP), LONGEST_DEPTH_STEP)
    return factor, variance


@njit(error_model='numpy')
def fit_despite_faults(kind, sensor, layers, forces, mend, rules, memory):
    """
    Fit with shear and, to mend the frame, without tactels that contradict others.

    Returns whether it worked, and whether tactels were left out.
    """
    stress, left, model, fit = memory.stress, memory.left, memory.model, memory.fits[0]
    model_error, tactels, state = rules.model_error, memory.tactels, memory.state[0]
    scatter = state.scatter
    for look in range(CENSORED_LOOKS + 1):
        if not fit_load(kind, stress, sensor, layers, forces, model_error, np.inf, scatter,
                        tactels, fit):
            return False, False
        if not (mend or state.any_censored):
            return True, False
        compare(kind, sensor, layers, fit, memory)
        if look == CENSORED_LOOKS or not state.any_censored:
            break
        fill_censored(stress, model, layers, memory.censored)
    if not mend or not any_off(left, model, layers, rules):
        return True, False
    left_out = False
    if fit_load(kind, stress, sensor, layers, forces, model_error, TUKEY, scatter, tactels, fit):
        compare(kind, sensor, layers, fit, memory)
        left_out = _leave_out_outliers(sensor, layers, rules, memory)
    fitted = fit_load(kind, stress, sensor, layers, forces, model_error, np.inf, scatter,
                      tactels, fit)
    return fitted, left_out
