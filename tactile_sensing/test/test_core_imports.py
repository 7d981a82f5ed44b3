"""ROS stays out of the core, and the core knows nothing of the nodes."""
import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / 'tactile_sensing'
MODULES = sorted(PACKAGE.rglob('*.py'))
ROS = {'rclpy', 'rcl_interfaces', 'builtin_interfaces', 'ament_index_python', 'launch',
       'launch_ros', 'tf2_ros', 'rosbag2_py', 'std_srvs'}


def imports(path):
    for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f'{path}: relative import'
            yield node.module
            yield from (f'{node.module}.{alias.name}' for alias in node.names)


def is_ros(name):
    top = name.split('.')[0]
    return top in ROS or top.endswith(('_msgs', '_interfaces'))


def is_node(path):
    return 'nodes' in path.relative_to(PACKAGE).parts


@pytest.mark.parametrize('path', MODULES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_of(path):
    names = set(imports(path))
    ours = {name for name in names if name.split('.')[0].startswith('tactile_')}
    allowed = {'tactile_sensing', 'tactile_msgs'}
    assert {name.split('.')[0] for name in ours} <= allowed
    if is_node(path):
        return
    assert not [name for name in ours if name.startswith('tactile_sensing.nodes')]
    if path.name != 'conversions.py':
        assert not [name for name in names if is_ros(name)]
        assert not [name for name in ours if name.startswith('tactile_sensing.conversions')]
