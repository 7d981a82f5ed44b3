"""Nodes outlive what rcl refuses to send, count it and say so; signals stop them quietly."""
import gc
import os
import signal
import subprocess
import sys
import time

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
import pytest
from rclpy.subscription import RCLError

from tactile_common.ros.node import TactileNode
from tactile_common.ros.runner import make_executor, run, spin

DEADLINE = 30.0  # s


class Refusing:
    """In place of rcl's publisher: refuses to publish, and is otherwise that one."""

    def __init__(self, real):
        self._real, self.refused, self.patience = real, 0, 5

    def __getattr__(self, name):
        return getattr(self._real, name)

    def __enter__(self):
        return self._real.__enter__()

    def __exit__(self, *arguments):
        return self._real.__exit__(*arguments)

    def publish(self, msg):
        if self.refused < self.patience:
            self.refused += 1
            raise RCLError('Failed to publish: cannot publish data')
        self._real.publish(msg)


@pytest.fixture
def bench(context):
    node = TactileNode('sender', context=context)
    executor = make_executor(context)
    executor.add_node(node)

    def wait(condition):
        end = time.monotonic() + DEADLINE
        spin(executor, context, lambda: condition() or time.monotonic() > end)
        assert condition()
    yield node, wait, context
    executor.shutdown()
    node.destroy_node()


def told(node):
    """Give the list that the statuses of a node go to."""
    statuses = []
    node.create_subscription(
        DiagnosticArray, '/diagnostics', lambda msg: statuses.extend(
            it for it in msg.status if it.name == '/sender: node'), 10)
    return statuses


def errors(status):
    return int(next(value.value for value in status.values if value.key == 'send_errors'))


def test_messages_that_cannot_be_sent_are_counted_and_told(bench):
    node, wait, _ = bench
    statuses = told(node)
    publisher = node.create_publisher(DiagnosticStatus, 'topic', 10)
    refusing = publisher._Publisher__publisher = Refusing(publisher.handle)
    for _ in range(7):
        publisher.publish(DiagnosticStatus())
    assert node.errors == refusing.refused == 5
    wait(lambda: statuses and errors(statuses[-1]) == 5)
    first = next(status for status in statuses if errors(status) == 5)
    assert first.level == DiagnosticStatus.WARN and 'could not be sent' in first.message
    wait(lambda: statuses[-1].level == DiagnosticStatus.OK)  # told once, counted for good
    assert errors(statuses[-1]) == 5


def test_an_error_of_rcl_in_a_callback_does_not_end_the_node(bench):
    node, wait, _ = bench
    calls = []

    def fail():
        calls.append(node.errors)
        raise RCLError('cannot send the response')

    node.create_timer(0.01, fail)
    wait(lambda: len(calls) > 5)
    assert calls[:3] == [0, 1, 2]


def test_other_errors_are_not_hidden(bench):
    node, wait, _ = bench
    node.create_timer(0.01, lambda: [][1])
    with pytest.raises(IndexError):
        wait(lambda: False)


def test_nothing_is_counted_once_the_context_is_down(bench):
    node, _, context = bench
    context.try_shutdown()
    with pytest.raises(RCLError, match='of the middleware'):
        node.count_error(RCLError('of the middleware'))
    assert node.errors == 0


PROGRAM = """
import sys
sys.path.insert(0, {folder!r})
from tactile_common.start import executable
executable('slow', {options})()
"""


def test_without_a_folder_for_kernels_an_executable_says_so_in_one_line(tmp_path):
    (tmp_path / 'slow.py').write_text('raise PermissionError("no folder for them")')
    done = subprocess.run([sys.executable, '-c', PROGRAM.format(folder=str(tmp_path), options='')],
                          capture_output=True, text=True, timeout=DEADLINE)
    assert (done.returncode, done.stderr) == (2, 'slow: no folder for them\n')


