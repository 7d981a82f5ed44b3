"""Executables that end quietly when they are interrupted, even while they are still imported."""
from collections.abc import Callable
import importlib
import os
import signal
import sys
from typing import Any

_SIGNALS = (signal.SIGINT, signal.SIGTERM)
INTERRUPTED = 'INTERRUPTED_STATUS'  # environment: exit status in place of the executable's own


def executable(module: str, interrupted: int = 130) -> Callable[[], None]:
    """
    Return the entry point that imports a module and calls its `main`.

    SIGINT and SIGTERM end it with the status `interrupted`, without a traceback: at once during
    the imports, which take seconds on a loaded machine, and as a KeyboardInterrupt in `main`,
    unless that takes the signals itself.

    Parameters
    ----------
    module : str
        Must be imported by nothing that the module of the entry point imports.
    interrupted : int
        0 for nodes, which are ended so. The environment variable INTERRUPTED_STATUS, which the
        launch file sets, goes before: to launch, every other status is a process that has died.
    """
    def entry() -> None:
        status = int(os.environ.get(INTERRUPTED, interrupted))
        _handle(lambda *_: os._exit(status))
        # The launch file starts its processes with SIGINT blocked: before this it would kill.
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _SIGNALS)
        main, ended = importlib.import_module(module).main, None
        try:
            _handle(_interrupt)
            ended = main() or 0
            _handle(_pass_over)
        except KeyboardInterrupt:
            if ended is None:
                if status:
                    print(f'{module.rpartition(".")[2]}: interrupted', file=sys.stderr)
                ended = status
        # To take the heap apart, with all that numba keeps there, lasts seconds on a loaded
        # machine, and is of no use.
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(ended)
    return entry


def _interrupt(*_: Any) -> None:
    _handle(_pass_over)  # one is enough; a second would interrupt the cleaning up
    raise KeyboardInterrupt


def _pass_over(*_: Any) -> None:
    """Take a signal; where one comes as SIG_IGN is set, Python would write a line about it."""


def _handle(handler: Callable[..., Any]) -> None:
    for number in _SIGNALS:
        signal.signal(number, handler)
