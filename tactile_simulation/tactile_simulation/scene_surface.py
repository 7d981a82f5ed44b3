"""Scenes of a surface from YAML; `launch/scenes/surfaces/sphere_126.yaml` explains the format."""
from collections.abc import Callable
from functools import partial
import math
from pathlib import Path
from typing import Any

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_sensing.dome.finite_elements import SkinConfig
from tactile_sensing.dome.geometry import Dome
from tactile_simulation.scene_file import (
    common,
    MAX_LENGTH,
    number,
    numbers,
    one_of,
    part,
    place,
    section,
    within,
)
from tactile_simulation.sensor import Sensor
from tactile_simulation.surface_objects import Mesh, Placed, SolidObject, StepShape, Torus
from tactile_simulation.surface_world import PA_PER_COUNT, SurfaceScene, SurfaceStart, Touch

# For each kind of object: its constructor, required sizes and optional sizes.
SHAPES: dict[str, tuple[Callable[..., SolidObject], tuple[str, ...], tuple[str, ...]]] = {
    'plane': (lambda: Torus(np.inf, np.inf), (), ()),
    'cylinder': (lambda radius: Torus(np.inf, radius), ('radius',), ()),
    'sphere': (lambda radius: Torus(0.0, radius), ('radius',), ()),
    'torus': (Torus, ('ring', 'tube'), ()),
    'step': (StepShape, ('height',), ('ahead',)),
    'ledge': (partial(StepShape, -np.inf), (), ('ahead',)),
    'mesh': (Mesh, ('file',), ('scale',))}


def surface_scene(tree: Any, path: Path) -> SurfaceScene:
    """Make a scene from a mapping of a file; ConfigurationError, see `load_scene`."""
    values = section(tree, '', ('name', 'description', 'surface'),
                     ('touch', 'probe', 'rubber', 'sensor', 'start', 'plant', 'calibration'))
    kind, rest = one_of(values['surface'], 'surface', SHAPES)
    placed = section(rest, 'surface', ('top',), ('heading',))
    top = place('surface.top', placed['top'])
    heading = math.radians(number('surface.heading', placed.get('heading', 0.0)))
    sensor = Sensor(**{'pa_per_count': PA_PER_COUNT,
                       **numbers(values.get('sensor', {}), 'sensor', Sensor)})
    return SurfaceScene(
        surface=Placed(_shape(kind, values['surface'][kind] or {}, path), top, heading), top=top,
        touch=part(values, 'touch', Touch), dome=part(values, 'probe', Dome),
        rubber=part(values, 'rubber', SkinConfig), start=part(values, 'start', SurfaceStart),
        **common(values, path, sensor))


def _shape(kind, tree, path):
    """Make the object of a section, in its own frame."""
    make, needed, optional = SHAPES[kind]
    given = section(tree, f'surface.{kind}', needed, optional)
    if kind == 'mesh':
        if not isinstance(given['file'], str):
            raise ConfigurationError(f'surface.mesh.file is {given["file"]!r:.60}, must be a text')
        scale = within('surface.mesh.scale', given.get('scale', 1.0), 1e-6, 1e6, '')
        return Mesh(str(path.parent / given['file']), scale)
    least = -1.0 if kind == 'step' else 1e-4
    return make(**{key: within(f'surface.{kind}.{key}', value, least, MAX_LENGTH)
                   for key, value in given.items()})
