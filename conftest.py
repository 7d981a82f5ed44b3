"""Settings for the tests of all packages: one thread, a ROS domain, tests that run alone."""
from functools import lru_cache
import os
from pathlib import Path

from hypothesis import settings
import pytest

# Set before numpy is loaded: its threads, one per core of the host, wait for each other on a busy
# machine.
for _library in ('OMP', 'OPENBLAS', 'MKL'):
    os.environ.setdefault(f'{_library}_NUM_THREADS', '1')

try:
    from tactile_common.ros.domains import hold_domain
except ImportError:  # only tests of tools, without the workspace
    pass
else:
    if not os.environ.get('ROS_DOMAIN_ID'):
        os.environ['ROS_DOMAIN_ID'] = str(hold_domain())

# No time decides a test: the first example may load a kernel.
settings.register_profile('untimed', deadline=None)
settings.load_profile('untimed')

ROOT = Path(__file__).resolve().parent
LONG = bool(os.environ.get('TACTILE_LONG_TESTS'))
WHOLE = (ROOT / 'test', ROOT / 'launch/test')  # tests of processes and of the whole system
# Tests in WHOLE that start no processes and measure no times.
BESIDE = {f'test_{name}.py' for name in (
    'cdr', 'demo_recording', 'docs', 'executables', 'golden_bags', 'hostile_files',
    'import_contracts', 'matrix_fit', 'mistakes', 'package_files', 'parameter_file',
    'public_names', 'read_run',
    'real_skin', 'replay_command', 'report', 'sensor_arguments', 'summary',
    'surface_summary', 'urdf')}


@lru_cache
def of_a_graph(path):
    """Return True if a test file starts ROS nodes or measures times of processes."""
    if path.parent in WHOLE:
        return path.name not in BESIDE
    return 'rclpy' in path.read_text(encoding='utf-8')


@pytest.fixture
def context():
    """Give a ROS context of the test's own."""
    import rclpy
    context = rclpy.Context()
    rclpy.init(context=context)
    yield context
    context.try_shutdown()


def pytest_collection_modifyitems(items):
    """Mark the tests that must run alone, and skip those that take long."""
    for item in items:
        if of_a_graph(item.path):
            item.add_marker('graph')
        if not LONG and item.get_closest_marker('long'):
            item.add_marker(pytest.mark.skip(reason='runs with TACTILE_LONG_TESTS=1'))
