"""Replay of one recording: input, comparison and result."""
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import asdict, dataclass, field, replace
from functools import cache, partial
from hashlib import sha256
from heapq import merge
from importlib.resources import files
import json
import math
from operator import attrgetter
from pathlib import Path
import time
from types import SimpleNamespace
from typing import Any

from geometry_msgs.msg import WrenchStamped
import numpy as np
from rcl_interfaces.msg import ParameterEvent
from rclpy.parameter import Parameter

from edge_tracking.parameters import SERVO
from edge_tracking.recording.settings import Settings
from edge_tracking.recording.topics import GraphBag, OF_SENSORS
from edge_tracking.replay.comparison import COMPARED, Comparison, Output
from edge_tracking.replay.servo_core import ServoCore
from tactile_common.command_line import version_of_all
from tactile_common.errors import ConfigurationError, TactileError
from tactile_common.kernels import PACKAGES
from tactile_common.progress import Progress, QUIET
from tactile_common.ros.bag_reader import Recorded
from tactile_common.ros.cdr import packed
from tactile_common.ros.conversions import NS, stamp_to_ns
from tactile_msgs.msg import Contact as ContactMsg
from tactile_sensing.contact.estimator import ContactEstimator, EstimatorConfig
from tactile_sensing.conversions import (
    contact_from_msg,
    contact_to_msg,
    contact_to_wrench,
    image_from_msg,
    sensor_info_from_msg,
)
from tactile_sensing.types.contact import Contact
from tactile_servo.conversions import joint_positions
from tactile_shape.local_surface.local_quadric import LocalQuadricConfig
from tactile_shape.nodes.shape_estimator import ShapeEstimatorConfig, ShapeTopics

MOST_FAULTS = 10  # faults that are printed
RESULT = 'result.json'  # written to the output folder at the end
# Topics that the replay computes, by the core that computes them.
OF_IMAGES = ('contact', 'wrench')
OF_SHAPE = ('surface_patch', 'contour', 'markers')
OF_SERVO = ('sensor_pose', 'surface_contact', 'joint_trajectory', 'servo_status')
# Topics that it reads, unless it makes them.
TAKEN = {'image', 'contact', 'sensor_info', 'joint_states', 'servo_calls', 'sensor_pose',
         'surface_contact'}
BEHIND = NS  # within this time a recorder has received all inputs that the servo used


@dataclass(frozen=True)
class Options:
    """Options of a replay."""

    source: str = 'image'  # or contact
    changes: Sequence[str] = ()  # NODE.PARAM=VALUE
    out: Path | None = None
    compare: str | None = None  # bag to compare with; '': itself
    tolerances: Mapping[str, float] = field(default_factory=dict)
    namespace: str | None = None
    parquet: bool = False  # tables as Parquet too


@cache
def digest_of_sources() -> str:
    """Return a digest of the installed sources; any change of the code changes it."""
    digest = sha256()
    for package in (*PACKAGES, 'edge_tracking'):
        for path in sorted(Path(str(files(package))).rglob('*.py')):
            digest.update(path.read_bytes())
    return digest.hexdigest()


def made_of(path: str | Path, options: Options) -> dict[str, Any]:
    """Return what a result depends on: options, version, sources, size and time of the files."""
    bags = [Path(path), *([Path(options.compare)] if options.compare else [])]
    inputs = {str(file.resolve()): (file.stat().st_size, file.stat().st_mtime_ns)
              for bag in bags for file in (bag, *bag.glob('*')) if file.is_file()}
    return json.loads(json.dumps(  # as it is read from a file
        {**asdict(replace(options, out=None)), 'version': version_of_all(),
         'sources': digest_of_sources(), 'files': inputs}))


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
    made_of: dict[str, Any] = field(default_factory=dict)

    @property
    def status(self) -> int:
        """Exit status: 0 equal or not compared, 1 differs, 2 cannot be read completely."""
        return 2 if self.faults else int(self.equal is False)


