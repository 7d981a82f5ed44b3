"""What a replay makes: messages, compared with recorded ones, a new recording and tables."""
from collections import Counter
from contextlib import ExitStack
import csv
from operator import attrgetter
from pathlib import Path
from typing import Any

from edge_tracking.recording.record_bag import BagWriter
from edge_tracking.recording.topics import topics
from edge_tracking.replay.comparison import Comparison
from tactile_common.errors import ConfigurationError
from tactile_common.ros.cdr import packed
from tactile_sensing.types.contact import Contact, REALS
from tactile_servo.types import Status

_REALS = ('lateral_error', 'longitudinal_error', 'angle_error', 'normal_force', 'force_target',
          'speed', 'progress', 'limit_scale', 'manipulability')
# Columns of the tables.
CONTACTS = ('stamp_ns', 'type', 'valid', 'force_valid', 'reasons', *REALS)
CYCLES = ('stamp_ns', 'steady', 'state', 'reason_code', *_REALS, 'window')


class Output:
    """Takes the results of a replay; `counts` are the numbers of messages by topic."""

    def __init__(self, comparison: Comparison):
        self.counts: Counter[str] = Counter()
        self._comparison = comparison
        self._writer: BagWriter | None = None
        self._tables: dict[str, Any] = {}

    def open(self, folder: Path, namespace: str, stack: ExitStack) -> None:
        """Open a recording and tables in a new folder; the stack closes them."""
        try:
            folder.mkdir(parents=True)
        except OSError as error:
            raise ConfigurationError(f'-o {folder}: {error.strerror}') from error
        self._writer = BagWriter(folder / 'bag', topics(namespace))
        stack.callback(self._writer.close)
        for name, columns in (('contacts', CONTACTS), ('cycles', CYCLES)):
            file = stack.enter_context((folder / f'{name}.csv').open('w', newline=''))
            self._tables[name] = csv.writer(file)
            self._tables[name].writerow(columns)

    def copy(self, name: str, time_ns: int, data: bytes) -> None:
        """Write a message of a topic to the recording."""
        if self._writer:
            self._writer.write(name, time_ns, data)

    def message(self, name: str, time_ns: int, message: Any) -> None:
        """Write and compare a message that the replay has made."""
        data = packed(message)
        self.counts[name] += 1
        self.copy(name, time_ns, data)
        self._comparison.take(name, data)

    def contact(self, stamp_ns: int, contact: Contact) -> None:
        """Write a row of the contacts."""
        if self._tables:
            self._tables['contacts'].writerow((
                stamp_ns, int(contact.type), int(contact.valid), int(contact.force_valid),
                int(contact.reasons), *attrgetter(*REALS)(contact)))

    def cycle(self, now: float, now_ns: int, status: Status, has_window: bool) -> None:
        """Write a row of the control cycles."""
        if self._tables:
            self._tables['cycles'].writerow((
                now_ns, now, status.state.name.lower(), int(status.reason.code),
                *attrgetter(*_REALS)(status), int(has_window)))
