"""The command `replay`."""
import argparse
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, ProcessPoolExecutor
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
import json
import math
from multiprocessing import active_children, get_context
from pathlib import Path
from shutil import rmtree
import signal
import sys
from typing import Any

from edge_tracking.replay.comparison import TOLERANCES
from edge_tracking.replay.one import describe, made_of, Options, replay_one, RESULT
from tactile_common.command_line import between, Parser, REFUSED, refusing
from tactile_common.errors import ConfigurationError
from tactile_common.progress import Progress
from tactile_servo.compile_kernels import compile_kernels

METADATA = 'metadata.yaml'
FILES = (METADATA, '*.mcap', '*.db3', '*.mcap.zstd', '*.db3.zstd')  # of recordings


def parser() -> argparse.ArgumentParser:
    """Return the command-line parser."""
    arguments = Parser(
        prog='replay', formatter_class=argparse.RawDescriptionHelpFormatter,
        description='Run recordings through the cores of contact estimator, servo and shape '
        'estimator, without a graph\nand as fast as this machine can; the same bag gives the '
        'same bytes.',
        epilog='Exit status: 0 all was read, and equals what it is compared with; 1 it differs; '
        '2 it cannot be read\nwhole, or an option is wrong.')
    add = arguments.add_argument
    add('bags', nargs='+', metavar='BAG',
        help='folder, .mcap or .db3 file of a recording, or a folder of many')
    add('--from', dest='source', choices=('image', 'contact'), default='image',
        help='estimate contacts anew (default), or take the recorded ones')
    add('--set', dest='changes', action='append', default=[], metavar='NODE.PARAM=VALUE',
        help='another value of a parameter, for instance edge_servo.force.gain=30')
    add('-o', '--out', type=Path, metavar='OUT',
        help='new folder to write: bag, contacts.csv, cycles.csv, result.json')
    add('--parquet', action='store_true',
        help='write the tables of OUT as Parquet, too (pip install pyarrow)')
    add('--compare', nargs='?', const='', metavar='OTHER',
        help='compare with what was recorded, or with another bag')
    add('--tolerance', dest='tolerances', action='append', default=[], type=tolerance,
        metavar='[[TOPIC.]FIELD=]VALUE',
        help='that a field may differ by (default ' + ', '.join(
            f'{name}={value:g}' if name else f'{value:g}' for name, value in TOLERANCES.items())
        + ')')
    add('--namespace', help='of the sensor in a bag that has several; default: tactile')
    add('--jobs', type=between(1, 1000, kind=int), default=1, metavar='N',
        help='of many bags, replay as many at a time; those done before in OUT are skipped')
    add('--dask', default='', metavar='ADDRESS',
        help='of many bags, replay them on a cluster that sees the same files')
    return arguments


def tolerance(text: str) -> tuple[str, float]:
    """Return name, '' for all, and value of a tolerance."""
    name, _, number = text.rpartition('=')
    return name, between(0.0, math.inf)(number)


def options_of(given: argparse.Namespace) -> Options:
    """Convert the command line to options; ConfigurationError if one is wrong."""
    if given.parquet and not given.out:
        raise ConfigurationError('--parquet: needs -o, the folder of the tables')
    if given.parquet and find_spec('pyarrow') is None:
        raise ConfigurationError('--parquet: needs pyarrow: pip install pyarrow')
    if given.tolerances and given.compare is None:
        raise ConfigurationError('--tolerance: needs --compare')
    return Options(given.source, given.changes, given.out, given.compare,
                   dict(given.tolerances), given.namespace, given.parquet)


