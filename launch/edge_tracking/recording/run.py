"""What happened in a run, as arrays."""

from dataclasses import dataclass

import numpy as np

from tactile_sensing.types.array import TactelArray


@dataclass(frozen=True, eq=False)
class Images:
    """
    Pictures of the pressure layer.

    stamp_ns, received_ns, sequence: `(N,)`; frames: `(N, rows, columns)` in `unit`, NaN =
    invalid tactel; array: their geometry, None without pictures; skipped: pictures left out for
    another size than the first.
    """

    stamp_ns: np.ndarray
    received_ns: np.ndarray
    sequence: np.ndarray
    frames: np.ndarray
    array: TactelArray | None
    unit: str
    skipped: int


@dataclass(frozen=True, eq=False)
class Contacts:
    """
    Contact estimates, `(N,)` each; fields as in Contact.msg.

    received_ns is the time of reception, within a fraction of a millisecond the publication's;
    m0 is the zeroth moment [N, or counts m^2]; centre_of_pressure is `(N, 2)` [m].
    """

    stamp_ns: np.ndarray
    received_ns: np.ndarray
    sequence: np.ndarray
    type: np.ndarray
    valid: np.ndarray
    reasons: np.ndarray
    a: np.ndarray
    yaw: np.ndarray
    normal_force: np.ndarray
    snr: np.ndarray
    m0: np.ndarray
    centre_of_pressure: np.ndarray
    latency: np.ndarray


@dataclass(frozen=True, eq=False)
class Wrenches:
    """Force [N] and torque [N m] of the object on the sensor, `(N, 3)` each."""

    stamp_ns: np.ndarray
    received_ns: np.ndarray
    force: np.ndarray
    torque: np.ndarray


@dataclass(frozen=True, eq=False)
class Statuses:
    """Control cycles, `(N,)` each; fields as in ServoStatus.msg."""

    stamp_ns: np.ndarray
    received_ns: np.ndarray
    controller: np.ndarray
    state: np.ndarray
    reason: np.ndarray
    contact_stamp_ns: np.ndarray
    lateral_error: np.ndarray
    angle_error: np.ndarray
    normal_force: np.ndarray
    force_target: np.ndarray
    speed: np.ndarray
    progress: np.ndarray
    limit_scale: np.ndarray
    manipulability: np.ndarray
    cycle_time: np.ndarray
    missed_cycles: np.ndarray


@dataclass(frozen=True, eq=False)
class Poses:
    """Poses of the sensor in the base frame, homogeneous transforms `(N, 4, 4)`."""

    stamp_ns: np.ndarray
    received_ns: np.ndarray
    matrix: np.ndarray

    @property
    def position(self) -> np.ndarray:
        """Positions of the pad's centre [m], shape `(N, 3)`."""
        return self.matrix[:, :3, 3]


@dataclass(frozen=True, eq=False)
class Joints:
    """Joint states: names, positions `(N, n)` [rad]."""

    stamp_ns: np.ndarray
    received_ns: np.ndarray
    names: tuple
    position: np.ndarray


@dataclass(frozen=True, eq=False)
class Commands:
    """Trajectories sent to the robot: first and last point, `(N, n)` [rad]."""

    received_ns: np.ndarray
    names: tuple
    first: np.ndarray
    last: np.ndarray
    horizon: np.ndarray  # time of the last point [s]


@dataclass(frozen=True, eq=False)
class Diagnostics:
    """Diagnostic messages, `(N,)` each; values holds one dict of texts per message."""

    received_ns: np.ndarray
    name: np.ndarray
    level: np.ndarray
    message: np.ndarray
    values: np.ndarray


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
    """
    One run of a sensor and its servo, read from a recording.

    A topic that the recording lacks gives empty arrays; `info` is then None. `contour` holds
    the points of the newest contour, `(N, 3)` [m], `patches` every valid Patch of a surface.
    """

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
    contour: np.ndarray
    patches: list
    info: Info | None

    def seconds(self, time_ns) -> np.ndarray:
        """Return times [ns] as seconds since the first message of the recording."""
        return (np.asarray(time_ns, dtype=np.int64) - self.start_ns) * 1e-9
