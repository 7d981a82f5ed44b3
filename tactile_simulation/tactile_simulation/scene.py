"""Scenes: what the synthetic sensor touches, read from YAML."""
from dataclasses import dataclass, field, fields, MISSING
import math
from pathlib import Path
from typing import ClassVar

import numpy as np

from tactile_common.config import bounded, check_fields, types_of
from tactile_common.errors import ConfigurationError
from tactile_common.yaml_file import read_yaml
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.skin import Skin as LayerSkin
from tactile_simulation.edge_path import EdgePath
from tactile_simulation.scene_edge import edge_from, number, section


@dataclass(frozen=True)
class Skin:
    """Soft layer above the tactels."""

    depth: float = bounded(0.002, 'of the tactels below the surface', 'm', 1e-5, 0.1)
    stiffness: float = bounded(2e5, 'force per length of edge and indentation', 'N/m^2', 1.0, 1e9)
    thickness: float = bounded(
        0.0, 'from the surface to a rigid backing; 0: there is none', 'm', 0.0, 1.0)
    poisson: float = bounded(0.5, "Poisson's ratio; nothing depends on it without a backing", '',
                             0.0, 0.5)

    def __post_init__(self):
        check_fields(self, 'skin.')
        try:
            LayerSkin(self.depth, self.thickness or math.inf, self.poisson)
        except ConfigurationError as error:
            raise ConfigurationError(f'skin.{error}') from error

    @property
    def layer(self) -> LayerSkin:
        """The skin without its stiffness."""
        return LayerSkin(self.depth, self.thickness or math.inf, self.poisson)


@dataclass(frozen=True)
class Sensor:
    """The array, and how its tactels turn pressure into unsigned counts."""

    # 40 dB below the peak of 5 N on a pad of 25.4 mm.
    noise_std: float = bounded(630.0, 'standard deviation of one tactel', 'Pa', 0.0, 1e7)
    baseline: float = bounded(10.0, 'without load', 'counts', 0.0, 65535.0)
    pa_per_count: float = bounded(627.45, 'pressure of one count', 'Pa', 1e-3, 1e7)
    bits: int = bounded(8, 'of the converter', '', 4, 16)
    area: float = bounded(
        1.0, 'side of what a tactel averages over; 0: it samples its centre', 'pitches', 0.0, 1.0)
    gain_spread: float = bounded(
        0.0, "standard deviation of a tactel's gain that nobody calibrated", '', 0.0, 0.3)
    creep: float = bounded(
        0.0, 'share by which a reading grows under a load that rests', '', 0.0, 0.3)
    creep_time: float = bounded(5.0, 'time constant of that', 's', 0.01, 1e4)
    hysteresis: float = bounded(
        0.0, 'share by which a reading is higher while its load is taken away', '', 0.0, 0.3)
    crosstalk: float = bounded(
        0.0, 'share of a reading that each of the four neighbours gets', '', 0.0, 0.2)
    dead: int = bounded(
        0, 'tactels that always report the baseline, unknown to the driver', 'tactels', 0, 64)
    specimen: int = bounded(
        1, 'which of the sensors of this kind, each with gains and dead tactels of its own', '',
        0, 2**31 - 1)
    rows: int = bounded(16, "along the pad's y", 'tactels', 3, 256)
    columns: int = bounded(16, "along the pad's x", 'tactels', 3, 256)
    pitch_x: float = bounded(0.0254 / 16, 'distance of the columns', 'm', 1e-5, 0.1)
    pitch_y: float = bounded(0.0254 / 16, 'distance of the rows', 'm', 1e-5, 0.1)

    def __post_init__(self):
        check_fields(self, 'sensor.')
        if self.baseline >= 1 << self.bits:
            raise ConfigurationError(f'sensor.baseline is {self.baseline}, must be below '
                                     f'{1 << self.bits} = 2^bits')

    @property
    def array(self) -> TactelArray:
        """Geometry of the array."""
        return TactelArray(self.rows, self.columns, self.pitch_x, self.pitch_y)


@dataclass(frozen=True)
class Start:
    """Where the pad is at the beginning, see `Scene.start_pose`."""

    s: float = bounded(0.02, 'arc length along the edge', 'm', 0.0)
    offset: float = bounded(0.003, 'centre of the pad to the left of the edge', 'm', -0.1, 0.1)
    height: float = bounded(0.004, "of the pad's surface above the edge", 'm', -0.01, 0.5)
    yaw: float = bounded(
        0.0, "of the pad about its own +z, away from the edge's direction", 'rad',
        -math.pi, math.pi)

    def __post_init__(self):
        check_fields(self, 'start.')


@dataclass(frozen=True)
class Plant:
    """Robot and timing of a simulation; the defaults are those of the mock nodes' plant."""

    dead_time: float = bounded(0.0025, 'from a command to the first motion', 's', 0.0, 1.0)
    lag: float = bounded(
        0.010, 'time constant with which a joint follows its command', 's', 0.0, 1.0)
    acceleration: float = bounded(2.0, 'largest of the pad on each axis', 'm/s^2', 0.1, 100.0)
    latency: float = bounded(0.010, 'from the instant of a picture to its arrival', 's', 0.0, 1.0)
    stamp_error: float = bounded(
        0.0, "of a picture's stamp: later than the instant it shows", 's', -0.1, 0.1)

    def __post_init__(self):
        check_fields(self, 'plant.')