def bags_in(paths: Sequence[str], out: Path | None) -> list[Path]:
    """
    Find recordings: the given ones, and all inside folders that are not recordings.

    What is inside the folder of the results is not replayed again.
    """
    found: list[Path] = []
    for path in map(Path, paths):
        by_folder = defaultdict[Path, list[Path]](list)
        for pattern in FILES:
            for file in path.rglob(pattern):
                by_folder[file.parent].append(file)
        # A folder is one recording if it has metadata or, of a killed recorder, one .mcap file.
        inside = [bag for folder, files in sorted(by_folder.items()) for bag in (
            [folder] if (folder / METADATA).exists() or [it.suffix for it in files] == ['.mcap']
            else sorted(files))]
        if out and inside not in ([], [path]):
            inside = [bag for bag in inside if not bag.resolve().is_relative_to(out.resolve())]
            if not inside:
                raise ConfigurationError(
                    f'-o {out}: holds the recordings of {path}; name another folder')
        found += inside or [path]
    return found


def result_name(bag: Path) -> str:
    """Return the name of a recording's result: its path with + for /, of each path another."""
    path = str(bag.resolve())[1:]
    return path.replace('%', '%25').replace('+', '%2B').replace('/', '+')


def replay_apart(options: Options, bag: Path) -> tuple[int, str]:
    """Replay one of many recordings, unless this was done before; return status and a text."""
    try:
        if not options.out:
            return _replay(bag, options)
        folder = options.out / result_name(bag)
        done = (folder / RESULT).exists()
        if done:
            result = json.loads((folder / RESULT).read_text())
            if result.get('made_of') == made_of(bag, options):
                return result['status'], 'done before'
        part = folder.with_name(f'{folder.name}.part')  # may be left by an interrupted replay
        rmtree(part, ignore_errors=True)
        ended = _replay(bag, replace(options, out=part))
        if done:
            rmtree(folder)
        part.rename(folder)
        return ended
    except (ConfigurationError, OSError) as error:
        return REFUSED, ' '.join(str(error).split())
    except Exception as error:  # one failure does not stop the others
        return REFUSED, f'{type(error).__name__}: {error}'


def _replay(bag: Path, options: Options) -> tuple[int, str]:
    compile_kernels()
    result = replay_one(bag, options, quiet=True)
    lines = describe(result).splitlines()
    return result.status, lines[-1] if result.status else lines[0]


def mapped(jobs: int, dask: str, stack: ExitStack) -> Callable[..., Iterator[tuple[int, str]]]:
    """Return a function like `map`, by some processes or a cluster, which `stack` closes."""
    if dask:
        try:
            from distributed import Client
        except ImportError as error:
            raise ConfigurationError(
                '--dask: needs dask.distributed: pip install distributed') from error
        client = stack.enter_context(Client(dask))
        return lambda function, items: (future.result() for future in client.map(
            function, items, pure=False))
    if jobs == 1:
        return map
    pool = stack.enter_context(ProcessPoolExecutor(jobs, mp_context=get_context('spawn')))
    stack.push(_end_workers)

    def run(function: Callable[..., Any], items: Sequence[Any]) -> Iterator[tuple[int, str]]:
        interrupt = signal.signal(signal.SIGINT, signal.SIG_IGN)  # the workers inherit this
        try:
            return pool.map(function, items)
        finally:
            signal.signal(signal.SIGINT, interrupt)
    return run


def _end_workers(kind: type[BaseException] | None, *_: Any) -> None:
    """End the worker processes at once if the command ends by an exception."""
    for worker in active_children() if kind else ():
        worker.terminate()


def main(args: list[str] | None = None) -> int:
    """Run the command; the exit status is explained by `--help`."""
    with refusing('replay', BrokenExecutor) as command, ExitStack() as stack:
        given = parser().parse_args(args)
        options, bags = options_of(given), bags_in(given.bags, given.out)
        if bags == [Path(given.bags[0])] and not given.dask:
            compile_kernels()
            result = replay_one(bags[0], options)
            print(describe(result), file=sys.stderr)
            command.status = result.status
            return command.status
        run = mapped(given.jobs, given.dask, stack)
        progress = stack.enter_context(Progress(len(bags)))
        results = zip(bags, run(partial(replay_apart, options), bags), strict=True)
        for done, (bag, (status, text)) in enumerate(results, 1):
            print(f'{status}  {bag}  {text}')
            progress.show(done, 'replay', f'{done} of {len(bags)} bags')
            command.status = max(command.status, status)
    return command.status
