"""
The least load that explains a frame, above the sharp one that is whole; all compiled.

The rungs: a point, or a line, with a patch; a line that begins or ends within the pad. A rung is
tried where the derivative by its parameter explains enough of what the load below leaves, and kept
where the fit with it leaves less by enough. Levenberg and Marquardt fit all parameters.
"""

import math

import numpy as np

from tactile_common.kernels import FAST, njit
from tactile_sensing.contact.gauss_newton import (
    CONVERGED,
    LINE,
    POINT,
    RESIDUAL,
    ROOT,
    VALUE,
    X,
    Y,
)
from tactile_sensing.contact.parameters import invert
from tactile_sensing.contact.variable_projection import weigh
from tactile_sensing.half_space.kernels import FORCE, Q0, Q1, SHEAR_X, SHEAR_Y
from tactile_sensing.half_space.layers import half_sides
from tactile_sensing.skin import kernels

# Rows beside those of `half_space.kernels.LOAD.vector`; of their bits are `extras` made.
VARIANCE, START, END = range(5, 8)
MODEL, ROWS = 8, 9  # the pressure itself, of `rows`
PATCH, BEGINS, ENDS = 1, 2, 4
EVIDENCE = 16.0  # chi-square that a rung must take off: four standard deviations
LEFT_OVER = 1.2  # chi-square per degree of freedom from which on a line may have ends
STEPS = 15  # most of them
SETTLED = 0.003  # a step after which none is needed [depths]
PANEL = 1.0  # of the integral along what a line lacks [depths]
BEYOND = 6.0  # depths beyond the pad from where nothing of a line is seen
_ABSCISSAS = np.array([-math.sqrt(0.6), 0.0, math.sqrt(0.6)])
_WEIGHTS = np.array([5.0, 8.0, 5.0]) / 18.0


@njit(error_model='numpy')
def along_chord(sensor, rho, yaw):
    """Where a line enters and leaves the pad, along itself from the origin's foot [m]."""
    half_x, half_y = half_sides(sensor)
    cos, sin = math.cos(yaw), math.sin(yaw)
    first, last = -np.inf, np.inf
    # x = rho cos - along sin, y = rho sin + along cos, both within the halves.
    for place, slope, half in ((rho * cos, -sin, half_x), (rho * sin, cos, half_y)):
        if abs(slope) > 1e-12:
            one, other = (-half - place) / slope, (half - place) / slope
            first, last = max(first, min(one, other)), min(last, max(one, other))
    return first, last


@njit(error_model='numpy', fastmath=FAST)
def _add_point(x, y, load, shape, slope, centre, scale, rows):
    force, shear_x, shear_y = load.force, load.shear_x, load.shear_y
    a, b = load.a, load.b
    by_a, by_b, of_force, of_x, of_y, of_variance, model = rows
    for i in range(x.size):
        u = x[i] - a
        v = y[i] - b
        squared = u * u + v * v
        f, g, df, dg, by_f, by_g = kernels.all_at(shape, slope, centre, squared)
        across = shear_x * u + shear_y * v
        by = force * df + across * dg
        by_a[i] -= scale * (by * u + shear_x * g)
        by_b[i] -= scale * (by * v + shear_y * g)
        of_force[i] += scale * f
        of_x[i] += scale * g * u
        of_y[i] += scale * g * v
        of_variance[i] += scale * (force * by_f + across * by_g)
        model[i] += scale * (force * f + across * g)


@njit(error_model='numpy', fastmath=FAST)
def _add_line(x, y, cos, sin, rho, load, shape, slope, centre, scale, rows):
    force, shear = load.force, load.shear
    by_rho, by_yaw, of_force, of_shear, _, of_variance, model = rows
    for i in range(x.size):
        v = x[i] * cos + y[i] * sin - rho
        squared = v * v
        f, g, df, dg, by_f, by_g = kernels.all_at(shape, slope, centre, squared)
        by = scale * ((force * df + shear * v * dg) * v + shear * g)
        by_rho[i] -= by
        by_yaw[i] += by * (y[i] * cos - x[i] * sin)
        of_force[i] += scale * f
        of_shear[i] += scale * g * v
        of_variance[i] += scale * (force * by_f + shear * v * by_g)
        model[i] += scale * (force * f + shear * v * g)


