"""Scenes of an edge, read from YAML; `launch/scenes/straight.yaml` explains the format."""
from dataclasses import replace
import math
from pathlib import Path
from typing import Any

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_common.polyline import arc_length
from tactile_simulation.edge_shapes import lifted, polygon, Turtle
from tactile_simulation.edge_world import EdgeScene, Slip, Start
from tactile_simulation.scene_file import (
    common,
    MAX_LENGTH,
    numbers,
    one_of,
    part,
    place,
    section,
    within,
)
from tactile_simulation.sensor import Sensor, Skin

# Limits that protect the memory from wrong units and untrusted files:
MAX_WAY = 20.0  # total length of a path, or of a closed polygon [m]
MAX_PAIRS = 5000  # points of a polygon or of a height profile
MAX_GAPS = 200
MAX_WAVES = 1000  # on a path


def edge_scene(tree: Any, path: Path) -> EdgeScene:
    """Make a scene from a mapping of a file; ConfigurationError, see `load_scene`."""
    values = section(tree, '', ('name', 'description', 'edge'),
                     ('skin', 'sensor', 'start', 'plant', 'slip', 'calibration'))
    skin, start = part(values, 'skin', Skin), numbers(values.get('start', {}), 'start', Start)
    start['yaw'] = math.radians(start.get('yaw', 0.0))
    return EdgeScene(
        edge=_edge(values['edge']), skin=skin, start=Start(**start),
        slip=part(values, 'slip', Slip) if 'slip' in values else None,
        **common(values, path, _sensor(values.get('sensor', {}), skin)))


def _sensor(tree, skin):
    """Make the sensor; a given array scales its range and noise to the peak of 5 N on its pad."""
    if isinstance(tree, dict) and 'pitch' in tree:
        if 'pitch_x' in tree or 'pitch_y' in tree:
            raise ConfigurationError('sensor has pitch and pitch_x or pitch_y, must have either')
        tree = {**tree, 'pitch_x': tree['pitch'], 'pitch_y': tree['pitch']}
        del tree['pitch']
    values = numbers(tree, 'sensor', Sensor)
    sensor = Sensor(**values)
    if values.keys() & {'rows', 'columns', 'pitch_x', 'pitch_y'}:
        # (3.1): the peak of a line load is proportional to the load per length and to 1 / depth.
        usual = Sensor()
        share = (Skin.depth * usual.array.size_y) / (skin.depth * sensor.array.size_y)
        sensor = replace(sensor, **{
            key: share * getattr(usual, key) for key in ('noise_std', 'pa_per_count')
            if key not in values})
    return sensor


def _edge(tree):
    shape, rest = one_of(tree, 'edge', ('path', 'polygon'))
    walk = ('start', 'heading') if shape == 'path' else ('z',)
    values = section(rest, 'edge', walk, ('closed', 'height', 'wave', 'gaps'))
    closed = values.get('closed', False)
    if not isinstance(closed, bool):
        raise ConfigurationError(f'edge.closed is {closed!r:.60}, must be true or false')
    if shape == 'path':
        x, y, z = place('edge.start', values['start'])
        heading = within('edge.heading', values['heading'], -360.0, 360.0, 'degrees')
        plan = _walked(Turtle((x, y), math.radians(heading)), tree['path'], closed)
    else:
        z = within('edge.z', values['z'], -MAX_LENGTH, MAX_LENGTH)
        plan = _polygon(tree['polygon'], closed)
    way = arc_length(plan)[-1]
    return lifted(plan, z, height=_height(values.get('height')),
                  wave=_wave(values.get('wave'), way), gaps=_gaps(values.get('gaps', []), way))


