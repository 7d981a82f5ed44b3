"""Progress on a terminal and in a log."""
import io
import math

from tactile_common.progress import Progress


class Terminal(io.StringIO):
    """Text that says that it is a terminal."""

    def isatty(self):
        return True


def test_a_log_gets_nothing():
    log = io.StringIO()
    with Progress(4.0, stream=log) as bar:
        bar.show(1.0, 'track', '10 mm')
    assert log.getvalue() == ''


def test_a_terminal_gets_one_line():
    terminal = Terminal()
    with Progress(2.0, stream=terminal) as bar:
        bar.show(1.0, 'fit')
    assert terminal.getvalue().count('\n') == 1 and terminal.getvalue().endswith('\n')
    assert '50 %' in terminal.getvalue().split('\r')[-1]


def test_nothing_is_shown_of_what_is_short():
    stream = Terminal()
    with Progress(1.0, delay=60.0, stream=stream) as bar:
        bar.show(0.5, 'fit')
        bar.show(1.0, 'fit')
    assert stream.getvalue() == ''


def test_nan_moves_nothing():
    terminal = Terminal()
    with Progress(1.0, stream=terminal) as bar:
        bar.show(0.5, 'track')
        bar.show(math.nan, 'hold')
    assert ' 50 %' in terminal.getvalue().split('\r')[-1] and 'nan' not in terminal.getvalue()
