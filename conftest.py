"""For the tests of all packages: one thread, a ROS domain of their own, who runs alone."""
from functools import lru_cache
import os
from pathlib import Path

# Before numpy is loaded: threads of its matrices, one for every core of the host, wait for each
# other where others compute as well.
for _library in ('OMP', 'OPENBLAS', 'MKL'):
    os.environ.setdefault(f'{_library}_NUM_THREADS', '1')

try:
    from tactile_common.ros.domains import hold_domain
except ImportError:  # tests of tools alone, without the workspace
    pass
else:
    if not os.environ.get('ROS_DOMAIN_ID'):
        os.environ['ROS_DOMAIN_ID'] = str(hold_domain())

ROOT = Path(__file__).resolve().parent
WHOLE = (ROOT / 'test', ROOT / 'launch/test')  # tests of processes and of the whole system


@lru_cache
def of_a_graph(path):
    """Whether a test file starts ROS nodes, or times processes."""
    return path.parent in WHOLE or 'rclpy' in path.read_text(encoding='utf-8')


def pytest_collection_modifyitems(items):
    """Mark the tests that no other test may run beside."""
    for item in items:
        if of_a_graph(item.path):
            item.add_marker('graph')
