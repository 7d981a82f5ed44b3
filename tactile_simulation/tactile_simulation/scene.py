"""Scenes: what the synthetic sensor touches, read from YAML."""
from dataclasses import dataclass, field, fields, MISSING
import math
from pathlib import Path

import numpy as np
import yaml

from tactile_common.errors import ConfigurationError
from tactile_sensing.types.array import TactelArray
from tactile_simulation.edge_path import EdgePath
from tactile_simulation.edge_shapes import lifted, polygon, spline, Turtle

# Longest element of a path [m], so that a slip of units cannot fill the memory.
MAX_LENGTH = 10.0
MOST_TACTELS = 256  # along one side


@dataclass(frozen=True)
class Skin:
    """Soft layer above the tactels."""

    depth: float = 0.002  # of the tactels below the surface [m]
    stiffness: float = 2e5  # force per length of edge and per indentation [N/m^2]

    def __post_init__(self):
        _bounded('skin.depth', self.depth, 1e-5, 0.1, 'm')
        _bounded('skin.stiffness', self.stiffness, 1.0, 1e9, 'N/m^2')


@dataclass(frozen=True)
class Sensor:
    """The tactels, and how they turn pressure into counts of eight bits."""

    rows: int = 16
    columns: int = 16
    pitch_x: float = 0.0254 / 16  # between columns [m]
    pitch_y: float = 0.0254 / 16  # between rows [m]
    # Standard deviation of one tactel [Pa]: 40 dB below the peak of 5 N on a pad of 25.4 mm.
    noise_std: float = 630.0
    baseline: float = 10.0  # counts without load
    pa_per_count: float = 627.45  # pressure of one count [Pa]: 160 kPa at 255
    gain_spread: float = 0.0  # standard deviation of a tactel's gain that nobody calibrated
    dead: float = 0.0  # tactels that always report the baseline, unknown to the driver

    def __post_init__(self):
        for name in ('rows', 'columns'):
            value = _bounded(f'sensor.{name}', getattr(self, name), 3, MOST_TACTELS, 'tactels')
            if value != int(value):
                raise ConfigurationError(f'sensor.{name} is {value:g}, must be a whole number')
            object.__setattr__(self, name, int(value))
        _bounded('sensor.pitch_x', self.pitch_x, 1e-5, 0.1, 'm')
        _bounded('sensor.pitch_y', self.pitch_y, 1e-5, 0.1, 'm')
        _bounded('sensor.noise_std', self.noise_std, 0.0, 1e7, 'Pa')
        _bounded('sensor.baseline', self.baseline, 0.0, 255.0, 'counts')
        _bounded('sensor.pa_per_count', self.pa_per_count, 1e-3, 1e7, 'Pa')
        _bounded('sensor.gain_spread', self.gain_spread, 0.0, 0.3, '')
        _bounded('sensor.dead', self.dead, 0, 64, 'tactels')

    @property
    def array(self) -> TactelArray:
        """Geometry of the tactels."""
        return TactelArray(self.rows, self.columns, self.pitch_x, self.pitch_y)


@dataclass(frozen=True)
class Start:
    """Where the pad is at the beginning, see `Scene.start_pose`."""

    s: float = 0.02  # arc length along the edge [m]
    offset: float = 0.003  # centre of the pad to the left of the edge [m]
    height: float = 0.004  # of the pad's surface above the edge [m]
    yaw: float = 0.0  # of the pad about its own +z, away from the edge's direction [rad]

    def __post_init__(self):
        _bounded('start.s', self.s, 0.0, math.inf, 'm')
        _bounded('start.offset', self.offset, -0.1, 0.1, 'm')
        _bounded('start.height', self.height, -0.01, 0.5, 'm')
        _bounded('start.yaw', self.yaw, -math.pi, math.pi, 'rad')


@dataclass(frozen=True)
class Plant:
    """Robot and timing of a simulation; the defaults are those of the mock nodes' plant."""

    dead_time: float = 0.0025  # from a command to the first motion [s]
    lag: float = 0.010  # time constant with which a joint follows its command [s]
    acceleration: float = 2.0  # largest of the pad, along each axis [m/s^2]
    latency: float = 0.010  # from the instant that a picture shows to its arrival [s]
    stamp_error: float = 0.0  # of a picture's stamp: later than the instant it shows [s]

    def __post_init__(self):
        _bounded('plant.dead_time', self.dead_time, 0.0, 1.0, 's')
        _bounded('plant.lag', self.lag, 0.0, 1.0, 's')
        _bounded('plant.acceleration', self.acceleration, 0.1, 100.0, 'm/s^2')
        _bounded('plant.latency', self.latency, 0.0, 1.0, 's')
        _bounded('plant.stamp_error', self.stamp_error, -0.1, 0.1, 's')


@dataclass(frozen=True)
class Slip:
    """A jump of the object to the left of its edge, once the pad has come so far."""

    s: float  # arc length of the pad at which the object slips [m]
    offset: float  # by how much, to the left [m]

    def __post_init__(self):
        _bounded('slip.s', self.s, 0.0, math.inf, 'm')
        _bounded('slip.offset', self.offset, -0.1, 0.1, 'm')


