"""Many recordings replayed side by side, each by a process of its own."""
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
import json
from pathlib import Path
from shutil import rmtree
import subprocess
import sys
from typing import Any, NamedTuple

from tactile_common.errors import ConfigurationError

RESULT = 'result.json'  # in the folder of each, once it is done


class Row(NamedTuple):
    """What became of a recording: its exit status, see the command, and that in words."""

    bag: str
    status: int
    text: str


def bags_in(paths: Sequence[str]) -> list[Path]:
    """Find recordings: those named, and all within folders that are none."""
    found: list[Path] = []
    for path in map(Path, paths):
        if not path.is_dir() or (path / 'metadata.yaml').exists():
            found.append(path)
            continue
        files = sorted({*path.rglob('*.mcap'), *path.rglob('*.db3')})
        # A folder of one file is its recording, with or without metadata.
        inside = [file.parent if (file.parent / 'metadata.yaml').exists() else file
                  for file in files]
        found += dict.fromkeys(inside) or [path]
    return found


def replay_many(bags: Sequence[Path], options: Sequence[str], out: Path | None, jobs: int,
                dask: str = '') -> Iterator[Row]:
    """Replay recordings with options of the command; a row of each, in their order."""
    folders = _folders(bags, out)
    with _pool(jobs, dask) as pool:
        rows = [pool.submit(_one, str(bag), list(options), str(folder or ''))
                for bag, folder in zip(bags, folders, strict=True)]
        for row in rows:
            yield row.result()


def _folders(bags: Sequence[Path], out: Path | None) -> list[Path | None]:
    if out is None:
        return [None] * len(bags)
    names = ['_'.join(bag.resolve().with_suffix('').parts[1:]) for bag in bags]
    return [out / name for name in names]


@contextmanager
def _pool(jobs: int, dask: str) -> Iterator[Any]:
    """Something with `submit`: threads that wait for processes here, or a cluster."""
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


def _one(bag: str, options: list[str], folder: str) -> Row:
    """Replay one in a process, unless that was done before."""
    done = Path(folder, RESULT)
    if folder and done.exists():
        found = json.loads(done.read_text())
        return Row(bag, found['status'], 'done before')
    part = Path(f'{folder}.part')  # of one that was interrupted there may be some
    if folder:
        rmtree(part, ignore_errors=True)
    ended = subprocess.run(
        [sys.executable, '-m', 'edge_tracking.replay.command', bag, *options,
         *(['-o', str(part)] if folder else [])], capture_output=True, text=True, check=False)
    if folder and (part / RESULT).exists():
        part.rename(folder)
    lines = [line for line in ended.stderr.splitlines() if not line.startswith('replay    |')]
    text = lines[0] if ended.returncode == 0 and lines else ' '.join(lines[-1:])
    return Row(bag, ended.returncode, text)
