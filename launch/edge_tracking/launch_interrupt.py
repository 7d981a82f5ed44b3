"""The end of a launch, which must not forget its processes."""
import asyncio
import shutil
import signal
import threading

# Before the command of every node. A Ctrl-C that comes before a process can take it, in its first
# tenths of a second, waits; and a node does not outlive its launch, however that ends.
PREFIX = 'env --block-signal=INT'
if shutil.which('setpriv'):
    PREFIX = f'setpriv --pdeathsig TERM {PREFIX}'


def leave_interrupt_to_launch() -> None:
    """
    Keep SIGINT from raising KeyboardInterrupt amid the work of launch.

    Launch hears of the signal by a descriptor and shuts down, but leaves Python's handler where
    it is. What that interrupts is given up: where it was the end of a process launch waits for
    that for ever, says that it does not terminate, and sends it SIGTERM and SIGKILL.
    """
    if (threading.current_thread() is threading.main_thread()
            and signal.getsignal(signal.SIGINT) is signal.default_int_handler):
        signal.signal(signal.SIGINT, _interrupt)


def _interrupt(number, frame):
    """Interrupt as usual, but not while an event loop runs in this thread."""
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        signal.default_int_handler(number, frame)