@dataclass(frozen=True)
class Slip:
    """A jump of the object to the left of its edge, once the pad has come so far."""

    s: float = bounded(MISSING, 'arc length of the pad at which the object slips', 'm', 0.0)
    offset: float = bounded(MISSING, 'by how much, to the left', 'm', -0.1, 0.1)

    def __post_init__(self):
        check_fields(self, 'slip.')


@dataclass(frozen=True, eq=False)
class Scene:
    """An edge, the skin that touches it, the sensor in the skin, and where it all begins."""

    action: ClassVar[str] = 'track_edge'  # that a servo is asked for
    name: str
    description: str
    edge: EdgePath
    skin: Skin = field(default_factory=Skin)
    sensor: Sensor = field(default_factory=Sensor)
    start: Start = field(default_factory=Start)
    plant: Plant = field(default_factory=Plant)
    slip: Slip | None = None
    # What the driver is told of the sensor; None: all that the scene says, but for its flaws.
    calibration: Path | None = None

    def __post_init__(self):
        if self.start.s > self.edge.length:
            raise ConfigurationError(
                f'start.s is {self.start.s}, must be at most the length of the edge, '
                f'{self.edge.length:.6g} m')

    def start_pose(self) -> np.ndarray:
        """
        First pose (4, 4) of the pad, sensor -> base, looking straight down at the edge.

        Pad z = base -z; pad y along the edge, turned by `start.yaw` about pad z (the edge then
        appears at minus that yaw in the picture); centre `start.offset` to the left of the edge
        (towards pad +x at yaw 0) and `start.height` above it.
        """
        along = self.edge.tangent_at(self.start.s)
        along = np.array([along[0], along[1], 0.0]) / math.hypot(along[0], along[1])
        down = np.array([0.0, 0.0, -1.0])
        left = np.cross(along, down)
        cos, sin = math.cos(self.start.yaw), math.sin(self.start.yaw)
        place = self.edge.point_at(self.start.s) + self.start.offset * left
        pose = np.eye(4)
        pose[:3] = np.column_stack([cos * left + sin * along, cos * along - sin * left, down,
                                    place - self.start.height * down])
        return pose


def load_scene(path) -> Scene:
    """
    Read a scene from a YAML file; those that come with the launch files explain the format.

    Raises
    ------
    ConfigurationError
        The file cannot be read, or a key is missing, unknown or has a value out of bounds.
    """
    return parsed(path, lambda tree: edge_scene(tree, Path(path)))


def parsed(path, make):
    """Return what `make` makes of a YAML file; its errors name the file."""
    try:
        return make(read_yaml(path))
    except ConfigurationError as error:
        raise ConfigurationError(f'scene {path}: {error}') from error


def edge_scene(tree, path: Path) -> Scene:
    """Return the scene of a mapping that has an `edge` and comes from a file, see `load_scene`."""
    values = section(tree, '', ('name', 'description', 'edge'),
                      ('skin', 'sensor', 'start', 'plant', 'slip', 'calibration'))
    for key in ('name', 'description'):
        if not isinstance(values[key], str) or not values[key].strip():
            raise ConfigurationError(f'{key} is {values[key]!r}, must be a text')
    start = numbers(values.get('start', {}), 'start', Start)
    start['yaw'] = math.radians(start.get('yaw', 0.0))
    skin = Skin(**numbers(values.get('skin', {}), 'skin', Skin))
    return Scene(
        values['name'], ' '.join(values['description'].split()), edge_from(values['edge']),
        skin, _sensor(values.get('sensor', {}), skin), Start(**start),
        Plant(**numbers(values.get('plant', {}), 'plant', Plant)),
        Slip(**numbers(values['slip'], 'slip', Slip)) if 'slip' in values else None,
        _beside(path, values['calibration']) if 'calibration' in values else None)


def _beside(path, name):
    """Path of a file that a scene names, from the folder of the scene."""
    if not isinstance(name, str) or not (path.parent / name).is_file():
        raise ConfigurationError(f'calibration is {name!r:.60}, must be a file, named from the '
                                 'folder of the scene')
    return path.parent / name


def _sensor(tree, skin):
    """Sensor; one whose array is named has range and noise for the peak of 5 N on its pad."""
    if isinstance(tree, dict) and 'pitch' in tree:
        if 'pitch_x' in tree or 'pitch_y' in tree:
            raise ConfigurationError('sensor has pitch and pitch_x or pitch_y, must have either')
        tree = {**tree, 'pitch_x': tree['pitch'], 'pitch_y': tree['pitch']}
        del tree['pitch']
    values = numbers(tree, 'sensor', Sensor)
    if values.keys() & {'rows', 'columns', 'pitch_x', 'pitch_y'}:
        # (3.1): the peak of a line load is as the load per length and the inverse of the depth.
        usual, array = Sensor(), Sensor(**values).array
        share = (Skin.depth * usual.array.size_y) / (skin.depth * array.size_y)
        values = {'noise_std': share * usual.noise_std,
                  'pa_per_count': share * usual.pa_per_count, **values}
    return Sensor(**values)


def numbers(tree, name, kind):
    """Return the numbers of a section; those with a default in the dataclass may be missing."""
    keys = [item.name for item in fields(kind) if item.default is MISSING]
    optional = [item.name for item in fields(kind) if item.default is not MISSING]
    values = {key: number(f'{name}.{key}', value)
              for key, value in section(tree, name, keys, optional).items()}
    return {key: float(value) if types_of(kind)[key] is float else value
            for key, value in values.items()}
