"""The command `record_bag`: what it writes is complete and read back, and why it has ended."""
from contextlib import suppress
import signal
import subprocess
import sys
import time

import pytest

from edge_tracking import record_bag
from edge_tracking.recording.settings import Settings
from edge_tracking.recording.writer import BagWriter
from tactile_common.errors import ConfigurationError
from tactile_common.ros.bag_reader import Bag


def recorded(path):
    """Parameters by node, as far as they are in a bag that is being written."""
    with suppress(ConfigurationError, OSError), Bag(path) as bag:
        return Settings.of(bag, '/left/parameters').recorded
    return {}


@pytest.mark.graph
def test_an_interrupt_ends_a_bag_that_says_how_it_was_made(tmp_path):
    path = tmp_path / 'bag'
    command = [sys.executable, '-c', 'from edge_tracking.record_bag import main; exit(main())',
               str(path), '--namespace', '/left/']
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        end = time.monotonic() + 60.0
        while 'recorder' not in recorded(path) and time.monotonic() < end:
            time.sleep(0.1)  # another process: the file is all that tells
        process.send_signal(signal.SIGINT)
        told = process.communicate(timeout=30.0)[1]
    assert process.returncode in (0, 130), told
    known = recorded(path)['recorder']
    with Bag(path) as bag:
        assert '/left/servo_calls' in bag.topics and '/joint_states' in bag.topics
    assert '--namespace' in known['command'] and 'numpy' in known['versions']
    assert record_bag.main([str(path)]) == 2  # nothing is overwritten


@pytest.mark.graph
def test_a_full_disk_is_the_last_line(tmp_path, monkeypatch, capfd):
    def write(*_):
        raise OSError(28, 'No space left on device')
    monkeypatch.setattr(BagWriter, 'write', write)
    assert record_bag.main([str(tmp_path / 'bag')]) == 1
    assert capfd.readouterr().err.splitlines()[-1] == (
        'record_bag: recording ended early: No space left on device')
