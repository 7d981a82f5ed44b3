"""Estimator, servo and shape estimator of a recording, fed with its messages one by one."""
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field
import json
import math
from types import SimpleNamespace
from typing import Any

from geometry_msgs.msg import PoseStamped, WrenchStamped

from edge_tracking.parameters import SERVO
from edge_tracking.recording.settings import Settings
from edge_tracking.recording.topics import KINDS
from tactile_common.errors import TactileError
from tactile_common.ros.bag_reader import Bag, DAMAGE, Recorded
from tactile_common.ros.cdr import packed
from tactile_common.ros.conversions import NS, pose_to_msg, set_stamp, stamp_to_ns
from tactile_msgs.msg import Contact as ContactMsg
from tactile_msgs.msg import ServoStatus
from tactile_sensing.contact.estimator import ContactEstimator, EstimatorConfig
from tactile_sensing.conversions import (
    contact_from_msg,
    contact_to_msg,
    contact_to_wrench,
    image_from_msg,
    sensor_info_from_msg,
)
from tactile_servo.config import ServoConfig
from tactile_servo.conversions import (
    joint_positions,
    status_to_msg,
    touch_to_msg,
    trajectory_to_bytes,
)
from tactile_servo.journal import ask_again, Call, WITH_TEXT
from tactile_servo.laws.registry import law_named
from tactile_servo.robot_config import NodeConfig, robot_of
from tactile_servo.supervisor import Supervisor
from tactile_servo.types import Timing
from tactile_shape.contour.object_model import ModelConfig
from tactile_shape.local_surface.local_quadric import LocalQuadricConfig
from tactile_shape.nodes.shape_estimator import ShapeEstimatorConfig, ShapeTopics

BEHIND = NS  # within this time a recorder has received all inputs that the servo used
WAITING = 4000  # inputs of one kind that are kept until used
UNKNOWN = Timing(math.nan, math.nan, math.nan, 0, 0)
Emit = Callable[[str, int, bytes], None]  # topic name, time [ns] and message
# Keys are integers, as in the messages: the lookup of an IntEnum is slow.
_KINDS = {int(Call.SENSOR): 'sensor_info', int(Call.JOINTS): 'joint_states',
          int(Call.IMAGE): 'image', int(Call.CONTACT): 'contact'}


class Inputs:
    """Recorded inputs by the stamps with which the servo's calls refer to them."""

    def __init__(self) -> None:
        self._kept: dict[str, dict[int, Any]] = {name: {} for name in _KINDS.values()}
        self._begun: set[str] = set()
        self.lost: Counter[str] = Counter()

    def keep(self, name: str, stamp_ns: int, value: Any) -> None:
        """Keep an input until it is used, or many newer ones have arrived."""
        kept = self._kept[name]
        kept[stamp_ns] = value
        if len(kept) > WAITING:
            del kept[next(iter(kept))]

    def find(self, name: str, stamp_ns: int) -> Any:
        """Return the input with a stamp [ns] and drop earlier ones; None if not recorded."""
        kept = self._kept[name]
        if stamp_ns not in kept:
            if name in self._begun:  # otherwise it was before the recording
                self.lost[name] += 1
            return None
        self._begun.add(name)
        while (first := next(iter(kept))) != stamp_ns:
            del kept[first]
        return kept[stamp_ns]


@dataclass
class Cycle:
    """A control cycle: the decision of the servo and its time."""

    now: float  # steady [s]
    now_ns: int
    status: Any
    window: Any
    told: bool = False  # True if its status was published


