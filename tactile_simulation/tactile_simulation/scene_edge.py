"""The edge of a scene, read from the YAML that describes it."""
import math
from typing import Any

import numpy as np

from tactile_common.config import checked
from tactile_common.errors import ConfigurationError
from tactile_common.polyline import arc_length
from tactile_simulation.edge_path import EdgePath
from tactile_simulation.edge_shapes import lifted, polygon, spline, Turtle

# So that neither a slip of units nor a file of a stranger fills the memory:
MAX_LENGTH = 10.0  # of an element of a path [m]
MAX_WAY = 20.0  # of all of them, or round all points [m]
MAX_PAIRS = 5000  # points of a polygon, a spline or a height
MAX_GAPS = 200
MAX_WAVES = 1000


def edge_from(tree: Any) -> EdgePath:
    """
    Return the edge of the section `edge`; the shipped scenes explain the format.

    Raises
    ------
    ConfigurationError
        A key is missing, unknown or has a value out of bounds.
    """
    shape, rest = _one_of(tree, 'edge', ('path', 'polygon', 'spline'))
    walk = ('start', 'heading') if shape == 'path' else ('z',)
    values = section(rest, 'edge', walk, ('closed', 'height', 'wave', 'gaps'))
    closed = values.get('closed', False)
    if not isinstance(closed, bool):
        raise ConfigurationError(f'edge.closed is {closed!r:.60}, must be true or false')
    if shape == 'path':
        plan, z = _walk(values, tree['path'], closed)
    else:
        z = _bounded('edge.z', values['z'], -MAX_LENGTH, MAX_LENGTH, 'm')
        make = _polygon if shape == 'polygon' else _spline
        plan = make(tree[shape], closed)
    way = arc_length(plan)[-1]
    return lifted(plan, z, height=_height(values.get('height')),
                  wave=_wave(values.get('wave'), way), gaps=_gaps(values.get('gaps', []), way))


def _walk(values, path, closed):
    start = values['start']
    if not isinstance(start, list) or len(start) != 3:
        raise ConfigurationError(f'edge.start is {start!r}, must be a list [x, y, z] [m]')
    for axis, value in zip('xyz', start, strict=True):
        _bounded(f'edge.start.{axis}', value, -MAX_LENGTH, MAX_LENGTH, 'm')
    _bounded('edge.heading', values['heading'], -360.0, 360.0, 'degrees')
    if not isinstance(path, list) or not path:
        raise ConfigurationError(f'edge.path is {path!r}, must be a list of elements')
    turtle, way = Turtle(start[:2], math.radians(values['heading'])), 0.0
    for number, element in enumerate(path):
        name = f'edge.path[{number}]'
        if not isinstance(element, dict) or len(element) != 1:
            raise ConfigurationError(f'{name} is {element!r}, must be one of straight, turn, arc')
        (kind, value), = element.items()
        if kind == 'straight':
            length = _bounded(f'{name}.straight', value, 1e-4, MAX_LENGTH, 'm')
            way = _longer('edge.path', way, length)
            turtle.straight(length)
        elif kind == 'turn':
            turtle.turn(math.radians(_bounded(f'{name}.turn', value, -179.0, 179.0, 'degrees')))
        elif kind == 'arc':
            arc = section(value, f'{name}.arc', ('radius', 'angle'))
            radius = _bounded(f'{name}.arc.radius', arc['radius'], 1e-4, MAX_LENGTH, 'm')
            angle = _bounded(f'{name}.arc.angle', arc['angle'], -360.0, 360.0, 'degrees')
            if angle == 0:
                raise ConfigurationError(f'{name}.arc.angle is 0, must turn')
            way = _longer('edge.path', way, radius * math.radians(abs(angle)))
            turtle.arc(radius, math.radians(angle))
        else:
            raise ConfigurationError(
                f'{name}: unknown key {kind!r}, must be one of straight, turn, arc')
    if len(turtle.points) < 2:
        raise ConfigurationError('edge.path has no length, must have a straight or an arc')
    plan = np.array(turtle.points)
    left_open = float(np.linalg.norm(plan[-1] - plan[0]))
    if closed and left_open > 1e-4:
        raise ConfigurationError(
            f'edge.path ends {left_open:.6g} m from its start, must be closed within 0.0001 m')
    if closed:
        plan[-1] = plan[0]
    return plan, float(start[2])


def _longer(name, way, length):
    """Return a way with a length more [m]."""
    if way + length > MAX_WAY:
        raise ConfigurationError(f'{name} is longer than {MAX_WAY:g} m, the most that is allowed')
    return way + length


