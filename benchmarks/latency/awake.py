"""Keeps processors awake, as on real-time hosts (idle=poll, /dev/cpu_dma_latency)."""

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
    Keep every processor busy with processes that yield to any other program (SCHED_IDLE).

    After a halt a processor's caches are cold; on a virtual machine they may contain data of
    another guest.
    """
    busy = [subprocess.Popen([sys.executable, '-c', BUSY % core])
            for core in sorted(os.sched_getaffinity(0))]
    try:
        yield
    finally:
        for process in busy:
            process.kill()
            process.wait()
