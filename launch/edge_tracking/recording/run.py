"""Run of a sensor and its servo: its data as arrays, read from a recording."""
from array import array
from collections import Counter, defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
import json
from operator import attrgetter
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


def _stamp(message: Any) -> int:
    return stamp_to_ns(message.header.stamp)


def xyz(vector: Any) -> tuple[float, float, float]:
    """Return the components of a vector or a point in a message."""
    return vector.x, vector.y, vector.z


def _matrix(message: Any) -> np.ndarray:
    try:
        return pose_from_msg(message.pose)
    except TactileError:
        return np.full((4, 4), np.nan)


class Table:
    """
    Makes an array of records from messages of a topic, one record per message.

    `types` are the columns, in order; `readers` give what is not a field of that name.
    """

    def __init__(self, types: Mapping[str, Any], **readers: Callable[[Any], Any]):
        self.dtype = np.dtype([*types.items()])
        self._read = [readers.get(name, attrgetter(name)) for name in types]

    def row(self, message: Any) -> tuple:
        """Return the record of a message."""
        return tuple([read(message) for read in self._read])

    def of(self, rows: Sequence[tuple]) -> np.recarray:
        """Return the array of some records; its attributes are the columns."""
        return np.array([*rows], self.dtype).view(np.recarray)


# Contact estimates; fields as in Contact.msg, and [m], [s].
CONTACTS = Table(
    {'stamp_ns': np.int64, 'type': np.int64, 'valid': bool, 'force_valid': bool, 'x': float,
     'y': float, 'yaw': float, 'normal_force': float, 'm0': float,  # [N, or counts m^2]
     'centre_of_pressure': '2f8', 'latency': float},
    stamp_ns=_stamp, m0=lambda message: message.moments[0],
    centre_of_pressure=lambda message: xyz(message.centre_of_pressure)[:2],
    latency=lambda message: stamp_to_seconds(message.latency))
# Status messages of the servo; fields as in ServoStatus.msg.
STATUSES = Table(
    {'stamp_ns': np.int64, 'controller': object, 'state': np.int64, 'reason': object,
     'reason_code': np.int64, 'contact_stamp_ns': np.int64, 'lateral_error': float,
     'longitudinal_error': float, 'force_target': float, 'speed': float, 'progress': float,
     'latency': float, 'cpu_time': float, 'cycles': np.int64, 'missed_cycles': np.int64},
    stamp_ns=_stamp, contact_stamp_ns=lambda message: stamp_to_ns(message.contact_stamp))
# Poses of the sensor in the base frame, homogeneous transforms.
POSES = Table({'stamp_ns': np.int64, 'matrix': '(4,4)f8'}, stamp_ns=_stamp, matrix=_matrix)


@dataclass(frozen=True, eq=False)
class Images:
    """N images of the pressure layer."""

    frames: np.ndarray  # (N, rows, columns), NaN = invalid tactel
    array: TactelArray | None  # None without images
    unit: str
    stamp_ns: np.ndarray  # (N,)
    sequence: np.ndarray  # (N,)


@dataclass(frozen=True, eq=False)
class RunData:
    """One run of a sensor and its servo; arrays are empty for topics that were not recorded."""

    namespace: str
    received_ns: int  # system time of the first message
    start_ns: int  # the first stamp, which may be of simulated time
    images: Images
    contacts: np.recarray  # see CONTACTS
    statuses: np.recarray  # see STATUSES
    poses: np.recarray  # see POSES
    contour: np.ndarray  # (N, 3), points of the newest contour [m]
    patches: list  # every valid Patch of a surface
    info: SensorInfo | None  # the newest; None if the recording lacks it
    joint_acceleration: np.ndarray  # (K, n), from the joint states [rad/s^2]
    stamps: Mapping[str, np.ndarray]  # stamps of all messages [ns] by topic name
    every: Mapping[str, int]  # by topic name; one of this many messages was read
    goals: Sequence[Mapping[str, Any]]  # fields of each goal
    parameters: Mapping[str, Mapping[str, Any]]  # by node
    nodes: frozenset[str]  # names of the nodes with diagnostics
    touches: np.recarray  # contacts with a surface, z along the outward normal

    def seconds(self, time_ns: Any) -> np.ndarray:
        """Convert times [ns] to seconds since the first stamp."""
        return (np.asarray(time_ns, dtype=np.int64) - self.start_ns) * 1e-9


def read_run(path: str | Path, namespace: str | None = None, *,
             joints: bool = True) -> RunData:
    """
    Read a run from a rosbag2 recording: its folder, or one of its files.

    Without `joints` the joint states are not read. Raises a ConfigurationError if there is no
    recording, or if `GraphBag` cannot choose one of its sensors.
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
            received_ns=bag.span[0],
            start_ns=min((int(known[0]) for known in stamps.values() if known),
                         default=bag.span[0]),
            images=_images(rows['image']),
            contacts=CONTACTS.of(rows['contact']),
            statuses=STATUSES.of(rows['servo_status']),
            poses=POSES.of(rows['sensor_pose']),
            contour=np.array(rows['contour'], float).reshape(-1, 3),
            patches=rows['surface_patch'],
            info=next(iter(rows['sensor_info']), None),
            nodes=frozenset(rows['diagnostics']),
            touches=POSES.of(rows['surface_contact']),
            joint_acceleration=_joint_acceleration(rows['joint_states']),
            stamps={name: np.asarray(known) for name, known in stamps.items()},
            every=every,
            goals=rows['servo_calls'],
            parameters=Settings(bag).recorded,
        )


def _image(message: Any) -> list[tuple]:
    """Return a list with shallowest pressure, unit, pitches, stamp, number; or an empty list."""
    layers = [layer for layer in message.layers if layer.component == _COMPONENT_ZZ
              and layer.stress.size == message.rows * message.columns > 0]
    return [(layer.stress.reshape(message.rows, message.columns), layer.unit,
             (message.pitch_x, message.pitch_y), _stamp(message), message.sequence)
            for layer in sorted(layers, key=lambda layer: layer.depth)[:1]]


def _images(rows: Sequence[tuple]) -> Images:
    """Return the images that have the shape of the first one."""
    if not rows:
        none = np.empty(0, np.int64)
        return Images(np.empty((0, 0, 0), np.float32), None, '', none, none)
    first, unit, pitches, *_ = rows[0]
    frames, _, _, stamps, numbers = zip(
        *(row for row in rows if row[0].shape == first.shape), strict=True)
    pressure = np.array(frames, np.float32)
    pressure[~np.isfinite(pressure)] = np.nan
    return Images(pressure, TactelArray(*first.shape, *pitches), unit,
                  np.array(stamps, np.int64), np.array(numbers, np.int64))


def _goals(calls: Any) -> list[dict[str, Any]]:
    """Return the fields of the goals that begin in a ServoCalls message."""
    named = calls.call[np.isin(calls.call, WITH_TEXT)].tolist()
    return [dict(json.loads(text)) for call, text in zip(named, calls.texts, strict=False)
            if call == Call.START]


# Functions that return the rows of a message, by the name of its topic.
_READ: dict[str, Callable[[Any], list[Any]]] = {
    'image': _image,
    'contact': lambda message: [CONTACTS.row(message)],
    'servo_status': lambda message: [STATUSES.row(message)],
    'sensor_pose': lambda message: [POSES.row(message)],
    'surface_contact': lambda message: [POSES.row(message)],
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
