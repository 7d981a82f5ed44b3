"""Operations per frame, counted in the source of the algorithms, beside Table 3.2."""

import ast
import inspect
import textwrap

from tactile_sensing import line_fit, point_fit

TACTELS = 16 * 16
WINDOW = 9 * 9
THESIS = {'Berger and Khosla (average case), thesis': 8833, "thesis' algorithm, thesis": 1280}


def innermost(function):
    """Arithmetic operations in one pass of a function's innermost loop, branches included."""
    source = inspect.getsource(getattr(function, 'py_func', function))
    loops = [node for node in ast.walk(ast.parse(textwrap.dedent(source)))
             if isinstance(node, ast.For)]
    outer = [loop for loop in loops if any(
        isinstance(node, ast.For) for part in loop.body for node in ast.walk(part))]
    inner = [loop for loop in loops if loop not in outer]
    return sum(_operations(loop) for loop in inner)


def _operations(loop):
    count = 0
    for part in loop.body:
        for node in ast.walk(part):
            if isinstance(node, (ast.BinOp, ast.AugAssign, ast.Compare)) or (
                    isinstance(node, ast.Call) and getattr(node.func, 'attr', '') == 'sqrt'):
                count += 1
    return count


def counts():
    """Name -> operations per frame of 16x16 tactels (point: 9x9 of them in the window)."""
    line_pass = innermost(line_fit._fit)
    start = TACTELS * innermost(line_fit._start)  # peak; level and sums
    passes = line_fit.STEPS + 2  # the force alone, the steps, the residuals
    point_pass = sum(innermost(part) for part in (
        point_fit._add_forces, point_fit._normal_of_forces, point_fit._add_position,
        point_fit._normal_of_position))
    return {
        **THESIS,
        # threshold; sums by row and column; y'Px; four products of length 16
        'six moments, separable': TACTELS * (1 + 2 + 2) + 2 * 2 * 16 + 8 * 16,
        'six moments, one matrix product': 2 * 6 * TACTELS,
        'line fit, 16x16': start + passes * line_pass * TACTELS,
        'point fit, 9x9, model 1': TACTELS + WINDOW * (
            (point_fit.STEPS + 1) * point_pass + innermost(point_fit._chi_square)),
        'of these per tactel and pass: line fit': line_pass,
        'of these per tactel and pass: point fit': point_pass}
