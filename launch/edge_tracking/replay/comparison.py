"""Comparison of recorded and replayed messages: which fields differ, by how much, and when."""
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, is_dataclass
import math
from typing import Any, NamedTuple

import numpy as np

from tactile_common.ros.conversions import NS

TOLERANCE = 1e-9
# Compared topics, with their fields that depend on the machine; these are not compared.
COMPARED: dict[str, tuple[str, ...]] = {
    'contact': ('latency',), 'wrench': (), 'surface_patch': (), 'contour': (),
    'surface_contact': (), 'sensor_pose': (), 'joint_trajectory': (),
    'servo_status': ('latency', 'cycle_time', 'cpu_time', 'cycles', 'missed_cycles')}
# A node skips images when it is late, a replay does not. So additional replayed messages of these
# topics are not differences.
SKIPPED = ('contact', 'wrench', 'surface_patch')
FIRST = 10  # differences that are listed
WAIT = 5 * NS  # time to wait for the other message of a pair


class Encoded(NamedTuple):
    """A serialised message; it is only decoded if the bytes of a pair differ."""

    stamp_ns: int
    data: bytes
    decode: Callable[[], Any]


@dataclass
class Tally:
    """Result of the comparison of one topic."""

    compared: int = 0
    begin: float = math.inf  # stamps of the first and the last pair
    end: float = -math.inf
    only: list[int] = field(default_factory=lambda: [0, 0])  # recorded, replayed
    differing: int = 0
    fields: dict[str, tuple[int, float]] = field(default_factory=dict)  # count and largest


class Comparison:
    """
    Compares messages of two sides, 0 recorded and 1 replayed, in pairs with equal stamps.

    A message without a partner counts as a difference only between the first and last pair of its
    topic, because a recording begins and ends in the middle. `tolerances` have the keys
    `topic.field`, `field`, or '' for all; the default is `TOLERANCE`.
    """

    def __init__(self, tolerances: dict[str, float]):
        self._tolerances = tolerances
        self._waiting: tuple[dict, dict] = ({}, {})
        self._unstamped: dict[tuple[str, int], int] = {}
        self.topics: dict[str, Tally] = {}
        self.first: list[str] = []

    def take(self, side: int, topic: str, message: Encoded, now_ns: int) -> None:
        """Add a message of a side; it is compared when its partner is there."""
        stamp = message.stamp_ns
        if not stamp:  # a window that begins on reception has no stamp
            stamp = -1 - self._unstamped.get((topic, side), 0)
            self._unstamped[topic, side] = -stamp
        other, _ = self._waiting[1 - side].pop((topic, stamp), (None, 0))
        if other is None:
            self._waiting[side][topic, stamp] = message, now_ns
        else:
            self._compare(topic, stamp, *((other, message) if side else (message, other)))
        self._give_up(now_ns - WAIT)

    def _give_up(self, before_ns: float) -> None:
        for side, waiting in enumerate(self._waiting):
            while waiting:
                (topic, stamp), (_, came_ns) = next(iter(waiting.items()))
                if came_ns >= before_ns:
                    break
                del waiting[topic, stamp]
                tally = self.topics.setdefault(topic, Tally())
                tally.only[side] += tally.begin < abs(stamp) < tally.end

    def finish(self) -> None:
        """Process the messages without a partner after the last message."""
        self._give_up(math.inf)

    def _compare(self, topic: str, stamp: int, before: Encoded, after: Encoded) -> None:
        tally = self.topics.setdefault(topic, Tally())
        tally.compared += 1
        tally.begin, tally.end = min(tally.begin, abs(stamp)), max(tally.end, abs(stamp))
        if before.data == after.data:
            return
        differs = False
        for name, one, other in unequal(before.decode(), after.decode(), COMPARED[topic]):
            size = distance(one, other)
            if size <= self._tolerance(topic, name):
                continue
            differs = True
            count, most = tally.fields.get(name, (0, 0.0))
            tally.fields[name] = count + 1, max(most, size)
            if len(self.first) < FIRST:
                at = f'{stamp / NS:.6f} s' if stamp > 0 else f'number {-stamp}'
                self.first.append(' '.join(
                    f'{topic} at {at}: {name} was {one}, is {other}'.split()))
        tally.differing += differs

    def _tolerance(self, topic: str, name: str) -> float:
        bare = name.split('[')[0]
        return next((self._tolerances[key] for key in (f'{topic}.{bare}', bare, '')
                     if key in self._tolerances), TOLERANCE)

    @property
    def equal(self) -> bool:
        """True if something was compared and nothing differs."""
        return any(it.compared for it in self.topics.values()) and not any(
            it.differing or it.only[0] or (it.only[1] and topic not in SKIPPED)
            for topic, it in self.topics.items())

    def table(self) -> str:
        """Return a short table of the compared topics, and the first differences."""
        lines = ['topic               compared  differ  only recorded  only replayed']
        for topic, it in self.topics.items():
            lines.append(f'{topic:18} {it.compared:9} {it.differing:7} {it.only[0]:14} '
                         f'{it.only[1]:14}')
            lines += [f'  {name}: {count} differ, by {most:.3g} at most'
                      for name, (count, most) in sorted(
                          it.fields.items(), key=lambda item: -item[1][0])[:5]]
        return '\n'.join([*lines, *self.first])


def unequal(one: Any, other: Any, without: tuple[str, ...] = ()) -> Iterator[tuple[str, Any, Any]]:
    """
    Yield names and values of the fields in which two messages of one type differ.

    Fields in `without` are skipped. If a field is missing in the other version of the type, its
    value is None.
    """
    for name in one.__dataclass_fields__:
        if name in without or name.startswith('__'):
            continue
        x, y = getattr(one, name), getattr(other, name, None)
        if is_dataclass(x):
            parts = [(name, x, y)]
        elif isinstance(x, list) and isinstance(y, list) and len(x) == len(y) and x and (
                is_dataclass(x[0])):
            parts = [(f'{name}[{k}]', *pair) for k, pair in enumerate(zip(x, y, strict=True))]
        else:
            if distance(x, y):
                yield name, x, y
            continue
        for place, before, after in parts:
            for below, *values in unequal(before, after):
                yield f'{place}.{below}', *values


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
