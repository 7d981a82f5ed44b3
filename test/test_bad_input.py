"""Bad input to the executables: one clear line on standard error, an exit status above 0."""

from pathlib import Path
import subprocess
import threading

from ament_index_python.packages import get_package_prefix
import pytest

from edge_tracking.track import Exit

DEADLINE = 60.0  # s


def executable(package, name):
    return str(Path(get_package_prefix(package), 'lib', package, name))


def run(package, name, *arguments):
    """Run an executable to its end; returns exit status and the lines on standard error."""
    done = subprocess.run(
        [executable(package, name), *arguments], capture_output=True, text=True,
        timeout=DEADLINE, check=False)
    return done.returncode, done.stderr.splitlines()


def ros_arguments(**parameters):
    return ['--ros-args', *(part for name, value in parameters.items()
                            for part in ('-p', f'{name}:={value}'))]


@pytest.fixture
def files(tmp_path):
    """Give paths for a port and for files that cannot be used."""
    contents = {
        'bad.yaml': 'edge: [unclosed',
        'list.yaml': '- not\n- a scene\n',
        'bad.urdf': '<robot name="x"><link',
        'calibration.yaml': 'model: flexitac\nrows: 16\ncolumns: 16\npitch: 0.0015875\n'
                            'unit: Pa\ngain: 627.45\nbaseline: [[10, 10], [10, 10]]\n',
    }
    for name, text in contents.items():
        (tmp_path / name).write_text(text)
    return tmp_path


CASES = {
    'driver_without_port': (
        'tactile_sensing', 'driver', {}, "'port' is empty, must name a serial port"),
    'calibration_of_wrong_size': (
        'tactile_sensing', 'driver', {'port': '{}/port', 'calibration': '{}/calibration.yaml'},
        'baseline'),
    'malformed_scene': (
        'tactile_simulation', 'mock_sensor', {'port': '{}/port', 'scene': '{}/bad.yaml'},
        'bad.yaml: is not YAML'),
    'malformed_urdf_of_the_servo': (
        'tactile_servo', 'edge_servo', {'robot_description': '{}/bad.urdf'}, 'malformed XML'),
    'malformed_urdf_of_the_robot': (
        'tactile_simulation', 'mock_robot', {'robot_description': '{}/bad.urdf'}, 'malformed XML'),
}


@pytest.mark.parametrize('case', CASES)
def test_node_refuses_in_one_line(files, case):
    package, name, parameters, text = CASES[case]
    status, lines = run(package, name, *ros_arguments(
        **{key: value.format(files) for key, value in parameters.items()}))
    assert status == 2
    assert len(lines) == 1, lines
    assert lines[0].startswith(f'{name}: ')
    assert text in lines[0]


def test_malformed_parameter_file_is_named(files):
    status, lines = run(
        'tactile_sensing', 'contact_estimator', '--ros-args', '--params-file',
        str(files / 'bad.yaml'))
    assert status == 2
    assert 'bad.yaml' in lines[-1]
    assert not any('Traceback' in line for line in lines)


def test_composed_process_refuses_in_one_line(files):
    status, lines = run(
        'edge_tracking', 'composed', '--robot-description', str(files / 'bad.urdf'))
    assert status == 2
    assert len(lines) == 1, lines
    assert lines[0].startswith('composed: ') and 'malformed XML' in lines[0]


@pytest.mark.parametrize('option, name', [
    ('--parameters', 'list.yaml'), ('--recording', 'bad.urdf'), ('--scene', 'list.yaml')])
def test_demo_refuses_a_file_once_and_leaves_nothing(files, option, name):
    status, lines = run('edge_tracking', 'demo', option, str(files / name),
                        '--out', str(files / 'out'))
    assert status == 2
    own = [line for line in lines if '[rcl]' not in line]
    assert len(own) == 1, lines
    assert own[0].startswith('demo: ') and name in own[0]
    assert not (files / 'out').exists()


def test_track_says_that_its_goal_was_rejected(running):
    """The goal goes to a servo of this process while the executable runs."""
    running.wait(lambda: running.listener.tared, 'the tare')
    outcome = []
    thread = threading.Thread(target=lambda: outcome.extend(run(
        'edge_tracking', 'track', '--ros-args', '-r', '__ns:=/tactile', '-p', 'speed:=0.5')))
    thread.start()
    running.wait(lambda: not thread.is_alive(), 'the end of track', DEADLINE)
    status, lines = outcome
    assert status == Exit.REFUSED
    assert len(lines) == 1, lines
    assert lines[0].startswith('track: ') and 'rejected' in lines[0]
    assert 'speed is 0.5, must be between 0.0001 and 0.2 m/s' in lines[0]


def test_track_says_what_it_waits_for():
    status, lines = run('edge_tracking', 'track', '--ros-args', '-r', '__ns:=/nobody',
                        '-p', 'wait:=0.2')
    assert status == Exit.NOT_READY
    assert len(lines) == 1, lines
    assert 'no contact estimates arrive' in lines[0]
