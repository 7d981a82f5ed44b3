"""Interrupt handling of a launch, so that no process survives it."""
import asyncio
import shutil
import signal
import threading
from typing import Any

# Prefix of the command of every node. In its first tenths of a second a process cannot handle
# Ctrl-C, so the signal is held back. A node ends with its launch, however that ends.
PREFIX = 'env --block-signal=INT'
if shutil.which('setpriv'):
    PREFIX = f'setpriv --pdeathsig TERM {PREFIX}'


def leave_interrupt_to_launch() -> None:
    """
    Prevent SIGINT from raising KeyboardInterrupt within launch's own code.

    Launch receives the signal through a file descriptor and shuts down, but Python's handler
    remains installed and interrupts whatever runs. If it interrupts the handling of a process'
    end, launch waits for that process forever, reports that it does not terminate, and sends it
    SIGTERM and SIGKILL.
    """
    if (threading.current_thread() is threading.main_thread()
            and signal.getsignal(signal.SIGINT) is signal.default_int_handler):
        signal.signal(signal.SIGINT, _interrupt)


def _interrupt(number: int, frame: Any) -> None:
    """Interrupt as usual, but not while an event loop runs in this thread."""
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        signal.default_int_handler(number, frame)
