"""What happened in a run, as arrays; how a column is read from its messages stands beside it."""
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields
from operator import attrgetter
from typing import Any

import numpy as np

from tactile_common.errors import TactileError
from tactile_common.ros.bag_reader import Recorded
from tactile_common.ros.conversions import pose_from_msg, stamp_to_ns, stamp_to_seconds
from tactile_sensing.types.array import TactelArray

_JOINTS = -1  # in a shape: as many as the table has names


def _column(dtype: Any = float, shape: tuple[int, ...] = (),
            read: str | Callable[[Any], Any] = '') -> Any:
    """Column of a table: type and shape of a value, and where in a message it is."""
    return field(metadata={'dtype': dtype, 'shape': shape, 'read': read})


def _stamp():
    return _column(np.int64, (), lambda message: stamp_to_ns(message.header.stamp))


def xyz(vector) -> tuple[float, float, float]:
    """Components of a vector or a point in a message."""
    return vector.x, vector.y, vector.z


def _matrix(message):
    try:
        return pose_from_msg(message.pose)
    except TactileError:
        return np.full((4, 4), np.nan)


@dataclass(frozen=True, eq=False)
class Table:
    """Columns of N rows, one for each message."""

    received_ns: np.ndarray  # time of reception

    @classmethod
    def of(cls, rows: Sequence[Recorded], **known):
        """Table of recorded messages; what is known otherwise is not read from them."""
        known['received_ns'] = np.array([row.received_ns for row in rows], dtype=np.int64)
        for item in fields(cls):
            if item.name in known:
                continue
            dtype, shape, read = (item.metadata[key] for key in ('dtype', 'shape', 'read'))
            read = read if callable(read) else attrgetter(read or item.name)
            shape = [len(known['names']) if size == _JOINTS else size for size in shape]
            known[item.name] = values = np.empty((len(rows), *shape), dtype=dtype)
            for index, row in enumerate(rows):
                values[index] = read(row.message)
        return cls(**known)


@dataclass(frozen=True, eq=False)
class Images(Table):
    """Pictures of the pressure layer."""

    frames: np.ndarray  # (N, rows, columns), NaN = invalid tactel
    array: TactelArray | None  # None without pictures
    unit: str
    skipped: int  # pictures left out for another size than the first
    stamp_ns: np.ndarray = _stamp()
    sequence: np.ndarray = _column(np.int64)


@dataclass(frozen=True, eq=False)
class Contacts(Table):
    """Contact estimates, as in Contact.msg; received within a fraction of a ms of publication."""

    stamp_ns: np.ndarray = _stamp()
    sequence: np.ndarray = _column(np.int64)
    type: np.ndarray = _column(np.int64)
    valid: np.ndarray = _column(bool)
    reasons: np.ndarray = _column(np.int64)
    a: np.ndarray = _column()
    yaw: np.ndarray = _column()
    normal_force: np.ndarray = _column()
    snr: np.ndarray = _column()
    m0: np.ndarray = _column(read=lambda message: message.moments[0])  # [N, or counts m^2]
    centre_of_pressure: np.ndarray = _column(  # [m]
        shape=(2,), read=lambda message: xyz(message.centre_of_pressure)[:2])
    latency: np.ndarray = _column(read=lambda message: stamp_to_seconds(message.latency))


@dataclass(frozen=True, eq=False)
class Wrenches(Table):
    """Force [N] and torque [N m] of the object on the sensor, `(N, 3)` each."""

    stamp_ns: np.ndarray = _stamp()
    force: np.ndarray = _column(shape=(3,), read=lambda message: xyz(message.wrench.force))
    torque: np.ndarray = _column(shape=(3,), read=lambda message: xyz(message.wrench.torque))


@dataclass(frozen=True, eq=False)
class Statuses(Table):
    """Control cycles, `(N,)` each; fields as in ServoStatus.msg."""

    stamp_ns: np.ndarray = _stamp()
    controller: np.ndarray = _column(object)
    state: np.ndarray = _column(np.int64)
    reason: np.ndarray = _column(object)
    contact_stamp_ns: np.ndarray = _column(
        np.int64, read=lambda message: stamp_to_ns(message.contact_stamp))
    lateral_error: np.ndarray = _column()
    angle_error: np.ndarray = _column()
    normal_force: np.ndarray = _column()
    force_target: np.ndarray = _column()
    speed: np.ndarray = _column()
    progress: np.ndarray = _column()
    limit_scale: np.ndarray = _column()
    manipulability: np.ndarray = _column()
    cycle_time: np.ndarray = _column()
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
class Joints(Table):
    """Joint states: names, positions `(N, n)` [rad]."""

    names: tuple
    stamp_ns: np.ndarray = _stamp()
    position: np.ndarray = _column(shape=(_JOINTS,))


@dataclass(frozen=True, eq=False)
class Commands(Table):
    """Trajectories sent to the robot: first and last point, `(N, n)` [rad]."""

    names: tuple
    first: np.ndarray = _column(
        shape=(_JOINTS,), read=lambda message: message.points[0].positions)
    last: np.ndarray = _column(
        shape=(_JOINTS,), read=lambda message: message.points[-1].positions)
    horizon: np.ndarray = _column(  # time of the last point [s]
        read=lambda message: stamp_to_seconds(message.points[-1].time_from_start))


@dataclass(frozen=True, eq=False)
class Diagnostics(Table):
    """Diagnostic messages, `(N,)` each; values holds one dict of texts per message."""

    name: np.ndarray = _column(object)
    level: np.ndarray = _column(np.int64)
    message: np.ndarray = _column(object)
    values: np.ndarray = _column(
        object, read=lambda status: {pair.key: pair.value for pair in status.values})


@dataclass(frozen=True)
class Info:
    """Newest description of the sensor; fields as in SensorInfo.msg."""

    sensor: str
    model: str
    array: TactelArray
    nominal_rate: float
    acquisition_delay: float
    unit: str
    full_scale: float
    noise_std: float
    calibration: str
    tared: bool


@dataclass(frozen=True, eq=False)
class RunData:
    """One run of a sensor and its servo; empty arrays of topics that the recording lacks."""

    namespace: str
    start_ns: int
    images: Images
    contacts: Contacts
    wrenches: Wrenches
    statuses: Statuses
    poses: Poses
    joints: Joints
    commands: Commands
    diagnostics: Diagnostics
    contour: np.ndarray  # (N, 3), points of the newest contour [m]
    patches: list  # every valid Patch of a surface
    info: Info | None  # None if the recording lacks it

    def seconds(self, time_ns) -> np.ndarray:
        """Return times [ns] as seconds since the first message of the recording."""
        return (np.asarray(time_ns, dtype=np.int64) - self.start_ns) * 1e-9
