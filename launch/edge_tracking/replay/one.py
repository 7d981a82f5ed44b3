"""Replay of one recording: input, comparison and result."""
from collections.abc import Collection, Iterator
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field
from functools import partial
from heapq import merge
import json
from pathlib import Path
import time

import numpy as np
from rcl_interfaces.msg import ParameterEvent
from rclpy.parameter import Parameter

from edge_tracking.recording.settings import Settings
from edge_tracking.recording.topics import RecordedTopics
from edge_tracking.replay.comparison import COMPARED, Comparison, Encoded
from edge_tracking.replay.cores import Cores
from edge_tracking.replay.output import Output
from tactile_common.errors import ConfigurationError
from tactile_common.progress import Progress
from tactile_common.ros.bag_reader import Bag, Recorded
from tactile_common.ros.cdr import packed

QUIET = 1.0  # s without a progress bar
MOST_FAULTS = 10  # faults that are printed
RESULT = 'result.json'  # written to the output folder at the end
# Topics that the replay computes, by the core that computes them.
OF_IMAGES = ('contact', 'wrench')
OF_SHAPE = ('surface_patch', 'contour', 'markers')
OF_SERVO = ('sensor_pose', 'surface_contact', 'joint_trajectory', 'servo_status')


@dataclass(frozen=True)
class Options:
    """Options of a replay."""

    source: str = 'image'  # or contact
    changes: tuple[str, ...] = ()  # NODE.PARAM=VALUE
    out: Path | None = None
    compare: bool = False
    other: str = ''  # bag to compare with, in place of itself
    tolerances: dict[str, float] = field(default_factory=dict)
    namespace: str | None = None
    parquet: bool = False  # tables as Parquet too


@dataclass
class Result:
    """Result of a replay."""

    bag: str
    seconds: float = 0.0  # duration of the recording [s]
    elapsed: float = 0.0  # duration of the replay [s]
    counts: dict[str, int] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)  # what is missing
    faults: list[str] = field(default_factory=list)  # why it cannot be read whole
    equal: bool | None = None
    table: str = ''

    @property
    def status(self) -> int:
        """Exit status: 0 equal or not compared, 1 differs, 2 cannot be read completely."""
        return 2 if self.faults else int(self.equal is False)


