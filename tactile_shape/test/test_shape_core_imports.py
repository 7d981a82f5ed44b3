"""ROS stays out of the core, and the core knows nothing of the nodes."""
import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / 'tactile_shape'
MODULES = sorted(PACKAGE.rglob('*.py'))
ROS = {'rclpy', 'rcl_interfaces', 'builtin_interfaces', 'ament_index_python', 'launch'}
OFFLINE = {'rosbags', 'matplotlib', 'mpl_toolkits'}
CONVERTERS = {'conversions.py', 'bag.py'}


def imports(nodes):
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0
            yield node.module
            yield from (f'{node.module}.{alias.name}' for alias in node.names)


@pytest.mark.parametrize('path', MODULES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_of_shape(path):
    tree = ast.parse(path.read_text(encoding='utf-8'))
    names = set(imports(ast.walk(tree)))
    tops = {name.split('.')[0] for name in names}
    ours = {name for name in names if name.startswith('tactile_')}
    assert {name.split('.')[0] for name in ours} <= {
        'tactile_msgs', 'tactile_sensing', 'tactile_shape'}
    if path.name != 'plots.py':
        # What is only needed off-line is imported where it is used.
        assert not {name.split('.')[0] for name in imports(tree.body)} & OFFLINE
    if 'nodes' in path.relative_to(PACKAGE).parts:
        return
    assert not [name for name in ours if '.nodes' in name]
    if path.name not in CONVERTERS:
        assert not tops & ROS
        assert not [top for top in tops if top.endswith(('_msgs', '_interfaces'))]
        assert not [name for name in ours if name.split('.')[1:2] == ['conversions']]