@pytest.mark.parametrize('module', [
    'import threading; print(1, flush=True); threading.Event().wait()',  # while imported
    'import threading\ndef main():\n  print(1, flush=True)\n  threading.Event().wait()',
    'from tactile_common.ros.node import TactileNode\n'
    'from tactile_common.ros.runner import run\n'
    'class Sleeper(TactileNode):\n'
    '  def __init__(self, **kwargs):\n'
    '    super().__init__("sleeper", **kwargs)\n'
    '    self.create_timer(0.1, lambda: print(1, flush=True))\n'
    'def main():\n  return run(Sleeper)'], ids=['import', 'main', 'node'])
@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_an_executable_ends_quietly_whenever_it_is_interrupted_and_twice(
        module, number, tmp_path):
    (tmp_path / 'slow.py').write_text(module)
    program = PROGRAM.format(folder=str(tmp_path), options='interrupted=0')
    process = subprocess.Popen([sys.executable, '-c', program], stdout=subprocess.PIPE,
                               stderr=subprocess.PIPE, text=True)
    assert process.stdout.readline() == '1\n'
    for _ in range(2):
        process.send_signal(number)
    _, error = process.communicate(timeout=DEADLINE)
    assert (process.returncode, error) == (0, '')


@pytest.mark.parametrize('wait', [
    'threading.Event().wait()',
    # A call that keeps the interpreter's lock, as those of rclpy do.
    'ctypes.PyDLL(None).sleep(60)'], ids=['lock', 'middleware'])
def test_a_node_that_cannot_be_destroyed_ends_and_says_what_it_waits_for(
        wait, tmp_path):
    (tmp_path / 'slow.py').write_text(
        'import ctypes, threading\n'
        'from tactile_common.ros.node import TactileNode\n'
        'from tactile_common.ros.runner import run\n'
        'class Stuck(TactileNode):\n'
        '  def __init__(self, **kwargs):\n'
        '    super().__init__("stuck", **kwargs)\n'
        '    self.create_timer(0.1, lambda: print(1, flush=True))\n'
        '  def destroy_node(self):\n'
        f'    {wait}\n'
        'def main():\n  return run(Stuck)')
    process = subprocess.Popen(
        [sys.executable, '-c', PROGRAM.format(folder=str(tmp_path), options='interrupted=0')],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout.readline() == '1\n'
    process.send_signal(signal.SIGINT)
    _, error = process.communicate(timeout=DEADLINE)
    assert process.returncode == 1
    assert error.startswith('Timeout (') and 'in destroy_node' in error


def test_a_signal_as_an_executable_ends_changes_nothing(tmp_path):
    (tmp_path / 'slow.py').write_text(
        'import os, signal\n'
        'def main():\n'
        '  real = signal.signal\n'
        '  def late(*arguments):\n'
        '    signal.signal = real\n'
        '    os.kill(os.getpid(), signal.SIGINT)\n'
        '    return real(*arguments)\n'
        '  signal.signal = late\n'  # the next change of a handler is at the end
        '  return 3')
    done = subprocess.run(
        [sys.executable, '-c', PROGRAM.format(folder=str(tmp_path), options='')],
        capture_output=True, text=True, check=False, timeout=DEADLINE)
    assert (done.returncode, done.stderr) == (3, '')


def test_interrupted_status_is_130_unless_the_environment_says_otherwise(tmp_path):
    (tmp_path / 'slow.py').write_text('def main():\n  raise KeyboardInterrupt')
    program = PROGRAM.format(folder=str(tmp_path), options='')
    for environment, status, text in (({}, 130, 'slow: interrupted\n'),
                                      ({'INTERRUPTED_STATUS': '0'}, 0, '')):
        done = subprocess.run([sys.executable, '-c', program], capture_output=True, text=True,
                              env={**os.environ, **environment}, check=False, timeout=DEADLINE)
        assert (done.returncode, done.stderr) == (status, text)


def test_what_a_node_has_made_is_out_of_all_garbage_collections_once_it_runs():
    class Rich(TactileNode):
        def __init__(self, **kwargs):
            super().__init__('rich', **kwargs)
            self.made = [[]]

    frozen = []

    def look(node):
        frozen.append(gc.get_freeze_count() > 0
                      and not any(one is node.made for one in gc.get_objects()))
        return True

    gc.unfreeze()
    try:
        assert run(Rich, [], look) == 0
    finally:
        gc.unfreeze()
    assert frozen == [True]
