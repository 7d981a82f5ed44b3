"""Robot, limits and box from parameters."""

from pathlib import Path

import numpy as np
import pytest

from tactile_common.errors import ConfigurationError
from tactile_common.parameter_file import ParameterFile
from tactile_servo.robot_config import NodeConfig, robot_of

PUMA = {'robot_description': str(
    Path(__file__).resolve().parents[2] / 'launch/urdf/puma260.urdf')}


def configured(**values):
    return ParameterFile().config('', NodeConfig, {**PUMA, **values})


@pytest.mark.parametrize('given, limits', [
    (5.0, [5.0] * 6), (5, [5.0] * 6), ([5.0], [5.0] * 6),
    ([1.0, 2.0, 3.0, 4.0, 5.0, 6.0], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0])])
def test_accelerations_are_of_all_joints_or_of_each(given, limits):
    _, found, _ = robot_of(configured(**{'joints.acceleration': given}))
    np.testing.assert_array_equal(found.acceleration, limits)


@pytest.mark.parametrize('given, message', [
    ([1.0, 2.0], r'joints\.acceleration has 2 values for 6 joints; .* one each of joint_1'),
    ([1.0] * 5 + [0.0], r'joints\.acceleration\[5\] is 0\.0, must be between 0\.1'),
    ([], 'joints.acceleration has 0 values'), ('fast', "is 'fast', must be a list")])
def test_accelerations_that_cannot_be_are_refused(given, message):
    with pytest.raises(ConfigurationError, match=message):
        robot_of(configured(**{'joints.acceleration': given}))


@pytest.mark.parametrize('corner', ['lower', 'upper'])
def test_a_box_in_millimetres_is_asked_about(corner):
    box = {'workspace.lower': [-300.0, -300.0, 50.0], 'workspace.upper': [300.0, 300.0, 400.0]}
    with pytest.raises(ConfigurationError, match=r'must be between -10 and 10 m; did you mean'):
        robot_of(configured(**{f'workspace.{corner}': box[f'workspace.{corner}']}))
