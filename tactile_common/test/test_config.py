"""Bounds of configuration fields: what is refused, with which words."""
from dataclasses import dataclass, field, replace
import math

import numpy as np
import pytest

from tactile_common.config import bounded, check_fields, checked, one_of
from tactile_common.errors import ConfigurationError
from tactile_common.parameter_file import ParameterFile
from tactile_common.yaml_file import parse_yaml


@dataclass(frozen=True)
class Force:
    gain: float = bounded(60.0, 'of the force loop', '1/s', 0.0, 1000.0)
    limits: tuple[float, ...] = bounded((1.0, 2.0), 'from, to', 'N', 0.0, 10.0)

    def __post_init__(self):
        check_fields(self, 'force.')


@dataclass(frozen=True)
class Config:
    rate: float = bounded(200.0, 'pictures', 'Hz', 1.0, 10000.0)
    count: int = bounded(3, 'how many', low=1)
    warmest: float = bounded(20.0, unit='K', high=300.0)
    shift: float = bounded(0.0, unit='m')
    method: str = one_of('fit', 'how', ['fit', 'moments'])
    loop: bool = False
    port: str = ''
    dead: tuple[int, ...] = ()
    seed: int | None = None
    free: float = math.inf  # no range: need not be finite
    force: Force = field(default_factory=Force)
    anything: object = None

    def __post_init__(self):
        check_fields(self)


@pytest.mark.parametrize('change', [
    {}, {'rate': 1}, {'rate': 10000.0}, {'rate': np.float32(5.0)}, {'count': np.int64(1)},
    {'method': 'moments'}, {'dead': (1, 2)}, {'dead': [1, 2]}, {'seed': 4},
    {'warmest': -1e9}, {'anything': 3}, {'loop': np.bool_(True)}])
def test_accepted(change):
    replace(Config(), **change)


@pytest.mark.parametrize('change, message', [
    ({'rate': 0.5}, 'rate is 0.5, must be between 1 and 10000 Hz'),
    ({'rate': math.nan}, 'rate is nan, must be between 1 and 10000 Hz'),
    ({'rate': 'fast'}, "rate is 'fast', must be a number"),
    ({'rate': True}, 'rate is True, must be a number'),
    ({'count': 0}, 'count is 0, must be finite and at least 1'),
    ({'count': -10**400}, f'count is -1{58 * "0"}, must be finite and at least 1'),
    ({'count': 2.0}, 'count is 2.0, must be an integer'),
    ({'warmest': 301.0}, 'warmest is 301.0, must be at most 300 K'),
    ({'shift': -math.inf}, 'shift is -inf, must be finite'),
    ({'method': 'guess'}, "method is 'guess', must be one of fit, moments"),
    ({'loop': 1}, 'loop is 1, must be a boolean'),
    ({'port': 7}, 'port is 7, must be a text'),
    ({'dead': 3}, 'dead is 3, must be a list'),
    ({'dead': (1, 2.5)}, 'dead[1] is 2.5, must be an integer'),
    ({'seed': 'x'}, "seed is 'x', must be an integer"),
    ({'force': 3.0}, 'force is 3.0, must be a Force')])
def test_refused(change, message):
    with pytest.raises(ConfigurationError) as error:
        replace(Config(), **change)
    assert str(error.value) == message


def test_prefix_items_and_the_type_that_was_asked_for():
    with pytest.raises(ConfigurationError, match=r'^force\.gain is -1\.0, must be between 0 and'):
        Force(gain=-1.0)
    with pytest.raises(ConfigurationError, match=r'^force\.limits\[1\] is 11\.0, must be .* N$'):
        Force(limits=(1.0, 11.0))
    assert type(checked('rate', 3, float)) is float
    assert checked('dead', [1, 2], tuple[int, ...]) == (1, 2)


@pytest.mark.parametrize('text, value', [('2e2', 200.0), ('1.5e+3', 1500.0), ('.5e1', 5.0)])
def test_an_exponent_in_a_parameter_file_is_that_of_a_number(tmp_path, text, value):
    path = tmp_path / 'own.yaml'
    path.write_text(f'/**/driver: {{ros__parameters: {{rate: {text}}}}}')
    assert ParameterFile(path).config('/tactile/driver', Config).rate == value


@pytest.mark.parametrize('value', ['x' * 1000, 10**400])
def test_a_value_that_is_no_float_is_refused_and_cut(value):
    with pytest.raises(ConfigurationError, match=r'^rate is .*, must be a number$') as error:
        checked('rate', value, float)
    assert len(str(error.value)) < 100


def test_a_text_that_begins_like_a_number_is_a_text():
    assert parse_yaml('[1e3_0.mcap, 1e3.mcap, 12e4x, 1e3]') == [
        '1e3_0.mcap', '1e3.mcap', '12e4x', 1000.0]


@pytest.mark.parametrize('text', ['!!int ""', '!!float ""', '!!bool x', '!!timestamp x'])
def test_a_value_that_is_not_of_its_tag_is_refused(text):
    with pytest.raises(ConfigurationError, match='^is not YAML: '):
        parse_yaml(f'a: {text}')


def test_a_huge_integer_is_refused_and_cut():
    with pytest.raises(ConfigurationError, match=r'^bits is 10{56,59}, must be between 1 and 16$'):
        checked('bits', 10**400, int, {'range': (1, 16)})
