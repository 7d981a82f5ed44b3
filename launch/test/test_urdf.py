"""The URDF of the PUMA 260 stands on its own."""

from pathlib import Path
from shutil import which
import subprocess
from xml.etree import ElementTree

import numpy as np
import pytest

URDF = Path(__file__).resolve().parents[1] / 'urdf/puma260.urdf'
ROBOT = ElementTree.parse(URDF).getroot()


def test_check_urdf_accepts_it():
    if which('check_urdf') is None:
        pytest.skip('check_urdf is not installed')
    done = subprocess.run(['check_urdf', URDF], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert 'root Link: base_link' in done.stdout


def test_one_tree_from_base_to_pad():
    links = [link.get('name') for link in ROBOT.findall('link')]
    children = [joint.find('child').get('link') for joint in ROBOT.findall('joint')]
    assert len(set(links)) == len(links) and len(set(children)) == len(children)
    assert set(links) - set(children) == {'base_link'}
    assert 'tactile_pad' in links
    assert ROBOT.find('.//mesh') is None  # its shapes need no files


def test_root_has_no_inertia_and_every_moving_link_a_possible_one():
    assert ROBOT.find("link[@name='base_link']/inertial") is None
    moving = {joint.find('child').get('link') for joint in ROBOT.findall('joint')
              if joint.get('type') != 'fixed'}
    for link in ROBOT.findall('link'):
        inertial = link.find('inertial')
        if inertial is None:
            assert link.get('name') not in moving
            continue
        assert float(inertial.find('mass').get('value')) > 0.0
        values = {k: float(v) for k, v in inertial.find('inertia').attrib.items()}
        moments = np.linalg.eigvalsh([
            [values['ixx'], values['ixy'], values['ixz']],
            [values['ixy'], values['iyy'], values['iyz']],
            [values['ixz'], values['iyz'], values['izz']]])
        assert moments[0] > 0.0 and moments[2] <= moments[0] + moments[1], link.get('name')


def test_pad_is_the_sensor():
    box = ROBOT.find("link[@name='tactile_pad']/visual/geometry/box").get('size').split()
    assert [float(v) for v in box[:2]] == [0.0254, 0.0254]
    origin = ROBOT.find("link[@name='tactile_pad']/visual/origin").get('xyz').split()
    # The surface, not the box's middle, is the origin of the frame.
    assert float(origin[2]) == pytest.approx(-0.5 * float(box[2]))