@dataclass(frozen=True, eq=False)
class Scene:
    """An edge, the skin that touches it, the sensor in the skin, and where it all begins."""

    name: str
    description: str
    edge: EdgePath
    skin: Skin = field(default_factory=Skin)
    sensor: Sensor = field(default_factory=Sensor)
    start: Start = field(default_factory=Start)
    plant: Plant = field(default_factory=Plant)
    slip: Slip | None = None

    def __post_init__(self):
        if self.start.s > self.edge.length:
            raise ConfigurationError(
                f'start.s is {self.start.s}, must be at most the length of the edge, '
                f'{self.edge.length:.6g} m')

    def start_pose(self) -> np.ndarray:
        """
        Return the first pose of the pad, looking straight down at the edge.

        Pad z = base -z; pad y along the edge, turned by `start.yaw` about pad z (the edge then
        appears at minus that yaw in the picture); centre `start.offset` to the left of the edge
        (towards pad +x at yaw 0) and `start.height` above it.

        Returns
        -------
        np.ndarray
            Homogeneous transform sensor -> base, shape `(4, 4)`.
        """
        along = self.edge.tangent_at(self.start.s)
        along = np.array([along[0], along[1], 0.0]) / math.hypot(along[0], along[1])
        down = np.array([0.0, 0.0, -1.0])
        left = np.cross(along, down)
        cos, sin = math.cos(self.start.yaw), math.sin(self.start.yaw)
        pose = np.eye(4)
        pose[:3, 0] = cos * left + sin * along
        pose[:3, 1] = cos * along - sin * left
        pose[:3, 2] = down
        pose[:3, 3] = (
            self.edge.point_at(self.start.s)
            + self.start.offset * left - self.start.height * down)
        return pose


def load_scene(path) -> Scene:
    """
    Read a scene.

    Parameters
    ----------
    path : str or os.PathLike
        YAML file; the scenes that come with the launch files explain the format.

    Returns
    -------
    Scene

    Raises
    ------
    ConfigurationError
        The file cannot be read, or a key is missing, unknown or has a value out of bounds.
    """
    try:
        tree = yaml.safe_load(Path(path).read_text(encoding='utf-8'))
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, 'strerror', None) or 'not a text in UTF-8'
        raise ConfigurationError(f'scene {path}: cannot be read: {reason}') from error
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        text = ' '.join(str(error).split())
        raise ConfigurationError(f'scene {path}: is not YAML: {text:.300}') from error
    try:
        return _scene(tree)
    except ConfigurationError as error:
        raise ConfigurationError(f'scene {path}: {error}') from error


def _scene(tree):
    values = _section(tree, '', ('name', 'description', 'edge'),
                      ('skin', 'sensor', 'start', 'plant', 'slip'))
    for key in ('name', 'description'):
        if not isinstance(values[key], str) or not values[key].strip():
            raise ConfigurationError(f'{key} is {values[key]!r}, must be a text')
    start = _numbers(values.get('start', {}), 'start', Start)
    start['yaw'] = math.radians(start.get('yaw', 0.0))
    skin = Skin(**_numbers(values.get('skin', {}), 'skin', Skin))
    return Scene(
        name=values['name'],
        description=' '.join(values['description'].split()),
        edge=_edge(values['edge']),
        skin=skin,
        sensor=_sensor(values.get('sensor', {}), skin),
        start=Start(**start),
        plant=Plant(**_numbers(values.get('plant', {}), 'plant', Plant)),
        slip=Slip(**_numbers(values['slip'], 'slip', Slip)) if 'slip' in values else None,
    )


def _sensor(tree, skin):
    """Sensor; one whose array is named has range and noise for the peak of 5 N on its pad."""
    if isinstance(tree, dict) and 'pitch' in tree:
        if 'pitch_x' in tree or 'pitch_y' in tree:
            raise ConfigurationError('sensor has pitch and pitch_x or pitch_y, must have either')
        tree = {**tree, 'pitch_x': tree['pitch'], 'pitch_y': tree['pitch']}
        del tree['pitch']
    values = _numbers(tree, 'sensor', Sensor)
    if values.keys() & {'rows', 'columns', 'pitch_x', 'pitch_y'}:
        # (3.1): the peak of a line load is as the load per length and the inverse of the depth.
        usual, array = Sensor(), Sensor(**values).array
        share = (Skin.depth * usual.array.size_y) / (skin.depth * array.size_y)
        values = {'noise_std': share * usual.noise_std,
                  'pa_per_count': share * usual.pa_per_count, **values}
    return Sensor(**values)


def _edge(tree):
    shape, rest = _one_of(tree, 'edge', ('path', 'polygon', 'spline'))
    walk = ('start', 'heading') if shape == 'path' else ('z',)
    values = _section(rest, 'edge', walk, ('closed', 'height', 'wave', 'gaps'))
    closed = values.get('closed', False)
    if not isinstance(closed, bool):
        raise ConfigurationError(f'edge.closed is {closed!r:.60}, must be true or false')
    if shape == 'path':
        plan, z = _walk(values, tree['path'], closed)
    else:
        z = _bounded('edge.z', values['z'], -MAX_LENGTH, MAX_LENGTH, 'm')
        make = _polygon if shape == 'polygon' else _spline
        plan = make(tree[shape], closed)
    length = float(np.linalg.norm(np.diff(plan, axis=0), axis=1).sum())
    return lifted(plan, z, height=_height(values.get('height')), wave=_wave(values.get('wave')),
                  gaps=_gaps(values.get('gaps', []), length))


