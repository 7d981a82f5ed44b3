"""
The course by arms of six and seven joints, each from three starts, one at a joint's limit.

The URDFs of the UR5 and the Panda are those of the package example-robot-data of the Python
index; the pad sits on their flange, 50 mm before it.
"""

from importlib import metadata
import json
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tactile_servo.motion.inverse import damped_least_squares
from tactile_servo.motion.robot import RobotModel
from tactile_simulation.cli.simulate import main
from tactile_simulation.scene import load_scene

ROOT = Path(__file__).resolve().parents[2]
COURSE = ROOT / 'launch/scenes/course.yaml'
POSE = load_scene(COURSE).start_pose()
FLANGES = {'ur5_robot': 'tool0', 'panda': 'panda_link8'}
PAD = """<joint name="pad_mount" type="fixed"><parent link="{}"/><child link="pad"/>
    <origin xyz="0 0 0.05" rpy="0 0 0"/></joint>"""
LARGEST = 0.3e-3  # m, lateral


def robot(name):
    """URDF of a robot as an element, and its sensor frame."""
    if name == 'puma260':
        return ElementTree.parse(ROOT / 'launch/urdf/puma260.urdf').getroot(), 'tactile_pad'
    try:
        files = metadata.files('example-robot-data') or ()
    except metadata.PackageNotFoundError:
        pytest.skip('the Python package example-robot-data is not installed')
    path = next(file for file in files if file.name == f'{name}.urdf').locate()
    urdf = ElementTree.parse(path).getroot()
    urdf.append(ElementTree.Element('link', name='pad'))
    urdf.append(ElementTree.fromstring(PAD.format(FLANGES[name])))
    return urdf, 'pad'


def model_of(urdf, tip):
    return RobotModel.from_urdf(ElementTree.tostring(urdf, encoding='unicode'), tip)


def simulated(urdf, tip, start, folder, capsys, speed='0.05', law='trace'):
    """Summary of `simulate` on the course, at 50 mm/s or another speed."""
    path = folder / 'robot.urdf'
    path.write_bytes(ElementTree.tostring(urdf))
    status = main([str(COURSE), '--speed', speed, '--law', law, '--robot', str(path), '--tip', tip,
                   '--json', '--start', *(f'{angle:.12f}' for angle in start)])
    summary = json.loads(capsys.readouterr().out)
    assert (status == 0) == summary['ok']
    return summary


@pytest.mark.parametrize('name, near', [
    ('puma260', (-0.5, 0.5, -2.7, 0.0, -1.0, -0.5)),
    ('ur5_robot', (-0.5, 0.4, -2.3, 0.4, -1.6, 1.1)),
    ('panda', (-1.9, 1.3, 1.5, -2.7, -1.5, 1.9, -2.4)),
    *(pytest.param(*it, marks=pytest.mark.long) for it in (
        ('puma260', (-0.5, 0.5, -2.7, -3.1, 1.0, 2.6)),
        ('ur5_robot', (-0.5, -1.3, 1.9, 1.0, 1.6, -2.0)),
        ('panda', (1.3, -0.5, -1.7, -2.8, -1.0, 2.6, -2.6))))])
def test_course_is_tracked(name, near, tmp_path, capsys):
    urdf, tip = robot(name)
    start = model_of(urdf, tip).inverse(POSE, near)
    assert np.abs(start - near).max() < 0.6  # the configuration that is meant
    summary = simulated(urdf, tip, start, tmp_path, capsys)
    assert summary['ok'] and summary['lateral_max'] <= LARGEST, summary['reason']


@pytest.mark.parametrize('name, near, joint', [
    ('puma260', (-0.5, 0.5, -2.7, 0.0, -1.0, -0.5), 4),
    ('ur5_robot', (-0.5, 0.4, -2.3, 0.4, -1.6, 1.1), 2)])
def test_course_is_tracked_by_six_joints_from_a_limit(name, near, joint, tmp_path, capsys):
    """The limit is moved to where the joint starts; the course would take it beyond."""
    urdf, tip = robot(name)
    model = model_of(urdf, tip)
    start = model.inverse(POSE, near)
    element = next(e for e in urdf.findall('joint') if e.get('name') == model.joint_names[joint])
    element.find('limit').set('upper', f'{start[joint]:.12f}')
    assert model_of(urdf, tip).upper[joint] == float(f'{start[joint]:.12f}')
    summary = simulated(urdf, tip, start, tmp_path, capsys)
    assert summary['ok'] and summary['lateral_max'] <= LARGEST, summary['reason']


