"""Replay of many recordings in parallel, each in a separate process."""
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, replace
import json
from pathlib import Path
from shutil import rmtree
import subprocess
import sys
from typing import Any, NamedTuple

from edge_tracking.replay.one import Options, replay_and_tell, RESULT
from tactile_common.command_line import refusing
from tactile_common.errors import ConfigurationError


class Row(NamedTuple):
    """Result of one recording: its exit status (see the command) and a text."""

    bag: str
    status: int
    text: str


def bags_in(paths: Sequence[str]) -> list[Path]:
    """Find recordings: the given ones, and all inside folders that are not recordings."""
    found: list[Path] = []
    for path in map(Path, paths):
        if not path.is_dir() or (path / 'metadata.yaml').exists():
            found.append(path)
            continue
        files = sorted({*path.rglob('*.mcap'), *path.rglob('*.db3')})
        # A folder with metadata is one recording; otherwise each file is one.
        inside = [file.parent if (file.parent / 'metadata.yaml').exists() else file
                  for file in files]
        found += dict.fromkeys(inside) or [path]
    return found


def replay_many(bags: Sequence[Path], options: Options, jobs: int, dask: str = ''
                ) -> Iterator[Row]:
    """Replay recordings, each into a separate folder in `out`; yield a row of each, in order."""
    with _pool(jobs, dask) as pool:
        rows = [pool.submit(_one, str(bag), options) for bag in bags]
        for row in rows:
            yield row.result()


@contextmanager
def _pool(jobs: int, dask: str) -> Iterator[Any]:
    """Yield an object with `submit`: threads that wait for local processes, or a cluster."""
    if not dask:
        with ThreadPoolExecutor(jobs) as pool:
            yield pool
        return
    try:
        from distributed import Client
    except ImportError as error:
        raise ConfigurationError('--dask: needs dask.distributed: pip install distributed') \
            from error
    with Client(dask) as client:
        yield client


def _one(bag: str, options: Options) -> Row:
    """Replay a recording in a process, unless this was done before."""
    folder = part = options.out and options.out / '_'.join(
        Path(bag).resolve().with_suffix('').parts[1:])
    if folder:
        if (folder / RESULT).exists():
            return Row(bag, json.loads((folder / RESULT).read_text())['status'], 'done before')
        part = folder.with_name(f'{folder.name}.part')  # may be left by an interrupted replay
        rmtree(part, ignore_errors=True)
    ended = subprocess.run(
        [sys.executable, '-m', __name__, bag, json.dumps(
            asdict(replace(options, out=part)), default=str)],
        capture_output=True, text=True, check=False)
    if folder and part and (part / RESULT).exists():
        part.rename(folder)
    lines = [line for line in ended.stderr.splitlines() if not line.startswith('replay    |')]
    text = lines[0] if ended.returncode == 0 and lines else ' '.join(lines[-1:])
    return Row(bag, ended.returncode, text)


def main() -> int:
    """Replay a bag with options as JSON, both from the command line."""
    bag, text = sys.argv[1:]
    options = Options(**json.loads(text))
    with refusing('replay') as command:
        command.status = replay_and_tell(bag, replace(
            options, out=Path(options.out) if options.out else None))
    return command.status


if __name__ == '__main__':
    sys.exit(main())
