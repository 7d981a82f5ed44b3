"""Progress display: one line on a terminal, nothing in a log."""
import math
import sys
from typing import TextIO

from tqdm import tqdm


class Progress(tqdm):
    """
    Progress bar of a total in any unit, on a terminal; use as a context manager.

    It shows nothing for tasks shorter than the delay [s]. The default stream is sys.stderr.
    """

    monitor_interval = 0  # no monitor thread

    def __init__(self, total: float, delay: float = 0.0, stream: TextIO | None = None):
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