def _polygon(tree, closed):
    values = section(tree, 'edge.polygon', ('points',), ('radius',))
    radius = _bounded('edge.polygon.radius', values.get('radius', 0.0), 0.0, MAX_LENGTH, 'm')
    try:
        return polygon(
            _places('edge.polygon.points', values['points'], 3 if closed else 2), radius, closed)
    except ConfigurationError as error:
        raise ConfigurationError(f'edge.polygon: {error}') from error


def _spline(tree, closed):
    values = section(tree, 'edge.spline', ('points',))
    try:
        return spline(_places('edge.spline.points', values['points'], 4), closed)
    except ConfigurationError as error:
        raise ConfigurationError(f'edge.spline: {error}') from error


def _height(tree):
    height = None if tree is None else _pairs('edge.height', tree, 2)
    if height is not None and (np.diff(height[:, 0]) < 0.0).any():
        raise ConfigurationError('edge.height: its distances must not decrease')
    return height


def _wave(tree, way):
    if tree is None:
        return None
    values = section(tree, 'edge.wave', ('height', 'length'))
    shortest = max(1e-3, way / MAX_WAVES)
    return (_bounded('edge.wave.height', values['height'], 0.0, 0.1, 'm'),
            _bounded('edge.wave.length', values['length'], shortest, MAX_LENGTH, 'm'))


def _gaps(tree, length):
    if tree == []:
        return []
    gaps = _pairs('edge.gaps', tree, 1, MAX_GAPS)
    for first, last in gaps:
        if not 0.0 <= first < last <= length:
            raise ConfigurationError(
                f'edge.gaps: {first:g} to {last:g} m is no part of 0 to {length:.6g} m')
    return gaps


def _places(name, tree, least):
    """As `_pairs`, of points whose polygon is no longer than `MAX_WAY`."""
    points = _pairs(name, tree, least)
    _longer(name, 0.0, np.linalg.norm(np.diff(points, axis=0, append=points[:1]), axis=1).sum())
    return points


def _pairs(name, tree, least, most=MAX_PAIRS):
    """Return a list of pairs of lengths [m] as an array (N, 2)."""
    if not isinstance(tree, list) or not least <= len(tree) <= most:
        raise ConfigurationError(f'{name} is {tree!r:.60}, must be {least} to {most} pairs [m]')
    for number, pair in enumerate(tree):
        if not isinstance(pair, list) or len(pair) != 2:
            raise ConfigurationError(f'{name}[{number}] is {pair!r:.60}, must be two lengths [m]')
        for value in pair:
            _bounded(f'{name}[{number}]', value, -MAX_LENGTH, MAX_LENGTH, 'm')
    return np.array(tree, dtype=float)


def _one_of(tree, name, kinds):
    """Return the one of the keys that a mapping has, and the mapping without it."""
    if not isinstance(tree, dict):
        raise ConfigurationError(f'{name}: is {tree!r:.60}, must be a mapping')
    found = [kind for kind in kinds if kind in tree]
    if len(found) != 1:
        raise ConfigurationError(
            f'{name} has {len(found)} of {", ".join(kinds)}, must have exactly one')
    return found[0], {key: value for key, value in tree.items() if key != found[0]}


def section(tree: Any, name: str, keys, optional=()) -> dict[str, Any]:
    """Return a mapping that has these keys, and at most the optional ones besides."""
    where = f'{name}: ' if name else ''
    if not isinstance(tree, dict):
        raise ConfigurationError(f'{where}is {tree!r:.60}, must be a mapping of {", ".join(keys)}')
    for key in tree:
        if key not in keys and key not in optional:
            raise ConfigurationError(
                f'{where}unknown key {key!r:.60}, must be one of '
                f'{", ".join([*keys, *optional])}')
    for key in keys:
        if key not in tree:
            raise ConfigurationError(f'{where}key {key!r} is missing')
    return tree


def number(name: str, value: Any) -> float | int:
    """Return a number of a file, infinite where it is too large for one."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        # YAML 1.1 takes 2e5 for a text.
        hint = ' (write an exponent like 2.0e+5)' if _isnumber(value) else ''
        raise ConfigurationError(f'{name} is {value!r:.60}, must be a number{hint}')
    return value if abs(value) < 1e300 else math.inf


def _isnumber(value):
    try:
        return isinstance(value, str) and math.isfinite(float(value))
    except ValueError:
        return False


def _bounded(name, value, low, high, unit):
    number(name, value)
    return checked(name, value, float, {'range': (low, high), 'unit': unit})