class Replay:
    """
    One replay: contact estimator, servo and shape estimator get the recorded messages in turn.

    Raises a ConfigurationError if nothing can be replayed, or an option is wrong.
    """

    def __init__(self, path: str | Path, options: Options, stack: ExitStack):
        self.result = Result(str(path), made_of=made_of(path, options))
        self.bag = stack.enter_context(GraphBag(path, options.namespace))
        self.bag.require_touch()
        settings, has = Settings(self.bag), self.bag.topic
        from_images = options.source == 'image' and 'image' in has
        with_servo = settings.has_robot and 'servo_calls' in has
        idle = {} if from_images else {'contact_estimator': 'the recorded contacts are taken'}
        if not with_servo:
            idle[SERVO] = 'the bag is without its calls or parameters'
            self.result.notes.append('without the calls and parameters of the servo in it: '
                                     'estimator and shape alone are replayed')
        if not settings.recorded:
            self.result.notes.append('without parameters in it: the defaults hold')
        if not from_images and 'contact' not in has:
            raise ConfigurationError(f'bag {path}: has no contact; replay it --from image')
        settings.change(options.changes, idle)
        self._made = {*OF_SHAPE, *(OF_IMAGES if from_images else ()),
                      *(OF_SERVO if with_servo else ())}
        self._reference = self._bag_to_compare(options.compare, stack)
        self._compares = options.compare is not None
        self._comparison = Comparison(
            options.tolerances,
            COMPARED.keys() & self._made & self._reference.topic.keys() if self._compares else (),
            self.result.faults)
        self.output = Output(self._comparison)
        self._make_cores(settings, with_servo)
        if options.out:  # the options are right, so the folder is not made in vain
            self.output.write_to(options.out, self.bag.prefix.strip('/'), stack)
        for node, values in settings.changed.items():  # also in the written recording
            self.output.copy('parameters', self.bag.span[0], packed(ParameterEvent(
                node=f'{self.bag.prefix}/{node}', changed_parameters=[
                    Parameter(name, value=value).to_parameter_msg()
                    for name, value in values.items()])))

    def _bag_to_compare(self, path: str | None, stack: ExitStack) -> GraphBag:
        """Open the bag to compare with: its sensor of the same namespace, or its only one."""
        if not path:
            return self.bag
        other = stack.enter_context(GraphBag(path, self.bag.prefix))
        if not other.topic.keys() & OF_SENSORS:
            other = stack.enter_context(GraphBag(path))
            self.result.notes.append(f'bag {path}: compared are messages of '
                                     f'{other.prefix or "/"}, here of {self.bag.prefix or "/"}')
        return other

    def _make_cores(self, settings: Settings, with_servo: bool) -> None:
        self._estimator = ContactEstimator(settings.config('contact_estimator', EstimatorConfig))
        self._shape = ShapeTopics(self._publisher, self.result.faults.append, *(
            settings.config('shape_estimator', kind)
            for kind in (ShapeEstimatorConfig, LocalQuadricConfig)))
        self._servo = ServoCore(settings, self._shape, self.output) if with_servo else None
        self._contact, self._wrench = ContactMsg(), WrenchStamped()
        self._now_ns = 0  # time of the message that is being processed
        self._later: deque[tuple[Recorded, Callable[[], None]]] = deque()

    def _publisher(self, _: Any, name: str, __: Any) -> Any:
        """Return a stand-in for a node's publisher."""
        return SimpleNamespace(
            publish=lambda message: self.output.message(name, self._now_ns, message))

    def run(self, progress: Progress) -> Result:
        """Replay all messages that can be read."""
        result, (begin_ns, end_ns) = self.result, self.bag.span
        result.seconds, begun, count = 1e-9 * (end_ns - begin_ns), time.perf_counter(), 0
        for row in self._rows():
            bag = self.bag if row.bag is self.bag else self._reference
            name = bag.name[row.topic]
            if row.bag is self._reference:
                self._comparison.take(name, row)
            if row.bag is self.bag and name not in self._made:
                count += 1
                self.output.copy(name, row.received_ns, row.data)
                self._do_waiting(row.received_ns - BEHIND)
                if name in TAKEN:
                    self._do(row, partial(self._take, name, row))
                if not count % 1000:
                    gone = 1e-9 * (row.received_ns - begin_ns)
                    progress.show(gone, 'replay', f'{gone:.0f} of {result.seconds:.0f} s')
        self._do_waiting(math.inf)
        result.elapsed, result.counts = time.perf_counter() - begun, dict(self.output.counts)
        if not count:
            result.faults.append(f'bag {result.bag}: holds no message of these topics')
        if self._servo:
            result.notes += self._servo.notes()
        if self._compares:
            lacking = COMPARED.keys() & result.counts.keys() - self._reference.topic.keys()
            if lacking:
                result.notes.append(f'bag {self._reference.path}: has no '
                                    f'{", ".join(sorted(lacking))}: not compared')
            result.equal, result.table = self._comparison.equal, self._comparison.table()
        return result

    def _do(self, row: Recorded, action: Callable[[], None]) -> None:
        """Process a message; one that cannot be used is a fault."""
        self._now_ns = row.received_ns
        try:
            with row.reading():
                action()
        except ConfigurationError as error:
            self.result.faults.append(str(error))

    def _do_later(self, row: Recorded, action: Callable[..., None], *arguments: Any) -> None:
        self._later.append((row, partial(action, *arguments)))

    def _do_waiting(self, before_ns: float) -> None:
        while self._later and self._later[0][0].received_ns < before_ns:
            self._do(*self._later.popleft())

    def _take(self, name: str, row: Recorded) -> None:
        message, servo, shape = row.message, self._servo, self._shape
        stamp_ns = stamp_to_ns(message.header.stamp)
        if name == 'image':
            self._take_image(row, message, stamp_ns)
        elif name == 'contact':
            self._use_contact(row, message, contact_from_msg(message))
        elif name == 'sensor_pose':
            self._do_later(row, shape.take_pose, message)
        elif name == 'surface_contact':
            self._do_later(row, shape.take_touch, message)
        elif servo and name == 'servo_calls':
            self._do_later(row, servo.repeat, message, row.received_ns)
        elif servo and name == 'sensor_info':
            servo.keep(name, stamp_ns, sensor_info_from_msg(message))
        elif servo and name == 'joint_states' and (
                positions := joint_positions(message, servo.joint_names)) is not None:
            servo.keep(name, stamp_ns, positions)

    def _take_image(self, row: Recorded, message: Any, stamp_ns: int) -> None:
        self._do_later(row, self._shape.take_image, bytes(row.data))
        image = None
        with suppress(TactileError):
            image = image_from_msg(message)
            if self._servo:
                self._servo.keep('image', stamp_ns, image)
        if 'contact' not in self._made:
            return
        contact = (self._estimator.refuse_malformed() if image is None
                   else self._estimator.estimate(image))
        self.output.message('contact', row.received_ns, contact_to_msg(
            contact, message, row.received_ns, self._contact))
        if contact.force_valid:
            self.output.message('wrench', row.received_ns, contact_to_wrench(
                contact, message, self._wrench))
        self._use_contact(row, message, contact)

    def _use_contact(self, row: Recorded, message: Any, contact: Contact) -> None:
        stamp_ns = stamp_to_ns(message.header.stamp)
        if self._servo:
            self._servo.keep('contact', stamp_ns, contact)
        self.output.contact(stamp_ns, contact)
        self._do_later(row, self._shape.take_contact, stamp_ns, contact, message.sensor)

    def _rows(self) -> Iterator[Recorded]:
        """Yield the messages to replay and to compare with, in the order of reception."""
        wanted: dict[GraphBag, set[str]] = {self.bag: {
            topic for topic, name in self.bag.name.items() if name not in self._made}}
        wanted[self._reference] = wanted.get(self._reference, set()) | {
            self._reference.topic[name] for name in self._comparison.compared}
        return merge(*(bag.readable(topics, self.result.faults.append)
                       for bag, topics in wanted.items()), key=attrgetter('received_ns'))


