"""Parameters of a node from a nested dataclass, as another process sees them."""
from dataclasses import dataclass, field

import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter

from tactile_common.config import bounded, check_fields, one_of
from tactile_common.errors import ConfigurationError
from tactile_common.ros.parameters import declare_from, follow_changes


@dataclass(frozen=True)
class Force:
    gain: float = bounded(60.0, 'of the force loop', '1/s', 0.0, 1000.0)
    steps: int = bounded(2, low=1)

    def __post_init__(self):
        check_fields(self)


@dataclass(frozen=True)
class Path:
    force: Force = field(default_factory=lambda: Force(steps=7))
    cut: float = bounded(5e-5, 'distance from a corner', 'm', 0.0, 1e-3)


@dataclass(frozen=True)
class Config:
    path: Path = field(default_factory=Path)
    force: Force = field(default_factory=lambda: Force(gain=30.0))
    method: str = one_of('fit', 'how', ('fit', 'moments'))
    box: tuple[float, ...] = (1.0, 2.0)


@pytest.fixture
def declared(context):
    nodes = []

    def declare(given=None):
        overrides = [Parameter(name, value=value) for name, value in (given or {}).items()]
        nodes.append(Node('parameters', context=context, parameter_overrides=overrides))
        return nodes[-1], declare_from(nodes[-1], Config)
    yield declare
    for node in nodes:
        node.destroy_node()


def test_defaults_are_those_of_the_outer_class_and_given_values_go_before(declared):
    node, config = declared()
    assert config == Config() and config.path.force.steps == 7 and config.force.gain == 30.0
    assert node.get_parameter('force.gain').value == 30.0
    assert node.get_parameter('path.force.steps').value == 7
    _, config = declared({'force.gain': 5, 'path.force.gain': 6.0, 'path.cut': 0.0,
                          'method': 'moments', 'box': [3.0]})
    assert config == Config(Path(Force(6.0, 7), 0.0), Force(5.0), 'moments', (3.0,))


def test_descriptors(declared):
    node, _ = declared()
    gain, method = node.describe_parameters(['force.gain', 'method'])
    assert gain.description == 'of the force loop [1/s]' and gain.read_only
    assert (gain.floating_point_range[0].from_value,
            gain.floating_point_range[0].to_value) == (0.0, 1000.0)
    assert method.additional_constraints == 'one of fit, moments'
    steps = node.describe_parameters(['path.force.steps'])[0].integer_range[0]
    assert (steps.from_value, steps.to_value) == (1, 2**63 - 1)


@pytest.mark.parametrize('given, message', [
    ({'force.gain': 'much'}, "parameter 'force.gain' is 'much', must be a number"),
    ({'force.gain': -1.0}, "parameter 'force.gain'"),
    ({'path.force.steps': 0}, "parameter 'path.force.steps'"),
    ({'path.force.steps': 1.5}, "parameter 'path.force.steps'.*"),
    ({'method': 'guess'}, "parameter 'method' is 'guess', must be one of fit, moments"),
    ({'box': 'x'}, "parameter 'box' is 'x', must be a list"),
    ({'box': ['x']}, r"parameter 'box'\[0\] is 'x', must be a number")])
def test_refused(declared, given, message):
    with pytest.raises(ConfigurationError, match=f'^{message}'):
        declared(given)


@dataclass(frozen=True)
class Gains:
    gain: float = bounded(5.0, 'of the loop', '1/s', 1.0, 10.0, live=True)
    other: float = bounded(5.0, 'of the loop', '1/s', 1.0, 10.0, live=True)
    limit: float = bounded(8.0, 'of the speed', 'm/s', 1.0, 10.0)

    def __post_init__(self):
        if self.gain + self.other > 15.0:
            raise ConfigurationError('gain and other together must be at most 15')


@dataclass(frozen=True)
class Law:
    loop: Gains = field(default_factory=Gains)


def test_gains_change_within_bounds_and_limits_do_not(declared):
    node, _ = declared()
    declare_from(node, Law)
    applied = []
    follow_changes(node, Law, applied.append)

    def set_to(name, value):
        return node.set_parameters([Parameter(name, value=value)])[0]

    assert set_to('loop.gain', 7.0).successful
    assert applied == [Law(Gains(gain=7.0))]
    for name, value, reason in (
            ('loop.gain', 11.0, 'loop.gain'), ('loop.gain', 'much', 'must be a number'),
            ('loop.other', 9.0, 'together must be at most 15'),
            ('loop.limit', 9.0, 'read-only')):
        answer = set_to(name, value)
        assert not answer.successful and reason in answer.reason, answer.reason
    assert node.get_parameter('loop.gain').value == 7.0 and len(applied) == 1
