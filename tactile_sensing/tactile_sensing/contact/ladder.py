"""
The least load that explains a frame, above the sharp one that is whole; all compiled.

The rungs: a point, or a line, with a patch; a line that begins or ends within the pad. A rung is
tried where the derivative by its parameter explains enough of what the load below leaves, and kept
where the fit with it leaves less by enough.
"""


import math

from tactile_common.kernels import FAST, njit
from tactile_sensing.contact.extended_fit import choose_parameters, dot, HOPELESS, set_up
from tactile_sensing.contact.extended_load import (
    add_rows,
    along_chord,
    BEGINS,
    ENDS,
    PATCH,
    source_of,
)
from tactile_sensing.contact.gauss_newton import (
    END,
    LINE,
    RESIDUAL,
    ROOT,
    START,
    VARIANCE,
    WEIGHT,
    X,
    Y,
)
from tactile_sensing.contact.model_selection import fit_without_idle_shear
from tactile_sensing.contact.parameters import copy_record, invert
from tactile_sensing.contact.variable_projection import weigh
from tactile_sensing.skin import kernels

EVIDENCE = 16.0  # chi-square that a rung must take off: four standard deviations
ALONE = 0.8  # share of the evidence of a second end that no single tactel may have
MUCH = 0.7  # of a hopeless chi-square, of which a rung may leave no more
SHORTEST = 2.0  # depths; a shorter line that begins and ends on the pad is a point or its patch
MOSTLY = 0.25  # of what a load leaves: a rung that leaves less is judged by that
LEFT_OVER = 1.0  # standard deviations of chi-square from which on a line may have ends


@njit(error_model='numpy', fastmath=FAST)
def _add_patch_slope(x, y, source, load, by_variance, centre, scale, row):
    """Add the derivative by the variance of a patch of a source that has none as yet."""
    of_f, of_g = by_variance
    cos, sin, rho, place, depends_on_w = source
    force, shear_v, shear_w = load.force, load.shear_x, load.shear_y
    for i in range(x.size):
        v = x[i] * cos + y[i] * sin - rho
        w = depends_on_w * (y[i] * cos - x[i] * sin - place)
        t = centre / (v * v + w * w + centre)
        row[i] += scale * (force * kernels.value_of(of_f, t) + (
            shear_v * v + shear_w * w) * kernels.value_of(of_g, t))


@njit(error_model='numpy')
def _patch_row(kind, sensor, layers, load, tactels):
    """The same at the gathered tactels, over the noise."""
    at, row, source, begin = tactels.at, tactels.by[VARIANCE], source_of(kind, load), 0
    row[:layers[-1].end] = 0.0
    for k in range(layers.size):
        layer, end, centre = layers[k], layers[k].end, kernels.centre_of(layers[k].depth)
        kernels.make_first_slope(
            sensor.polynomials[k], layer.depth, kind - 1, load.yaw, layer.load_slope)
        by_variance = kernels.coefficients_of(layer.load_slope)
        for j in range(sensor.nodes.size):
            node = sensor.nodes[j]
            _add_patch_slope(at[X][begin:end] + node.x, at[Y][begin:end] + node.y, source, load,
                             by_variance, centre, node.weight / layer.noise, row[begin:end])
        begin = end


@njit(error_model='numpy')
def _gain(row, sign, n, tactels, equations):
    """
    Chi-square that a further parameter would take off, and its own share of it.

    Leaves in equations.right the products with the parameters in use, whose inverse is there.
    """
    by, weights = tactels.by[row], tactels.at[WEIGHT][:n]
    gradient = sign * dot(by, tactels.at[RESIDUAL], weights)
    if not gradient > 0.0:
        return 0.0, 0.0
    free, products = dot(by, by, weights), equations.right
    for i in range(equations.count):
        products[i] = dot(by, tactels.by[equations.active[i]], weights)
    for i in range(equations.count):
        for j in range(equations.count):
            free -= equations.inverse[i, j] * products[i] * products[j]
    return (gradient * gradient / free, gradient / free) if free > 0.0 else (0.0, 0.0)


@njit(error_model='numpy')
def _told_by_one(row, sign, n, tactels):
    """Whether a single tactel, which may be broken, tells nearly all of a further parameter."""
    by, residual, weights = tactels.by[row], tactels.at[RESIDUAL], tactels.at[WEIGHT]
    total = most = 0.0
    for i in range(n):
        part = sign * by[i] * residual[i] * weights[i]
        total += part
        most = max(most, part)
    return most > ALONE * total


