"""Entry points that end quietly when interrupted, even while modules are being imported."""
from collections.abc import Callable
import importlib
import os
import signal
import sys
from typing import Any

_SIGNALS = (signal.SIGINT, signal.SIGTERM)
INTERRUPTED = 'INTERRUPTED_STATUS'  # environment variable with the exit status to use


def executable(module: str, interrupted: int = 130) -> Callable[[], None]:
    """
    Return the entry point that imports a module and calls its `main`.

    SIGINT and SIGTERM end it with status `interrupted` and without a traceback. During the
    imports, which take seconds on a loaded machine, it ends at once. In `main` the signal raises a
    KeyboardInterrupt, unless `main` handles signals itself.

    Parameters
    ----------
    module : str
        No module that the module of the entry point imports may import it.
    interrupted : int
        Exit status; 0 for nodes, because a signal is their normal end. The environment variable
        INTERRUPTED_STATUS, set by the launch file, overrides it: launch treats every other status
        as a process that died.
    """
    def entry() -> None:
        status = int(os.environ.get(INTERRUPTED, interrupted))
        name = module.rpartition('.')[2]
        _handle(lambda *_: os._exit(status))
        # The launch file blocks SIGINT: before the handler is set, the signal would kill.
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _SIGNALS)
        try:
            main, ended = importlib.import_module(module).main, None
        except PermissionError as error:  # this user may write to no folder for compiled kernels
            print(f'{name}: {error}', file=sys.stderr)
            sys.exit(2)
        try:
            _handle(_interrupt)
            ended = main() or 0
            _handle(_pass_over)
        except KeyboardInterrupt:
            if ended is None:
                if status:
                    print(f'{name}: interrupted', file=sys.stderr)
                ended = status
        # Skip the normal clean-up: to free numba's objects takes seconds on a loaded machine.
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(ended)
    return entry


def _interrupt(*_: Any) -> None:
    _handle(_pass_over)  # a second signal would interrupt the clean-up
    raise KeyboardInterrupt


def _pass_over(*_: Any) -> None:
    """Ignore a signal. SIG_IGN would let Python print a line about a pending signal."""


def _handle(handler: Callable[..., Any]) -> None:
    for number in _SIGNALS:
        signal.signal(number, handler)