def _walked(turtle, path, closed):
    """Return the vertices (N, 2) of the elements of a path."""
    if not isinstance(path, list) or not path:
        raise ConfigurationError(f'edge.path is {path!r}, must be a list of elements')
    way = 0.0
    for number, element in enumerate(path):
        name = f'edge.path[{number}]'
        kind, rest = one_of(element, name, ('straight', 'turn', 'arc'))
        section(rest, name, ())
        if kind == 'straight':
            length = within(f'{name}.straight', element[kind], 1e-4, MAX_LENGTH)
            way = _longer('edge.path', way, length)
            turtle.straight(length)
        elif kind == 'turn':
            turtle.turn(math.radians(
                within(f'{name}.turn', element[kind], -179.0, 179.0, 'degrees')))
        else:
            arc = section(element[kind], f'{name}.arc', ('radius', 'angle'))
            radius = within(f'{name}.arc.radius', arc['radius'], 1e-4, MAX_LENGTH)
            angle = within(f'{name}.arc.angle', arc['angle'], -360.0, 360.0, 'degrees')
            if angle == 0:
                raise ConfigurationError(f'{name}.arc.angle is 0, must turn')
            way = _longer('edge.path', way, radius * math.radians(abs(angle)))
            turtle.arc(radius, math.radians(angle))
    if len(turtle.points) < 2:
        raise ConfigurationError('edge.path has no length, must have a straight or an arc')
    plan = np.array(turtle.points)
    left_open = float(np.linalg.norm(plan[-1] - plan[0]))
    if closed and left_open > 1e-4:
        raise ConfigurationError(
            f'edge.path ends {left_open:.6g} m from its start, must be closed within 0.0001 m')
    if closed:
        plan[-1] = plan[0]
    return plan


def _longer(name, way, length):
    """Return the sum of a path length and a length [m]; ConfigurationError if it is too long."""
    if way + length > MAX_WAY:
        raise ConfigurationError(f'{name} is longer than {MAX_WAY:g} m, the most that is allowed')
    return way + length


def _polygon(tree, closed):
    values = section(tree, 'edge.polygon', ('points',), ('radius',))
    radius = within('edge.polygon.radius', values.get('radius', 0.0), 0.0, MAX_LENGTH)
    points = _pairs('edge.polygon.points', values['points'], 3 if closed else 2)
    _longer('edge.polygon', 0.0, arc_length(np.vstack([points, points[:1]]))[-1])
    try:
        return polygon(points, radius, closed)
    except ConfigurationError as error:
        raise ConfigurationError(f'edge.polygon: {error}') from error


def _height(tree):
    height = None if tree is None else _pairs('edge.height', tree, 2)
    if height is not None and (np.diff(height[:, 0]) < 0.0).any():
        raise ConfigurationError('edge.height: its distances must not decrease')
    return height


def _wave(tree, way):
    if tree is None:
        return None
    values = section(tree, 'edge.wave', ('height', 'length'))
    return (within('edge.wave.height', values['height'], 0.0, 0.1),
            within('edge.wave.length', values['length'], max(1e-3, way / MAX_WAVES), MAX_LENGTH))


def _gaps(tree, length):
    if tree == []:
        return []
    gaps = _pairs('edge.gaps', tree, 1, MAX_GAPS)
    for first, last in gaps:
        if not 0.0 <= first < last <= length:
            raise ConfigurationError(
                f'edge.gaps: {first:g} to {last:g} m is no part of 0 to {length:.6g} m')
    return gaps


def _pairs(name, tree, least, most=MAX_PAIRS):
    """Convert a list of pairs of lengths [m] to an array (N, 2)."""
    if not isinstance(tree, list) or not least <= len(tree) <= most:
        raise ConfigurationError(f'{name} is {tree!r:.60}, must be {least} to {most} pairs [m]')
    for number, pair in enumerate(tree):
        if not isinstance(pair, list) or len(pair) != 2:
            raise ConfigurationError(f'{name}[{number}] is {pair!r:.60}, must be two lengths [m]')
        for value in pair:
            within(f'{name}[{number}]', value, -MAX_LENGTH, MAX_LENGTH)
    return np.array(tree, dtype=float)
