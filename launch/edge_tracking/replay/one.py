"""One recording replayed: what is read, written, compared."""
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
import csv
from dataclasses import asdict, dataclass, field
import json
from pathlib import Path
import time
from typing import Any, TextIO

import numpy as np
from rcl_interfaces.msg import ParameterEvent
from rclpy.parameter import Parameter

from edge_tracking.process_group import topics
from edge_tracking.recording.settings import Settings
from edge_tracking.recording.writer import BagWriter
from edge_tracking.replay.comparison import COMPARED, Comparison, TOLERANCE
from edge_tracking.replay.cores import Cores, Cycle
from edge_tracking.replay.names import Names
from tactile_common.errors import ConfigurationError
from tactile_common.progress import Progress
from tactile_common.ros.bag_reader import Bag, Recorded
from tactile_common.ros.cdr import packed, unpacked
from tactile_sensing.types.contact import REALS
from tactile_servo.compile_kernels import compile_kernels

QUIET = 1.0  # s without a progress bar
MOST_FAULTS = 10  # that are told
_ERRORS = ('lateral_error', 'longitudinal_error', 'angle_error', 'normal_force', 'force_target',
           'speed', 'progress', 'limit_scale', 'manipulability')
CYCLES = ('stamp_ns', 'steady', 'state', 'reason_code', *_ERRORS, 'window')
CONTACTS = ('stamp_ns', 'type', 'valid', 'force_valid', 'reasons', *REALS)
# Topics that stay as they were recorded.
INPUTS = ('image', 'sensor_info', 'joint_states', 'servo_calls', 'parameters')


@dataclass(frozen=True)
class Options:
    """What a replay is asked for."""

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
    """What a replay has found."""

    bag: str
    seconds: float = 0.0  # that the recording lasts
    elapsed: float = 0.0  # that it took [s]
    counts: dict[str, int] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)  # what is missing
    faults: list[str] = field(default_factory=list)  # why it cannot be read whole
    equal: bool | None = None
    table: str = ''

    @property
    def status(self) -> int:
        """Exit status: 0 equal, or not compared, 1 differs, 2 cannot be read whole."""
        return 2 if self.faults else int(self.equal is False)


class Table:
    """A CSV file."""

    def __init__(self, file: TextIO | None, columns: Sequence[str]):
        self._writer = csv.writer(file) if file else None
        if self._writer:
            self._writer.writerow(columns)

    def row(self, values: Sequence[Any]) -> None:
        """Write a row, if there is a file."""
        if self._writer:
            self._writer.writerow(values)