@njit(error_model='numpy', fastmath=FAST)
def _take_source(x, y, cos, sin, rho, at, load, shape, slope, centre, scale, rows):
    """Take off a point of the line, with the derivatives by all but its place along."""
    force, shear = load.force, load.shear
    by_rho, by_yaw, of_force, of_shear, _, of_variance, model = rows
    for i in range(x.size):
        v = x[i] * cos + y[i] * sin - rho
        along = y[i] * cos - x[i] * sin
        w = along - at
        squared = v * v + w * w
        f, g, df, dg, by_f, by_g = kernels.all_at(shape, slope, centre, squared)
        by = force * df + shear * v * dg
        by_v = scale * (by * v + shear * g)
        by_rho[i] += by_v
        by_yaw[i] -= by_v * along - scale * by * w * (v + rho)
        of_force[i] -= scale * f
        of_shear[i] -= scale * g * v
        of_variance[i] -= scale * (force * by_f + shear * v * by_g)
        model[i] -= scale * (force * f + shear * v * g)


@njit(error_model='numpy', fastmath=FAST)
def _add_tip(x, y, cos, sin, rho, at, load, shape, centre, scale, row):
    """Add the pressure of a metre of line at one place along it: the derivative by an end."""
    for i in range(x.size):
        v = x[i] * cos + y[i] * sin - rho
        w = y[i] * cos - x[i] * sin - at
        f, g, _, _, _, _ = kernels.all_at(shape, shape, centre, v * v + w * w)
        row[i] += scale * (load.force * f + load.shear * v * g)


@njit(error_model='numpy')
def _panels(first, last, depth):
    return max(1, int(math.ceil((last - first) / (PANEL * depth))))


@njit(error_model='numpy')
def add_lacking_rows(first, last, sensor, layer, k, load, shape, source, model):
    """Take the line between two places along it off a picture; source is memory for a load."""
    depth, centre = layer.depth, kernels.centre_of(layer.depth)
    kernel = kernels.coefficients_of(shape)
    cos, sin = math.cos(load.yaw), math.sin(load.yaw)
    count = _panels(first, last, depth)
    length = (last - first) / count
    for i in range(count):
        for j in range(3):
            at = first + (i + 0.5 + 0.5 * _ABSCISSAS[j]) * length
            share = -length * _WEIGHTS[j]
            source.a, source.b = load.rho * cos - at * sin, load.rho * sin + at * cos
            source.force, source.shear_x, source.shear_y = (
                share * load.force, share * load.shear * cos, share * load.shear * sin)
            for node in sensor.nodes:
                for r in range(sensor.y.size):
                    kernels.add_point_row(sensor.x + node.x, sensor.y[r] + node.y, source, kernel,
                                          centre, node.weight, model[k, r])


@njit(error_model='numpy')
def _lack(first, last, x, y, cos, sin, rho, load, shape, slope, centre, depth, scale, rows):
    """Take off the line between two places along it, by Gauss' points."""
    count = _panels(first, last, depth)
    length = (last - first) / count
    for i in range(count):
        for j in range(3):
            at = first + (i + 0.5 + 0.5 * _ABSCISSAS[j]) * length
            _take_source(x, y, cos, sin, rho, at, load, shape, slope, centre,
                         scale * length * _WEIGHTS[j], rows)


@njit(error_model='numpy')
def limits_of(sensor, load, depth):
    """Where the line enters and leaves the pad, and from where it is not seen."""
    first, last = along_chord(sensor, load.rho, load.yaw)
    reach = BEYOND * depth
    return first, last, first - reach, last + reach


