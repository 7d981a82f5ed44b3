"""SIGINT as an event loop runs interrupts nothing of it; otherwise all is as usual."""
import asyncio
import os
import shutil
import signal
import subprocess
import sys
import time

import pytest

from edge_tracking.launch_interrupt import leave_interrupt_to_launch, PREFIX


@pytest.fixture
def handler():
    """Python's own handler, and the present one afterwards."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


async def interrupted():
    os.kill(os.getpid(), signal.SIGINT)
    return 'done'


def run(coroutine):
    loop = asyncio.new_event_loop()  # asyncio.run has a handler of its own
    try:
        return loop.run_until_complete(coroutine)
    finally:
        loop.close()


def test_what_a_loop_does_is_not_interrupted(handler):
    with pytest.raises(KeyboardInterrupt):
        run(interrupted())
    leave_interrupt_to_launch()
    assert run(interrupted()) == 'done'
    with pytest.raises(KeyboardInterrupt):  # no loop runs
        os.kill(os.getpid(), signal.SIGINT)


def test_the_handler_of_somebody_else_stays(handler):
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    leave_interrupt_to_launch()
    assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN


@pytest.mark.skipif(shutil.which('setpriv') is None, reason='setpriv is not installed')
def test_a_process_does_not_outlive_its_launch():
    """However that ends: the pipe ends with the last who has it."""
    launch = subprocess.Popen(
        [sys.executable, '-c', 'import subprocess, sys\n'
         'subprocess.run([*sys.argv[1].split(), "sh", "-c", "echo up; exec sleep 60"])', PREFIX],
        stdout=subprocess.PIPE, text=True)
    assert launch.stdout.readline() == 'up\n'
    launch.kill()
    begin = time.monotonic()
    assert launch.stdout.read() == ''
    launch.wait()
    assert time.monotonic() - begin < 30.0