def replay_one(path: str | Path, options: Options, quiet: bool = False) -> Result:
    """Replay a recording; ConfigurationError if nothing of it can be replayed."""
    with ExitStack() as stack:
        replay = Replay(path, options, stack)
        begin, end = replay.bag.span
        with Progress(1e-9 * (end - begin) or 1.0, 1e9 if quiet else QUIET) as progress, \
                np.errstate(all='ignore'):
            result = replay.run(progress)
    if options.out and options.parquet:
        from pyarrow import csv as tables
        from pyarrow import parquet
        for file in options.out.glob('*.csv'):
            parquet.write_table(tables.read_csv(file), file.with_suffix('.parquet'))
    if options.out:
        (options.out / RESULT).write_text(json.dumps(
            {**asdict(result), 'status': result.status}, indent=1))
    return result


def describe(result: Result) -> str:
    """Return the text of a result for the terminal."""
    rate = result.seconds / max(result.elapsed, 1e-9)
    lines = [f'{result.bag}: {result.seconds:.1f} s in {result.elapsed:.1f} s, {rate:.1f} times '
             f'real time: {", ".join(f"{n} {name}" for name, n in sorted(result.counts.items()))}',
             *result.notes]
    if result.table:
        lines.append(result.table)
    more = len(result.faults) - MOST_FAULTS
    return '\n'.join([*lines, *result.faults[:MOST_FAULTS],
                      *([f'and {more} faults more'] if more > 0 else [])])
