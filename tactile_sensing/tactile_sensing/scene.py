"""Scenes: what the synthetic sensor touches, read from YAML."""
from dataclasses import dataclass, fields
from functools import cached_property
import math
from pathlib import Path

from numba import njit
import numpy as np
import yaml

from tactile_sensing.errors import ConfigurationError

# Longest chord of an arc [m]; at a radius of 60 mm it leaves the circle by 0.13 um.
ARC_STEP = 0.25e-3
# Longest element of a path [m], so that a slip of units cannot fill the memory.
MAX_LENGTH = 10.0


@dataclass(frozen=True, eq=False)
class EdgePath:
    """
    Edge of a rigid object, as a polyline in the base frame with its direction of travel.

    Parameters
    ----------
    points : np.ndarray
        Vertices [m], shape `(N, 3)`, N >= 2, no two successive ones at one place.

    Raises
    ------
    ConfigurationError
        The points are not a polyline.
    """

    points: np.ndarray

    def __post_init__(self):
        points = np.array(self.points, dtype=float)
        if points.ndim != 2 or points.shape[1] != 3 or len(points) < 2:
            raise ConfigurationError(f'points have shape {points.shape}, must be (N >= 2, 3)')
        if not (np.isfinite(points).all() and (np.diff(points, axis=0) != 0).any(axis=1).all()):
            raise ConfigurationError('points must be finite and successively different')
        points.flags.writeable = False
        object.__setattr__(self, 'points', points)

    @cached_property
    def arclength(self) -> np.ndarray:
        """Length of the way from the first point to each point [m], shape `(N,)`."""
        steps = np.linalg.norm(np.diff(self.points, axis=0), axis=1)
        return np.concatenate(([0.0], np.cumsum(steps)))

    @property
    def length(self) -> float:
        """Length of the whole edge [m]."""
        return float(self.arclength[-1])

    def point_at(self, s):
        """
        Return the point at arc length `s`, held between the ends of the edge.

        Parameters
        ----------
        s : float or np.ndarray
            Arc length [m].

        Returns
        -------
        np.ndarray
            Point [m] in the base frame, shape `(3,)` or `s.shape + (3,)`.
        """
        return np.stack([np.interp(s, self.arclength, axis) for axis in self.points.T], axis=-1)

    def tangent_at(self, s) -> np.ndarray:
        """
        Return the unit direction of the chord at arc length `s`; at a corner, of the next one.

        Parameters
        ----------
        s : float or np.ndarray
            Arc length [m].

        Returns
        -------
        np.ndarray
            Direction in the base frame, shape `(3,)` or `s.shape + (3,)`.
        """
        index = np.searchsorted(self.arclength, s, side='right') - 1
        index = np.clip(index, 0, len(self.points) - 2)
        chord = self.points[index + 1] - self.points[index]
        return chord / np.linalg.norm(chord, axis=-1, keepdims=True)

    def nearest(self, points):
        """
        Project points onto the edge, seen from above (along base -z).

        Parameters
        ----------
        points : np.ndarray
            Points [m] in the base frame, shape `(M, 3)`.

        Returns
        -------
        lateral : np.ndarray
            Horizontal distance to the nearest point of the edge [m], shape `(M,)`; positive to
            the left of the direction of travel.
        s : np.ndarray
            Arc length of that point [m], shape `(M,)`, between 0 and `length`.
        """
        points = np.atleast_2d(np.asarray(points, dtype=float))
        return _nearest(points, self.points, self.arclength)


@njit(cache=True)
def _nearest(points, vertices, arclength):
    lateral = np.empty(len(points))
    along = np.empty(len(points))
    for m in range(len(points)):
        best, best_cross = np.inf, 0.0
        for n in range(len(vertices) - 1):
            ax, ay = points[m, 0] - vertices[n, 0], points[m, 1] - vertices[n, 1]
            bx = vertices[n + 1, 0] - vertices[n, 0]
            by = vertices[n + 1, 1] - vertices[n, 1]
            squared = bx * bx + by * by
            share = (ax * bx + ay * by) / squared if squared > 0.0 else 0.0
            if share <= 0.0:
                share, dx, dy = 0.0, ax, ay
            elif share >= 1.0:
                share = 1.0
                dx, dy = points[m, 0] - vertices[n + 1, 0], points[m, 1] - vertices[n + 1, 1]
            else:
                dx, dy = ax - share * bx, ay - share * by
            distance = dx * dx + dy * dy
            cross = (bx * dy - by * dx) / np.sqrt(squared) if squared > 0.0 else 0.0
            # Outside a sharp corner two chords are equally near; the one that sees the point
            # more from the side knows on which side it is.
            if distance < best or (distance == best and abs(cross) > abs(best_cross)):
                best, best_cross = distance, cross
                along[m] = arclength[n] + share * (arclength[n + 1] - arclength[n])
        lateral[m] = math.copysign(math.sqrt(best), best_cross)
    return lateral, along


