"""Processors that never halt, as on hosts for real time (idle=poll, /dev/cpu_dma_latency)."""

from contextlib import contextmanager
import os
import subprocess
import sys

BUSY = """
import os
os.sched_setaffinity(0, {%d})
os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
while True:
    pass
"""


@contextmanager
def kept_awake():
    """
    Keep every processor busy with what gives way to any other program at once (SCHED_IDLE).

    A processor that has halted finds its caches cold, and that of a virtual machine the work of
    another guest in them.
    """
    busy = [subprocess.Popen([sys.executable, '-c', BUSY % core])
            for core in sorted(os.sched_getaffinity(0))]
    try:
        yield
    finally:
        for process in busy:
            process.kill()
            process.wait()
