"""Progress on a terminal and in a log."""
import fcntl
import io
import math
import os
import re
import struct
import subprocess
import sys
import termios

from tactile_common.progress import Progress


class Terminal(io.StringIO):
    """Text that says that it is a terminal."""

    def isatty(self):
        return True


def test_a_log_gets_nothing_nor_does_a_terminal_of_what_is_short():
    for stream, delay in ((io.StringIO(), 0.0), (Terminal(), 60.0)):
        with Progress(4.0, delay=delay, stream=stream) as bar:
            bar.show(1.0, 'track', '10 mm')
        assert stream.getvalue() == ''


def test_a_terminal_gets_one_line():
    terminal = Terminal()
    with Progress(2.0, 0.0, terminal) as bar:
        bar.show(1.0, 'fit')
        bar.show(math.nan, 'hold')  # moves nothing
    assert terminal.getvalue().count('\n') == 1 and terminal.getvalue().endswith('\n')
    assert ' 50 %' in terminal.getvalue().split('\r')[-1] and 'nan' not in terminal.getvalue()


PROGRAM = """
import subprocess, sys
from tactile_common.progress import live_progress
with live_progress(4.0) as bar:
    for done in range(4):
        bar.show(float(done), 'track')
        bar.refresh()
        subprocess.run(['sh', '-c', 'echo a log line >&2'])
print('after', file=sys.stderr)
"""


def test_lines_of_other_processes_are_not_cut_into():
    ours, theirs = os.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack('4H', 24, 100, 0, 0))
    with subprocess.Popen([sys.executable, '-c', PROGRAM], stderr=theirs) as program:
        os.close(theirs)
        shown = b''
        try:
            while data := os.read(ours, 4096):
                shown += data
        except OSError:  # what a terminal whose other end is closed gives
            pass
    os.close(ours)
    assert program.returncode == 0
    text = shown.decode()
    assert re.split('[\r\n]+', text).count('a log line') == 4, text
    assert ' 75 %' in text and text.endswith('\nafter\r\n')