class ServoCore:
    """A servo that repeats its recorded calls."""

    def __init__(self, settings: Settings, inputs: Inputs, emit: Emit,
                 on_pose: Callable[[PoseStamped], None], on_touch: Callable[[PoseStamped], None],
                 on_cycle: Callable[[Cycle], None]):
        c, config = settings.config(SERVO, NodeConfig), settings.config(SERVO, ServoConfig)
        law = law_named(c.law)
        self._model, limits, box = robot_of(c)
        self._settings, self._inputs, self._emit = settings, inputs, emit
        self._on_pose, self._on_touch, self._on_cycle = on_pose, on_touch, on_cycle
        self.servo = Supervisor(self._model, limits, law.law(
            config, settings.config(SERVO, law.law.config_type)), config, box)
        self.joint_names = self._model.joint_names
        self._pose, self._status = PoseStamped(), ServoStatus()
        self._pose.header.frame_id = self._model.root_frame
        self._status.header.frame_id = c.tip_frame
        self._maps = law.maps_surface
        self._cycle: Cycle | None = None
        self._news: Any = None  # last state and reason
        self._due = 0  # number of the next call
        self.lost_calls = 0

    def repeat(self, received_ns: int, message: Any) -> None:
        """Repeat the calls of a ServoCalls message."""
        if self._due:
            self.lost_calls += max(message.first - self._due, 0)
        self._due = message.first + len(message.call)
        texts, times = iter(message.texts), message.time.tolist()
        offset = received_ns - round(NS * max(times, default=0.0))
        calls = zip(message.call.tolist(), times, message.value.tolist(), strict=True)
        for call, time, value in calls:
            at = offset + round(NS * time)
            if call in _KINDS:
                self._end_cycle(at)
                self._see(call, time, value, at)
            elif call == Call.CYCLE:
                self._end_cycle(at)
                self._cycle = Cycle(time, value, *self.servo.cycle(time, value))
            elif call == Call.STATUS and self._cycle:
                self._cycle.told = True
            elif call == Call.LATE and self._cycle and self._cycle.window:
                self.servo.motion.in_time(self._cycle.window, math.inf)
                self._cycle.window = None
            elif call >= Call.START:
                self._end_cycle(at)
                self._ask(call, time, value, next(texts, '') if call in WITH_TEXT else '')
        self._end_cycle(received_ns)

    def _ask(self, call: int, time: float, value: int, text: str) -> None:
        if call == Call.TUNE:
            text = json.dumps({**json.loads(text), **self._settings.changed.get(SERVO, {})})
        try:
            ask_again(self.servo, call, time, value, text)
        except TactileError:
            pass  # it was also refused in the recording, or is so with changed settings

    def _see(self, call: int, time: float, stamp_ns: int, at: int) -> None:
        seen = self._inputs.find(_KINDS[call], stamp_ns)
        if seen is None:
            return
        servo = self.servo
        if call == Call.SENSOR:
            servo.see_sensor(seen)
        elif call == Call.CONTACT:
            servo.see_contact(seen, stamp_ns, time)
        elif call == Call.IMAGE:
            self._see_image(seen, time, at)
        else:
            try:
                servo.see_joints(seen, stamp_ns, time)
            except ValueError:  # also refused in the recording
                return
            pose_to_msg(servo.inputs.pose, self._pose.pose)
            set_stamp(self._pose.header.stamp, stamp_ns)
            self._emit('sensor_pose', at, packed(self._pose))
            self._on_pose(self._pose)

    def _see_image(self, image: Any, time: float, at: int) -> None:
        try:
            self.servo.see_image(image, time)
        except TactileError:  # also refused in the recording
            return
        touch = self.servo.law.touch
        if self._maps and touch and touch.stamp_ns == image.stamp_ns:
            message = touch_to_msg(touch, self._model.root_frame)
            self._emit('surface_contact', at, packed(message))
            self._on_touch(message)

    def _end_cycle(self, at: int) -> None:
        """Emit the results of a cycle once all calls that belong to it are known."""
        cycle, self._cycle = self._cycle, None
        if cycle is None:
            return
        if cycle.window is not None:
            self._emit('joint_trajectory', at, trajectory_to_bytes(cycle.window))
        news = cycle.status.state, cycle.status.reason
        if cycle.told or news != (self._news or news):
            status_to_msg(cycle.status, self.servo.law.name, UNKNOWN, self._status)
            set_stamp(self._status.header.stamp, cycle.now_ns)
            self._emit('servo_status', at, packed(self._status))
        self._news = news
        self._on_cycle(cycle)


