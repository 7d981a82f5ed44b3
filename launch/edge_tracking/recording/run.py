"""Data of a run as arrays; each column is declared together with how it is read."""
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cache, partial
from itertools import repeat
from typing import Any

import numpy as np

from tactile_common.errors import TactileError
from tactile_common.ros.conversions import pose_from_msg, stamp_to_ns, stamp_to_seconds
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.image import SensorInfo


def _column(dtype: Any = float, shape: tuple[int, ...] = (),
            read: Callable[[Any], Any] | None = None) -> Any:
    """Declare a column: type and shape of a value, and a reader if it is not a field."""
    return field(metadata={'dtype': dtype, 'shape': shape, 'read': read})


def _stamp():
    return _column(np.int64, (), lambda message: stamp_to_ns(message.header.stamp))


def xyz(vector) -> tuple[float, float, float]:
    """Return the components of a vector or a point in a message."""
    return vector.x, vector.y, vector.z


def _matrix(message):
    try:
        return pose_from_msg(message.pose)
    except TactileError:
        return np.full((4, 4), np.nan)


@dataclass(frozen=True, eq=False)
class Table:
    """Columns of N rows, one row per message."""

    @classmethod
    def row(cls: Any, message) -> tuple:
        """Return the values of a message in the order of the columns."""
        return tuple([getattr(message, name) if read is None else read(message)
                      for name, _, _, read in _columns(cls)])

    @classmethod
    def of(cls: Any, rows: Sequence[tuple], **known) -> Any:
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

    def seconds(self, time_ns) -> np.ndarray:
        """Convert times [ns] to seconds since the first message that was read."""
        return (np.asarray(time_ns, dtype=np.int64) - self.start_ns) * 1e-9
