"""The launch file under test, and a launch service without the `ros2` command."""

from contextlib import contextmanager, suppress
import os
from pathlib import Path
import re
import signal
import subprocess
import sys
import threading
import time

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription, LaunchService
from launch.actions import IncludeLaunchDescription, RegisterEventHandler
from launch.event_handlers import OnProcessExit, OnProcessIO, OnProcessStart
from launch.launch_description_sources import PythonLaunchDescriptionSource

LAUNCH_FILE = Path(
    get_package_share_directory('edge_tracking'), 'launch', 'edge_tracking.launch.py')
NOTED = 'launch takes note of it'
DEADLINE = 90.0  # s, of a launch: several processes start on a loaded machine


def parameters(folder, **servo):
    """Write the shipped parameters, with some of the servo's added; returns the file's path."""
    shipped = Path(get_package_share_directory('edge_tracking'), 'config', 'edge_tracking.yaml')
    begin = '/**/edge_servo:\n  ros__parameters:\n'
    path = Path(folder, 'parameters.yaml')
    path.write_text(shipped.read_text('utf-8').replace(begin, begin + ''.join(
        f'    {name}: {value}\n' for name, value in servo.items())), 'utf-8')
    return str(path)


def edge_tracking(**arguments):
    """Return the action that includes the launch file with arguments."""
    return IncludeLaunchDescription(
        PythonLaunchDescriptionSource(str(LAUNCH_FILE)), launch_arguments=arguments.items())


class Processes:
    """What the processes of a launch wrote, and `exits`: their exit statuses by name."""

    def __init__(self):
        self.exits, self._text = {}, {}
        self._changed = threading.Condition()

    def handlers(self):
        return [RegisterEventHandler(OnProcessExit(on_exit=self._on_exit)),
                RegisterEventHandler(OnProcessIO(on_stdout=self._on_text,
                                                 on_stderr=self._on_text))]

    @staticmethod
    def _name(event):
        return event.process_name.rpartition('-')[0]

    def _on_exit(self, event, _):
        with self._changed:
            self.exits[self._name(event)] = event.returncode
            self._changed.notify_all()

    def _on_text(self, event):
        with self._changed:
            name = self._name(event)
            self._text[name] = self._text.get(name, '') + event.text.decode(errors='replace')
            self._changed.notify_all()

    def text(self, name):
        return self._text.get(name, '')

    def wait(self, condition, what):
        """Block until a condition of this object holds; AssertionError after the deadline."""
        with self._changed:
            done = self._changed.wait_for(condition, DEADLINE)
        assert done, f'{what} did not come; exits {self.exits}, output {self._text}'


class Launched:
    """A launch as a process group of its own, as under a terminal, and the lines it wrote."""

    def __init__(self, arguments, **environment):
        self.lines, self._changed = [], threading.Condition()
        self._process = subprocess.Popen(
            [sys.executable, __file__, *arguments], stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT, text=True, start_new_session=True,
            env={**os.environ, 'RCUTILS_COLORIZED_OUTPUT': '0', **environment})
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self):
        for line in self._process.stdout or ():
            with self._changed:
                self.lines.append(line.rstrip())
                self._changed.notify_all()

    @property
    def status(self):
        return self._process.poll()

    def found(self, text):
        return [line for line in self.lines if re.search(text, line)]

    def wait(self, text, times=1):
        """Block until a regular expression has been found in so many lines."""
        with self._changed:
            done = self._changed.wait_for(lambda: len(self.found(text)) >= times, DEADLINE)
        assert done, '\n'.join([f'{text!r} did not come:', *self.lines[-30:]])

    def pid(self, name):
        """Return the newest process id of a node by its name."""
        started = self.found(rf'\[{name}-\d+\]: process started')[-1]
        return int(re.findall(r'pid \[(\d+)\]', started)[0])

    def prepared(self, names):
        """
        Block until nodes can be interrupted.

        Launch loses the end of a process that it has not taken note of, which comes after the
        line that says that it has started; and SIGINT would kill the launch file's prefix.
        """
        end = time.monotonic() + DEADLINE
        for name in names:
            self.wait(rf'\[{name}-\d+\]: {NOTED}')
            command = Path(f'/proc/{self.pid(name)}/cmdline')
            while not re.match(rf'(?!env\0).*/{name}\0', command.read_text()):
                assert time.monotonic() < end, f'{name} does not start: {command.read_text()!r}'
                time.sleep(0.01)

    def interrupt(self):
        """Send what Ctrl-C in a terminal sends, to all processes."""
        os.killpg(self._process.pid, signal.SIGINT)

    def end(self):
        """Wait for the end; returns the exit status."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(DEADLINE)
        assert self.status is not None, '\n'.join(['launch does not end:', *self.lines[-30:]])
        self._reader.join(DEADLINE)
        return self.status


@contextmanager
def launched(*arguments, **environment):
    """Give a launch with arguments NAME:=VALUE; nothing of it is left afterwards."""
    it = Launched(arguments, **environment)
    try:
        yield it
    finally:
        if it.status is None:
            os.killpg(it._process.pid, signal.SIGKILL)
            it.end()


def main(arguments):
    """Launch the file with arguments NAME:=VALUE; returns the launch service's exit status."""
    # It is ignored where a script without job control runs the tests in its background.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    service = LaunchService(noninteractive=True)
    service.include_launch_description(LaunchDescription([
        RegisterEventHandler(OnProcessStart(on_start=lambda event, _: print(
            f'[{event.process_name}]: {NOTED}', flush=True))),
        edge_tracking(**dict(argument.split(':=', 1) for argument in arguments))]))
    return service.run()


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