@njit(error_model='numpy')
def _gain_of_patch(kind, sensor, layers, forces, memory):
    """
    Chi-square that a patch would take off a sharp load, from what its fit has left behind.

    Leaves in the memory how that patch would move the load (hidden), 0 if none shows at all.
    """
    load, tactels, equations = memory.fits[0], memory.tactels, memory.equations[0]
    hidden, n = memory.state[0].hidden, layers[-1].end
    hidden[:] = 0.0
    choose_parameters(forces, 0, equations)
    if not invert(load.normal, equations.count, equations.inverse):
        return 0.0
    _patch_row(kind, sensor, layers, load, tactels)
    if memory.state[0].scatter > 0.0:
        weigh((tactels.by[VARIANCE],), tactels.at[ROOT], n)
    gain, patch = _gain(VARIANCE, 1.0, n, tactels, equations)
    if gain > 0.0:
        for i in range(equations.count):
            for j in range(equations.count):
                hidden[i] -= equations.inverse[i, j] * equations.right[j] * patch
    return gain


@njit(error_model='numpy', inline='always')
def _likelier_extra(kind, sensor, layers, forces, tried, memory):
    """
    The extra, not tried yet, that would explain most of what the load leaves, and how much.

    Ends are looked for where more is left than noise: what hides in it moves nothing.
    """
    load, tactels, equations = memory.fits[0], memory.tactels, memory.equations[0]
    freedom = max(load.used - 2.0 - forces, 1.0)
    tips = kind == LINE and load.squared_error > freedom + LEFT_OVER * math.sqrt(2.0 * freedom)
    if not (load.extras or tried or tips):
        return PATCH, _gain_of_patch(kind, sensor, layers, forces, memory)
    add_rows(kind, sensor, layers, load, BEGINS | ENDS if tips else 0, tactels)
    choose_parameters(forces, load.extras, equations)
    n, best, most = layers[-1].end, 0, 0.0
    set_up(tactels, n, memory.state[0].scatter, equations)
    if not invert(equations.matrix, equations.count, equations.inverse):
        return best, most
    for bit, row, sign in ((PATCH, VARIANCE, 1.0), (BEGINS, START, 1.0), (ENDS, END, -1.0)):
        if (load.extras | tried) & bit == 0 and (tips or bit == PATCH):
            gain, _ = _gain(row, sign, n, tactels, equations)
            if gain > most and not (
                    load.extras & (BEGINS | ENDS) and _told_by_one(row, sign, n, tactels)):
                best, most = bit, gain
    return best, most


@njit(error_model='numpy')
def _ends_show(sensor, load, depth):
    """Whether a line begins and ends where the pad sees it, and in this order."""
    if not load.extras & (BEGINS | ENDS):
        return True
    first, last = along_chord(sensor, load.rho, load.yaw)
    start = load.start if load.extras & BEGINS else first
    end = load.end if load.extras & ENDS else last
    both = load.extras & BEGINS and load.extras & ENDS
    shortest = SHORTEST * depth if both else 0.0
    return first - depth <= start and end <= last + depth and end - start > shortest


@njit(error_model='numpy', inline='always')
def climb(kind, sensor, layers, forces, shear, memory):
    """
    Give the load that was fitted the extras that the frame shows, one by one.

    Each must explain enough, by the scatter that is left; where nobody tells the noise, a rung
    that explains most by that alone, as it was part of what was taken for noise. Returns whether
    the load has shear.
    """
    load, below, tried = memory.fits[0], memory.fits[1], 0
    memory.state[0].unexplained = 0.0
    least = 1.0 if layers[0].given_noise > 0.0 else 0.0
    while True:
        extra, gain = _likelier_extra(
            kind, sensor, layers, forces if shear else forces // 2, tried, memory)
        spread = max(1.0, load.squared_error / max(load.used - 2.0 - forces, 1.0))
        would_leave = load.squared_error - gain
        if would_leave < MOSTLY * load.squared_error:  # as a patch on few tactels
            spread = max(least, would_leave / max(load.used - 3.0 - forces, 1.0))
        if gain < EVIDENCE * spread:
            memory.state[0].unexplained = gain / max(load.squared_error, gain)
            return shear
        copy_record(memory.fits, 0, memory.fits, 1)
        first, last = along_chord(sensor, load.rho, load.yaw)
        if extra == BEGINS:
            load.start = first
        elif extra == ENDS:
            load.end = last
        fitted, with_shear = fit_without_idle_shear(
            kind, sensor, layers, forces, load.extras | extra, memory)
        spread = max(least, load.squared_error / max(load.used - 3.0 - forces, 1.0))
        if (not fitted or below.squared_error - load.squared_error < EVIDENCE * spread
                or not _ends_show(sensor, load, layers[0].depth)):
            copy_record(memory.fits, 1, memory.fits, 0)
            tried |= extra
        else:
            shear, tried = with_shear, 0
        if load.squared_error > HOPELESS * load.used and (
                load.squared_error > MUCH * below.squared_error):
            return shear
