"""Parameter files: what is refused before a node starts, what is warned of, and all parameters."""
import pytest
import yaml

from edge_tracking.parameters import check_file, main, names_in, NODES, parameters_of, text_of_all
from edge_tracking.resources import share
from tactile_common.errors import ConfigurationError
from tactile_servo.laws.registry import LAWS

TACTILE = names_in('tactile')


@pytest.fixture
def written(tmp_path):
    def write(text):
        path = tmp_path / 'own.yaml'
        path.write_text(text)
        return path
    return write


def section(name, *values):
    return f'{name}:\n  ros__parameters:\n' + ''.join(f'    {value}\n' for value in values)


@pytest.mark.parametrize('namespace', ['tactile', 'left', '/deep/left', ''])
def test_the_shipped_file_holds_in_any_namespace(namespace):
    assert check_file(share('config', 'edge_tracking.yaml'), names_in(namespace)) == []


@pytest.mark.parametrize('law', LAWS)
def test_the_file_of_all_parameters_is_one_and_has_the_defaults(written, law, capsys):
    path = written(text_of_all(law))
    assert check_file(path, TACTILE, law) == []
    tree = yaml.safe_load(path.read_text())
    for node in NODES:
        given = tree[f'/**/{node}']['ros__parameters']
        for name, default, _kind, _ in parameters_of(node, law):
            if default != ():
                value = tuple(given[name]) if isinstance(given[name], list) else given[name]
                assert value == default and type(value) is type(default), name
    assert main(['--law', law]) == 0
    assert capsys.readouterr().out.strip() == text_of_all(law).strip()


@pytest.mark.parametrize('name', [
    '/tactile/edge_servo', '/**/edge_servo', '/*/edge_servo', '/**', 'tactile/edge_servo'])
def test_names_that_ros_takes_for_the_node(written, name):
    with pytest.raises(ConfigurationError, match='/tactile/edge_servo: rate is 9.0, must be betw'):
        check_file(written(section(name, 'rate: 9.0')), {'edge_servo': TACTILE['edge_servo']})


def test_a_name_may_be_cut_into_mappings(written):
    path = written('tactile:\n  edge_servo:\n    ros__parameters: {force: {gain: 0.5}}\n')
    with pytest.raises(ConfigurationError, match='force.gain is 0.5, must be between 1 and 200'):
        check_file(path, TACTILE)


@pytest.mark.parametrize('text, message', [
    (section('/left/edge_servo', 'rate: 100.0'), "/left/edge_servo is not the name of the node, "
     "which is /tactile/edge_servo; '/\\*\\*/edge_servo' holds in every namespace"),
    (section('/**/edge_servo', 'rate: fast'), "rate is 'fast', must be a number"),
    (section('/**/edge_servo', 'speed.maks: 1.0'),
     'no parameter speed.maks; did you mean speed.max'),
    (section('/**/edge_servo', 'force: {gian: 3.0}', 'use_sim_time: true'),
     '/\\*\\*/edge_servo: no parameter force.gian; did you mean force.gain'),
    (section('/**/edge_servo', 'workspace: {lower: [0, -0.3, 0.05]}'),
     'edge_servo: workspace.lower is \\[0, -0.3, 0.05\\], must have items of one type: in a list '
     'of numbers, write 0.0 for 0'),
    (section('/**/mock_sensor', 'rate: -1.0'), '/tactile/mock_sensor: rate is -1.0'),
    ('rate: 100.0', 'must be a mapping of names of nodes'),
    ('/**/driver: {ros__parameters: 3}', 'ros__parameters must be a mapping'),
    ('a: [1', 'is not YAML'),
    ('#' * 2_000_000, 'has more than 1048576 bytes')])
def test_refused_with_one_line(written, text, message):
    path = written(text)
    with pytest.raises(ConfigurationError, match=f'^parameter file {path}: .*{message}') as caught:
        check_file(path, TACTILE)
    assert '\n' not in str(caught.value)


def test_a_file_that_cannot_be_read(tmp_path, capsys):
    with pytest.raises(ConfigurationError, match='nowhere.yaml: cannot be read: No such file'):
        check_file('nowhere.yaml', TACTILE)
    assert main(['--check', str(tmp_path)]) == 2
    assert 'Is a directory' in capsys.readouterr().err


def test_unknown_nodes_are_warned_of_with_the_nearest_known_one(written, capsys):
    path = written(section('/**/edge_serve', 'rate: 3.0') + section('/**/other', 'rate: 3.0'))
    warnings = [text.removeprefix(f'parameter file {path}: ')
                for text in check_file(path, TACTILE)]
    assert warnings == ['no node /**/edge_serve; did you mean edge_servo?', 'no node /**/other']
    assert main(['--check', str(path)]) == 1
    assert 'did you mean edge_servo?' in capsys.readouterr().err


@pytest.mark.parametrize('namespace, robot', [('robot1', '/robot1'), ('tactile', '')])
def test_the_mock_robot_is_where_the_launch_starts_it(written, namespace, robot):
    path = written(section(f'{robot}/mock_robot', 'use_sim_time: false'))
    assert main(['--check', str(path), '--namespace', namespace]) == 0


def test_parameters_of_the_other_law_are_known(written):
    path = written(section('/**/edge_servo', 'position: {segment_time: 0.1}'))
    assert check_file(path, TACTILE, 'trace') == []