@dataclass(frozen=True)
class Skin:
    """Soft layer above the tactels."""

    depth: float  # of the tactels below the surface [m]
    stiffness: float  # force per length of edge and per indentation [N/m^2]

    def __post_init__(self):
        _bounded('skin.depth', self.depth, 1e-5, 0.1, 'm')
        _bounded('skin.stiffness', self.stiffness, 1.0, 1e9, 'N/m^2')


@dataclass(frozen=True)
class Sensor:
    """How the tactels turn pressure into counts of eight bits."""

    noise_std: float  # standard deviation of one tactel [Pa]
    baseline: float  # counts without load
    pa_per_count: float  # pressure of one count [Pa]

    def __post_init__(self):
        _bounded('sensor.noise_std', self.noise_std, 0.0, 1e7, 'Pa')
        _bounded('sensor.baseline', self.baseline, 0.0, 255.0, 'counts')
        _bounded('sensor.pa_per_count', self.pa_per_count, 1e-3, 1e7, 'Pa')


@dataclass(frozen=True)
class Start:
    """Where the pad is at the beginning, see `Scene.start_pose`."""

    s: float  # arc length along the edge [m]
    offset: float  # centre of the pad to the left of the edge [m]
    height: float  # of the pad's surface above the edge [m]
    yaw: float  # of the pad about its own +z, away from the edge's direction [rad]

    def __post_init__(self):
        _bounded('start.s', self.s, 0.0, math.inf, 'm')
        _bounded('start.offset', self.offset, -0.1, 0.1, 'm')
        _bounded('start.height', self.height, -0.01, 0.5, 'm')
        _bounded('start.yaw', self.yaw, -math.pi, math.pi, 'rad')


@dataclass(frozen=True, eq=False)
class Scene:
    """An edge, the skin that touches it, the sensor in the skin, and where it all begins."""

    name: str
    description: str
    edge: EdgePath
    skin: Skin
    sensor: Sensor
    start: Start

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
    values = _section(tree, '', ('name', 'description', 'edge', 'skin', 'sensor', 'start'))
    for key in ('name', 'description'):
        if not isinstance(values[key], str) or not values[key].strip():
            raise ConfigurationError(f'{key} is {values[key]!r}, must be a text')
    start = _numbers(values['start'], 'start', Start)
    start['yaw'] = math.radians(start['yaw'])
    return Scene(
        name=values['name'],
        description=' '.join(values['description'].split()),
        edge=_edge(values['edge']),
        skin=Skin(**_numbers(values['skin'], 'skin', Skin)),
        sensor=Sensor(**_numbers(values['sensor'], 'sensor', Sensor)),
        start=Start(**start),
    )


def _edge(tree):
    values = _section(tree, 'edge', ('start', 'heading', 'path'))
    start = values['start']
    if not isinstance(start, list) or len(start) != 3:
        raise ConfigurationError(f'edge.start is {start!r}, must be a list [x, y, z] [m]')
    for axis, value in zip('xyz', start, strict=True):
        _bounded(f'edge.start.{axis}', value, -MAX_LENGTH, MAX_LENGTH, 'm')
    _bounded('edge.heading', values['heading'], -360.0, 360.0, 'degrees')
    path = values['path']
    if not isinstance(path, list) or not path:
        raise ConfigurationError(f'edge.path is {path!r}, must be a list of elements')
    turtle = _Turtle(start, math.radians(values['heading']))
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
    return EdgePath(np.array(turtle.points))


class _Turtle:
    """Walks in a horizontal plane and remembers its vertices."""

    def __init__(self, start, heading):
        self.points = [np.array(start, dtype=float)]
        self.heading = heading

    def straight(self, length):
        self._step(length, self.heading)

    def turn(self, angle):
        self.heading += angle

    def arc(self, radius, angle):
        count = math.ceil(radius * abs(angle) / ARC_STEP)
        step = angle / count
        for _ in range(count):
            self._step(2.0 * radius * math.sin(0.5 * abs(step)), self.heading + 0.5 * step)
            self.heading += step

    def _step(self, length, heading):
        step = length * np.array([math.cos(heading), math.sin(heading), 0.0])
        self.points.append(self.points[-1] + step)


def _section(tree, name, keys):
    """Return a mapping that has exactly these keys."""
    where = f'{name}: ' if name else ''
    if not isinstance(tree, dict):
        raise ConfigurationError(f'{where}is {tree!r:.60}, must be a mapping of {", ".join(keys)}')
    for key in tree:
        if key not in keys:
            raise ConfigurationError(
                f'{where}unknown key {key!r:.60}, must be one of {", ".join(keys)}')
    for key in keys:
        if key not in tree:
            raise ConfigurationError(f'{where}key {key!r} is missing')
    return tree


def _numbers(tree, name, kind):
    keys = tuple(field.name for field in fields(kind))
    values = _section(tree, name, keys)
    return {key: _number(f'{name}.{key}', values[key]) for key in keys}


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
