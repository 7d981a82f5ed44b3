"""Interface between the supervisor and a servo law, and the data that they exchange."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, Protocol, runtime_checkable

import numpy as np

from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import Contact
from tactile_sensing.types.image import SensorInfo, TactileImage
from tactile_servo.config import ServoConfig
from tactile_servo.control.press_check import PressCheck
from tactile_servo.motion.motion import Motion
from tactile_servo.reasons import Reason, ReasonCode
from tactile_servo.types import State, TaskError

# An image whose pose is unknown
UNPLACED = Reason(ReasonCode.BAD_IMAGE, 'no joint state near its stamp; compare the clocks of '
                  'sensor and robot')


@dataclass(eq=False)  # not frozen: two are made for every image
class Observation:
    """An image, or the contact estimated from one."""

    stamp_ns: int  # of the image
    arrival: float  # steady time [s]
    age: float  # relative to the newest joint state at its arrival [s]; inf if unknown
    pose: np.ndarray | None  # (4, 4), of the sensor at the stamp, measured; None if unknown
    image: TactileImage | None = None
    contact: Contact | None = None


class Touch(NamedTuple):
    """A contact with a surface, in the base frame."""

    stamp_ns: int  # of the image
    point: np.ndarray  # (3,) [m]
    normal: np.ndarray  # (3,), inward unit normal


class Assessment(NamedTuple):
    """Decision of a law about the next cycle."""

    state: State  # one of TRACKING, or HOLD, or DONE to end the goal
    reason: Reason
    success: bool = False  # with DONE: whether the goal was reached
    lift: bool = False  # with DONE: whether to lift off even if the goal asks for no retreat


def done(code: ReasonCode, detail: str = '', *, success: bool = False,
         lift: bool = False) -> Assessment:
    """Return the assessment that ends a goal."""
    return Assessment(State.DONE, Reason(code, detail), success, lift)


def overforce(load: float, force: float, most: float) -> Assessment:
    """End a goal of a force [N] because of a load [N] beyond `most` times this force."""
    return done(ReasonCode.OVERFORCE, f'{load:.1f} N, beyond {most:g} times the {force:g} N asked '
                'for', lift=True)


class Reference(NamedTuple):
    """Wanted motion in the next cycle."""

    twist: np.ndarray  # (6,) of the sensor in its own frame [m/s, rad/s]
    speed: float  # along the edge or path [m/s]
    heading: Sequence[float]  # (3,) unit vector of travel, base frame; progress counts along it


@dataclass(frozen=True, eq=False)
class LawResult:
    """Result of a law: whether the contour closed, and its points (N, 3) [m] if the law maps."""

    closed: bool = False
    contour: np.ndarray | None = None


class ServoLaw(Protocol):
    """How to follow something by touch. The supervisor decides when to move at all."""

    name: ClassVar[str]
    goal_type: ClassVar[type]
    config_type: ClassVar[type]
    sees_images: ClassVar[bool] = True  # whether it observes images in addition to contacts
    even: ClassVar[bool] = True  # whether the stiffness that it knows is the same all the way
    near: ClassVar[float] = 1.0  # lateral error [tactels] above which an image counts as beside
    stiffness: float  # total, of skin, finger and robot [N/m]
    press: PressCheck | None = None
    touch: Touch | None = None  # last one, if the law maps a surface
    error: TaskError | None = None  # last observed

    def __init__(self, servo: ServoConfig, config: Any = None) -> None: ...

    def depth(self, force: float) -> float:
        """Return the depth [m] for a force [N], from an arbitrary zero."""

    @property
    def unfelt(self) -> float:
        """Force that the depth implies beyond the measured force [N]."""

    def retune(self, config: Any) -> None:
        """Use a new configuration from now on; only its `live` fields may differ."""

    def validate(self, goal: Any) -> Reason | None:
        """Return why this law cannot execute a goal, or None: a code of 400 or above."""

    def begin(self, goal: Any, sensor: SensorInfo) -> None:
        """Forget the last goal and start a new one; ConfigurationError if the sensor is unfit."""

    def halt(self) -> None:
        """Stop along the path and keep the force, until `resume`."""

    def resume(self) -> None:
        """Continue from a standstill with the knowledge so far."""

    def observe(self, observation: Observation) -> None:
        """Process an image or a contact; before the first goal only its age is used."""

    def lacks(self, now: float) -> Reason | None:
        """Return what prevents the law from tracking at steady time `now` [s], or None."""

    def assess(self, now: float, progress: float, load: float) -> Assessment:
        """Decide whether to continue, given the distance so far [m] and the load [N]."""

    def reference(self, pose: np.ndarray, commanded: np.ndarray, robot: Motion,
                  dt: float) -> Reference:
        """
        Compute the wanted motion from the sensor's measured and commanded poses (4, 4).

        The commanded one is where the commands lead it, see `Driven.pose`.
        """

    def result(self) -> LawResult:
        """Return the result of the goal so far."""
        return LawResult()


@runtime_checkable
class Teachable(Protocol):
    """A law that stores features of an image under a name, which goals can refer to."""

    def teach(self, name: str, image: TactileImage, array: TactelArray) -> str:
        """
        Store the features of an image under a name and return a description of them.

        ConfigurationError if the image shows none, or the name is invalid.
        """
        ...
