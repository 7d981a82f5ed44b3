"""Estimator, servo and shape estimator of a recording, fed with its messages one by one."""
from collections import Counter, deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
import json
import math
from types import SimpleNamespace
from typing import Any

from geometry_msgs.msg import PoseStamped, WrenchStamped

from edge_tracking.parameters import SERVO
from edge_tracking.recording.settings import Settings
from edge_tracking.replay.output import Output
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
    trajectory_to_msg,
)
from tactile_servo.journal import ask_again, Call, WITH_TEXT
from tactile_servo.laws.registry import law_named
from tactile_servo.robot_config import NodeConfig, robot_of
from tactile_servo.supervisor import Supervisor
from tactile_servo.types import Timing
from tactile_shape.local_surface.local_quadric import LocalQuadricConfig
from tactile_shape.nodes.shape_estimator import ShapeEstimatorConfig, ShapeTopics

BEHIND = NS  # within this time a recorder has received all inputs that the servo used
WAITING = 4000  # inputs of one kind that are kept until used
UNKNOWN = Timing(math.nan, math.nan, math.nan, 0, 0)
# Keys are integers, as in the messages: the lookup of an IntEnum is slow.
_KINDS = {int(Call.SENSOR): 'sensor_info', int(Call.JOINTS): 'joint_states',
          int(Call.IMAGE): 'image', int(Call.CONTACT): 'contact'}


@dataclass
class Cycle:
    """A control cycle: its time and the decision of the servo."""

    now: float  # steady [s]
    now_ns: int
    status: Any
    window: Any
    told: bool = False  # True if its status was published


class ServoCore:
    """
    A servo that repeats its recorded calls; the shape estimator gets its poses and touches.

    Attributes
    ----------
    lost : Counter
        By topic, number of inputs that the servo used and that were not recorded.
    lost_calls : int
        Number of calls that were not recorded.
    """

    def __init__(self, settings: Settings, shape: ShapeTopics, output: Output):
        c, config = settings.config(SERVO, NodeConfig), settings.config(SERVO, ServoConfig)
        law = law_named(c.law)
        self._model, limits, box = robot_of(c)
        self._settings, self._shape, self._output = settings, shape, output
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
        self.lost_calls, self.lost = 0, Counter[str]()
        # Recorded inputs by the stamps with which the calls refer to them [ns].
        self._kept: dict[str, dict[int, Any]] = {name: {} for name in _KINDS.values()}
        self._begun: set[str] = set()  # topics of which an input was used

    def keep(self, name: str, stamp_ns: int, value: Any) -> None:
        """Keep an input until it is used, or many newer ones have arrived."""
        kept = self._kept[name]
        kept[stamp_ns] = value
        if len(kept) > WAITING:
            del kept[next(iter(kept))]

    def _find(self, name: str, stamp_ns: int) -> Any:
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
        # Some were also refused in the recording, or are so with changed settings.
        with suppress(TactileError):
            ask_again(self.servo, call, time, value, text)

    def _see(self, call: int, time: float, stamp_ns: int, at: int) -> None:
        seen, servo = self._find(_KINDS[call], stamp_ns), self.servo
        if seen is None:
            return
        with suppress(TactileError, ValueError):  # also refused in the recording
            if call == Call.SENSOR:
                servo.see_sensor(seen)
            elif call == Call.CONTACT:
                servo.see_contact(seen, stamp_ns, time)
            elif call == Call.IMAGE:
                servo.see_image(seen, time)
                self._touch(stamp_ns, at)
            else:
                servo.see_joints(seen, stamp_ns, time)
                pose_to_msg(servo.inputs.pose, self._pose.pose)
                set_stamp(self._pose.header.stamp, stamp_ns)
                self._output.message('sensor_pose', at, packed(self._pose))
                self._shape.take_pose(self._pose)

    def _touch(self, stamp_ns: int, at: int) -> None:
        touch = self.servo.law.touch
        if self._maps and touch and touch.stamp_ns == stamp_ns:
            message = touch_to_msg(touch, self._model.root_frame)
            self._output.message('surface_contact', at, packed(message))
            if self._shape.by_servo:
                self._shape.take_touch(message)

    def _end_cycle(self, at: int) -> None:
        """Emit the results of a cycle once all calls that belong to it are known."""
        cycle, self._cycle = self._cycle, None
        if cycle is None:
            return
        if cycle.window is not None:
            self._output.message(
                'joint_trajectory', at, packed(trajectory_to_msg(cycle.window)))
        news = cycle.status.state, cycle.status.reason
        if cycle.told or news != (self._news or news):
            status_to_msg(cycle.status, self.servo.law.name, UNKNOWN, self._status)
            set_stamp(self._status.header.stamp, cycle.now_ns)
            self._output.message('servo_status', at, packed(self._status))
        self._news = news
        self._output.cycle(cycle.now, cycle.now_ns, cycle.status, cycle.window is not None)