@dataclass
class Cores:
    """
    The cores of the nodes in sequence: input messages lead to calls of `emit` and to tables.

    With `from_images` the contact estimator runs; otherwise the recorded contacts are used.
    `contact_row` takes a stamp [ns] and a Contact, `cycle_row` a Cycle.
    """

    bag: Bag
    settings: Settings
    emit: Emit
    from_images: bool
    contact_row: Callable[[int, Any], None]
    cycle_row: Callable[[Cycle], None]
    with_servo: bool = True
    faults: list[str] = field(default_factory=list)  # messages that could not be used

    def __post_init__(self) -> None:
        settings, self.inputs = self.settings, Inputs()
        self._estimator = ContactEstimator(settings.config('contact_estimator', EstimatorConfig))
        self._now_ns = 0  # time of the message that is being processed
        self._shape = ShapeTopics(self._publisher, self.faults.append, *(
            settings.config('shape_estimator', kind)
            for kind in (ShapeEstimatorConfig, LocalQuadricConfig, ModelConfig)))
        self.servo = ServoCore(
            settings, self.inputs, self.emit, self._shape.take_pose,
            self._take_touch, self.cycle_row) if self.with_servo else None
        self._contact, self._wrench = ContactMsg(), WrenchStamped()
        self._later: deque[tuple[Recorded, Callable[..., None], tuple]] = deque()
        self._takers = {name: taker for name in KINDS
                        if (taker := getattr(self, f'_on_{name}', None))}

    def _publisher(self, _: Any, name: str, __: Any) -> Any:
        """Return a stand-in for a node's publisher."""
        return SimpleNamespace(
            publish=lambda message: self.emit(name, self._now_ns, packed(message)))

    def take(self, name: str, row: Recorded) -> None:
        """Process a raw message of a topic; call this in the order of reception."""
        while self._later and self._later[0][0].received_ns < row.received_ns - BEHIND:
            self._do_next()
        if name in self._takers:
            self._do(row, self._read, self._takers[name], row)

    def finish(self) -> None:
        """Process everything that still waits."""
        while self._later:
            self._do_next()

    def _do_next(self) -> None:
        row, action, arguments = self._later.popleft()
        self._now_ns = row.received_ns
        self._do(row, action, *arguments)

    def _do_later(self, row: Recorded, action: Callable[..., None], *arguments: Any) -> None:
        self._later.append((row, action, arguments))

    def _do(self, row: Recorded, action: Callable[..., None], *arguments: Any) -> None:
        try:
            action(*arguments)
        except (TactileError, *DAMAGE) as error:
            self.faults.append(str(self.bag.damaged(row.topic, row.received_ns, error)))

    def _read(self, take: Callable[[Recorded, Any], None], row: Recorded) -> None:
        take(row, self.bag.unpacked(row))

    def _on_image(self, row: Recorded, message: Any) -> None:
        raw, stamp_ns = bytes(row.message), stamp_to_ns(message.header.stamp)
        if not self._shape.by_servo:
            self._do_later(row, self._shape.take_image, raw)
        try:
            image = image_from_msg(message)
        except TactileError:
            image = None
        else:
            self.inputs.keep('image', stamp_ns, image)
        if not self.from_images:
            return
        contact = (self._estimator.refuse_malformed() if image is None
                   else self._estimator.estimate(image))
        self.emit('contact', row.received_ns, packed(contact_to_msg(
            contact, message, row.received_ns, self._contact)))
        if contact.force_valid:
            self.emit('wrench', row.received_ns, packed(
                contact_to_wrench(contact, message, self._wrench)))
        self._use(row, stamp_ns, contact, message.sensor)

    def _on_contact(self, row: Recorded, message: Any) -> None:
        if not self.from_images:
            self._use(row, stamp_to_ns(message.header.stamp), contact_from_msg(message),
                      message.sensor)

    def _use(self, row: Recorded, stamp_ns: int, contact: Any, sensor: str) -> None:
        self.inputs.keep('contact', stamp_ns, contact)
        self.contact_row(stamp_ns, contact)
        self._do_later(row, self._shape.take_contact, stamp_ns, contact, sensor)

    def _on_sensor_info(self, row: Recorded, message: Any) -> None:
        self.inputs.keep('sensor_info', stamp_to_ns(message.header.stamp),
                         sensor_info_from_msg(message))

    def _on_joint_states(self, row: Recorded, message: Any) -> None:
        if self.servo is not None:
            positions = joint_positions(message, self.servo.joint_names)
            if positions is not None:
                self.inputs.keep('joint_states', stamp_to_ns(message.header.stamp), positions)

    def _on_servo_calls(self, row: Recorded, message: Any) -> None:
        if self.servo is not None:
            self._do_later(row, self.servo.repeat, row.received_ns, message)

    def _on_sensor_pose(self, row: Recorded, message: Any) -> None:
        if self.servo is None:
            self._do_later(row, self._shape.take_pose, message)

    def _on_surface_contact(self, row: Recorded, message: Any) -> None:
        if self.servo is None:
            self._do_later(row, self._take_touch, message)

    def _take_touch(self, message: Any) -> None:
        if self._shape.by_servo:
            self._shape.take_touch(message)
