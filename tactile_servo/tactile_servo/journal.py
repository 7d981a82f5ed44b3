"""A supervisor that records its calls, and the replay of these calls."""

from array import array
from dataclasses import asdict, dataclass, field
from enum import IntEnum
import json
from typing import Any

import numpy as np

from tactile_common.config import built, checked
from tactile_sensing.types.contact import Contact
from tactile_sensing.types.image import SensorInfo, TactileImage
from tactile_servo.laws.surface_goal import Pattern
from tactile_servo.motion.trajectory import Trajectory
from tactile_servo.reasons import Reason, ReasonCode
from tactile_servo.supervisor import Supervisor
from tactile_servo.types import State, Status


class Call(IntEnum):
    """Kinds of calls, with the numbers of ServoCalls.msg."""

    SENSOR = 0
    JOINTS = 1
    IMAGE = 2
    CONTACT = 3
    CYCLE = 4
    STATUS = 5
    LATE = 6
    START = 7
    FINISH = 8
    CANCEL = 9
    PAUSE = 10
    TUNE = 11
    TEACH = 12
    AROUND = 13
    REFUSED = 14
    NOTED = 15
    CLIENT = 16
    DELAY = 17
    WRENCH = 18


WITH_TEXT = (Call.START, Call.TUNE, Call.TEACH, Call.AROUND, Call.REFUSED, Call.NOTED,
             Call.DELAY, Call.WRENCH)


@dataclass(eq=False)
class Journal:
    """Recorded calls, as in ServoCalls.msg."""

    first: int = 0
    call: array = field(default_factory=lambda: array('B'))
    time: array = field(default_factory=lambda: array('d'))
    value: array = field(default_factory=lambda: array('q'))
    texts: list[str] = field(default_factory=list)

    def add(self, call: Call, time: float = 0.0, value: int = 0, text: str | None = None) -> None:
        """Append a call."""
        self.call.append(call)
        self.time.append(time)
        self.value.append(value)
        if text is not None:
            self.texts.append(text)


