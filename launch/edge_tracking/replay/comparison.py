"""What a replay makes: messages, compared with recorded ones, a new recording and tables."""
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from contextlib import ExitStack
import csv
from dataclasses import dataclass, field, is_dataclass
import math
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np

from edge_tracking.recording.record_bag import BagWriter
from edge_tracking.recording.topics import KINDS, topics
from tactile_common.config import did_you_mean
from tactile_common.errors import ConfigurationError
from tactile_common.ros.bag_reader import DamagedMessageError, Recorded
from tactile_common.ros.cdr import packed, stamp_of, unpacked
from tactile_common.ros.conversions import NS
from tactile_sensing.types.contact import Contact, REALS
from tactile_servo.types import Status

# Of all values, and of some. Other processors and numbers of BLAS threads round the fits of
# contacts and shapes differently: seen are 1e-6 of a variance. Times are whole nanoseconds.
TOLERANCES = {'': 1e-7, 'covariance': 1e-5, 'joint_trajectory.points': 2e-9}
# Compared topics, with their fields that depend on the machine; these are not compared.
COMPARED: dict[str, tuple[str, ...]] = {
    'contact': ('latency',), 'wrench': (), 'surface_patch': (), 'contour': (),
    'surface_contact': (), 'sensor_pose': (), 'joint_trajectory': (),
    'servo_status': ('latency', 'cycle_time', 'cpu_time', 'cycles', 'missed_cycles')}
# A node skips images when it is late, a replay does not. So additional replayed messages of these
# topics are not differences; if there are any, nor is the topic that is made of all contacts.
SKIPPED = ('contact', 'wrench', 'surface_patch')
OF_ALL = 'contour'
DURATION = 'builtin_interfaces/msg/Duration'
FIRST = 10  # differences that are listed
_REALS = ('lateral_error', 'longitudinal_error', 'angle_error', 'normal_force', 'force_target',
          'speed', 'progress', 'limit_scale', 'manipulability')
# Columns of the tables.
CONTACTS = ('stamp_ns', 'type', 'valid', 'force_valid', 'reasons', *REALS)
CYCLES = ('stamp_ns', 'steady', 'state', 'reason_code', *_REALS, 'window')


@dataclass
class Tally:
    """Result of the comparison of one topic."""

    compared: int = 0
    # Stamps of the first and the last message: recorded, replayed.
    spans: tuple[list[float], list[float]] = field(
        default_factory=lambda: ([math.inf, -math.inf], [math.inf, -math.inf]))
    # Messages without a partner by their stamps: recorded, replayed.
    waiting: tuple[dict[int, Any], dict[int, Any]] = field(default_factory=lambda: ({}, {}))
    differing: int = 0
    fields: dict[str, tuple[int, float]] = field(default_factory=dict)  # count and largest

    @property
    def only(self) -> list[int]:
        """Number of messages of each side without a partner, within the span of the other side."""
        return [sum(begin < abs(stamp) < end for stamp in side)
                for side, (begin, end) in zip(self.waiting, reversed(self.spans), strict=True)]


