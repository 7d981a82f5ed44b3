"""Replay of one recording: input, output and comparison."""
from collections.abc import Collection, Iterator
from contextlib import ExitStack
import csv
from dataclasses import asdict, dataclass, field
from heapq import merge
import json
from operator import attrgetter
from pathlib import Path
import sys
import time
from typing import Any

import numpy as np
from rcl_interfaces.msg import ParameterEvent
from rclpy.parameter import Parameter

from edge_tracking.recording.settings import Settings
from edge_tracking.recording.topics import KINDS, RecordedTopics, topics
from edge_tracking.recording.writer import BagWriter
from edge_tracking.replay.comparison import COMPARED, Comparison
from edge_tracking.replay.cores import Cores, Cycle
from tactile_common.errors import ConfigurationError
from tactile_common.progress import Progress
from tactile_common.ros.bag_reader import Bag, Recorded
from tactile_common.ros.cdr import packed, unpacked
from tactile_sensing.types.contact import REALS
from tactile_servo.compile_kernels import compile_kernels

QUIET = 1.0  # s without a progress bar
MOST_FAULTS = 10  # faults that are printed
RESULT = 'result.json'  # written to the output folder at the end
_ERRORS = ('lateral_error', 'longitudinal_error', 'angle_error', 'normal_force', 'force_target',
           'speed', 'progress', 'limit_scale', 'manipulability')
CYCLES = ('stamp_ns', 'steady', 'state', 'reason_code', *_ERRORS, 'window')
_errors_of, _reals_of = attrgetter(*_ERRORS), attrgetter(*REALS)
CONTACTS = ('stamp_ns', 'type', 'valid', 'force_valid', 'reasons', *REALS)
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
        self._comparison = Comparison(options.tolerances) if options.compare else None
        self._compared = COMPARED.keys() & self._made & has.keys() if options.compare else set()
        self._reference = stack.enter_context(Bag(options.other)) if options.other else self.bag
        self._writer: BagWriter | None = None
        self._tables: dict[str, Any] = {}
        if options.out is not None:
            self._open(options.out, stack)
        self.cores = Cores(self.bag, settings, self._emit, from_images, self._contact_row,
                           self._cycle_row, with_servo)
        for node, values in settings.changed.items():  # also in the written recording
            self._write('parameters', self.bag.span[0], packed(ParameterEvent(
                node=f'{self._topics.prefix}/{node}', changed_parameters=[
                    Parameter(name, value=value).to_parameter_msg()
                    for name, value in values.items()])))

    def _open(self, folder: Path, stack: ExitStack) -> None:
        """Open a recording and tables in a new folder."""
        try:
            folder.mkdir(parents=True)
        except OSError as error:
            raise ConfigurationError(f'-o {folder}: {error.strerror}') from error
        known = topics(self._topics.prefix.strip('/'))
        self._index = {name.rpartition('/')[2]: index
                       for index, (name, _, _) in enumerate(known)}
        self._writer = BagWriter(folder / 'bag', known)
        stack.callback(self._writer.close)
        for name, columns in (('contacts', CONTACTS), ('cycles', CYCLES)):
            file = stack.enter_context((folder / f'{name}.csv').open('w', newline=''))
            self._tables[name] = csv.writer(file)
            self._tables[name].writerow(columns)

    def _contact_row(self, stamp_ns: int, contact: Any) -> None:
        if self._tables:
            self._tables['contacts'].writerow((
                stamp_ns, int(contact.type), int(contact.valid), int(contact.force_valid),
                int(contact.reasons), *_reals_of(contact)))

    def _cycle_row(self, cycle: Cycle) -> None:
        if self._tables:
            status = cycle.status
            self._tables['cycles'].writerow((
                cycle.now_ns, cycle.now, status.state.name.lower(), int(status.reason.code),
                *_errors_of(status), int(cycle.window is not None)))

    def _write(self, name: str, time_ns: int, data: bytes) -> None:
        if self._writer:
            self._writer.write(self._index[name], time_ns, data)

    def _emit(self, name: str, time_ns: int, data: bytes) -> None:
        counts = self.result.counts
        counts[name] = counts.get(name, 0) + 1
        self._write(name, time_ns, data)
        if self._comparison and name in self._compared:
            self._comparison.take(1, name, unpacked(data, KINDS[name]), time_ns)

    def run(self, progress: Progress) -> None:
        """Replay all messages that can be read."""
        result, (begin_ns, end_ns) = self.result, self.bag.span
        result.seconds, begun, count = 1e-9 * (end_ns - begin_ns), time.perf_counter(), 0
        for bag, name, row in self._rows():
            if bag is self._reference and name in self._compared and self._comparison:
                self._comparison.take(0, name, bag.unpacked(row), row.received_ns)
            if bag is self.bag and name not in self._made:
                count += 1
                self._write(name, row.received_ns, row.message)
                self.cores.take(name, row)
                if not count % 1000:
                    gone = 1e-9 * (row.received_ns - begin_ns)
                    progress.show(gone, 'replay', f'{gone:.0f} of {result.seconds:.0f} s')
        self.cores.finish()
        result.elapsed = time.perf_counter() - begun
        result.faults += self.cores.faults
        if not count:
            result.faults.append(f'bag {result.bag}: holds no message of these topics')
        self._judge()

    def _rows(self) -> Iterator[tuple[Bag, str, Recorded]]:
        """Yield the messages to replay and to compare with, in the order of reception."""
        wanted = {self.bag: self._topics.name.keys() - {
            topic for topic, name in self._topics.name.items() if name in self._made}}
        wanted[self._reference] = wanted.get(self._reference, set()) | {
            topic for topic in self._reference.topics
            if self._topics.name.get(topic) in self._compared}
        return merge(*(self._readable(*it) for it in wanted.items()),
                     key=lambda it: it[2].received_ns)

    def _readable(self, bag: Bag, wanted: Collection[str]) -> Iterator[tuple[Bag, str, Recorded]]:
        """Yield the readable messages of a bag; if there are unreadable ones, record a fault."""
        try:
            for row in bag.messages(wanted, raw=True):
                yield bag, self._topics.name[row.topic], row
        except ConfigurationError as error:
            self.result.faults.append(str(error))

    def _judge(self) -> None:
        result, lost = self.result, self.cores.inputs.lost
        result.notes += [f'{count} of {name} that the servo used were not recorded'
                         for name, count in lost.items()]
        if self.cores.servo is not None and self.cores.servo.lost_calls:
            result.notes.append(f'{self.cores.servo.lost_calls} calls were not recorded')
        if self._comparison:
            self._comparison.finish()
            result.equal, result.table = self._comparison.equal, self._comparison.table()


def replay_one(path: str | Path, options: Options, quiet: bool = False) -> Result:
    """Replay a recording; ConfigurationError if nothing of it can be replayed."""
    with ExitStack() as stack:
        replay = Replay(path, options, stack)
        begin, end = replay.bag.span
        with Progress(1e-9 * (end - begin) or 1.0, 1e9 if quiet else QUIET) as progress, \
                np.errstate(all='ignore'):
            replay.run(progress)
    result = replay.result
    if options.out:
        if options.parquet:
            _to_parquet(options.out)
        (options.out / RESULT).write_text(json.dumps(
            {**asdict(result), 'status': result.status}, indent=1, default=str))
    return result


def replay_and_tell(path: str | Path, options: Options) -> int:
    """Replay a recording, print the result on the terminal and return the exit status."""
    compile_kernels()
    result = replay_one(path, options)
    print(describe(result), file=sys.stderr)
    return result.status


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