@njit(error_model='numpy')
def _rows_of(kind, sensor, layers, load, tips, memory, rows):
    """Pressure of a load and its derivatives over the noise, at the gathered tactels."""
    tactels = memory.tactels
    at, ends = tactels.at, tactels.ends
    rows[:, :ends[-1]] = 0.0
    cos, sin = math.cos(load.yaw), math.sin(load.yaw)
    begin = 0
    for k in range(layers.size):
        layer, end, depth = layers[k], ends[k], layers[k].depth
        x, y = at[X][begin:end], at[Y][begin:end]
        part = (rows[Q0][begin:end], rows[Q1][begin:end], rows[FORCE][begin:end],
                rows[SHEAR_X][begin:end], rows[SHEAR_Y][begin:end], rows[VARIANCE][begin:end],
                rows[MODEL][begin:end])
        centre = kernels.centre_of(depth)
        kernels.make_shape(sensor.polynomials[k], depth, kind - 1, load.yaw, load.variance,
                           tactels.shapes[k], tactels.slopes[k])
        shape, slope = tactels.shapes[k], tactels.slopes[k]
        for j in range(sensor.nodes.size):
            node = sensor.nodes[j]
            scale, dx, dy = node.weight / layer.noise, x + node.x, y + node.y
            if kind == POINT:
                _add_point(dx, dy, load, shape, slope, centre, scale, part)
                continue
            _add_line(dx, dy, cos, sin, load.rho, load, shape, slope, centre, scale, part)
            if not tips:
                continue
            first, last, from_, to = limits_of(sensor, load, depth)
            tip, by_tip = memory.tip_shapes[0], memory.tip_shapes[1]
            kernels.make_shape(sensor.polynomials[k], depth, 0, 0.0, load.variance, tip, by_tip)
            start = load.start if load.extras & BEGINS else first
            stop = load.end if load.extras & ENDS else last
            _add_tip(dx, dy, cos, sin, load.rho, start, load, tip, centre, -scale,
                     rows[START][begin:end])
            _add_tip(dx, dy, cos, sin, load.rho, stop, load, tip, centre, scale,
                     rows[END][begin:end])
            if load.extras & BEGINS:
                _lack(from_, start, dx, dy, cos, sin, load.rho, load, tip, by_tip, centre, depth,
                      scale, part)
            if load.extras & ENDS:
                _lack(stop, to, dx, dy, cos, sin, load.rho, load, tip, by_tip, centre, depth,
                      scale, part)
        begin = end


@njit(error_model='numpy', fastmath=FAST)
def _dot(one, other, weights):
    total = 0.0
    for i in range(one.size):
        total += one[i] * other[i] * weights[i]
    return total


@njit(error_model='numpy')
def _normal_equations(memory, rows, active, count, scatter, matrix, vector):
    """Normal equations of the active parameters, lower triangle; returns chi-square."""
    n = memory.tactels.ends[-1]
    values, residual = memory.tactels.at[VALUE][:n], memory.tactels.at[RESIDUAL][:n]
    weights = memory.weights[:n]
    for i in range(n):
        off = scatter * rows[MODEL, i]
        residual[i] = values[i] - rows[MODEL, i]
        weights[i] = 1.0 / (1.0 + off * off)
    for i in range(count):
        row = rows[active[i], :n]
        vector[i] = _dot(row, residual, weights)
        for j in range(i + 1):
            matrix[i, j] = _dot(row, rows[active[j], :n], weights)
    return _dot(residual, residual, weights)


@njit(error_model='numpy')
def _active(forces, extras, active):
    """Rows of the parameters in use into active; their number."""
    count = 0
    for row in range(2 + forces):
        active[count] = row
        count += 1
    for bit, row in ((PATCH, VARIANCE), (BEGINS, START), (ENDS, END)):
        if extras & bit:
            active[count] = row
            count += 1
    return count


@njit(error_model='numpy')
def _parameter(load, row):
    if row == VARIANCE:
        return load.variance
    if row == START:
        return load.start
    if row == END:
        return load.end
    return load.vector[row]


@njit(error_model='numpy')
def _set_parameter(load, row, value):
    if row == VARIANCE:
        load.variance = value
    elif row == START:
        load.start = value
    elif row == END:
        load.end = value
    else:
        load.vector[row] = value


