"""Journal of the calls of a supervisor, from which they can be repeated."""

from array import array
from dataclasses import dataclass, field
from enum import IntEnum


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
MOST_CALLS = 100_000  # that wait for `take`: about a minute of a goal


@dataclass(eq=False)
class Journal:
    """Recorded calls, as in ServoCalls.msg."""

    first: int = 0
    call: array = field(default_factory=lambda: array('B'))
    time: array = field(default_factory=lambda: array('d'))
    value: array = field(default_factory=lambda: array('q'))
    texts: list[str] = field(default_factory=list)

    def add(self, call: Call, time: float = 0.0, value: int = 0, text: str | None = None) -> None:
        """Append a call. At `MOST_CALLS`, those that nobody took are dropped."""
        if len(self.call) >= MOST_CALLS:
            self.take()
        self.call.append(call)
        self.time.append(time)
        self.value.append(value)
        if text is not None:
            self.texts.append(text)

    def take(self) -> 'Journal':
        """Return the calls since the last `take`, and begin anew."""
        taken = Journal(self.first, self.call, self.time, self.value, self.texts)
        self.first += len(self.call)
        self.call, self.time, self.value, self.texts = array('B'), array('d'), array('q'), []
        return taken