class Comparison:
    """
    Compares recorded with replayed messages of some topics, in pairs with equal stamps.

    A message without a partner counts as a difference only between the first and last message of
    the other side, because a recording begins and ends in the middle. A topic without a pair
    counts as a difference, too. `tolerances` have the keys `topic.field`, `field`, or '' for all,
    and come before `TOLERANCES`. Raises a ConfigurationError if a key is none of these. `faults`
    take what is said of recorded messages that are damaged.
    """

    def __init__(self, tolerances: Mapping[str, float], compared: Collection[str],
                 faults: list[str]):
        known = {'', *(name for topic in COMPARED for field in names_of(KINDS[topic]())
                       for name in (field, f'{topic}.{field}'))}
        for name in tolerances.keys() - known:
            raise ConfigurationError(f'--tolerance {name}: no compared message has such a field'
                                     f'{did_you_mean(name, known)}')
        self._tolerances, self.compared, self._faults = tolerances, compared, faults
        self._unstamped: Counter[tuple[str, int]] = Counter()
        self.topics: dict[str, Tally] = {}
        self.first: list[str] = []

    def take(self, topic: str, message: Recorded | bytes) -> None:
        """Add a recorded message or the bytes of a replayed one; compare it with its partner."""
        if topic in self.compared:
            try:
                self._take(topic, message)
            except DamagedMessageError as error:
                self._faults.append(str(error))

    def _take(self, topic: str, message: Recorded | bytes) -> None:
        side, stamp = (1, stamp_of(message)) if isinstance(message, bytes) else (
            0, message.stamp_ns)
        tally = self.topics.setdefault(topic, Tally())
        if not stamp:  # a window that begins on reception has no stamp
            self._unstamped[topic, side] += 1
            stamp = -self._unstamped[topic, side]
        span = tally.spans[side]
        span[:] = min(span[0], abs(stamp)), max(span[1], abs(stamp))
        other = tally.waiting[1 - side].pop(stamp, None)
        if other is None:
            tally.waiting[side][stamp] = message
        else:
            self._compare(topic, stamp, *((other, message) if side else (message, other)))

    def _compare(self, topic: str, stamp: int, before: Recorded, after: bytes) -> None:
        tally = self.topics[topic]
        tally.compared += 1
        if before.data == after:  # the usual case: neither is decoded
            return
        differs = False
        for name, one, other in unequal(before.message, unpacked(after, KINDS[topic])):
            size = distance(one, other)
            if name.split('.')[0] in COMPARED[topic] or size <= self._tolerance(topic, name):
                continue
            differs = True
            count, most = tally.fields.get(name, (0, 0.0))
            tally.fields[name] = count + 1, max(most, size)
            if len(self.first) < FIRST:
                at = f'{stamp / NS:.6f} s' if stamp > 0 else f'number {-stamp}'
                self.first.append(' '.join(
                    f'{topic} at {at}: {name} was {one!s:.100}, is {other!s:.100}'.split()))
        tally.differing += differs

    def _tolerance(self, topic: str, name: str) -> float:
        bare = name.split('[')[0]
        return next(values[key] for values in (self._tolerances, TOLERANCES)
                    for key in (f'{topic}.{bare}', bare, '') if key in values)

    @property
    def equal(self) -> bool:
        """True if something was compared and nothing differs."""
        skipped = any(it.only[1] for topic, it in self.topics.items() if topic in SKIPPED)
        return bool(self.topics) and all(
            it.compared and not (it.differing or any(it.only[:1 if topic in SKIPPED else 2]))
            for topic, it in self.topics.items() if not (skipped and topic == OF_ALL))

    def table(self) -> str:
        """Return a short table of the compared topics, the first differences and the verdict."""
        lines = ['topic               recorded  replayed  compared  differ  only recorded  '
                 'only replayed']
        for topic, it in self.topics.items():
            all_of = [it.compared + len(side) for side in it.waiting]
            lines.append(f'{topic:18} {all_of[0]:9} {all_of[1]:9} {it.compared:9} '
                         f'{it.differing:7} {it.only[0]:14} {it.only[1]:14}')
            lines += [f'  {name}: {count} differ, by {most:.3g} at most'
                      for name, (count, most) in sorted(
                          it.fields.items(), key=lambda item: -item[1][0])[:5]]
        verdict = 'equal within the tolerance' if self.equal else 'they differ'
        if not any(it.compared for it in self.topics.values()):
            verdict = 'nothing was compared: no topic has messages with equal stamps on both sides'
        return '\n'.join([*lines, *self.first, verdict])


def names_of(message: Any, name: str = '') -> Iterator[str]:
    """Yield the names of the fields of a message, with dots; a list is one field."""
    if not hasattr(message, 'get_fields_and_field_types'):
        yield name
        return
    for key in message.get_fields_and_field_types():
        yield from names_of(getattr(message, key), f'{name}.{key}' if name else key)


def unequal(one: Any, other: Any, name: str = '') -> Iterator[tuple[str, Any, Any]]:
    """
    Yield names and values of the fields in which two messages of one type differ.

    If a field is missing in the other version of the type, its value is None. A duration is a
    number of seconds.
    """
    if getattr(one, '__msgtype__', '') == DURATION and other is not None:
        one, other = (it.sec + it.nanosec / NS for it in (one, other))
    if is_dataclass(one):
        for key in one.__dataclass_fields__:
            if not key.startswith('__'):
                yield from unequal(getattr(one, key), getattr(other, key, None),
                                   f'{name}.{key}' if name else key)
    elif isinstance(one, list) and isinstance(other, list) and len(one) == len(other) and one and (
            is_dataclass(one[0])):
        for k, pair in enumerate(zip(one, other, strict=True)):
            yield from unequal(*pair, f'{name}[{k}]')
    elif distance(one, other):
        yield name, one, other


def distance(one: Any, other: Any) -> float:
    """Return the difference of two values, relative if above 1; infinite if incomparable."""
    if not isinstance(one, np.ndarray) and not isinstance(other, np.ndarray):
        if one == other:
            return 0.0
        if isinstance(one, (str, list)) or isinstance(other, (str, list)):
            return math.inf
    a, b = (np.asarray(it, dtype=float) for it in (one, other))
    if a.shape != b.shape or (np.isnan(a) != np.isnan(b)).any():
        return math.inf
    differ = ~((a == b) | np.isnan(a))
    a, b = a[differ], b[differ]
    return float((np.abs(a - b) / np.fmax(np.abs(a), 1.0)).max(initial=0.0))


class Output:
    """
    Takes the results of a replay; `counts` are the numbers of messages by topic.

    They are compared and, once there is a folder for them, written.
    """

    def __init__(self, comparison: Comparison):
        self.counts: Counter[str] = Counter()
        self._comparison = comparison
        self._writer: BagWriter | None = None
        self._tables: dict[str, Any] = {}

    def write_to(self, folder: Path, namespace: str, stack: ExitStack) -> None:
        """Make a new folder with a recording and tables, which the stack closes."""
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
