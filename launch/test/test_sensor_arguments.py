"""What the launch arguments of a sensor give the driver, and which are refused."""
from pathlib import Path
import re

import pytest

from edge_tracking.parameters import driver_parameters
from tactile_common.errors import ConfigurationError
from tactile_sensing.devices.registry import protocol_named, PROTOCOLS


def given(**values):
    return driver_parameters({'sensor': 'mock', 'port': '', 'topic': '', 'options': '',
                              'calibration': '', **values})


def test_each_road():
    assert given() == given(sensor='none') == {}
    assert given(calibration='a.yaml') == {'calibration': 'a.yaml'}
    assert given(sensor='flexitac', port='/dev/x') == {'port': '/dev/x', 'protocol': 'flexitac'}
    assert given(sensor='topic', topic='/raw', calibration='a.yaml') == {
        'topic': '/raw', 'calibration': 'a.yaml'}
    assert given(sensor='csv_lines', port='/dev/x', calibration='a.yaml',
                 options='stamp=us,checksum=true') == {
        'port': '/dev/x', 'protocol': 'csv_lines', 'calibration': 'a.yaml',
        'options': 'stamp=us,checksum=true'}


@pytest.mark.parametrize('sensor', PROTOCOLS)
def test_every_protocol_needs_its_port_and_most_a_calibration(sensor):
    with pytest.raises(ConfigurationError, match=f'sensor:={sensor} needs its port, for instance'):
        given(sensor=sensor, calibration='a.yaml')
    if not protocol_named(sensor).calibration:
        with pytest.raises(ConfigurationError, match=f'sensor:={sensor} needs calibration:=FILE'):
            given(sensor=sensor, port='/dev/x')


def test_the_page_has_a_line_for_every_sensor():
    page = (Path(__file__).parents[2] / 'docs/array.md').read_text('utf-8')
    rows = [dict(item.split(':=') for item in text.split())
            for text in re.findall(r'^\|.*`(sensor:=\w.*?)` \|', page, re.M)]
    assert {row['sensor'] for row in rows} == {*PROTOCOLS, 'topic', 'none'}
    for row in rows:
        given(calibration='mine.yaml', **row)


@pytest.mark.parametrize('values, reason', [
    ({'sensor': 'topic'}, 'sensor:=topic needs its topic, for instance topic:=/my_sensor/image'),
    ({'sensor': 'topic', 'topic': '/raw'}, 'sensor:=topic needs calibration:=FILE.yaml'),
    ({'sensor': 'vitac', 'port': 'x', 'calibration': 'a', 'options': 'b=1'}, "no option 'b'")])
def test_what_is_refused(values, reason):
    with pytest.raises(ConfigurationError, match=reason):
        given(**values)