@njit(error_model='numpy')
def _bounded_step(kind, sensor, load, active, count, step, depth):
    """Shorten a step to where the model holds; its length [m]."""
    half_x, half_y = half_sides(sensor)
    lever = 1.0 if kind == POINT else math.hypot(half_x, half_y)
    length = math.hypot(step[0], lever * step[1])
    longest = length
    for i in range(count):
        if active[i] >= START:
            longest = max(longest, 0.25 * abs(step[i]))  # an end may be far off
    shorter = min(1.0, depth / longest) if longest > 0.0 else 1.0
    largest = kernels.largest_variance(depth)
    for i in range(count):
        step[i] *= shorter
        if active[i] == VARIANCE:
            step[i] = min(max(load.variance + step[i], 0.0), largest) - load.variance
            length = max(length, depth * abs(step[i]) / largest)
    return shorter * max(length, 4.0 * (longest - length) if longest > length else 0.0)


@njit(error_model='numpy')
def fit_extended(kind, sensor, layers, forces, extras, scatter, memory):
    """
    Fit a load with extras from where it is, to the tactels that the last fit gathered.

    The load, a record of FIT in the memory, gets its squared error, and the memory its covariance
    (8, 8). Returns whether it settled.
    """
    load, rows, active = memory.fit[0], memory.rows, memory.active
    load.extras = extras
    count = _active(forces, extras, active)
    for row in range(2 + forces, 5):
        load.vector[row] = 0.0
    depth, tips = layers[0].depth, (extras & (BEGINS | ENDS)) != 0
    matrix, vector, inverse, step = memory.matrix, memory.right, memory.inverse, memory.step
    kept = memory.kept_load
    _rows_of(kind, sensor, layers, load, tips, memory, rows)
    chi = _normal_equations(memory, rows, active, count, scatter, matrix, vector)
    damping, settled, done = 1e-3, False, 0
    memory.regular[0] = False
    while done < STEPS and not settled:
        done += 1
        for i in range(count):
            matrix[i, i] *= 1.0 + damping
        if not invert(matrix, count, inverse):
            return False
        for i in range(count):
            step[i] = 0.0
            for j in range(count):
                step[i] += inverse[i, j] * vector[j]
        length = _bounded_step(kind, sensor, load, active, count, step, depth)
        for i in range(count):
            kept[i] = _parameter(load, active[i])
            _set_parameter(load, active[i], kept[i] + step[i])
        _rows_of(kind, sensor, layers, load, tips, memory, rows)
        new = _normal_equations(memory, rows, active, count, scatter, matrix, vector)
        if new <= chi * (1.0 + 1e-9):
            settled = length <= SETTLED * depth
            chi, damping = new, 0.1 * damping
            continue
        if not new < np.inf or damping > 1e4:
            return False
        settled = length <= 0.1 * SETTLED * depth
        damping = max(10.0 * damping, 1e-2)
        for i in range(count):
            _set_parameter(load, active[i], kept[i])
        _rows_of(kind, sensor, layers, load, tips, memory, rows)
        chi = _normal_equations(memory, rows, active, count, scatter, matrix, vector)
    load.squared_error, load.iterations = chi, load.iterations + done
    load.converged = settled or length <= CONVERGED * depth
    memory.regular[0] = invert(matrix, count, inverse)
    memory.cov[:] = 0.0
    for i in range(count):
        for j in range(count):
            memory.cov[active[i], active[j]] = inverse[i, j]
    return load.force > 0.0 and chi < np.inf


@njit(error_model='numpy', fastmath=FAST)
def _add_patch_slope(kind, x, y, cos, sin, load, by_variance, centre, scale, row):
    """Add the derivative by the variance of a patch that is a point or a line as yet."""
    by_f, by_g = by_variance
    if kind == POINT:
        for i in range(x.size):
            u = x[i] - load.a
            v = y[i] - load.b
            t = centre / (u * u + v * v + centre)
            row[i] += scale * (load.force * kernels.value_of(by_f, t) + (
                load.shear_x * u + load.shear_y * v) * kernels.value_of(by_g, t))
    else:
        for i in range(x.size):
            v = x[i] * cos + y[i] * sin - load.rho
            t = centre / (v * v + centre)
            row[i] += scale * (load.force * kernels.value_of(by_f, t)
                               + load.shear * v * kernels.value_of(by_g, t))


