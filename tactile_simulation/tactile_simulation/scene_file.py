"""
Scenes from the contents of their files.

The formats are explained in `launch/scenes/straight.yaml` for an edge and in
`launch/scenes/surfaces/sphere_126.yaml` for a surface.
"""
from collections.abc import Callable, Collection, Mapping
from dataclasses import fields, MISSING, replace
from functools import partial
import math
from pathlib import Path
from typing import Any

import numpy as np

from tactile_common.config import check_fields, checked, types_of
from tactile_common.errors import ConfigurationError
from tactile_common.polyline import arc_length
from tactile_sensing.dome.finite_elements import SkinConfig
from tactile_sensing.dome.geometry import Dome
from tactile_simulation.edge_path import EdgePath, lifted, walk
from tactile_simulation.edge_world import EdgeScene, Slip, Start
from tactile_simulation.sensor import Sensor, Skin
from tactile_simulation.surface_objects import Placed, SolidObject, StepShape, Torus
from tactile_simulation.surface_world import PA_PER_COUNT, SurfaceScene, SurfaceStart, Touch
from tactile_simulation.world import Plant

MAX_LENGTH = 10.0  # m, of a coordinate or a part
MAX_WAY = 20.0  # m, of a path: bounds the memory that a file can demand
SHORTEST_WAVE = 0.005  # m, likewise: a wave has 64 vertices

# For each kind of object: its constructor, required sizes and optional sizes.
SHAPES: dict[str, tuple[Callable[..., SolidObject], tuple[str, ...], tuple[str, ...]]] = {
    'plane': (lambda: Torus(np.inf, np.inf), (), ()),
    'cylinder': (lambda radius: Torus(np.inf, radius), ('radius',), ()),
    'sphere': (lambda radius: Torus(0.0, radius), ('radius',), ()),
    'torus': (Torus, ('ring', 'tube'), ()),
    'step': (StepShape, ('height',), ('ahead',)),
    'ledge': (partial(StepShape, -np.inf), (), ('ahead',))}


def edge_scene(tree: Any, path: Path) -> EdgeScene:
    """Return the scene of an edge from a mapping; ConfigurationError, see `load_scene`."""
    values = mapping(tree, '', ('name', 'description', 'edge'),
                     ('skin', 'sensor', 'start', 'plant', 'slip', 'calibration'))
    skin, start = part(Skin, values, 'skin'), part(Start, values, 'start')
    return EdgeScene(
        edge=_edge(values['edge']), skin=skin, start=start,
        slip=part(Slip, values, 'slip') if 'slip' in values else None,
        sensor=_scaled(part(Sensor, values, 'sensor'), values.get('sensor', {}), skin),
        **_common(values, path))


def surface_scene(tree: Any, path: Path) -> SurfaceScene:
    """Return the scene of a surface from a mapping; ConfigurationError, see `load_scene`."""
    values = mapping(tree, '', ('name', 'description', 'surface'),
                     ('touch', 'probe', 'rubber', 'sensor', 'start', 'plant', 'calibration'))
    kind, rest = one_of(values['surface'], 'surface', SHAPES)
    placed = mapping(rest, 'surface', ('top',), ('heading',))
    top = lengths('surface.top', placed['top'], 3)
    heading = math.radians(within(
        'surface.heading', placed.get('heading', 0.0), -360.0, 360.0, 'degrees'))
    make, needed, optional = SHAPES[kind]
    sizes = mapping(values['surface'][kind] or {}, f'surface.{kind}', needed, optional)
    shape = make(**{key: within(f'surface.{kind}.{key}', value,
                                -1.0 if kind == 'step' else 1e-4, MAX_LENGTH)
                    for key, value in sizes.items()})
    return SurfaceScene(
        surface=Placed(shape, top, heading), top=top, touch=part(Touch, values, 'touch'),
        dome=part(Dome, values, 'probe'), rubber=part(SkinConfig, values, 'rubber'),
        start=part(SurfaceStart, values, 'start'),
        sensor=part(Sensor, values, 'sensor', pa_per_count=PA_PER_COUNT), **_common(values, path))


def _common(values, path):
    """Return the fields of a scene that do not depend on the touched object."""
    for key in ('name', 'description'):
        if not isinstance(values[key], str) or not values[key].strip():
            raise ConfigurationError(f'{key} is {values[key]!r}, must be a text')
    calibration = values.get('calibration')
    if calibration is not None:
        if not isinstance(calibration, str) or not (path.parent / calibration).is_file():
            raise ConfigurationError(f'calibration is {calibration!r:.60}, must be a file, named '
                                     'from the folder of the scene')
        calibration = path.parent / calibration
    return {'name': values['name'], 'description': ' '.join(values['description'].split()),
            'plant': part(Plant, values, 'plant'), 'calibration': calibration}


def _scaled(sensor, given, skin):
    """Scale range and noise, if not given, to the peak of 5 N on the pad of a given array."""
    if not given.keys() & {'rows', 'columns', 'pitch_x', 'pitch_y'}:
        return sensor
    # (3.1): the peak of a line load is proportional to the load per length and to 1 / depth.
    usual = Sensor()
    share = (Skin.depth * usual.array.size_y) / (skin.depth * sensor.array.size_y)
    return replace(sensor, **{key: share * getattr(usual, key)
                              for key in ('noise_std', 'pa_per_count') if key not in given})


