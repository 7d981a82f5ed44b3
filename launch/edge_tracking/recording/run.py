"""Run of a sensor and its servo: its data as arrays, read from a recording."""
from array import array
from collections import Counter, defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cache, partial
from itertools import repeat
import json
from pathlib import Path
from typing import Any

import numpy as np

from edge_tracking.recording.settings import Settings
from edge_tracking.recording.topics import GraphBag
from tactile_common.errors import TactileError
from tactile_common.ros.conversions import pose_from_msg, stamp_to_ns, stamp_to_seconds
from tactile_sensing.conversions import sensor_info_from_msg
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.image import SensorInfo
from tactile_servo.journal import Call, WITH_TEXT
from tactile_shape.conversions import patch_from_msg
from tactile_simulation.metrics import accelerations

MOST = 60_000  # messages of a topic, evenly spaced, that are read; of others only the stamps
_COMPONENT_ZZ = 0


def _column(dtype: Any = float, shape: tuple[int, ...] = (),
            read: Callable[[Any], Any] | None = None) -> Any:
    """Declare a column: type and shape of a value, and a reader if it is not a field."""
    return field(metadata={'dtype': dtype, 'shape': shape, 'read': read})


def _stamp() -> Any:
    return _column(np.int64, (), lambda message: stamp_to_ns(message.header.stamp))


def xyz(vector: Any) -> tuple[float, float, float]:
    """Return the components of a vector or a point in a message."""
    return vector.x, vector.y, vector.z


def _matrix(message: Any) -> np.ndarray:
    try:
        return pose_from_msg(message.pose)
    except TactileError:
        return np.full((4, 4), np.nan)


@dataclass(frozen=True, eq=False)
class Table:
    """Columns of N rows, one row per message."""

    @classmethod
    def row(cls: Any, message: Any) -> tuple:
        """Return the values of a message in the order of the columns."""
        return tuple([getattr(message, name) if read is None else read(message)
                      for name, _, _, read in _columns(cls)])

    @classmethod
    def of(cls: Any, rows: Sequence[tuple], **known: Any) -> Any:
        """Make a table of such rows; `known` are the fields that are not columns."""
        values = zip(*rows, strict=True) if rows else repeat(())
        for (name, dtype, shape, _), column in zip(_columns(cls), values, strict=False):
            known[name] = np.array(column, dtype=dtype).reshape(len(rows), *shape)
        return cls(**known)


@cache
def _columns(table: Any) -> list[tuple[str, Any, tuple[int, ...], Any]]:
    """Return name, type, shape and reader of each column."""
    return [(item.name, *item.metadata.values()) for item in fields(table) if item.metadata]


@dataclass(frozen=True, eq=False)
class Images(Table):
    """Images of the pressure layer."""

    frames: np.ndarray  # (N, rows, columns), NaN = invalid tactel
    array: TactelArray | None  # None without images
    unit: str
    stamp_ns: np.ndarray = _stamp()
    sequence: np.ndarray = _column(np.int64)


@dataclass(frozen=True, eq=False)
class Contacts(Table):
    """Contact estimates, `(N,)` each; fields as in Contact.msg."""

    stamp_ns: np.ndarray = _stamp()
    type: np.ndarray = _column(np.int64)
    valid: np.ndarray = _column(bool)
    force_valid: np.ndarray = _column(bool)
    x: np.ndarray = _column()
    y: np.ndarray = _column()
    yaw: np.ndarray = _column()
    normal_force: np.ndarray = _column()
    m0: np.ndarray = _column(read=lambda message: message.moments[0])  # [N, or counts m^2]
    centre_of_pressure: np.ndarray = _column(  # [m]
        shape=(2,), read=lambda message: xyz(message.centre_of_pressure)[:2])
    latency: np.ndarray = _column(read=lambda message: stamp_to_seconds(message.latency))  # [s]


