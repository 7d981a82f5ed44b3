"""
Scenes by name or from a YAML file.

The formats are explained in `launch/scenes/straight.yaml` for an edge and in
`launch/scenes/surfaces/sphere_126.yaml` for a surface.
"""
from collections.abc import Callable, Collection, Mapping
from dataclasses import fields, MISSING, replace
import difflib
from functools import partial
import math
import os
from pathlib import Path
import re
from typing import Any

import numpy as np

from tactile_common.config import built, checked
from tactile_common.errors import ConfigurationError
from tactile_common.polyline import arc_length
from tactile_common.yaml_file import mapping_of, read_yaml
from tactile_sensing.dome.finite_elements import SkinConfig
from tactile_sensing.dome.geometry import Dome
from tactile_simulation.edge_path import EdgePath, lifted, walk
from tactile_simulation.edge_world import EdgeScene, Slip, Start
from tactile_simulation.sensor import SceneSkin, Sensor
from tactile_simulation.surface_objects import PlacedObject, SolidObject, StepShape, Torus
from tactile_simulation.surface_world import SENSOR, SurfaceScene, SurfaceStart, TouchedObject
from tactile_simulation.world import Plant, Scene

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

# Optional sections of a scene's file, by what is touched; all but `slip` have defaults.
SECTIONS: dict[str, dict[str, type]] = {
    'edge': {'skin': SceneSkin, 'sensor': Sensor, 'start': Start, 'plant': Plant, 'slip': Slip},
    'surface': {'touch': TouchedObject, 'probe': Dome, 'rubber': SkinConfig, 'sensor': Sensor,
                'start': SurfaceStart, 'plant': Plant}}


def shipped_scenes() -> dict[str, Path]:
    """Return the files of the scenes of package edge_tracking by name; empty without it."""
    for prefix in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep):
        folder = Path(prefix, 'share', 'edge_tracking', 'scenes')
        if folder.is_dir():
            return {path.relative_to(folder).with_suffix('').as_posix(): path
                    for path in sorted(folder.rglob('*.yaml'))}
    return {}


def describe_scenes() -> str:
    """Return a text with name and description of each installed scene, one per line."""
    lines = ['scenes, or the path of a .yaml file of your own:']
    for name, path in shipped_scenes().items():
        found = re.search(r'^description: *(.+)$', path.read_text('utf-8'), re.M)
        lines.append(f'  {name:24}{found[1] if found else ""}')
    return '\n'.join(lines)


def find_scene(name: str | os.PathLike) -> Path:
    """Return the file of an installed scene or path; ConfigurationError if there is none."""
    known = shipped_scenes()
    if str(name) in known:
        return known[str(name)]
    path = Path(name)
    if path.exists() or path.suffix in ('.yaml', '.yml'):
        return path
    near = difflib.get_close_matches(str(name), known, 1) or [
        one for one in known if one.endswith(f'/{name}')]
    hint = f'did you mean {near[0]}? ' if near else ''
    raise ConfigurationError(f'scene {str(name)!r} is unknown; {hint}shipped are '
                             f'{", ".join(known)}; or give the path of a .yaml file')


def load_scene(name: str | os.PathLike) -> Scene:
    """
    Read a scene, see `find_scene`.

    Raises
    ------
    ConfigurationError
        The scene does not exist or cannot be read, or a key is missing, unknown or out of bounds.
    """
    path = find_scene(name)
    try:
        return _scene(read_yaml(path), path)
    except ConfigurationError as error:
        raise ConfigurationError(f'scene {path}: {error}') from error


def _scene(tree: Any, path: Path) -> Scene:
    body = 'surface' if isinstance(tree, dict) and 'surface' in tree else 'edge'
    sections = SECTIONS[body]
    values = mapping_of(tree, '', ('name', 'description', body), [*sections, 'calibration'])
    for key in ('name', 'description'):
        if not isinstance(values[key], str) or not values[key].strip():
            raise ConfigurationError(f'{key} is {values[key]!r}, must be a text')
    calibration = values.get('calibration')
    if calibration is not None:
        if not isinstance(calibration, str) or not (path.parent / calibration).is_file():
            raise ConfigurationError(f'calibration is {calibration!r:.60}, must be a file, named '
                                     'from the folder of the scene')
        calibration = path.parent / calibration
    usual = {'sensor': SENSOR} if body == 'surface' else {}
    parts = {key: _part(kind, values, key, usual.get(key))
             for key, kind in sections.items() if key in values or kind is not Slip}
    parts |= {'name': values['name'], 'description': ' '.join(values['description'].split()),
              'calibration': calibration}
    if body == 'surface':
        return SurfaceScene(surface=_surface(values[body]), dome=parts.pop('probe'), **parts)
    parts['sensor'] = _scaled(parts['sensor'], values.get('sensor', {}), parts['skin'])
    return EdgeScene(edge=_edge(values[body]), **parts)


def _surface(tree: Any) -> PlacedObject:
    kind, rest = _one_of(tree, 'surface', SHAPES)
    placed = mapping_of(rest, 'surface', ('top',), ('heading',))
    heading = _number('surface.heading', placed.get('heading', 0.0), -360.0, 360.0, 'degrees')
    make, needed, optional = SHAPES[kind]
    sizes = mapping_of(tree[kind] or {}, f'surface.{kind}', needed, optional)
    smallest = -1.0 if kind == 'step' else 1e-4
    shape = make(**{key: _number(f'surface.{kind}.{key}', value, smallest, MAX_LENGTH)
                    for key, value in sizes.items()})
    return PlacedObject(shape, _lengths('surface.top', placed['top'], 3), math.radians(heading))