@njit(error_model='numpy')
def patch_gain(kind, sensor, layers, forces, memory):
    """
    Chi-square that a patch would take off a sharp load, from what its fit has left behind.

    Leaves in the memory how that patch would move the load (hidden), 0 if none shows at all.
    """
    memory.hidden[:] = 0.0
    load, row, tactels = memory.fit[0], memory.rows[VARIANCE], memory.tactels
    count, ends = 2 + forces, tactels.ends
    n = ends[-1]
    if not invert(load.normal, count, memory.inverse):
        return 0.0
    row[:n] = 0.0
    cos, sin = math.cos(load.yaw), math.sin(load.yaw)
    begin = 0
    for k in range(layers.size):
        end, depth = ends[k], layers[k].depth
        kernels.make_first_slope(
            sensor.polynomials[k], depth, kind - 1, load.yaw, tactels.slopes[k])
        by_variance = kernels.coefficients_of(tactels.slopes[k])
        for node in sensor.nodes:
            x, y = tactels.at[X][begin:end] + node.x, tactels.at[Y][begin:end] + node.y
            _add_patch_slope(kind, x, y, cos, sin, load, by_variance, kernels.centre_of(depth),
                             node.weight / layers[k].noise, row[begin:end])
        begin = end
    residual, weights = tactels.at[RESIDUAL][:n], memory.weights[:n]
    if memory.scatter[0] > 0.0:
        weigh((row,), tactels.at[ROOT], n)
    weights[:] = 1.0
    gradient = _dot(row[:n], residual, weights)
    if not gradient > 0.0:
        return 0.0
    free = _dot(row[:n], row[:n], weights)
    for i in range(count):
        memory.right[i] = _dot(row[:n], tactels.by[i, :n], weights)
    for i in range(count):
        for j in range(count):
            free -= memory.inverse[i, j] * memory.right[i] * memory.right[j]
    if not free > 0.0:
        return 0.0
    for i in range(count):
        for j in range(count):
            memory.hidden[i] -= memory.inverse[i, j] * memory.right[j] * gradient / free
    return gradient * gradient / free


@njit(error_model='numpy')
def likelier_extra(kind, sensor, layers, forces, scatter, memory):
    """
    The extra that would explain most of what the load leaves, and how much; 0 if none would.

    Ends are looked for where more is left than noise: what hides in it moves nothing.
    """
    load, rows, active = memory.fit[0], memory.rows, memory.active
    freedom = max(load.used - 2.0 - forces, 1.0)
    tips = kind == LINE and load.squared_error > LEFT_OVER * freedom
    if not load.extras and not tips:
        return PATCH, patch_gain(kind, sensor, layers, forces, memory)
    _rows_of(kind, sensor, layers, load, tips, memory, rows)
    matrix, vector, inverse = memory.matrix, memory.right, memory.inverse
    count = _active(forces, load.extras, active)
    _normal_equations(memory, rows, active, count, scatter, matrix, vector)
    if not invert(matrix, count, inverse):
        return 0, 0.0
    n = memory.tactels.ends[-1]
    residual, weights = memory.tactels.at[RESIDUAL][:n], memory.weights[:n]
    best, most = 0, 0.0
    for bit, row, sign in ((PATCH, VARIANCE, 1.0), (BEGINS, START, 1.0), (ENDS, END, -1.0)):
        if load.extras & bit or (row != VARIANCE and not tips):
            continue
        by = rows[row, :n]
        gradient = sign * _dot(by, residual, weights)
        if gradient <= 0.0:
            continue
        free = _dot(by, by, weights)
        for i in range(count):
            vector[i] = _dot(by, rows[active[i], :n], weights)
        for i in range(count):
            for j in range(count):
                free -= inverse[i, j] * vector[i] * vector[j]
        gain = gradient * gradient / free if free > 0.0 else 0.0
        if gain > most:
            best, most = bit, gain
    return best, most
