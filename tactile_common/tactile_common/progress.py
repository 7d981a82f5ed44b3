"""Progress display: one line on a terminal, nothing in a log."""
from collections.abc import Iterator
from contextlib import contextmanager
import math
import os
import sys
import threading
from typing import TextIO

from tqdm import tqdm

QUIET = 1.0  # s before a progress bar appears


class Progress(tqdm):
    """
    Progress bar of a total in any unit, on a terminal; use as a context manager.

    It shows nothing for tasks shorter than the delay [s]. The default stream is sys.stderr.
    """

    monitor_interval = 0  # no monitor thread

    def __init__(self, total: float, delay: float = QUIET, stream: TextIO | None = None):
        super().__init__(
            total=total, file=stream or sys.stderr, disable=None, delay=delay, miniters=0,
            dynamic_ncols=True,
            bar_format='{desc:9} |{bar:30}| {percentage:3.0f} % {elapsed}<{remaining}{postfix}')

    def show(self, done: float, state: str, text: str = '') -> None:
        """Show the amount done, the state and a text; an amount of NaN does not move the bar."""
        self.set_description_str(state, refresh=False)
        self.set_postfix_str(text, refresh=False)
        if math.isfinite(done):
            # At the very start the remaining time cannot be estimated.
            self.n = min(done, self.total) if done > 1e-3 * self.total else 0.0
        self.update(0)


@contextmanager
def live_progress(total: float) -> Iterator[Progress]:
    """
    Show progress while this process and its child processes log to standard error.

    On a terminal the log lines are written above the bar, so that they do not break it.
    """
    if not sys.stderr.isatty():
        with Progress(total, 0.0) as progress:
            yield progress
        return
    sys.stderr.flush()
    reading, writing = os.pipe()
    with os.fdopen(os.dup(2), 'w') as terminal, Progress(total, 0.0, terminal) as progress:
        def relay() -> None:
            with os.fdopen(reading, errors='replace') as lines:
                for line in lines:
                    progress.write(line, file=terminal, end='')

        os.dup2(writing, 2)
        os.close(writing)
        relaying = threading.Thread(target=relay, daemon=True)
        relaying.start()
        try:
            yield progress
        finally:
            sys.stderr.flush()
            os.dup2(terminal.fileno(), 2)
            relaying.join(1.0)  # do not wait longer for a child process that still runs
