"""A servo that repeats the calls of a recording."""
from collections import Counter
from contextlib import suppress
import json
import math
from types import SimpleNamespace
from typing import Any

from geometry_msgs.msg import PoseStamped

from edge_tracking.parameters import SERVO
from edge_tracking.recording.settings import Settings
from edge_tracking.replay.comparison import Output
from tactile_common.errors import TactileError
from tactile_common.ros.conversions import NS, pose_to_msg, set_stamp
from tactile_msgs.msg import ServoStatus
from tactile_servo.config import ServoConfig
from tactile_servo.conversions import status_to_msg, touch_to_msg, trajectory_to_msg
from tactile_servo.journal import Call, WITH_TEXT
from tactile_servo.laws.registry import law_named
from tactile_servo.robot_config import NodeConfig, robot_of
from tactile_servo.supervisor import Supervisor
from tactile_servo.types import State, Timing
from tactile_shape.nodes.shape_estimator import ShapeTopics

WAITING = 4000  # inputs of one kind that are kept until used
UNKNOWN = Timing(math.nan, math.nan, math.nan, 0, 0)
# Keys are integers, as in the messages: the lookup of an IntEnum is slow.
_KINDS = {int(Call.SENSOR): 'sensor_info', int(Call.JOINTS): 'joint_states',
          int(Call.IMAGE): 'image', int(Call.CONTACT): 'contact'}


class ServoCore:
    """A servo that repeats its recorded calls; the shape estimator gets its poses and touches."""

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
        self._cycle: Any = None  # the last one, until all calls that belong to it are known
        self._news: Any = None  # last state and reason
        self._due = 0  # number of the next call
        self._lost_calls, self._lost = 0, Counter[str]()  # not recorded: calls; inputs by topic
        # Recorded inputs by the stamps with which the calls refer to them [ns].
        self._kept: dict[str, dict[int, Any]] = {name: {} for name in _KINDS.values()}
        self._begun: set[str] = set()  # topics of which an input was used

    def keep(self, name: str, stamp_ns: int, value: Any) -> None:
        """Keep an input until it is used, or many newer ones have arrived."""
        kept = self._kept[name]
        kept[stamp_ns] = value
        if len(kept) > WAITING:
            del kept[next(iter(kept))]

    def notes(self) -> list[str]:
        """Return texts about what the servo used and was not recorded."""
        calls = [f'{self._lost_calls} calls were not recorded'] if self._lost_calls else []
        return [f'{lost} of {name} that the servo used were not recorded'
                for name, lost in self._lost.items()] + calls

    def _find(self, name: str, stamp_ns: int) -> Any:
        """Return the input with a stamp [ns] and drop earlier ones; None if not recorded."""
        kept = self._kept[name]
        if stamp_ns not in kept:
            self._lost[name] += 1
            return None
        if name not in self._begun:
            self._begun.add(name)
            del self._lost[name]  # they were before the recording
        while (first := next(iter(kept))) != stamp_ns:
            del kept[first]
        return kept[stamp_ns]

    def repeat(self, message: Any, received_ns: int) -> None:
        """Repeat the calls of a ServoCalls message."""
        if self._due:
            self._lost_calls += max(message.first - self._due, 0)
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
                status, window = self.servo.cycle(time, value)
                self._cycle = SimpleNamespace(
                    now=time, now_ns=value, status=status, window=window, published=False)
            elif call == Call.STATUS and self._cycle:
                self._cycle.published = True
            elif call == Call.LATE and self._cycle and self._cycle.window:
                self.servo.motion.in_time(self._cycle.window, math.inf)
                self._cycle.window = None
            elif call >= Call.START:
                self._end_cycle(at)
                self._ask(call, time, value, next(texts, '') if call in WITH_TEXT else '')
        self._end_cycle(received_ns)
        self.servo.journal.take()  # what is repeated is not recorded again

    def _ask(self, call: int, time: float, value: int, text: str) -> None:
        if call == Call.FINISH and self.servo.state is not State.DONE:
            return  # with inputs lost, or other settings, the goal goes on
        if call == Call.TUNE:
            text = json.dumps({**json.loads(text), **self._settings.changed.get(SERVO, {})})
        # Some were also refused in the recording, or are so with changed settings.
        with suppress(TactileError):
            self.servo.repeat(call, time, value, text)

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
                self._output.message('sensor_pose', at, self._pose)
                self._shape.take_pose(self._pose)

    def _touch(self, stamp_ns: int, at: int) -> None:
        touch = self.servo.law.touch
        if self._maps and touch and touch.stamp_ns == stamp_ns:
            message = touch_to_msg(touch, self._model.root_frame)
            self._output.message('surface_contact', at, message)
            self._shape.take_touch(message)

    def _end_cycle(self, at: int) -> None:
        """Emit the results of the last cycle."""
        cycle, self._cycle = self._cycle, None
        if cycle is None:
            return
        if cycle.window is not None:
            self._output.message('joint_trajectory', at, trajectory_to_msg(cycle.window))
        news = cycle.status.state, cycle.status.reason
        if cycle.published or news != (self._news or news):
            status_to_msg(cycle.status, self.servo.law.name, UNKNOWN, self._status)
            set_stamp(self._status.header.stamp, cycle.now_ns)
            self._output.message('servo_status', at, self._status)
        self._news = news
        self._output.cycle(cycle.now, cycle.now_ns, cycle.status, cycle.window is not None)
