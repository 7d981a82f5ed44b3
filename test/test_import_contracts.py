"""Which package, room and module may import which; and that each rule sees what breaks it."""
from pathlib import Path
import subprocess
import sys

import pytest
from tactile_tests import import_rules
from tactile_tests.imports import read_tree

ROOT = Path(__file__).resolve().parents[1]
RULES = ('wrong_arrows', 'imported_programs', 'core_with_ros', 'offline_where_it_runs',
         'import_cycles', 'thesis_apart', 'manifests')
# A sound tree: path -> text; '.xml' stands for the dependencies in a package's package.xml.
SOUND = {
    'tactile_common/.xml': 'rclpy',
    'tactile_common/tactile_common/errors.py': '',
    'tactile_common/tactile_common/ros/runner.py': 'import rclpy',
    'tactile_sensing/.xml': 'tactile_common tactile_msgs python3-numpy test:python3-pytest',
    'tactile_sensing/tactile_sensing/image.py':
        'import numpy as np\nfrom tactile_common.errors import Error',
    'tactile_sensing/tactile_sensing/conversions.py':
        'from tactile_msgs.msg import Image\nfrom tactile_common.ros import runner',
    'tactile_sensing/tactile_sensing/nodes/driver.py':
        'from tactile_sensing.conversions import f\nfrom tactile_common.ros.runner import run',
    'tactile_sensing/tactile_sensing/thesis/moments.py': 'from tactile_sensing.image import x',
    'tactile_sensing/tactile_sensing/contact/estimator.py':
        "def f():\n    import_module('tactile_sensing.thesis.moments')",
    'tactile_sensing/test/test_image.py': 'import pytest\nfrom tactile_sensing.image import x',
    'tactile_servo/.xml': 'tactile_sensing',
    'tactile_servo/tactile_servo/laws/law.py': 'from tactile_sensing import image',
    'tactile_servo/tactile_servo/motion/limits.py': 'from tactile_servo.laws import law',
    'tactile_simulation/.xml': 'tactile_servo python3-matplotlib',
    'tactile_simulation/tactile_simulation/scene.py': 'from tactile_servo.laws.law import f',
    'tactile_simulation/tactile_simulation/cli/plots.py': 'from matplotlib import pyplot',
    'tactile_simulation/tactile_simulation/cli/simulate.py':
        'def plot():\n    from tactile_simulation.cli import plots',
    'launch/.xml': 'edge_tracking: tactile_sensing tactile_simulation',
    'launch/edge_tracking/demo.py':
        'from tactile_sensing.nodes.driver import D\nimport tactile_simulation.scene',
    'benchmarks/edge/charts.py': 'import matplotlib\nimport tactile_servo.laws.law',
}
SCIPY = {f'scipy.{name}' for name in (
    'linalg', 'ndimage', 'optimize', 'sparse', 'spatial', 'special')}
SERVO, SENSING = 'tactile_servo/tactile_servo/', 'tactile_sensing/tactile_sensing/'


def write(root, files):
    """Write a tree of sources."""
    for name, text in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if name.endswith('.xml'):
            package, _, depends = text.rpartition(': ')
            package = package or path.parent.name
            lines = ''.join(
                f'<test_depend>{item[5:]}</test_depend>' if item.startswith('test:')
                else f'<exec_depend>{item}</exec_depend>' for item in depends.split())
            path = path.with_name('package.xml')
            text = f'<package><name>{package}</name>{lines}</package>'
        path.write_text(text, 'utf-8')
    return read_tree(root)


@pytest.fixture(scope='module')
def our_tree():
    return read_tree(ROOT)


@pytest.mark.parametrize('rule', RULES)
def test_our_packages(rule, our_tree):
    tree = our_tree
    assert len(tree.modules) > 100 and set(tree.declared) >= set(import_rules.CORE)
    found = getattr(import_rules, rule)(tree)
    assert not found, '\n'.join(found)


@pytest.mark.parametrize('rule', RULES)
def test_a_sound_tree_passes(rule, tmp_path):
    assert getattr(import_rules, rule)(write(tmp_path, SOUND)) == []


