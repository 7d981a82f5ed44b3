"""What a simulated pad touches: pressure and force at a pose, and the truth about a run."""
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, TYPE_CHECKING

import numpy as np

from tactile_common.config import bounded, check_fields
from tactile_simulation.sensor import Sensor, Skin, TactelResponse
from tactile_simulation.smoothness import speeds


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

    def __post_init__(self):
        check_fields(self, 'plant.')


@dataclass(frozen=True)
class NodeParameters:
    """Parameters that a scene's probe asks for, beside those of a file."""

    servo: Mapping[str, Any] = field(default_factory=dict)
    shape: Mapping[str, Any] = field(default_factory=dict)  # of the shape estimator,
    contact: Mapping[str, Any] = field(default_factory=dict)  # and of the contact estimator


@dataclass(frozen=True, eq=False)
class Course:
    """Where a pad was in a run, and what it felt there; arrays (N, ...)."""

    time: np.ndarray  # s
    poses: np.ndarray  # (N, 4, 4), sensor -> base
    force: np.ndarray  # on the pad [N]
    shift: np.ndarray  # (N, 3), of the object, which may have slipped [m]
    progress: np.ndarray  # of the servo by its own account [m]
    tracking: np.ndarray  # whether the servo followed what it touched
    settled: np.ndarray  # of it from `SETTLING_LENGTH` after first contact on

    @cached_property
    def speed(self) -> np.ndarray:
        """Speed of the pad (N,) [m/s]; NaN where unknown."""
        return speeds(self.time, self.poses[:, :3, 3])


@dataclass(frozen=True, eq=False)
class Truth(Course):
    """A course beside what it followed; `settled` ends where that ends."""

    on_target: np.ndarray  # where the force can be and is held against its target


class World(ABC):
    """
    What the sensor of a scene touches.

    Attributes
    ----------
    shift : ndarray, shape (3,)
        How far the object has slipped [m].
    """

    def __init__(self, scene: 'Scene'):
        self.array = scene.sensor.array
        self.shift = np.zeros(3)
        self._response = TactelResponse(scene.sensor)

    @abstractmethod
    def render(self, pose: np.ndarray) -> np.ndarray:
        """Return the pressure at the tactels (rows, columns), free of noise [Pa]."""

    @abstractmethod
    def force(self, pose: np.ndarray) -> float:
        """Return the normal force on the pad at a pose (4, 4), sensor -> base [N]."""

    def counts(self, pose: np.ndarray | None, rng: np.random.Generator,
               now: float = 0.0) -> np.ndarray:
        """
        Return one frame (rows, columns) of counts at a time [s], see `TactelResponse`.

        Without a pose the sensor touches nothing.
        """
        pressure = np.zeros(self.array.shape) if pose is None else self.render(pose)
        return self._response.counts(pressure, rng, now)

    @abstractmethod
    def truth(self, course: Course) -> Truth:
        """Compare a course with the scene."""

    @abstractmethod
    def numbers(self, truth: Any, felt: np.ndarray, force: float) -> dict[str, Any]:
        """
        Numbers of a summary that only what was touched knows, SI units.

        `truth` is of this world; `felt` (N, 3) are the contacts on a surface, or the vertices of
        an edge's outline [m]; `force` is wanted [N].
        """

    @abstractmethod
    def objection(self, numbers: Mapping[str, Any]) -> str:
        """Why a goal that the servo met counts as failed by the truth; empty if it does not."""


@dataclass(frozen=True, eq=False)
class Scene(ABC):
    """A world, the sensor that touches it, and where it begins, as a file describes them."""

    action: ClassVar[str]  # that a servo is asked for
    name: str
    description: str
    sensor: Sensor = field(default_factory=Sensor, kw_only=True)
    plant: Plant = field(default_factory=Plant, kw_only=True)
    # What the driver knows of the sensor; None: all that the scene says, but for its flaws.
    calibration: Path | None = field(default=None, kw_only=True)

    if TYPE_CHECKING:  # a field of some scenes, derived by others
        @property
        def skin(self) -> Skin:
            """Skin above the tactels."""

    @abstractmethod
    def start_pose(self) -> np.ndarray:
        """First pose (4, 4) of the sensor in the base."""

    @abstractmethod
    def world(self) -> World:
        """What the sensor touches."""

    @property
    def way(self) -> float:
        """Length that there is to follow [m]; 0 where only a goal says it."""
        return 0.0

    @property
    def closed(self) -> bool:
        """Whether what is followed ends where it begins."""
        return False

    def parameters(self) -> NodeParameters:
        """Parameters of nodes that the probe asks for; none for a flat pad."""
        return NodeParameters()