@dataclass(frozen=True, eq=False)
class Statuses(Table):
    """Status messages of the servo, `(N,)` each; fields as in ServoStatus.msg."""

    stamp_ns: np.ndarray = _stamp()
    controller: np.ndarray = _column(object)
    state: np.ndarray = _column(np.int64)
    reason: np.ndarray = _column(object)
    reason_code: np.ndarray = _column(np.int64)
    contact_stamp_ns: np.ndarray = _column(
        np.int64, read=lambda message: stamp_to_ns(message.contact_stamp))
    lateral_error: np.ndarray = _column()
    longitudinal_error: np.ndarray = _column()
    force_target: np.ndarray = _column()
    speed: np.ndarray = _column()
    progress: np.ndarray = _column()
    latency: np.ndarray = _column()
    cpu_time: np.ndarray = _column()
    cycles: np.ndarray = _column(np.int64)
    missed_cycles: np.ndarray = _column(np.int64)


@dataclass(frozen=True, eq=False)
class Poses(Table):
    """Poses of the sensor in the base frame, homogeneous transforms `(N, 4, 4)`."""

    stamp_ns: np.ndarray = _stamp()
    matrix: np.ndarray = _column(shape=(4, 4), read=_matrix)

    @property
    def position(self) -> np.ndarray:
        """Positions of the pad's centre [m], shape `(N, 3)`."""
        return self.matrix[:, :3, 3]


@dataclass(frozen=True, eq=False)
class RunData:
    """One run of a sensor and its servo; arrays are empty for topics that were not recorded."""

    namespace: str
    start_ns: int
    images: Images
    contacts: Contacts
    statuses: Statuses
    poses: Poses
    contour: np.ndarray  # (N, 3), points of the newest contour [m]
    patches: list  # every valid Patch of a surface
    info: SensorInfo | None  # the newest; None if the recording lacks it
    joint_acceleration: np.ndarray = field(  # (K, n), from the joint states [rad/s^2]
        default_factory=lambda: np.empty((0, 0)))
    stamps: Mapping[str, np.ndarray] = field(  # stamps of all messages [ns] by topic name
        default_factory=lambda: defaultdict(partial(np.empty, 0, np.int64)))
    every: Mapping[str, int] = field(default_factory=dict)  # one of this many was read
    goals: Sequence[Mapping[str, Any]] = ()  # fields of each goal
    parameters: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)  # by node
    nodes: frozenset[str] = frozenset()  # names of the nodes with diagnostics
    touches: Poses = field(  # contacts with a surface, z along the outward normal
        default_factory=lambda: Poses.of([]))

    def seconds(self, time_ns: Any) -> np.ndarray:
        """Convert times [ns] to seconds since the first message that was read."""
        return (np.asarray(time_ns, dtype=np.int64) - self.start_ns) * 1e-9