def _edge(tree: Any) -> EdgePath:
    values = mapping(tree, 'edge', ('start', 'heading', 'path'), ('height', 'wave', 'gaps'))
    x, y, z = lengths('edge.start', values['start'], 3)
    heading = within('edge.heading', values['heading'], -360.0, 360.0, 'degrees')
    plan = walk((x, y), math.radians(heading), _elements(values['path']))
    more: dict[str, Any] = {}
    if 'height' in values:
        more['height'] = _pairs('edge.height', values['height'])
        if (np.diff(more['height'][:, 0]) < 0.0).any():
            raise ConfigurationError('edge.height: its distances must not decrease')
    if 'wave' in values:
        wave = mapping(values['wave'], 'edge.wave', ('height', 'length'))
        more['wave'] = (within('edge.wave.height', wave['height'], 0.0, 0.1),
                        within('edge.wave.length', wave['length'], SHORTEST_WAVE, MAX_LENGTH))
    if values.get('gaps'):
        more['gaps'], way = _pairs('edge.gaps', values['gaps']), arc_length(plan)[-1]
        if (np.diff(more['gaps'].ravel(), prepend=-1e-9, append=way + 1e-9) <= 0.0).any():
            raise ConfigurationError(f'edge.gaps: must ascend within 0 to {way:.6g} m')
    return lifted(plan, z, **more)


def _elements(path):
    """Return length [m] and turn [rad] of the elements of a path, see `walk`."""
    if not isinstance(path, list) or not path:
        raise ConfigurationError(f'edge.path is {path!r}, must be a list of elements')
    elements = []
    for count, element in enumerate(path):
        name = f'edge.path[{count}]'
        kind, rest = one_of(element, name, ('straight', 'turn', 'arc'))
        mapping(rest, name, ())
        length = turn = 0.0
        if kind == 'straight':
            length = within(f'{name}.straight', element[kind], 1e-4, MAX_LENGTH)
        elif kind == 'turn':
            turn = within(f'{name}.turn', element[kind], -179.0, 179.0, 'degrees')
        else:
            arc = mapping(element[kind], f'{name}.arc', ('radius', 'angle'))
            turn = within(f'{name}.arc.angle', arc['angle'], -360.0, 360.0, 'degrees')
            length = math.radians(abs(turn)) * within(
                f'{name}.arc.radius', arc['radius'], 1e-4, MAX_LENGTH)
        elements.append((length, math.radians(turn)))
    way = sum(length for length, _ in elements)
    if not 0.0 < way <= MAX_WAY:
        raise ConfigurationError(
            f'edge.path is {way:g} m long, must be above 0 and at most {MAX_WAY:g} m')
    return elements


# Checks of what a file contains; each names the wrong value.

def mapping(tree: Any, name: str, keys: Collection[str],
            optional: Collection[str] = ()) -> dict[str, Any]:
    """Return a mapping after a check: it has all `keys` and no others except `optional` ones."""
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


def one_of(tree: Any, name: str, kinds: Collection[str]) -> tuple[str, dict[str, Any]]:
    """Return the one key of `kinds` that a mapping has, and the mapping without it."""
    if not isinstance(tree, dict):
        raise ConfigurationError(f'{name}: is {tree!r:.60}, must be a mapping')
    found = [kind for kind in kinds if kind in tree]
    if len(found) != 1:
        raise ConfigurationError(
            f'{name} has {len(found)} of {", ".join(kinds)}, must have exactly one')
    return found[0], {key: value for key, value in tree.items() if key != found[0]}


def part(kind: type, values: Mapping[str, Any], name: str, **defaults: Any) -> Any:
    """Return the dataclass of numbers of a section, which may lack those with a default."""
    keys = {item.name: item.default for item in fields(kind)}
    needed = [key for key, default in keys.items() if default is MISSING]
    given = mapping(values.get(name, {}), name, needed, keys)
    made = kind(**{**defaults, **{
        key: float(number(f'{name}.{key}', value)) if types_of(kind)[key] is float
        else number(f'{name}.{key}', value) for key, value in given.items()}})
    check_fields(made, f'{name}.')
    return made


def number(name: str, value: Any) -> float | int:
    """Return a number of a file; infinite if it is too large."""
    if isinstance(value, str):  # YAML 1.1 reads 2e5 as a text
        try:
            value = float(value)
        except ValueError:
            pass
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ConfigurationError(f'{name} is {value!r:.60}, must be a number')
    return math.inf if abs(value) >= 1e300 else value


def within(name: str, value: Any, low: float, high: float, unit: str = 'm') -> float:
    """Return a number of a file after a check of its bounds, both allowed."""
    return checked(name, float(number(name, value)), float, {'range': (low, high), 'unit': unit})


def lengths(name: str, value: Any, count: int) -> tuple[float, ...]:
    """Return a list of lengths of a file [m]."""
    if not isinstance(value, list) or len(value) != count:
        raise ConfigurationError(f'{name} is {value!r:.60}, must be a list of {count} lengths [m]')
    return tuple(within(f'{name}[{index}]', item, -MAX_LENGTH, MAX_LENGTH)
                 for index, item in enumerate(value))


def _pairs(name, tree):
    """Return a list of pairs of lengths as an array (N, 2) [m]."""
    if not isinstance(tree, list) or not tree:
        raise ConfigurationError(f'{name} is {tree!r:.60}, must be a list of pairs [m]')
    return np.array([lengths(f'{name}[{count}]', pair, 2) for count, pair in enumerate(tree)])