class Cores:
    """
    The cores of the nodes in sequence.

    With `from_images` the contact estimator runs; otherwise the recorded contacts are used.
    Messages that could not be used are listed in `faults`.
    """

    def __init__(self, bag: Bag, settings: Settings, output: Output, from_images: bool,
                 with_servo: bool):
        self._bag, self._output, self._from_images = bag, output, from_images
        self.faults: list[str] = []
        self._estimator = ContactEstimator(settings.config('contact_estimator', EstimatorConfig))
        self._now_ns = 0  # time of the message that is being processed
        self._shape = ShapeTopics(self._publisher, self.faults.append, *(
            settings.config('shape_estimator', kind)
            for kind in (ShapeEstimatorConfig, LocalQuadricConfig)))
        self.servo = ServoCore(settings, self._shape, output) if with_servo else None
        self._contact, self._wrench = ContactMsg(), WrenchStamped()
        self._later: deque[tuple[Recorded, Callable[[], None]]] = deque()
        self._takers: dict[str, Callable[[Recorded, Any], None]] = {
            'image': self._on_image, 'contact': self._on_contact,
            'sensor_info': self._on_sensor_info}
        if self.servo:
            self._takers |= {'joint_states': self._on_joint_states,
                             'servo_calls': self._on_servo_calls}
        else:
            self._takers |= {'sensor_pose': self._on_sensor_pose,
                             'surface_contact': self._on_surface_contact}

    def _publisher(self, _: Any, name: str, __: Any) -> Any:
        """Return a stand-in for a node's publisher."""
        return SimpleNamespace(
            publish=lambda message: self._output.message(name, self._now_ns, packed(message)))

    def take(self, name: str, row: Recorded) -> None:
        """Process a raw message of a topic; call this in the order of reception."""
        while self._later and self._later[0][0].received_ns < row.received_ns - BEHIND:
            self._do(*self._later.popleft())
        if name in self._takers:
            self._do(row, lambda: self._takers[name](row, self._bag.unpacked(row)))

    def finish(self) -> None:
        """Process everything that still waits."""
        while self._later:
            self._do(*self._later.popleft())

    def _do(self, row: Recorded, action: Callable[[], None]) -> None:
        self._now_ns = row.received_ns
        try:
            action()
        except (TactileError, *DAMAGE) as error:
            self.faults.append(str(self._bag.damaged(row.topic, row.received_ns, error)))

    def _do_later(self, row: Recorded, action: Callable[..., None], *arguments: Any) -> None:
        self._later.append((row, partial(action, *arguments)))

    def _keep(self, name: str, stamp_ns: int, value: Any) -> None:
        if self.servo:
            self.servo.keep(name, stamp_ns, value)

    def _on_image(self, row: Recorded, message: Any) -> None:
        raw, stamp_ns = bytes(row.message), stamp_to_ns(message.header.stamp)
        if not self._shape.by_servo:
            self._do_later(row, self._shape.take_image, raw)
        try:
            image = image_from_msg(message)
        except TactileError:
            image = None
        else:
            self._keep('image', stamp_ns, image)
        if not self._from_images:
            return
        contact = (self._estimator.refuse_malformed() if image is None
                   else self._estimator.estimate(image))
        self._output.message('contact', row.received_ns, packed(contact_to_msg(
            contact, message, row.received_ns, self._contact)))
        if contact.force_valid:
            self._output.message('wrench', row.received_ns, packed(
                contact_to_wrench(contact, message, self._wrench)))
        self._use(row, stamp_ns, contact, message.sensor)

    def _on_contact(self, row: Recorded, message: Any) -> None:
        if not self._from_images:
            self._use(row, stamp_to_ns(message.header.stamp), contact_from_msg(message),
                      message.sensor)

    def _use(self, row: Recorded, stamp_ns: int, contact: Any, sensor: str) -> None:
        self._keep('contact', stamp_ns, contact)
        self._output.contact(stamp_ns, contact)
        self._do_later(row, self._shape.take_contact, stamp_ns, contact, sensor)

    def _on_sensor_info(self, row: Recorded, message: Any) -> None:
        self._keep('sensor_info', stamp_to_ns(message.header.stamp),
                         sensor_info_from_msg(message))

    def _on_joint_states(self, row: Recorded, message: Any) -> None:
        if self.servo and (
                positions := joint_positions(message, self.servo.joint_names)) is not None:
            self.servo.keep('joint_states', stamp_to_ns(message.header.stamp), positions)

    def _on_servo_calls(self, row: Recorded, message: Any) -> None:
        if self.servo:
            self._do_later(row, self.servo.repeat, row.received_ns, message)

    def _on_sensor_pose(self, row: Recorded, message: Any) -> None:
        self._do_later(row, self._shape.take_pose, message)

    def _on_surface_contact(self, row: Recorded, message: Any) -> None:
        if self._shape.by_servo:
            self._do_later(row, self._shape.take_touch, message)
