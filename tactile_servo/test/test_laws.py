"""The registry of laws, and the parameters of laws, robot and limits."""
import ast
from dataclasses import fields, replace
from importlib import import_module
import inspect
from pathlib import Path

import numpy as np
import pytest

from tactile_common.errors import ConfigurationError
from tactile_common.parameter_file import ParameterFile, parameters_of
from tactile_sensing.devices.calibration import Calibration
from tactile_sensing.types.array import TactelArray
from tactile_servo import laws
from tactile_servo.config import ServoConfig
from tactile_servo.conversions import ACTIONS
from tactile_servo.law import ServoLaw
from tactile_servo.laws.registry import DEFAULT, law_for, law_named, LAWS, make_law
from tactile_servo.laws.surface_config import ProbeConfig
from tactile_servo.robot_config import NodeConfig, robot_of
from tactile_servo.types import EdgeGoal

MEMBERS = [name for name, _ in inspect.getmembers(ServoLaw) if not name.startswith('_')]


@pytest.mark.parametrize('name', LAWS)
def test_a_row_has_what_supervisor_and_node_ask_for(name):
    row, law = law_named(name), make_law(name, ServoConfig())
    assert law.name == row.law.name == name
    assert isinstance(row.law.config_type(), row.law.config_type)
    assert row.action in ACTIONS
    missing = [member for member in ('name', 'goal_type', 'config_type', 'stiffness')
               if not hasattr(law, member)]
    assert 'observe' in MEMBERS and missing == []
    for member in MEMBERS:
        wanted, own = (inspect.getattr_static(kind, member, None) for kind in (ServoLaw, row.law))
        if inspect.isfunction(wanted) or isinstance(wanted, property):
            assert own is not wanted or member == 'result', member
        if inspect.isfunction(wanted):
            assert (list(inspect.signature(own).parameters)
                    == list(inspect.signature(wanted).parameters)), member


def test_the_goals_of_an_action_are_those_of_its_laws():
    for row in LAWS.values():
        goal = ACTIONS[row.action].goal_from_msg(ACTIONS[row.action].type.Goal())
        assert isinstance(goal, row.law.goal_type)
        assert {'speed', 'force', 'retreat'} <= {field.name for field in fields(goal)}


def test_a_law_is_found_for_an_action_and_refused_for_another():
    assert law_for('track_edge') == DEFAULT
    assert law_for('track_edge', 'resolved_rate') == 'resolved_rate'
    assert law_for('track_surface') == 'tactile_jacobian'
    with pytest.raises(ConfigurationError, match="'trace' works on goals of track_edge; .* asks "
                       'for track_surface, which tactile_jacobian, jacobian_rate can'):
        law_for('track_surface', 'trace')
    with pytest.raises(ConfigurationError, match="'telepathy' is not one of trace"):
        law_for('track_edge', 'telepathy')


def begun(skin_stiffness, name='trace'):
    """Edge law on a sensor whose driver gives this stiffness."""
    law = make_law(name, ServoConfig())
    sensor = Calibration(TactelArray(16, 16, 1.6e-3, 1.6e-3), depth=2e-3).sensor_info(
        'pad', '', 0)
    law.begin(EdgeGoal(0.03, 5.0), replace(sensor, skin_stiffness=skin_stiffness))
    return law


@pytest.mark.parametrize('told, used', [(1e5, 1e5), (0.0, 2e5)])
def test_the_stiffness_of_the_skin_is_that_of_the_calibration(told, used):
    assert begun(told).sight.edge.skin_stiffness == used
    for name in ('trace', 'resolved_rate'):  # with an edge along 16 tactels of 1.6 mm
        assert begun(told, name).stiffness == pytest.approx(used * 0.0256)


@pytest.mark.parametrize('name', ['trace', 'resolved_rate'])
@pytest.mark.parametrize('told', [float('nan'), float('inf'), -1.0, 200.0])  # 200: of kN/m^2
def test_an_impossible_stiffness_of_the_skin_is_refused(told, name):
    with pytest.raises(ConfigurationError, match='skin_stiffness is .*, must be'):
        begun(told, name)


@pytest.mark.parametrize('name', LAWS)
def test_no_parameter_has_two_meanings(name):
    declared = [parameter.name for parameter in parameters_of(
        (NodeConfig, ServoConfig, LAWS[name].law.config_type))]
    assert len(declared) == len(set(declared))


@pytest.mark.parametrize('kind', [
    ServoConfig, ProbeConfig, *dict.fromkeys(row.law.config_type for row in LAWS.values())])
def test_settings_out_of_bounds_are_refused_by_python_too(kind):
    bounds = {item.name: item.metadata['range'] for item in fields(kind)
              if 'range' in item.metadata}
    assert bounds
    for name, (low, high) in bounds.items():
        for value in (low - 1.0, high + 1.0, float('nan')):
            with pytest.raises(ConfigurationError, match=rf'{name} is .*must be between'):
                kind(**{name: value})


def test_a_load_below_what_counts_as_contact_is_refused():
    assert ServoConfig(max_load=0.91).max_force == pytest.approx(0.607, abs=1e-3)
    with pytest.raises(ConfigurationError, match='of 0.8 N allows goals of 0.533 N at most, '
                       'approach.contact_force of 0.5 N those of 0.6 N at least'):
        ServoConfig(max_load=0.8)


def test_laws_do_not_import_each_other():
    modules = {row.law.__module__ for row in LAWS.values()}
    for module in modules:
        tree = ast.parse(Path(import_module(module).__file__).read_text(encoding='utf-8'))
        imported = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
        assert not imported & (modules - {module} | {f'{laws.__name__}.registry'})


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
