"""Arguments of the launch file: described, and refused in one clear line where they are wrong."""

import os
from pathlib import Path
import re
import subprocess
import sys

import pytest

WHY = 'launch_pytest is not installed: it comes with ROS 2, not as a wheel'
pytest.importorskip('launch_pytest', reason=WHY)
pytest.importorskip('launch_ros', reason=WHY)

# Only where launch is installed.
from launch.actions import DeclareLaunchArgument  # noqa: E402, I100, I202
from launch.launch_description_sources import (  # noqa: E402, I100, I202
    get_launch_description_from_python_launch_file,
)
from tactile_tests import launching  # noqa: E402, I100, I202
from tactile_tests.graph import bench  # noqa: E402, I100

NAMED = {'sensor', 'port', 'calibration', 'scene', 'law', 'speed', 'force', 'robot_description',
         'controller', 'use_sim_time', 'use_rviz', 'use_respawn', 'log_level', 'params_file',
         'namespace', 'robot_namespace', 'topic', 'options', 'view'}


def launch(*arguments, **environment):
    """Run the launch service as a process of its own; returns exit status and lines."""
    done = subprocess.run(
        [sys.executable, launching.__file__, *arguments], stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, text=True, timeout=launching.DEADLINE, check=False,
        env={**os.environ, 'RCUTILS_COLORIZED_OUTPUT': '0', **environment})
    return done.returncode, done.stdout.splitlines()


def test_every_argument_has_a_description_and_a_default():
    description = get_launch_description_from_python_launch_file(str(launching.LAUNCH_FILE))
    declared = [entity for entity in description.entities
                if isinstance(entity, DeclareLaunchArgument)]
    assert {argument.name for argument in declared} >= NAMED
    for argument in declared:
        assert argument.description and argument.description != 'no description given'
        assert argument.default_value is not None


def test_the_lines_of_the_pages_have_arguments_that_there_are():
    root = Path(__file__).resolve().parents[1]
    text = '\n'.join(page.read_text('utf-8') for page in (
        root / 'README.md', *sorted((root / 'docs').glob('*.md'))))
    lines = re.findall(r'ros2 launch edge_tracking edge_tracking\S+((?:\s+\w+:=\S+)*)', text)
    named = {name for line in lines for name in re.findall(r'(\w+):=', line)}
    assert len(lines) > 5 and named <= NAMED | {'start'}
    # A goal needs a servo that has none yet.
    goal = text.index('ros2 action send_goal')
    assert 'start:=false' in text[text.rindex('edge_tracking.launch.py', 0, goal):goal]


@pytest.mark.parametrize('argument, text', [
    ('scene:=nowhere', "scene 'nowhere' is unknown; shipped are course, curve, "),
    ('scene:=nowhere.yaml', 'scene nowhere.yaml: cannot be read: No such file'),
    ('scene:=strait', "scene 'strait' is unknown; did you mean straight? shipped are"),
    ('pattern:=raster', 'pattern:=raster does not apply to an edge'),
    ('use_rviz:=true', 'use_rviz:=true needs rviz2: apt install ros-$ROS_DISTRO-rviz2'),
    ('sensor:=flexitac', 'sensor:=flexitac needs its port, for instance port:=/dev/ttyUSB0'),
    ('speed:=fast', 'speed:=fast is not a number'),
    ('speed:=50', 'speed is 50.0, must be between 0.0001 and 0.2 m/s; did you mean 0.05?'),
    ('force:=nan', 'force is nan, must be between 0.6 and 8 N'),
    ('length:=-1', 'length is -1.0, must be finite and at least 0 m'),
    ('length:=inf', 'length is inf, must be finite and at least 0 m'),
    ('sensor:=other', "Valid options are: ['mock', 'flexitac', 'csv_lines', 'vitac', "),
    ('sensor:=topic', 'sensor:=topic needs its topic, for instance topic:=/my_sensor/image'),
    ('law:=tactile_jacobian', "law: 'tactile_jacobian' works on goals of track_surface; what is "
     'to be touched here asks for track_edge'),
    ('params_file:=nowhere.yaml', 'parameter file nowhere.yaml: cannot be read: No such'),
    ('robot_description:=<robot', 'robot description: malformed XML'),
    ('calibration:=nowhere.yaml', 'calibration nowhere.yaml: cannot be read: No such'),
])
def test_wrong_argument_ends_the_launch_with_a_clear_line(argument, text, tmp_path):
    status, lines = launch(argument, TMPDIR=str(tmp_path))
    assert status == 1
    assert not list(tmp_path.glob('tactile_*'))
    errors = [line for line in lines if '[ERROR]' in line]
    assert text in errors[-1]
    assert not any('Traceback' in line for line in lines)
    assert not any('process started' in line for line in lines)


def test_a_launch_service_tracks_without_the_ros2_command_and_without_a_red_line(tmp_path):
    beside = tmp_path / 'mine.yaml'
    beside.write_text('kept')
    with launching.launched('shutdown:=true', 'length:=0.01', 'namespace:=elsewhere',
                            f'port:={tmp_path}/mine', TMPDIR=str(tmp_path)) as it, \
            bench(namespace='elsewhere') as graph:
        graph.attend(lambda: it.status is not None, 'the end', launching.DEADLINE)
        assert it.end() == 0
        lines = it.lines
    assert not list(tmp_path.glob('tactile_*')) and not (tmp_path / 'mine').is_symlink()
    assert beside.read_text() == 'kept'
    assert any('track: length reached' in line for line in lines), '\n'.join(lines)
    # A window that a loaded machine delivers late is rejected, rightly.
    red = [line for line in lines if '[ERROR]' in line or 'Traceback' in line]
    assert [line for line in red if 'trajectory rejected' not in line] == []
    early = r'WARN.*(is not there|not tared|had no sensor_pose)'
    assert not [line for line in lines if re.search(early, line)]
    started = sum('process started' in line for line in lines)
    assert sum('process has finished cleanly' in line for line in lines) == started == 7
