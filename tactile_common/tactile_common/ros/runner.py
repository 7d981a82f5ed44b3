"""Start, spin and stop one node, or several in one process, with clean exits."""
from argparse import RawDescriptionHelpFormatter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
import faulthandler
import gc
import inspect
import math
import os
import re
import signal
import sys
import time
import traceback
from typing import Any

import rclpy
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.executors import Executor, ExternalShutdownException
from rclpy.logging import get_logger
from rclpy.signals import SignalHandlerOptions
from rclpy.subscription import RCLError
from rclpy.utilities import remove_ros_args

from tactile_common.command_line import Parser, REFUSED
from tactile_common.errors import ConfigurationError
from tactile_common.ros.node import TactileNode
from tactile_common.start import INTERRUPTED

try:  # the cheapest executor of this rclpy
    from rclpy.experimental import EventsExecutor as _Executor
except ImportError:
    from rclpy.executors import SingleThreadedExecutor as _Executor  # type: ignore[assignment]

# Longest time between checks of `until` and the signals [s].
_TICK = 0.05
# More errors of rcl than this in a row have a lasting cause.
_MOST_ERRORS = 100
_LAST_WORDS = 2.0  # s
_DELIVERY = 0.2  # s for the last messages to leave; they are lost if their writer is destroyed
_ENDING = 3.5  # s for a node to be destroyed; launch sends SIGTERM after 5 s, kills after 10


def split_ros_args(args: list[str]) -> tuple[list[str], list[str]]:
    """Split a command line into the program's arguments and the node's: from --ros-args on."""
    ros = args.index('--ros-args') if '--ros-args' in args else len(args)
    return args[:ros], args[ros:] or ['--ros-args']


def make_executor(context: rclpy.Context) -> Executor:
    """Return an executor for the nodes of a context, for `spin`."""
    return _Executor(context=context)


def spin(executor: Executor, context: rclpy.Context, until: Callable[[], bool],
         seconds: float = math.inf) -> None:
    """
    Process callbacks until the context is shut down, `until()` returns True or the time is over.

    This is a loop of `spin_once`: `EventsExecutor.spin` uses a whole core in some builds, and
    repeated short waits for a future starve its timers on a busy machine.

    `until()` is called after every callback and at least every 0.05 s. An error of rcl in a
    callback, such as an answer that cannot be sent, does not end the loop: the nodes count it (see
    `TactileNode`).
    """
    failed, end = 0, time.monotonic() + seconds
    while context.ok() and not until() and time.monotonic() < end:
        try:
            executor.spin_once(timeout_sec=_TICK)
            failed = 0
        except ExternalShutdownException:
            return
        except RCLError as error:
            failed += 1
            nodes = [node for node in executor.get_nodes() if isinstance(node, TactileNode)]
            if failed > _MOST_ERRORS or not nodes or not context.ok():
                raise
            for node in nodes:
                node.count_error(error)


def freeze_heap() -> None:
    """
    Exclude all present objects from later garbage collections, once a process is set up.

    A collection of all objects would delay a servo by 0.1 s (`benchmarks/latency/shortcuts.py`).
    So would the first log line, for which `inspect` lists all modules; it does so here.
    """
    inspect.getmodule(inspect.currentframe())
    gc.collect()
    gc.freeze()


class Stop:
    """Whether a signal asked to end; unlike an Event's lock, two signals cannot dead-lock it."""

    requested = False

    def is_set(self) -> bool:
        """Return True if the end was requested."""
        return self.requested

    def on_signal(self, *_: Any) -> None:
        """Request the end: a signal handler."""
        self.requested = True


@contextmanager
def stop_on_signals() -> Iterator[Stop]:
    """
    Yield a flag that SIGINT and SIGTERM set; the signals have no other effect.

    rclpy's own handlers shut the context down at once. Nodes could then neither publish a last
    message nor be destroyed in order. Use it with `SignalHandlerOptions.NO`, in the main thread.
    """
    stop = Stop()
    with _on_signals(stop.on_signal):
        yield stop


