"""A scene with its sensor's calibration, the world touched in it, and the truth of a run."""
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, KW_ONLY, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from tactile_common.config import bounded
from tactile_sensing.devices.calibration import Calibration, load_calibration, save_calibration
from tactile_simulation.sensor import SceneSkin, Sensor, TactelResponse

ACQUISITION_DELAY = 0.0025  # s, from the instant that a frame shows to its last byte
MAX_LOAD = 40.0  # N, that the sensor bears


@dataclass(frozen=True)
class Plant:
    """Robot and timing of a simulation; the defaults are those of the mock nodes' plant."""

    dead_time: float = bounded(0.0025, 'from a command to the first motion', 's', 0.0, 1.0)
    lag: float = bounded(
        0.010, 'time constant with which a joint follows its command', 's', 0.0, 1.0)
    acceleration: float = bounded(2.0, 'largest of the pad on each axis', 'm/s^2', 0.1, 100.0)
    latency: float = bounded(0.010, 'from the instant of an image to its arrival', 's', 0.0, 1.0)
    stamp_error: float = bounded(
        0.0, "of an image's stamp: later than the instant it shows", 's', -0.1, 0.1)


@dataclass(frozen=True, eq=False)
class Course:
    """
    Course of a pad in a run, with its forces; arrays (N, ...).

    `Scene.truth` compares it with the scene: it ends `settled` at the end of the edge, and adds
    the fields from `on_target` on.
    """

    time: np.ndarray  # s
    poses: np.ndarray  # (N, 4, 4), sensor -> base
    force: np.ndarray  # on the pad [N]
    shift: np.ndarray  # (N, 3), slip of the object [m]
    progress: np.ndarray  # progress reported by the servo [m]
    tracking: np.ndarray  # True while the servo tracks
    settled: np.ndarray  # tracking, from `SETTLING_LENGTH` after first contact on
    on_target: Any = None  # settled, and the target force can be reached
    lateral: Any = None  # pad's centre to the left of the edge [m]
    along: Any = None  # arc length of the nearest point of the edge [m]
    place: Any = None  # (N, 2), contact of a round probe while tracking [m]


class World(ABC):
    """
    The object that the sensor of a scene touches.

    Attributes
    ----------
    shift : ndarray, shape (3,)
        Slip of the object [m].
    """

    def __init__(self, scene: Any):
        self.scene, self.array = scene, scene.sensor.array
        self.shift = np.zeros(3)
        self._response = TactelResponse(scene.sensor)

    @abstractmethod
    def render(self, pose: np.ndarray) -> np.ndarray:
        """Return the noise-free pressure at the tactels (rows, columns) [Pa]."""

    @abstractmethod
    def force(self, pose: np.ndarray) -> float:
        """
        Return the force at a pose (4, 4), sensor -> base [N].

        It is normal to a pad, within the rectangle of its array, or to the touched surface.
        """

    def counts(self, pose: np.ndarray | None, rng: np.random.Generator,
               now: float = 0.0) -> np.ndarray:
        """Return one frame (rows, columns) of counts at a time [s]; without a pose, unloaded."""
        pressure = np.zeros(self.array.shape) if pose is None else self.render(pose)
        return self._response.counts(pressure, rng, now)


@dataclass(frozen=True, eq=False)
class Scene(ABC):
    """An object, the sensor that touches it, and the start, as described by a file."""

    action: ClassVar[str]  # action of the servo
    name: str
    description: str
    _: KW_ONLY
    skin: SceneSkin = field(default_factory=SceneSkin)
    sensor: Sensor = field(default_factory=Sensor)
    plant: Plant = field(default_factory=Plant)
    # Calibration for the driver; None: derived from the scene, without the sensor's flaws.
    calibration: Path | None = None

    @abstractmethod
    def start_pose(self) -> np.ndarray:
        """Return the first pose (4, 4) of the sensor in the base frame."""

    @abstractmethod
    def world(self) -> World:
        """Return the object that the sensor touches."""

    @property
    def way(self) -> float:
        """Length of the path to follow [m]; 0 if only the goal defines it."""
        return 0.0

    @property
    def closed(self) -> bool:
        """True if the path to follow ends where it begins."""
        return False

    def parameters(self) -> dict[str, dict[str, Any]]:
        """Return the parameters that the probe requires, by node; none for a flat pad."""
        return {}

    @abstractmethod
    def truth(self, course: Course) -> Course:
        """Compare a course with the scene."""

    @abstractmethod
    def numbers(self, truth: Course, felt: np.ndarray, force: float) -> dict[str, Any]:
        """
        Return the values of a summary that need the touched object, in SI units.

        `truth` comes from `truth`; `felt` (N, 3) are the contacts on a surface, or the vertices
        of an edge's outline [m]; `force` is the target [N].
        """

    @abstractmethod
    def objection(self, numbers: Mapping[str, Any]) -> str:
        """Return why the truth contradicts a goal that the servo met; empty if it does not."""


def calibration_of(scene: Scene) -> Calibration:
    """Return the calibration file that a scene names, or else one derived from the scene."""
    sensor, skin = scene.sensor, scene.skin
    found = load_calibration(scene.calibration) if scene.calibration else Calibration(
        sensor.array, gain=np.array(sensor.pa_per_count), baseline=np.array(sensor.baseline),
        bits=sensor.bits, depth=skin.depth, thickness=skin.thickness, poisson=skin.poisson)
    return replace(found, model='mock', skin_stiffness=skin.stiffness)


def write_calibration(scene: Scene, path: Path) -> Path:
    """Write the calibration file that the driver needs for a scene's sensor; return its path."""
    save_calibration(replace(
        calibration_of(scene), max_load=MAX_LOAD, acquisition_delay=ACQUISITION_DELAY,
        nominal_rate=200.0), path)
    return path