class JournaledSupervisor(Supervisor):
    """A supervisor that records its calls in `journal`, until `take_journal`."""

    def __init__(self, *arguments: Any, **named: Any):
        super().__init__(*arguments, **named)
        self.journal = Journal()
        self._recorded: dict[Call, Reason | None] = {Call.AROUND: None, Call.REFUSED: None}
        self._delay = self.motion.delay.learnt

    def take_journal(self) -> Journal:
        """Return the calls since the last `take_journal`, and begin a new journal."""
        journal = self.journal
        self.journal = Journal(journal.first + len(journal.call))
        return journal

    def _record_reasons(self) -> None:
        """Record values that are set from outside, if they have changed."""
        for call, reason in ((Call.AROUND, self.around), (Call.REFUSED, self.inputs.refused)):
            if reason != self._recorded[call]:
                self._recorded[call] = reason
                code, text = reason or (ReasonCode.NONE, '')
                self.journal.add(call, 0.0, code, text)
        if self._delay != self.motion.delay.learnt:
            self._delay = self.motion.delay.learnt
            self.journal.add(Call.DELAY, text=json.dumps(self._delay))

    def see_sensor(self, sensor: SensorInfo) -> None:
        """Record the call, and pass it on; so do the methods below."""
        self.journal.add(Call.SENSOR, 0.0, sensor.stamp_ns)
        super().see_sensor(sensor)

    def see_joints(self, positions: np.ndarray, stamp_ns: int, arrival: float) -> None:
        self.journal.add(Call.JOINTS, arrival, stamp_ns)
        super().see_joints(positions, stamp_ns, arrival)

    def see_image(self, image: TactileImage, arrival: float) -> None:
        self.journal.add(Call.IMAGE, arrival, image.stamp_ns)
        super().see_image(image, arrival)

    def see_contact(self, contact: Contact, stamp_ns: int, arrival: float) -> None:
        self.journal.add(Call.CONTACT, arrival, stamp_ns)
        super().see_contact(contact, stamp_ns, arrival)

    def see_wrench(self, force: np.ndarray, arrival: float) -> None:
        self.journal.add(Call.WRENCH, arrival, text=json.dumps(force.tolist()))
        super().see_wrench(force, arrival)

    def cycle(self, now: float, now_ns: int) -> tuple[Status, Trajectory | None]:
        self._record_reasons()
        self.journal.add(Call.CYCLE, now, now_ns)
        return super().cycle(now, now_ns)

    def start(self, goal: Any, now: float) -> None:
        self._record_reasons()
        self.journal.add(
            Call.START, now, text=json.dumps(asdict(goal), default=np.ndarray.tolist))
        super().start(goal, now)

    def hear_client(self) -> None:
        self.journal.add(Call.CLIENT)
        super().hear_client()

    def finish(self) -> None:
        self.journal.add(Call.FINISH)
        super().finish()

    def cancel(self, code: ReasonCode = ReasonCode.CANCELLED) -> None:
        self.journal.add(Call.CANCEL, 0.0, code)
        super().cancel(code)

    def pause(self, paused: bool, now: float) -> Reason:
        self.journal.add(Call.PAUSE, now, paused)
        return super().pause(paused, now)

    def teach(self, name: str) -> str:
        self.journal.add(Call.TEACH, text=name)
        return super().teach(name)

    def note(self, refusal: Reason) -> None:
        self.journal.add(Call.NOTED, 0.0, refusal.code, refusal.detail)
        super().note(refusal)

    def retune(self, config: Any) -> None:
        """Record a configuration with changed live fields, and pass it to the law."""
        values: dict[str, Any] = {}
        built(type(config), lambda name, value, *_: values.setdefault(name, value),
              defaults=config)
        self.journal.add(Call.TUNE, text=json.dumps(values))
        self.law.retune(config)


def ask_again(servo: Supervisor, call: int, time: float, value: int, text: str) -> None:
    """
    Repeat a recorded call of a servo, one of those from `Call.START` on.

    TactileError if the servo refuses the call, as it did in the recording.
    """
    code = next((it for it in ReasonCode if it == value), ReasonCode.NONE)
    reason = Reason(code, text) if value else None
    if call == Call.START:
        if servo.state is State.DONE:  # with other settings the last goal may end earlier
            servo.finish()
        servo.start(_goal(servo.law.goal_type, json.loads(text)), time)
    elif call == Call.FINISH:
        servo.finish()
    elif call == Call.CANCEL:
        servo.cancel(code)
    elif call == Call.PAUSE:
        servo.pause(bool(value), time)
    elif call == Call.TUNE:
        values = json.loads(text)
        servo.law.retune(built(
            servo.law.config_type, lambda name, default, kind, metadata: checked(
                name, values.get(name, default), kind, metadata)))
    elif call == Call.TEACH:
        servo.teach(text)
    elif call == Call.AROUND:
        servo.around = reason
    elif call == Call.REFUSED:
        servo.inputs.refused = reason
    elif call == Call.CLIENT:
        servo.hear_client()
    elif call == Call.DELAY:
        servo.motion.delay.learnt = tuple(json.loads(text))
    elif call == Call.WRENCH:
        servo.see_wrench(np.array(json.loads(text)), time)
    elif call == Call.NOTED and reason is not None:
        servo.note(reason)


def _goal(kind: type, values: dict[str, Any]) -> Any:
    """Create a goal from its fields in JSON."""
    if 'points' in values:
        values['points'] = np.array(values['points'], dtype=float).reshape(-1, 3)
        pattern = values['pattern']
        values['pattern'] = Pattern(pattern) if pattern in list(Pattern) else pattern
    return kind(**{name: tuple(value) if isinstance(value, list) else value
                   for name, value in values.items()})
