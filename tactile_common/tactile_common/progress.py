"""One line of progress on a terminal, a line now and then in a log."""
from collections.abc import Iterator
from contextlib import contextmanager
import math
import os
import sys
import threading
from typing import TextIO

from tqdm import tqdm

_QUIET_PERIOD = 2.0  # s between lines where the output is no terminal


class Progress(tqdm):
    """
    Progress bar of a total in any unit; use as a context manager.

    Nothing is shown of what takes less than the delay [s]. The stream is sys.stderr if missing.
    """

    monitor_interval = 0  # no thread beside

    def __init__(self, total: float, delay: float = 0.0, stream: TextIO | None = None):
        stream = stream or sys.stderr
        self._terminal, self._drawn = stream.isatty(), False
        super().__init__(
            total=total, file=stream, delay=delay, miniters=0, leave=self._terminal,
            mininterval=0.1 if self._terminal else _QUIET_PERIOD, dynamic_ncols=True,
            bar_format='{desc:9} |{bar:30}| {percentage:3.0f} % {elapsed}<{remaining}{postfix}')

    def show(self, done: float, state: str, text: str = '') -> None:
        """Show how much is done, the state and a text; what is NaN leaves the bar as it is."""
        self.set_description_str(state, refresh=False)
        self.set_postfix_str(text, refresh=False)
        if math.isfinite(done):
            # Of next to nothing no time can be told that is left.
            self.n = min(done, self.total) if done > 1e-3 * self.total else 0.0
        self.update(0)

    def display(self, msg: str | None = None, pos: int | None = None) -> bool:
        """Draw the bar, in a log as a line of its own."""
        self._drawn = True
        if self._terminal:
            return super().display(msg, pos)
        if msg != '':  # which would erase the line
            self.fp.write(f'{self if msg is None else msg}\n')
        return False

    def close(self) -> None:
        """Draw what there is at the end, if anything was drawn before."""
        if not self.disable and self._drawn and not self._terminal:
            self.display()
        super().close()


@contextmanager
def live_progress(total: float) -> Iterator[Progress]:
    """
    Progress of what logs to standard error, from this process or those that it starts meanwhile.

    On a terminal their lines are written above the bar, which they would cut into otherwise.
    """
    if not sys.stderr.isatty():
        with Progress(total) as progress:
            yield progress
        return
    sys.stderr.flush()
    reading, writing = os.pipe()
    with os.fdopen(os.dup(2), 'w') as terminal, Progress(total, stream=terminal) as progress:
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
            relaying.join(1.0)  # of a process that is still there no more is waited for
