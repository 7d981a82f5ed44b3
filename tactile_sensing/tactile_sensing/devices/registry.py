"""Byte protocols of driver and mock sensor; other packages add protocols by an entry point."""
from collections.abc import Mapping
from importlib.metadata import entry_points
from typing import Any

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_sensing.devices import flexitac, lines, robotiq, weiss
from tactile_sensing.devices.protocol import SensorProtocol

GROUP = 'tactile_sensing.protocols'  # group of entry points: name -> SensorProtocol
OWN = {
    'flexitac': SensorProtocol(
        flexitac.FlexiTacDecoder, flexitac.FlexiTacDevice, 2_000_000,
        calibration='flexitac_16x16.yaml'),
    'csv_lines': SensorProtocol(
        lines.CsvDecoder, lines.CsvDevice, 115200, np.int32,
        options={'stamp': '', 'checksum': False}),
    'vitac': SensorProtocol(lines.VitacDecoder, lines.VitacDevice, 2_000_000),
    'weiss_wts': SensorProtocol(
        weiss.WeissDecoder, weiss.WeissDevice, 115200, np.uint16,
        options={'rle': False, 'cells': 0, 'first': 0}),
    'weiss_dsa': SensorProtocol(
        weiss.DsaDecoder, weiss.DsaDevice, 115200, np.uint16,
        options={'rle': True, 'cells': 0, 'first': 0}),
    'robotiq_tsf85': SensorProtocol(
        robotiq.TsfDecoder, robotiq.TsfDevice, 115200, np.uint16, robotiq.SHAPE,
        options={'finger': 0}),
}
_OTHERS = {point.name: point for point in entry_points(group=GROUP)}
PROTOCOLS = (*OWN, *sorted(_OTHERS.keys() - OWN.keys()))  # names


def protocol_named(name: str) -> SensorProtocol:
    """Return a protocol by name; raise a ConfigurationError if there is none."""
    if name in OWN:
        return OWN[name]
    if name not in _OTHERS:
        raise ConfigurationError(f'protocol is {name!r}, must be one of {", ".join(PROTOCOLS)}')
    try:
        found = _OTHERS[name].load()
    except Exception as error:  # another package may raise anything
        raise ConfigurationError(f'protocol {name} cannot be loaded: {error}') from error
    if not isinstance(found, SensorProtocol):
        raise ConfigurationError(f'protocol {name}: {_OTHERS[name].value} is no SensorProtocol')
    return found


def options_of(name: str, given: str | Mapping[str, Any]) -> dict[str, Any]:
    """
    Return the options of a protocol as keyword arguments of its decoder.

    `given` is a mapping or a text `name=value name=value`. Raises a ConfigurationError if an
    option is unknown or has a wrong type.
    """
    known, values = protocol_named(name).options, {}
    words = {'true': True, 'yes': True, '1': True, 'false': False, 'no': False, '0': False}
    if isinstance(given, str):
        given = dict(item.partition('=')[::2] for item in given.replace(',', ' ').split())
    for key, value in given.items():
        if key not in known:
            there = ', '.join(known) or 'none'
            raise ConfigurationError(f'{name} has no option {key!r}, there are: {there}')
        kind = type(known[key])
        try:
            of_text = kind is bool and isinstance(value, str)
            values[key] = words[value.lower()] if of_text else kind(value)
            if not isinstance(value, str) and values[key] != value:
                raise ValueError
        except (KeyError, TypeError, ValueError):
            raise ConfigurationError(
                f'option {key} is {value!r}, must be of the type {kind.__name__}') from None
    return {**known, **values}