def read_run(path: str | Path, namespace: str | None = None, *,
             joints: bool = True) -> RunData:
    """
    Read a run from a rosbag2 recording: its folder, or one of its files.

    Without `joints` the joint states are not read. Raises a ConfigurationError if there is no
    recording, or if it contains several sensors and no namespace is given.
    """
    with GraphBag(path, namespace) as bag, bag.clear_errors():
        wanted = {topic: name for topic, name in bag.name.items()
                  if name in _READ and (joints or name != 'joint_states')}
        every = {name: -(-bag.count(topic) // MOST) or 1 for topic, name in wanted.items()
                 if name in _THINNED}
        rows, seen = defaultdict[str, list[Any]](list), Counter[str]()
        stamps = {name: array('q') for name in _STAMPED}
        for row in bag.messages(wanted):
            name = wanted[row.topic]
            if name in stamps:
                stamps[name].append(row.stamp_ns)
            seen[name] += 1
            if (seen[name] - 1) % every.get(name, 1):
                continue
            if name in _NEWEST:
                rows[name].clear()
            with row.reading():
                rows[name] += _READ[name](row.message)
        return RunData(
            namespace=bag.prefix,
            start_ns=bag.span[0],
            images=_images(rows['image']),
            contacts=Contacts.of(rows['contact']),
            statuses=Statuses.of(rows['servo_status']),
            poses=Poses.of(rows['sensor_pose']),
            contour=np.array(rows['contour'], float).reshape(-1, 3),
            patches=rows['surface_patch'],
            info=next(iter(rows['sensor_info']), None),
            nodes=frozenset(rows['diagnostics']),
            touches=Poses.of(rows['surface_contact']),
            joint_acceleration=_joint_acceleration(rows['joint_states']),
            stamps={name: np.asarray(known) for name, known in stamps.items()},
            every=every,
            goals=rows['servo_calls'],
            parameters=Settings(bag).recorded,
        )


def _image(message: Any) -> list[Any]:
    """Return a list with shallowest pressure, (unit, pitches) and columns, or an empty list."""
    layers = [layer for layer in message.layers if layer.component == _COMPONENT_ZZ
              and layer.stress.size == message.rows * message.columns > 0]
    return [(layer.stress.reshape(message.rows, message.columns),
             (layer.unit, message.pitch_x, message.pitch_y), Images.row(message))
            for layer in sorted(layers, key=lambda layer: layer.depth)[:1]]


def _images(rows: Sequence[Any]) -> 'Images':
    """Return the table of images that have the shape of the first one."""
    if not rows:
        return Images.of([], frames=np.empty((0, 0, 0), np.float32), array=None, unit='')
    first, (unit, *pitches), _ = rows[0]
    frames, _, kept = zip(*(row for row in rows if row[0].shape == first.shape), strict=True)
    return Images.of(kept, frames=np.array(frames, np.float32), unit=unit,
                         array=TactelArray(*first.shape, *pitches))


def _goals(calls: Any) -> list[dict[str, Any]]:
    """Return the fields of the goals that begin in a ServoCalls message."""
    named = calls.call[np.isin(calls.call, WITH_TEXT)].tolist()
    return [dict(json.loads(text)) for call, text in zip(named, calls.texts, strict=False)
            if call == Call.START]


# Functions that return the rows of a message, by the name of its topic.
_READ: dict[str, Callable[[Any], list[Any]]] = {
    'image': _image,
    'contact': lambda message: [Contacts.row(message)],
    'servo_status': lambda message: [Statuses.row(message)],
    'sensor_pose': lambda message: [Poses.row(message)],
    'surface_contact': lambda message: [Poses.row(message)],
    'surface_patch': lambda message: [patch_from_msg(message)] if message.valid else [],
    'contour': lambda message: [xyz(pose.pose.position) for pose in message.poses],
    'sensor_info': lambda message: [sensor_info_from_msg(message)],
    'joint_states': lambda message: [message],
    'diagnostics': lambda message: [
        status.name.partition(':')[0].rpartition('/')[2] for status in message.status],
    'servo_calls': _goals}
_STAMPED = ('image', 'contact', 'servo_status', 'sensor_pose', 'surface_contact')
_THINNED = {*_STAMPED, 'surface_patch'} - {'servo_status'}  # a state may last one message only
_NEWEST = ('contour', 'sensor_info')  # only the newest message is needed


def _joint_acceleration(rows: Sequence[Any]) -> np.ndarray:
    """Return joint accelerations from the recorded velocities, or else from the positions."""
    if not rows:
        return np.empty((0, 0))
    names = rows[0].name
    states = [state for state in rows if state.name == names]
    stamps = np.array([stamp_to_ns(state.header.stamp) for state in states])
    times, new = np.unique(stamps, return_index=True)
    seconds = 1e-9 * (times - times[0])
    if all(len(states[k].velocity) == len(names) for k in new):
        velocities = np.array([states[k].velocity for k in new])
        return np.diff(velocities, axis=0) / np.diff(seconds)[:, None]
    return accelerations(seconds, np.array([states[k].position for k in new]))