@pytest.mark.parametrize('rule, files, message', [
    ('wrong_arrows', {SERVO + 'a.py': 'def f():\n    from tactile_simulation import scene'},
     'a.py:2: tactile_servo imports tactile_simulation.scene'),
    ('wrong_arrows', {SERVO + 'a.py': "import_module('tactile_simulation.scene')"},
     'tactile_servo imports tactile_simulation.scene'),
    ('wrong_arrows', {SERVO + 'a.py': 'if TYPE_CHECKING:\n    import edge_tracking.demo'},
     'tactile_servo imports edge_tracking.demo'),
    ('wrong_arrows', {'tactile_simulation/tactile_simulation/a.py': 'import benchmarks.edge'},
     'tactile_simulation imports benchmarks'),
    ('imported_programs', {SERVO + 'a.py': 'from tactile_sensing.nodes.driver import D'},
     'tactile_servo.a imports tactile_sensing.nodes.driver'),
    ('imported_programs', {SENSING + 'a.py': 'from .nodes import driver'},
     'tactile_sensing.a imports tactile_sensing.nodes.driver'),
    ('core_with_ros', {SENSING + 'a.py': 'import rclpy'}, 'tactile_sensing.a -> rclpy'),
    ('core_with_ros', {SERVO + 'a.py': 'import tactile_common.ros.runner'},
     'tactile_servo.a -> tactile_common.ros.runner -> rclpy'),
    ('core_with_ros', {SERVO + 'a.py': 'def f():\n    from tactile_common.ros import runner'},
     'within a function -> rclpy'),
    ('offline_where_it_runs', {SERVO + 'a.py': 'from rosbags.rosbag2 import Reader'},
     'tactile_servo.a imports rosbags.rosbag2'),
    ('offline_where_it_runs', {SENSING + 'nodes/a.py': 'from tactile_sensing.cli import plots',
                               SENSING + 'cli/plots.py': 'import matplotlib'},
     'tactile_sensing.nodes.a -> tactile_sensing.cli.plots -> matplotlib'),
    ('thesis_apart', {SENSING + 'a.py': 'from tactile_sensing.thesis.moments import f'},
     'tactile_sensing.a imports tactile_sensing.thesis.moments'),
    ('thesis_apart', {SERVO + 'a.py': "import_module('tactile_sensing.thesis.moments')"},
     'tactile_servo.a imports tactile_sensing.thesis.moments'),
    ('import_cycles', {SERVO + 'a.py': 'import tactile_servo.b',
                       SERVO + 'b.py': 'def f():\n    from tactile_servo import a'},
     'tactile_servo.a <-> tactile_servo.b'),
    ('import_cycles', {SERVO + 'laws/other.py': 'from tactile_servo.motion import limits'},
     'tactile_servo.laws <-> tactile_servo.motion'),
    ('manifests', {'tactile_servo/.xml': ''}, 'tactile_servo does not declare tactile_sensing'),
    ('manifests', {'tactile_sensing/test/test_a.py': 'from nav_msgs.msg import Path'},
     'tactile_sensing does not declare for its tests nav_msgs'),
    ('manifests', {'tactile_servo/.xml': 'tactile_sensing nav_msgs'},
     'tactile_servo declares, but does not import nav_msgs'),
    ('manifests', {'tactile_servo/.xml': 'tactile_sensing test:tactile_sensing'},
     'tactile_servo declares twice tactile_sensing'),
    ('manifests', {'tactile_sensing/.xml': SOUND['tactile_sensing/.xml'] + ' test:tactile_servo'},
     'circle of packages: tactile_sensing <-> tactile_servo')])
def test_each_rule_sees_what_breaks_it(rule, files, message, tmp_path):
    found = getattr(import_rules, rule)(write(tmp_path, {**SOUND, **files}))
    assert any(message in line for line in found), found


def test_what_may_be(tmp_path):
    tree = write(tmp_path, {
        **SOUND,
        SENSING + 'bag.py': 'import rclpy',
        SENSING + 'cli/fit.py': 'def f():\n    from tactile_sensing.bag import read\n'
                                '    import rosbags',
        SENSING + 'a.py': 'if TYPE_CHECKING:\n    import tactile_sensing.b',
        SENSING + 'b.py': 'import tactile_sensing.a'})
    for rule in ('core_with_ros', 'offline_where_it_runs', 'import_cycles'):
        assert getattr(import_rules, rule)(tree) == []


@pytest.mark.parametrize('modules, unused', [
    ('tactile_sensing.nodes.contact_estimator, tactile_shape.nodes.shape_estimator, '
     'tactile_servo.nodes.servo, tactile_simulation.nodes.mock_sensor', SCIPY),
    ('edge_tracking.view, tactile_sensing.nodes.driver', SCIPY | {'numba', 'pinocchio'})])
def test_a_node_does_not_load_what_it_may_never_use(modules, unused):
    """Each of these takes .1 to 1 s and 20 to 50 MB."""
    loaded = subprocess.run(
        [sys.executable, '-c', f'import sys, {modules}; print(*sys.modules)'],
        check=True, capture_output=True, text=True).stdout.split()
    assert set(modules.split(', ')) <= set(loaded)
    assert not unused & set(loaded)