@pytest.mark.parametrize('speed', [pytest.param('0.03', marks=pytest.mark.long), '0.2'])
def test_a_joint_that_runs_out_is_named_and_presses_nothing(speed, tmp_path, capsys):
    """The other five cannot do without the first one on the way round."""
    urdf, tip = robot('puma260')
    model = model_of(urdf, tip)
    start = model.inverse(POSE, (-0.5, 0.5, -2.7, 0.0, -1.0, -0.5))
    limit = next(e for e in urdf.findall('joint') if e.get('name') == 'joint_1').find('limit')
    limit.set('upper', f'{start[0] + 0.05:.12f}')
    summary = simulated(urdf, tip, start, tmp_path, capsys, speed)
    assert not summary['ok'] and 'joint_1 is at its upper limit' in summary['reason']
    assert summary['force_max'] < 9.5 and summary['force_end'] == 0.0


@pytest.mark.parametrize('joint', [
    *(pytest.param(joint, marks=pytest.mark.long) for joint in (0, 4)), 6])
def test_course_is_tracked_by_seven_joints_from_a_limit(joint, tmp_path, capsys):
    """The limits are the robot's own; the other joints solve for the start."""
    urdf, tip = robot('panda')
    held = model_of(urdf, tip)
    held.upper[joint] = held.lower[joint]
    start = held.inverse(POSE)
    assert start[joint] == held.lower[joint]
    summary = simulated(urdf, tip, start, tmp_path, capsys)
    assert summary['ok'] and summary['lateral_max'] <= LARGEST, summary['reason']


def arm_of_seven(heights=(0.0, 0.34, 0.0, 0.532, 0.0, 0.4, 0.0)):
    """URDF of an arm whose axes are z and y in turn, as an element; its wrist can stretch."""
    links = ''.join(f'<link name="l{k}"/>' for k in range(8))
    joints = ''.join(
        f'<joint name="j{k}" type="revolute"><parent link="l{k}"/><child link="l{k + 1}"/>'
        f'<origin xyz="0 0 {height}"/><axis xyz="{("0 0 1", "0 1 0")[k % 2]}"/>'
        '<limit lower="-3" upper="3" velocity="1.7" effort="100"/></joint>'
        for k, height in enumerate(heights))
    urdf = ElementTree.fromstring(f'<robot name="arm">{links}<link name="pad"/>{joints}</robot>')
    urdf.append(ElementTree.fromstring(PAD.format('l7').replace('0.05', '0.176')))
    return urdf


@pytest.mark.parametrize('near', [
    (2.955, -0.748, 0.026, -2.393, -1.547, -0.018, -1.762),
    *(pytest.param(near, marks=pytest.mark.long) for near in (
        (-0.181, 0.748, 0.02, 2.393, -1.539, 0.013, 1.372),
        (-0.11, 0.749, -0.075, 2.393, -1.579, -0.051, 1.413)))])
def test_a_singular_wrist_leads_off_no_edge(near, tmp_path, capsys):
    urdf = arm_of_seven()
    model = model_of(urdf, 'pad')
    start = model.inverse(POSE, near)
    _, smallest = damped_least_squares(model.jacobian(start), np.zeros(6))
    assert smallest < 1.5e-3  # m/rad; .03 and more elsewhere
    summary = simulated(urdf, 'pad', start, tmp_path, capsys)
    assert summary['ok'] and summary['lateral_max'] <= LARGEST, summary['reason']
    assert summary['force_max'] < 7.5


@pytest.mark.parametrize('law, start', [
    pytest.param('trace', (0.17, 1.49, -1.19, -1.07, -1.28, 0.51), marks=pytest.mark.long),
    ('resolved_rate', (0.71, 0.2, -0.85, -1.47, 0.23, -1.32))])
def test_an_arm_that_meets_a_singularity_says_so(law, start, tmp_path, capsys):
    """A PUMA 260 on a base from where these joint positions are at the start of the course."""
    urdf, tip = robot('puma260')
    model = model_of(urdf, tip)
    base = POSE @ np.linalg.inv(model.pose(start))
    place, turn = (' '.join(map(str, numbers)) for numbers in (
        base[:3, 3], Rotation.from_matrix(base[:3, :3]).as_euler('xyz')))
    urdf.append(ElementTree.Element('link', name='ground'))
    urdf.append(ElementTree.fromstring(
        f'<joint name="base" type="fixed"><parent link="ground"/>'
        f'<child link="{model.root_frame}"/><origin xyz="{place}" rpy="{turn}"/></joint>'))
    summary = simulated(urdf, tip, start, tmp_path, capsys, law=law)
    assert not summary['ok'] and 'the arm is near a singularity' in summary['reason']


@pytest.mark.parametrize('option, text', [
    (('--tip', 'hand'), "tip_frame 'hand': the robot has no such frame"),
    (('--start', '0', '0'), '6 finite joint positions are needed')])
def test_frame_and_start_have_to_be_those_of_the_robot(option, text, capsys):
    assert main([str(COURSE), '--robot', str(ROOT / 'launch/urdf/puma260.urdf'), *option]) == 2
    assert text in capsys.readouterr().err
