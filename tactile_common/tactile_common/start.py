"""Executables that end quietly when they are interrupted, even while they are still imported."""
from collections.abc import Callable
import importlib
import os
import signal
import sys

_SIGNALS = (signal.SIGINT, signal.SIGTERM)
INTERRUPTED = 'INTERRUPTED_STATUS'  # environment: exit status in place of the executable's own


def executable(module: str, interrupted: int = 130) -> Callable[[], int]:
    """
    Return the entry point that imports a module and calls its `main`.

    SIGINT and SIGTERM end it with the status `interrupted`, without a traceback: at once during
    the imports, which take seconds on a loaded machine, and as a KeyboardInterrupt in `main`,
    unless that takes the signals itself. At the end they are ignored.

    Parameters
    ----------
    module : str
        Must be imported by nothing that the module of the entry point imports.
    interrupted : int
        0 for nodes, which are ended so. The environment variable INTERRUPTED_STATUS, which the
        launch file sets, goes before: to launch, every other status is a process that has died.
    """
    def entry() -> int:
        status = int(os.environ.get(INTERRUPTED, interrupted))
        _handle(lambda *_: os._exit(status))
        # The launch file starts its processes with SIGINT blocked: until here it would kill.
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _SIGNALS)
        main = importlib.import_module(module).main
        try:
            _handle(_interrupt)
            return main() or 0
        except KeyboardInterrupt:
            if status:
                print(f'{module.rpartition(".")[2]}: interrupted', file=sys.stderr)
            return status
        finally:
            _handle(signal.SIG_IGN)  # the interpreter would put the killing default back
    return entry


def _interrupt(*_):
    _handle(signal.SIG_IGN)  # one is enough; a second would interrupt the cleaning up
    raise KeyboardInterrupt


def _handle(handler):
    for number in _SIGNALS:
        signal.signal(number, handler)
