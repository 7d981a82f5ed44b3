"""Scenes of a round probe on a surface, read from YAML."""
from collections.abc import Callable
from dataclasses import dataclass, field
import math
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from tactile_common.config import bounded, check_fields
from tactile_common.errors import ConfigurationError
from tactile_sensing.dome.geometry import Dome
from tactile_sensing.dome.skin import SkinConfig
from tactile_simulation.scene import numbers, Plant, Sensor, Skin
from tactile_simulation.scene_edge import number, section
from tactile_simulation.surface_objects import (
    Ledge,
    mesh_beside,
    nearest_point,
    normal_at,
    Placed,
    SolidObject,
    StepShape,
    torus,
)

MOST = 10.0  # m
# Of the objects: the sizes that they must have, and how they are made of them.
SIZES = {'plane': (), 'cylinder': ('radius',), 'sphere': ('radius',), 'torus': ('ring', 'tube'),
         'step': ('height',), 'ledge': (), 'mesh': ('file',)}
SHAPES: dict[str, Callable[..., SolidObject]] = {
    'plane': lambda: torus(np.inf, np.inf), 'cylinder': lambda radius: torus(np.inf, radius),
    'sphere': lambda radius: torus(0.0, radius), 'torus': torus, 'step': StepShape,
    'ledge': Ledge}
PA_PER_COUNT = 1000.0  # of a probe: 15 N on a sphere of its own size do not saturate it


@dataclass(frozen=True)
class Touch:
    """How the object takes being touched."""

    friction: float = bounded(0.0, 'coefficient of Coulomb friction with the skin', '', 0.0, 3.0)
    fragile: float = bounded(0.0, 'force that breaks the object; 0: none does', 'N', 0.0, 1e4)

    def __post_init__(self):
        check_fields(self, 'touch.')


@dataclass(frozen=True)
class SurfaceStart:
    """Where the probe is at the beginning, see `SurfaceScene.start_pose`."""

    x: float = bounded(0.0, 'of the first contact, from where the object is placed', 'm', -1, 1)
    y: float = bounded(0.0, 'likewise', 'm', -1.0, 1.0)
    height: float = bounded(0.004, "of the probe's surface above the object", 'm', 0.0, 0.5)
    aside_x: float = bounded(
        0.0, 'place of the first contact on the pad: by this much the probe is turned', 'm',
        -0.02, 0.02)
    aside_y: float = bounded(0.0, 'likewise', 'm', -0.02, 0.02)

    def __post_init__(self):
        check_fields(self, 'start.')


@dataclass(frozen=True, eq=False)
class SurfaceScene:
    """An object, the round probe that touches it, and where it all begins."""

    action: ClassVar[str] = 'track_surface'  # that a servo is asked for
    name: str
    description: str
    surface: SolidObject
    top: tuple[float, float, float]
    touch: Touch = field(default_factory=Touch)
    dome: Dome = field(default_factory=Dome)
    rubber: SkinConfig = field(default_factory=SkinConfig)
    sensor: Sensor = field(default_factory=lambda: Sensor(pa_per_count=PA_PER_COUNT))
    start: SurfaceStart = field(default_factory=SurfaceStart)
    plant: Plant = field(default_factory=Plant)
    calibration: Path | None = None  # see `Scene`

    @property
    def skin(self) -> Skin:
        """Depth of the tactels, as the driver knows it."""
        return Skin(depth=self.dome.depth)

    def start_pose(self) -> np.ndarray:
        """First pose (4, 4) of the sensor: it looks at the object, and down."""
        start = self.start
        above = np.array(self.top) + [start.x, start.y, 0.0]
        contact = nearest_point(self.surface, above)
        outward = normal_at(self.surface, contact)
        level = np.array([1.0, 0.0, 0.0]) - outward[0] * outward
        ahead = level / np.linalg.norm(level)
        # z into the object, x ahead
        rotation = np.column_stack([ahead, np.cross(-outward, ahead), -outward])
        place = np.array([start.aside_x, start.aside_y])
        rotation = rotation @ _turned_to(self.dome.direction(place)).T
        pose = np.eye(4)
        pose[:3, :3] = rotation
        centre = contact + (start.height + self.dome.skin_radius) * outward
        pose[:3, 3] = centre - rotation @ self.dome.centre
        return pose


def _turned_to(direction):
    """Rotation (3, 3) that turns z the shortest way to a unit vector."""
    x, y, z = direction
    return np.array([[1.0 - x * x / (1.0 + z), -x * y / (1.0 + z), x],
                     [-x * y / (1.0 + z), 1.0 - y * y / (1.0 + z), y], [-x, -y, z]])


def surface_scene(tree: Any, path: Path) -> SurfaceScene:
    """
    Scene of a mapping that has a `surface`; `launch/scenes/sphere_126.yaml` explains the format.

    Raises
    ------
    ConfigurationError
        A key is missing, unknown or has a value out of bounds.
    """
    values = section(tree, '', ('name', 'description', 'surface'),
                     ('touch', 'probe', 'rubber', 'sensor', 'start', 'plant'))
    for key in ('name', 'description'):
        if not isinstance(values[key], str) or not values[key].strip():
            raise ConfigurationError(f'{key} is {values[key]!r}, must be a text')
    surface, top = _object(values['surface'], path)

    def part(name, kind):
        return kind(**numbers(values.get(name, {}), name, kind))
    scene = SurfaceScene(
        values['name'], ' '.join(values['description'].split()), surface, top,
        part('touch', Touch), part('probe', Dome), part('rubber', SkinConfig),
        Sensor(**{'pa_per_count': PA_PER_COUNT,
                  **numbers(values.get('sensor', {}), 'sensor', Sensor)}),
        part('start', SurfaceStart), part('plant', Plant))
    return scene


def _length(name, value, low, high):
    given = float(number(name, value))
    if not low <= given <= high:
        raise ConfigurationError(
            f'{name} is {value!r:.60}, must be between {low:g} and {high:g} m')
    return given


def _object(tree, path):
    """The object of the section `surface`, and where its first contact is."""
    found = [kind for kind in SIZES if isinstance(tree, dict) and kind in tree]
    if len(found) != 1:
        raise ConfigurationError(
            f'surface has {len(found)} of {", ".join(SIZES)}, must have exactly one')
    kind, = found
    values = section(tree, 'surface', (kind, 'top'), ('heading',))
    top = values['top']
    if not isinstance(top, list) or len(top) != 3:
        raise ConfigurationError(f'surface.top is {top!r:.60}, must be a list [x, y, z] [m]')
    x, y, z = (_length('surface.top', value, -MOST, MOST) for value in top)
    place = x, y, z
    heading = math.radians(number('surface.heading', values.get('heading', 0.0)))
    optional = ('scale',) if kind == 'mesh' else ('ahead',) if kind in ('step', 'ledge') else ()
    given = section(tree[kind] or {}, f'surface.{kind}', SIZES[kind], optional)
    if kind == 'mesh':
        scale = _length('surface.mesh.scale', given.get('scale', 1.0), 1e-6, 1e6)
        shape: SolidObject = mesh_beside(path, str(given['file']), scale)
    else:
        sizes = {key: _length(f'surface.{kind}.{key}', value, -1.0 if kind == 'step' else 1e-4,
                              MOST) for key, value in given.items()}
        shape = SHAPES[kind](**sizes)
    return Placed(shape, place, heading), place