class Replay:
    """
    One replay, from a bag to another bag, tables and a comparison.

    Raises a ConfigurationError if nothing can be replayed, or an option is wrong.
    """

    def __init__(self, path: str | Path, options: Options, stack: ExitStack):
        self.result = Result(str(path))
        self.bag = stack.enter_context(Bag(path))
        self._topics = RecordedTopics(self.bag, options.namespace)
        self._topics.require_touch(self.bag)
        settings, has = Settings.of(self.bag, self._topics), self._topics.topic
        settings.change(options.changes)
        from_images = options.source == 'image' and 'image' in has
        with_servo = settings.has_robot and 'servo_calls' in has
        if not with_servo:
            self.result.notes.append('without the calls and parameters of the servo in it: '
                                     'estimator and shape alone are replayed')
        if not settings.recorded:
            self.result.notes.append('without parameters in it: the defaults hold')
        if not from_images and 'contact' not in has:
            raise ConfigurationError(f'bag {path}: has no contact; replay it --from image')
        self._made = {*OF_SHAPE, *(OF_IMAGES if from_images else ()),
                      *(OF_SERVO if with_servo else ())}
        self._reference = stack.enter_context(Bag(options.other)) if options.other else self.bag
        self._compares = options.compare
        self.output = Output(
            Comparison(options.tolerances),
            COMPARED.keys() & self._made & has.keys() if options.compare else ())
        if options.out is not None:
            self.output.open(options.out, self._topics.prefix.strip('/'), stack)
        self.cores = Cores(self.bag, settings, self.output, from_images, with_servo)
        for node, values in settings.changed.items():  # also in the written recording
            self.output.copy('parameters', self.bag.span[0], packed(ParameterEvent(
                node=f'{self._topics.prefix}/{node}', changed_parameters=[
                    Parameter(name, value=value).to_parameter_msg()
                    for name, value in values.items()])))

    def run(self, progress: Progress) -> Result:
        """Replay all messages that can be read."""
        result, (begin_ns, end_ns) = self.result, self.bag.span
        result.seconds, begun, count = 1e-9 * (end_ns - begin_ns), time.perf_counter(), 0
        for bag, name, row in self._rows():
            if bag is self._reference and name in self.output.compared:
                self.output.comparison.take(0, name, Encoded(
                    bag.stamp_ns(row), row.message, partial(bag.unpacked, row)))
            if bag is self.bag and name not in self._made:
                count += 1
                self.output.copy(name, row.received_ns, row.message)
                self.cores.take(name, row)
                if not count % 1000:
                    gone = 1e-9 * (row.received_ns - begin_ns)
                    progress.show(gone, 'replay', f'{gone:.0f} of {result.seconds:.0f} s')
        self.cores.finish()
        result.elapsed, result.counts = time.perf_counter() - begun, dict(self.output.counts)
        result.faults += self.cores.faults
        if not count:
            result.faults.append(f'bag {result.bag}: holds no message of these topics')
        if servo := self.cores.servo:
            result.notes += [f'{lost} of {name} that the servo used were not recorded'
                             for name, lost in servo.lost.items()]
            if servo.lost_calls:
                result.notes.append(f'{servo.lost_calls} calls were not recorded')
        if self._compares:
            result.equal = self.output.comparison.equal
            result.table = self.output.comparison.table()
        return result

    def _rows(self) -> Iterator[tuple[Bag, str, Recorded]]:
        """Yield the messages to replay and to compare with, in the order of reception."""
        names = self._topics.name
        wanted = {self.bag: {topic for topic in names if names[topic] not in self._made}}
        wanted[self._reference] = wanted.get(self._reference, set()) | {
            topic for topic in self._reference.topics if names.get(topic) in self.output.compared}
        return merge(*(self._readable(*it) for it in wanted.items()),
                     key=lambda it: it[2].received_ns)

    def _readable(self, bag: Bag, wanted: Collection[str]) -> Iterator[tuple[Bag, str, Recorded]]:
        """Yield the readable messages of a bag; if there are unreadable ones, record a fault."""
        try:
            for row in bag.messages(wanted, raw=True):
                yield bag, self._topics.name[row.topic], row
        except ConfigurationError as error:
            self.result.faults.append(str(error))


def replay_one(path: str | Path, options: Options, quiet: bool = False) -> Result:
    """Replay a recording; ConfigurationError if nothing of it can be replayed."""
    with ExitStack() as stack:
        replay = Replay(path, options, stack)
        begin, end = replay.bag.span
        with Progress(1e-9 * (end - begin) or 1.0, 1e9 if quiet else QUIET) as progress, \
                np.errstate(all='ignore'):
            result = replay.run(progress)
    if options.out and options.parquet:
        _to_parquet(options.out)
    if options.out:
        (options.out / RESULT).write_text(json.dumps(
            {**asdict(result), 'status': result.status}, indent=1))
    return result


def _to_parquet(folder: Path) -> None:
    """Also write the tables of a folder as Parquet."""
    from pyarrow import csv as tables
    from pyarrow import parquet
    for path in folder.glob('*.csv'):
        parquet.write_table(tables.read_csv(path), path.with_suffix('.parquet'))


def describe(result: Result) -> str:
    """Return the text of a result for the terminal."""
    rate = result.seconds / max(result.elapsed, 1e-9)
    lines = [f'{result.bag}: {result.seconds:.1f} s in {result.elapsed:.1f} s, {rate:.1f} times '
             f'real time: {", ".join(f"{n} {name}" for name, n in sorted(result.counts.items()))}',
             *result.notes]
    if result.table:
        lines += [result.table,
                  'equal within the tolerance' if result.equal else 'they differ']
    more = len(result.faults) - MOST_FAULTS
    return '\n'.join([*lines, *result.faults[:MOST_FAULTS],
                      *([f'and {more} faults more'] if more > 0 else [])])
