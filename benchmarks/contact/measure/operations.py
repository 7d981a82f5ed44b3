"""Operations per frame, counted in the source of the algorithms, beside Table 3.2."""

import ast
import inspect
import textwrap

from tactile_sensing.contact import gauss_newton, initial_guess, variable_projection
from tactile_sensing.half_space import kernels

TACTELS = 16 * 16
WINDOW = 9 * 9
THESIS = {'Berger and Khosla (average case), thesis': 8833, "thesis' algorithm, thesis": 1280}


def innermost(function):
    """Arithmetic operations in one pass of a function's innermost loops, branches included."""
    source = inspect.getsource(getattr(function, 'py_func', function))
    loops = [node for node in ast.walk(ast.parse(textwrap.dedent(source)))
             if isinstance(node, ast.For)]
    if not loops:
        raise ValueError(f'{function.__name__} has no loop to count in')
    inner = [loop for loop in loops if not any(
        isinstance(node, ast.For) for part in loop.body for node in ast.walk(part))]
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
    algebra = (innermost(variable_projection.normal_of_forces)
               + innermost(variable_projection.normal_of_place))
    passes = gauss_newton.STEPS + 1  # before the first step, and after each
    once = innermost(variable_projection.chi_square)
    per_tactel = {
        'line': algebra + innermost(kernels.add_line_forces) + innermost(kernels.add_line_place),
        'point': algebra + innermost(kernels.add_point_forces) + innermost(
            kernels.add_point_place)}
    peak = innermost(initial_guess.peak)
    before = {'line': TACTELS * (peak + innermost(initial_guess.guess_line)),
              'point': TACTELS * peak}
    return {
        **THESIS,
        # threshold; sums by row and column; y'Px; four products of length 16
        'six moments, separable': TACTELS * (1 + 2 + 2) + 2 * 2 * 16 + 8 * 16,
        'six moments, one matrix product': 2 * 6 * TACTELS,
        'line fit, 16x16': before['line'] + TACTELS * (passes * per_tactel['line'] + once),
        'point fit, 9x9, model 1': before['point'] + WINDOW * (
            passes * per_tactel['point'] + once),
        'of these per tactel and pass: line fit': per_tactel['line'],
        'of these per tactel and pass: point fit': per_tactel['point']}