def _scaled(sensor: Sensor, given: Mapping[str, Any], skin: SceneSkin) -> Sensor:
    """Scale range and noise, if not given, to the peak of 5 N on the pad of a given array."""
    if not given.keys() & {'rows', 'columns', 'pitch_x', 'pitch_y'}:
        return sensor
    # (3.1): the peak of a line load is proportional to the load per length and to 1 / depth.
    usual = Sensor()
    share = (SceneSkin.depth * usual.array.size_y) / (skin.depth * sensor.array.size_y)
    return replace(sensor, **{key: share * getattr(usual, key)
                              for key in ('noise_std', 'pa_per_count') if key not in given})


def _edge(tree: Any) -> EdgePath:
    values = mapping_of(tree, 'edge', ('start', 'heading', 'path'), ('height', 'wave', 'gaps'))
    x, y, z = _lengths('edge.start', values['start'], 3)
    heading = _number('edge.heading', values['heading'], -360.0, 360.0, 'degrees')
    plan = walk((x, y), math.radians(heading), _elements(values['path']))
    more: dict[str, Any] = {}
    if 'height' in values:
        more['height'] = _pairs('edge.height', values['height'])
        if (np.diff(more['height'][:, 0]) < 0.0).any():
            raise ConfigurationError('edge.height: its distances must not decrease')
    if 'wave' in values:
        wave = mapping_of(values['wave'], 'edge.wave', ('height', 'length'))
        more['wave'] = (_number('edge.wave.height', wave['height'], 0.0, 0.1),
                        _number('edge.wave.length', wave['length'], SHORTEST_WAVE, MAX_LENGTH))
    if values.get('gaps'):
        more['gaps'], way = _pairs('edge.gaps', values['gaps']), arc_length(plan)[-1]
        if (np.diff(more['gaps'].ravel(), prepend=-1e-9, append=way + 1e-9) <= 0.0).any():
            raise ConfigurationError(f'edge.gaps: must ascend within 0 to {way:.6g} m')
    return lifted(plan, z, **more)


def _elements(path: Any) -> list[tuple[float, float]]:
    """Return length [m] and turn [rad] of the elements of a path, see `walk`."""
    if not isinstance(path, list) or not path:
        raise ConfigurationError(f'edge.path is {path!r}, must be a list of elements')
    elements = []
    for count, element in enumerate(path):
        name = f'edge.path[{count}]'
        kind, rest = _one_of(element, name, ('straight', 'turn', 'arc'))
        mapping_of(rest, name, ())
        length = turn = 0.0
        if kind == 'straight':
            length = _number(f'{name}.straight', element[kind], 1e-4, MAX_LENGTH)
        elif kind == 'turn':
            turn = _number(f'{name}.turn', element[kind], -179.0, 179.0, 'degrees')
        else:
            arc = mapping_of(element[kind], f'{name}.arc', ('radius', 'angle'))
            turn = _number(f'{name}.arc.angle', arc['angle'], -360.0, 360.0, 'degrees')
            length = math.radians(abs(turn)) * _number(
                f'{name}.arc.radius', arc['radius'], 1e-4, MAX_LENGTH)
        elements.append((length, math.radians(turn)))
    way = sum(length for length, _ in elements)
    if not 0.0 < way <= MAX_WAY:
        raise ConfigurationError(
            f'edge.path is {way:g} m long, must be above 0 and at most {MAX_WAY:g} m')
    return elements


# Checks of what a file contains; each names the wrong value.

def _one_of(tree: Any, name: str, kinds: Collection[str]) -> tuple[str, dict[str, Any]]:
    """Return the one key of `kinds` that a mapping has, and the mapping without it."""
    if not isinstance(tree, dict):
        raise ConfigurationError(f'{name}: is {tree!r:.60}, must be a mapping')
    found = [kind for kind in kinds if kind in tree]
    if len(found) != 1:
        raise ConfigurationError(
            f'{name} has {len(found)} of {", ".join(kinds)}, must have exactly one')
    return found[0], {key: value for key, value in tree.items() if key != found[0]}


def _part(kind: type, values: Mapping[str, Any], name: str, defaults: Any = None) -> Any:
    """Return the dataclass of a section; fields that it lacks have those of `defaults`."""
    known = {item.name: item.default for item in fields(kind)}
    given = mapping_of(values.get(name, {}), name,
                     [key for key, default in known.items() if default is MISSING], known)
    return built(kind, {f'{name}.{key}': value for key, value in given.items()}, f'{name}.',
                 defaults)


def _number(name: str, value: Any, low: float, high: float, unit: str = 'm') -> float:
    return checked(name, value, float, {'range': (low, high), 'unit': unit})


def _lengths(name: str, value: Any, count: int) -> tuple[float, ...]:
    """Return a list of lengths of a file [m]."""
    if not isinstance(value, list) or len(value) != count:
        raise ConfigurationError(f'{name} is {value!r:.60}, must be a list of {count} lengths [m]')
    return tuple(_number(f'{name}[{index}]', item, -MAX_LENGTH, MAX_LENGTH)
                 for index, item in enumerate(value))


def _pairs(name: str, tree: Any) -> np.ndarray:
    """Return a list of pairs of lengths as an array (N, 2) [m]."""
    if not isinstance(tree, list) or not tree:
        raise ConfigurationError(f'{name} is {tree!r:.60}, must be a list of pairs [m]')
    return np.array([_lengths(f'{name}[{count}]', pair, 2) for count, pair in enumerate(tree)])