@contextmanager
def _on_signals(handler: Callable[..., Any]) -> Iterator[None]:
    previous = {number: signal.signal(number, handler)
                for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, before in previous.items():
            signal.signal(number, before)


def run(node_class: Any, args: list[str] | None = None,
        until: Callable[[Any], bool] | None = None,
        on_stop: Callable[[Any], None] | None = None,
        status_of: Callable[[Any], int] | None = None) -> int:
    """
    Run one node until SIGINT, SIGTERM or the shutdown of its context; return the exit status.

    `node_class` is called with `context` only. A `ValueError`, the base of every configuration
    error, means that a parameter is wrong. Without `args` those of the process are used; --help
    and --version are answered. `until(node)` returns True when the node's work is done.
    `on_stop(node)` is called at a signal; the node then has two seconds to finish.
    `status_of(node)` returns the exit status, once the node is destroyed; default 0. A signal that
    arrives while the node is being made (a minute if kernels are compiled) ends the process at
    once. If the node is not destroyed within 3.5 s after a signal, the process prints the stack of
    every thread and ends with status 1.
    """
    context = rclpy.Context()
    try:
        _read_options(node_class, args)
    except (ConfigurationError, RuntimeError) as error:
        return _refuse(node_class, error)
    with stop_on_signals() as stop:
        try:
            rclpy.init(args=args, context=context, signal_handler_options=SignalHandlerOptions.NO)
        except RuntimeError as error:  # a ROS argument or a parameter file that rcl cannot read
            return _refuse(node_class, error)
        try:
            with _on_signals(lambda *_: os._exit(int(os.environ.get(INTERRUPTED, 0)))):
                node = node_class(context=context)
        except (ValueError, NameValidationException, ParameterException) as error:
            # The context destroys the incomplete node, which may lack attributes that this needs.
            with suppress(AttributeError):
                context.try_shutdown()
            return _refuse(node_class, error)
        executor, stopped = make_executor(context), False
        try:
            executor.add_node(node)
            freeze_heap()
            spin(executor, context, lambda: stop.is_set() or bool(until and until(node)))
            stopped = stop.is_set()
            if stopped and on_stop and until:
                stop.requested = False  # a second signal ends it at once
                on_stop(node)
                spin(executor, context, lambda: until(node) or stop.is_set(), _LAST_WORDS)
                spin(executor, context, stop.is_set, _DELIVERY)
        finally:
            if stopped:  # by its own thread in C: rclpy may hold the interpreter's lock
                faulthandler.dump_traceback_later(_ENDING, exit=True)
            with _on_one_core():
                executor.shutdown()  # first: no message may reach a destroyed node
                node.destroy_node()
                context.try_shutdown()
            faulthandler.cancel_dump_traceback_later()
    return status_of(node) if status_of else 0


@contextmanager
def _on_one_core() -> Iterator[None]:
    """
    Restrict the threads of this process to one core.

    While Fast DDS destroys its participant, it waits for its callbacks, also for those caused by
    other nodes that leave at the same time. In builds for old systems, such as the wheels, this
    wait is a loop that takes the callbacks' lock again as soon as it releases it. On several cores
    this can last minutes. On one core, the thread that the release wakes runs first.
    """
    if not hasattr(os, 'sched_setaffinity'):
        yield
        return
    cores = os.sched_getaffinity(0)
    with open('/proc/self/stat', encoding='ascii', errors='replace') as file:
        here = int(file.read().rpartition(')')[2].split()[36])  # another may be busy
    _keep_to(cores & {here} or cores)
    try:
        yield
    finally:
        _keep_to(cores)


def _keep_to(cores: set[int]) -> None:
    for thread in os.listdir('/proc/self/task'):
        with suppress(OSError):  # it has ended
            os.sched_setaffinity(int(thread), cores)


def name_of(node_class: Any) -> str:
    """Return the name of a node's executable."""
    return re.sub('(?<!^)(?=[A-Z])', '_', node_class.__name__.removesuffix('Node')).lower()


def _read_options(node_class: type, args: list[str] | None) -> None:
    """Answer --help and --version; refuse all other options that are not ROS arguments."""
    about = inspect.getdoc(inspect.getmodule(node_class)) or ''
    Parser(prog=name_of(node_class), description=about,
           formatter_class=RawDescriptionHelpFormatter,
           usage='%(prog)s [--help] [--version] [--ros-args -p NAME:=VALUE '
                 '--params-file FILE.yaml -r FROM:=TO ...]',
           epilog='`ros2 run edge_tracking parameters` prints every parameter of every node.',
           ).parse_args(remove_ros_args(args)[1:] if args is None else remove_ros_args(args))


def _refuse(node_class: type, error: Exception) -> int:
    """Print in one line why a node cannot start; log level debug shows the traceback."""
    name = name_of(node_class)
    get_logger(name).debug(''.join(traceback.format_exception(error)))
    print(f'{name}: {" ".join(str(error).split())}', file=sys.stderr)
    return REFUSED
