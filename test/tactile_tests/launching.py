"""The launch file under test, and a launch service without the `ros2` command."""

from pathlib import Path
import sys
import threading

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription, LaunchService
from launch.actions import IncludeLaunchDescription, RegisterEventHandler
from launch.event_handlers import OnProcessExit, OnProcessIO
from launch.launch_description_sources import PythonLaunchDescriptionSource

LAUNCH_FILE = Path(
    get_package_share_directory('edge_tracking'), 'launch', 'edge_tracking.launch.py')
DEADLINE = 90.0  # s, of a launch: several processes start on a loaded machine


def edge_tracking(**arguments):
    """Return the action that includes the launch file with arguments."""
    return IncludeLaunchDescription(
        PythonLaunchDescriptionSource(str(LAUNCH_FILE)), launch_arguments=arguments.items())


class Processes:
    """
    What the processes of a launch wrote and how they ended.

    Attributes
    ----------
    exits : dict
        Exit status by process name, without the number that launch appends.
    """

    def __init__(self):
        self.exits, self._text = {}, {}
        self._changed = threading.Condition()

    def handlers(self):
        """Return the actions that feed this object."""
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
        """Return what a process has written."""
        return self._text.get(name, '')

    def wait(self, condition, what):
        """Block until a condition of this object holds; AssertionError after the deadline."""
        with self._changed:
            done = self._changed.wait_for(condition, DEADLINE)
        assert done, f'{what} did not come; exits {self.exits}, output {self._text}'


def main(arguments):
    """Launch the file with arguments NAME:=VALUE; returns the launch service's exit status."""
    service = LaunchService(noninteractive=True)
    service.include_launch_description(LaunchDescription([
        edge_tracking(**dict(argument.split(':=', 1) for argument in arguments))]))
    return service.run()


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