def _walk(values, path, closed):
    start = values['start']
    if not isinstance(start, list) or len(start) != 3:
        raise ConfigurationError(f'edge.start is {start!r}, must be a list [x, y, z] [m]')
    for axis, value in zip('xyz', start, strict=True):
        _bounded(f'edge.start.{axis}', value, -MAX_LENGTH, MAX_LENGTH, 'm')
    _bounded('edge.heading', values['heading'], -360.0, 360.0, 'degrees')
    if not isinstance(path, list) or not path:
        raise ConfigurationError(f'edge.path is {path!r}, must be a list of elements')
    turtle = Turtle(start[:2], math.radians(values['heading']))
    for number, element in enumerate(path):
        name = f'edge.path[{number}]'
        if not isinstance(element, dict) or len(element) != 1:
            raise ConfigurationError(f'{name} is {element!r}, must be one of straight, turn, arc')
        (kind, value), = element.items()
        if kind == 'straight':
            turtle.straight(_bounded(f'{name}.straight', value, 1e-4, MAX_LENGTH, 'm'))
        elif kind == 'turn':
            turtle.turn(math.radians(_bounded(f'{name}.turn', value, -179.0, 179.0, 'degrees')))
        elif kind == 'arc':
            arc = _section(value, f'{name}.arc', ('radius', 'angle'))
            radius = _bounded(f'{name}.arc.radius', arc['radius'], 1e-4, MAX_LENGTH, 'm')
            angle = _bounded(f'{name}.arc.angle', arc['angle'], -360.0, 360.0, 'degrees')
            if angle == 0:
                raise ConfigurationError(f'{name}.arc.angle is 0, must turn')
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


def _polygon(tree, closed):
    values = _section(tree, 'edge.polygon', ('points',), ('radius',))
    radius = _bounded('edge.polygon.radius', values.get('radius', 0.0), 0.0, MAX_LENGTH, 'm')
    try:
        return polygon(
            _pairs('edge.polygon.points', values['points'], 3 if closed else 2), radius, closed)
    except ConfigurationError as error:
        raise ConfigurationError(f'edge.polygon: {error}') from error


def _spline(tree, closed):
    values = _section(tree, 'edge.spline', ('points',))
    try:
        return spline(_pairs('edge.spline.points', values['points'], 4), closed)
    except ConfigurationError as error:
        raise ConfigurationError(f'edge.spline: {error}') from error


def _height(tree):
    if tree is None:
        return None
    height = _pairs('edge.height', tree, 2)
    if (np.diff(height[:, 0]) < 0.0).any():
        raise ConfigurationError('edge.height: its distances must not decrease')
    return height


def _wave(tree):
    if tree is None:
        return None
    values = _section(tree, 'edge.wave', ('height', 'length'))
    return (_bounded('edge.wave.height', values['height'], 0.0, 0.1, 'm'),
            _bounded('edge.wave.length', values['length'], 1e-3, MAX_LENGTH, 'm'))


def _gaps(tree, length):
    if tree == []:
        return []
    gaps = _pairs('edge.gaps', tree, 1)
    for first, last in gaps:
        if not 0.0 <= first < last <= length:
            raise ConfigurationError(
                f'edge.gaps: {first:g} to {last:g} m is no part of 0 to {length:.6g} m')
    return gaps


def _pairs(name, tree, least):
    """Return a list of pairs of lengths [m] as an array (N, 2)."""
    if not isinstance(tree, list) or len(tree) < least:
        raise ConfigurationError(f'{name} is {tree!r:.60}, must be at least {least} pairs [m]')
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


def _section(tree, name, keys, optional=()):
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


def _numbers(tree, name, kind):
    """Numbers of a section; those with a default in the dataclass may be missing."""
    keys = [item.name for item in fields(kind) if item.default is MISSING]
    optional = [item.name for item in fields(kind) if item.default is not MISSING]
    values = _section(tree, name, keys, optional)
    return {key: _number(f'{name}.{key}', value) for key, value in values.items()}


def _number(name, value):
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        # YAML 1.1 takes 2e5 for a text.
        hint = ' (write an exponent like 2.0e+5)' if _is_number(value) else ''
        raise ConfigurationError(f'{name} is {value!r:.60}, must be a number{hint}')
    return float(value) if abs(value) < 1e300 else math.inf


def _is_number(value):
    try:
        return isinstance(value, str) and math.isfinite(float(value))
    except ValueError:
        return False


def _bounded(name, value, low, high, unit):
    number = _number(name, value)
    if not (math.isfinite(number) and low <= number <= high):  # NaN fails as well
        raise ConfigurationError(
            f'{name} is {value!r:.60}, must be between {low:g} and {high:g} {unit}')
    return number
