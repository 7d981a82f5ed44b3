"""What a servo law is to the supervisor, and what passes between them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, Protocol, runtime_checkable

import numpy as np

from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import Contact
from tactile_sensing.types.image import SensorInfo, TactileImage
from tactile_servo.config import ServoConfig
from tactile_servo.motion.agility import Agility
from tactile_servo.reasons import Reason
from tactile_servo.types import State, TaskError

Refusal = Reason  # of a code from 400 on, or of the input that is missing


@dataclass(eq=False)  # not frozen: two are made for every image
class Observation:
    """An image, or the contact estimated in one."""

    stamp_ns: int  # of the image
    arrival: float  # steady time [s]
    age: float  # how much older than the newest joint state it was as it came [s]; inf if unknown
    locate: Callable[[int], np.ndarray | None]  # measured pose of the sensor at a stamp [ns]
    image: TactileImage | None = None
    contact: Contact | None = None

    def pose(self) -> np.ndarray | None:
        """Pose of the sensor (4, 4) at the stamp in the base frame; None if it is not known."""
        return self.locate(self.stamp_ns)


class Touch(NamedTuple):
    """Where a surface was touched, in the base frame."""

    stamp_ns: int  # of the image
    point: np.ndarray  # (3,) [m]
    normal: np.ndarray  # (3,), inward unit normal


class Assessment(NamedTuple):
    """What a law decides about the next cycle."""

    state: State  # one of TRACKING, or HOLD, or DONE to end the goal
    reason: Reason
    success: bool = False  # of an end: whether the goal was met
    lift: bool = False  # of an end: whether to lift off whatever the goal says


class Reference(NamedTuple):
    """Wanted motion of the next cycle."""

    twist: np.ndarray  # (6,) of the sensor in its own frame [m/s, rad/s]
    speed: float  # along what is tracked [m/s]
    heading: Sequence[float]  # (3,) unit vector of travel in the base: progress counts along it


@dataclass(frozen=True, eq=False)
class LawResult:
    """What a law has learnt: whether the contour closed, and its points (N, 3) [m] if it maps."""

    closed: bool = False
    contour: np.ndarray | None = None


class Goal(Protocol):
    """
    What every goal has.

    Speed [m/s], force [N], whether to lift off at the end, and how long its client may be silent
    [s].
    """

    @property
    def speed(self) -> float: ...
    @property
    def force(self) -> float: ...
    @property
    def retreat(self) -> bool: ...
    @property
    def client_timeout(self) -> float: ...


class ServoLaw(Protocol):
    """How to follow something by touch; when to move at all is the supervisor's affair."""

    name: ClassVar[str]
    goal_type: ClassVar[type]
    config_type: ClassVar[type]
    sees_images: ClassVar[bool]  # whether images are observed beside contacts
    near: ClassVar[float]  # tactels from the pad's centre, beyond which what is tracked is beside

    @property
    def stiffness(self) -> float: ...  # total, of skin, finger and robot [N/m]
    def depth(self, force: float) -> float: ...  # that a force [N] stands for, from any zero [m]
    @property
    def touch_speed(self) -> float: ...  # at which it presses a pad that feels nothing yet [m/s]
    @property
    def unfelt(self) -> float: ...  # by the pad's depth, force beyond what images tell [N]
    @property
    def touch(self) -> Touch | None: ...  # of a law that maps a surface; else None
    @property
    def error(self) -> TaskError | None: ...  # as last observed, None before

    def __init__(self, servo: ServoConfig, config: Any = None) -> None: ...

    def retune(self, config: Any) -> None:
        """Take a configuration from now on in which `live` fields have changed, nothing else."""

    def validate(self, goal: Any) -> Refusal | None:
        """Why a goal is beyond this law, or None."""

    def begin(self, goal: Any, sensor: SensorInfo) -> None:
        """Forget the last goal and take a new one."""

    def resume(self) -> None:
        """Go on from a standstill, with what is known so far."""

    def observe(self, observation: Observation) -> None:
        """Take an image or a contact; before the first goal only its age says something."""

    def lacks(self, now: float) -> Reason | None:
        """What keeps the law from tracking at steady time `now` [s], or None."""

    def assess(self, now: float, progress: float, load: float) -> Assessment:
        """Decide whether to go on, after a way of `progress` [m] and at a load [N]."""

    def reference(self, pose: np.ndarray, commanded: np.ndarray, agility: Agility,
                  dt: float) -> Reference:
        """Wanted motion from the measured and the commanded pose (4, 4) of the sensor."""

    def result(self) -> LawResult:
        """What has been learnt."""


@runtime_checkable
class Teachable(Protocol):
    """A law whose goals can ask for what it was shown."""

    def teach(self, name: str, image: TactileImage, array: TactelArray) -> str:
        """Keep what an image shows by a name, and say what that is; else ConfigurationError."""
        ...