class Replay:
    """
    One replay, from a bag to another, tables and a comparison.

    ConfigurationError where nothing can be replayed, or an option is wrong.
    """

    def __init__(self, path: str | Path, options: Options, stack: ExitStack):
        self.result, self._options = Result(str(path)), options
        self.bag = stack.enter_context(Bag(path))
        self._names = Names(self.bag, options.namespace)
        settings = Settings.of(self.bag, self._names.topic.get('parameters', ''))
        settings.change(options.changes)
        has = self._names.topic
        from_images = options.source == 'image' and 'image' in has
        with_servo = settings.has_robot and 'servo_calls' in has
        if not with_servo:
            self.result.notes.append('without the calls and parameters of the servo in it: '
                                     'estimator and shape alone are replayed')
        if not settings.recorded:
            self.result.notes.append('without parameters in it: the defaults hold')
        if not from_images and 'contact' not in has:
            raise ConfigurationError(f'bag {path}: has no contact; replay it --from image')
        other = options.other and stack.enter_context(Bag(options.other))
        self._other = iter(other.messages([
            topic for topic in other.topics if self._names.of.get(topic) in COMPARED])) if (
            other) else None
        self._comparison = Comparison(options.tolerances) if (
            options.compare) else None
        made = {'contact', 'wrench'} if from_images else set()
        made |= {'surface_patch', 'contour', 'markers'}
        made |= {'sensor_pose', 'surface_contact', 'joint_trajectory',
                 'servo_status'} if with_servo else set()
        self._made = made
        self._kinds = {name.rpartition('/')[2]: kind for name, kind, _ in topics('')}
        self._open_out(stack)
        self.cores = Cores(self.bag, settings, self._emit, from_images, self._contact_row,
                           self._cycle_row, with_servo)
        for node, values in settings.changed.items():
            self._tell_change(node, values)

    def _open_out(self, stack: ExitStack) -> None:
        self._writer, folder = None, self._options.out
        files: list[TextIO | None] = [None, None]
        if folder is not None:
            try:
                folder.mkdir(parents=True)
            except OSError as error:
                raise ConfigurationError(f'-o {folder}: {error.strerror}') from error
            known = topics(self._names.prefix.strip('/'))
            self._index = {name.rpartition('/')[2]: index
                           for index, (name, _, _) in enumerate(known)}
            self._writer = BagWriter(folder / 'bag', known)
            stack.callback(self._writer.close)
            files = [stack.enter_context((folder / name).open('w', newline=''))
                     for name in ('contacts.csv', 'cycles.csv')]
        self._contacts, self._cycles = Table(files[0], CONTACTS), Table(files[1], CYCLES)

    def _tell_change(self, node: str, values: dict[str, Any]) -> None:
        """Have the recording that is written say what was changed."""
        self._write('parameters', self.bag.span[0], packed(ParameterEvent(
            node=f'{self._names.prefix}/{node}', changed_parameters=[
                Parameter(name, value=value).to_parameter_msg()
                for name, value in values.items()])))

    def _contact_row(self, stamp_ns: int, contact: Any) -> None:
        self._contacts.row((stamp_ns, int(contact.type), int(contact.valid),
                            int(contact.force_valid), int(contact.reasons),
                            *(getattr(contact, name) for name in REALS)))

    def _cycle_row(self, cycle: Cycle) -> None:
        status = cycle.status
        self._cycles.row((cycle.now_ns, cycle.now, status.state.name.lower(),
                          int(status.reason.code), *(getattr(status, it) for it in _ERRORS),
                          int(cycle.window is not None)))

    def _write(self, name: str, time_ns: int, data: bytes) -> None:
        if self._writer and name in self._index:
            self._writer.write(self._index[name], time_ns, data)

    def _emit(self, name: str, time_ns: int, data: bytes) -> None:
        counts = self.result.counts
        counts[name] = counts.get(name, 0) + 1
        self._write(name, time_ns, data)
        if self._comparison and name in COMPARED and name in self._names.topic:
            self._comparison.take(1, name, unpacked(data, self._kinds[name]), time_ns)

    def run(self, progress: Progress) -> None:
        """Replay everything that can be read."""
        result, (begin_ns, end_ns) = self.result, self.bag.span
        result.seconds, begun = 1e-9 * (end_ns - begin_ns), time.perf_counter()
        own = self._comparison and self._other is None
        wanted = [topic for topic, name in self._names.of.items() if topic in self.bag.topics
                  and (name not in self._made or own)]
        rows, count = self.bag.messages(wanted, raw=True), 0
        for row in self._readable(rows):
            name, count = self._names.of[row.topic], count + 1
            if name not in self._made:
                self._write(name, row.received_ns, row.message)
            elif self._comparison and own and name in COMPARED:
                self._comparison.take(0, name, self.bag.unpacked(row), row.received_ns)
            self._read_other(row.received_ns)
            self.cores.take(name, row)
            if not count % 1000:
                gone = 1e-9 * (row.received_ns - begin_ns)
                progress.show(gone, 'replay', f'{gone:.0f} of {result.seconds:.0f} s')
        self.cores.finish()
        self._read_other(1 << 62)
        result.elapsed = time.perf_counter() - begun
        result.faults += self.cores.faults
        if not count:
            result.faults.append(f'bag {result.bag}: holds no message of these topics')
        self._judge()

    def _readable(self, rows: Iterator[Recorded]) -> Iterator[Recorded]:
        """What can be read; why no more than that is a fault."""
        try:
            yield from rows
        except ConfigurationError as error:
            self.result.faults.append(str(error))

    def _read_other(self, until_ns: int) -> None:
        """Take what another recording holds until a time [ns]."""
        if self._other is None or self._comparison is None:
            return
        for row in self._readable(self._other):
            name = self._names.of[row.topic]
            if name in self._made and name in self._names.topic:
                self._comparison.take(0, name, row.message, row.received_ns)
            if row.received_ns >= until_ns:
                return

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
    """Replay a recording; ConfigurationError where nothing of it can be."""
    compile_kernels()
    with ExitStack() as stack:
        replay = Replay(path, options, stack)
        begin, end = replay.bag.span
        with Progress(1e-9 * (end - begin) or 1.0, 1e9 if quiet else QUIET) as progress, \
                np.errstate(all='ignore'):
            replay.run(progress)
    result = replay.result
    if options.out and options.parquet:
        _to_parquet(options.out)
    if options.out:
        (options.out / 'result.json').write_text(json.dumps(
            {**asdict(result), 'status': result.status}, indent=1, default=str))
    return result


def _to_parquet(folder: Path) -> None:
    """Write the tables of a folder as Parquet, too."""
    from pyarrow import csv as tables
    from pyarrow import parquet
    for path in folder.glob('*.csv'):
        parquet.write_table(tables.read_csv(path), path.with_suffix('.parquet'))


def describe(result: Result) -> str:
    """Text of a result for the terminal."""
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


__all__ = ['Options', 'Result', 'TOLERANCE', 'describe', 'replay_one']
