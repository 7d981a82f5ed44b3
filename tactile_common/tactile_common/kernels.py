"""
Cache folder for the kernels that numba compiles, named after the sources of all kernels.

Numba checks only the file of the compiled function, not the files of the functions that it
calls. A separate folder for every state of the sources keeps its cache valid. Like numba, it
counts a file that was written again as another one: in a folder with old and new versions of the
same function, calls fail. Every module with a kernel imports `njit` from here, so that the folder
is set before anything is compiled.

`compile_kernels`, also a command, fills that folder, so that the first start need not wait.
"""
from collections.abc import Iterator
from concurrent.futures import as_completed, ProcessPoolExecutor
from contextlib import suppress
from importlib import import_module
from importlib.util import find_spec
from multiprocessing import get_context
import os
from pathlib import Path
import re
import shutil
import signal
import sys
from tempfile import TemporaryDirectory
import time
from typing import Any
import zlib

from numba import config, njit
from numba.core import event
from numba.np.unsafe.ndarray import to_fixed_tuple

__all__ = ['FAST', 'njit', 'to_fixed_tuple']

PACKAGES = ('tactile_common', 'tactile_sensing', 'tactile_shape', 'tactile_servo',
            'tactile_simulation')
# Sources that match affect compiled code; `ws` contains the same pattern.
COMPILED = re.compile(rb'@njit|dtype\(|NamedTuple|IntEnum')
# Reassociation lets sums be vectorised; NaN and infinity keep their meaning.
FAST = {'reassoc', 'contract', 'nsz', 'arcp'}


class _Notice(event.Listener):
    """Prints once, on a terminal, that kernels are compiled; silent for cached kernels."""

    said = False

    def on_start(self, event: Any) -> None:
        package = event.data['dispatcher'].py_func.__module__.partition('.')[0]
        if not self.said and package in PACKAGES and sys.stderr.isatty():
            self.said = True
            print('compiling kernels, once: this takes up to a minute', file=sys.stderr)

    def on_end(self, event: Any) -> None:
        pass


_NOTICE = _Notice()
event.register('numba:compile', _NOTICE)


def cache_folder() -> Path:
    """
    Return the folder of the compiled kernels: in NUMBA_CACHE_DIR, else in the user's cache.

    Its name changes with every module of these packages that contains kernels, or the records,
    tuples and enumerations that kernels use. numba reads only from folders that it can write to:
    if this user cannot write to NUMBA_CACHE_DIR, because another user built the workspace, its
    kernels are copied to the user's cache.

    Raises
    ------
    PermissionError
        If the user can write to neither.
    """
    digest = 0
    for name in PACKAGES:
        spec = find_spec(name)
        for folder in (spec.submodule_search_locations or ()) if spec else ():
            for path in sorted(Path(folder).rglob('*.py')):
                source = path.read_bytes()
                if COMPILED.search(source):
                    digest = zlib.crc32(source, digest)
                    digest = zlib.crc32(b'%d' % path.stat().st_mtime_ns, digest)
    user = os.environ.get('XDG_CACHE_HOME') or '~/.cache'
    shared, own = (Path(root, 'tactile_kernels', f'{digest:08x}').expanduser()
                   for root in (os.environ.get('NUMBA_CACHE_DIR') or user, user))
    if _writable(shared):
        return shared
    if not _writable(own):
        raise PermissionError(f'no folder for compiled kernels: you cannot write to {own}; set '
                              'NUMBA_CACHE_DIR to a folder that you can write to')
    if not own.exists():
        _copy(shared, own)
    return own


def _writable(folder: Path) -> bool:
    """Return whether this user can write to a folder, or make it if it does not exist."""
    there = next(path for path in (folder, *folder.parents) if os.path.exists(path))
    return os.access(there, os.W_OK | os.X_OK)


def _copy(shared: Path, own: Path) -> None:
    """Copy compiled kernels, unless they cannot be read: then they are compiled again."""
    own.parent.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(dir=own.parent) as folder, suppress(OSError):
        # At once: another process may look for them, or make the same copy.
        shutil.copytree(shared, Path(folder, own.name)).rename(own)


def compile_kernels() -> Iterator[tuple[str, float]]:
    """
    Compile the kernels of every installed package anew; those compiled before are deleted.

    A package with kernels has a module `compile_kernels` with a function of that name, which calls
    each kernel once. Each package is compiled in a separate process. Yields the name of each
    package and its time [s].
    """
    folder = cache_folder()
    shutil.rmtree(folder.parent, ignore_errors=True)
    with ProcessPoolExecutor(mp_context=get_context('spawn'), initializer=signal.signal,
                             initargs=(signal.SIGINT, signal.SIG_IGN)) as pool:
        done = [pool.submit(_compile, package, str(folder)) for package in PACKAGES
                if find_spec(package) and find_spec(f'{package}.compile_kernels')]
        for one in as_completed(done):
            yield one.result()


def _compile(package: str, folder: str) -> tuple[str, float]:
    config.CACHE_DIR = folder  # in this new process no kernel is imported yet
    _NOTICE.said = True  # the command has printed it
    begin = time.perf_counter()
    import_module(f'{package}.compile_kernels').compile_kernels()
    return package, time.perf_counter() - begin


def main() -> int:
    """Compile all kernels and print one line for each package."""
    # Imported here, because every kernel imports this module.
    from tactile_common.command_line import Parser, refusing

    with refusing('compile_kernels') as command:
        Parser(prog='compile_kernels', description='Compiles every kernel of the installed '
               'packages; else they are compiled when they are first used.').parse_args()
        print(f'kernels go to {cache_folder()}', file=sys.stderr)
        for package, seconds in compile_kernels():
            print(f'{package}: {seconds:.1f} s', file=sys.stderr)
    return command.status


config.CACHE_DIR = str(cache_folder())

if __name__ == '__main__':
    sys.exit(main())
