"""One line of progress on a terminal."""

import time

_WIDTH = 30
_PERIOD = 0.1  # s between lines on a terminal
_QUIET_PERIOD = 2.0  # s where the output is no terminal: a log


class Progress:
    """
    Progress bar that rewrites its line on a terminal, and prints now and then elsewhere.

    Parameters
    ----------
    stream : file
        Where to, usually sys.stderr.
    delay : float, optional
        Nothing is shown of what takes less than this [s].
    """

    def __init__(self, stream, delay=0.0):
        self._stream = stream
        self._begin = time.monotonic() + delay
        self._terminal = stream.isatty()
        self._shown = -float('inf')
        self._drawn = False

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self._terminal and self._drawn:
            self._stream.write('\n')

    def show(self, fraction, state, text):
        """Show the fraction done (0 to 1), the state and a text."""
        now = time.monotonic()
        if now < self._begin or now - self._shown < (_PERIOD if self._terminal else _QUIET_PERIOD):
            return
        self._shown, self._drawn = now, True
        done = round(_WIDTH * fraction)
        line = f'{state:9} [{"#" * done}{"." * (_WIDTH - done)}] {text}'
        self._stream.write(f'\r\x1b[2K{line}' if self._terminal else f'{line}\n')
        self._stream.flush()
