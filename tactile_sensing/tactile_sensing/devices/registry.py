"""Byte protocols that driver and mock sensor know: one row each."""
from tactile_common.errors import ConfigurationError
from tactile_sensing.devices import flexitac
from tactile_sensing.devices.protocol import SensorProtocol

PROTOCOLS = {
    'flexitac': SensorProtocol(
        flexitac.FlexiTacDecoder, flexitac.encode_next, flexitac.MARKER, flexitac.BAUD_RATE,
        'flexitac_16x16.yaml'),
}


def protocol_named(name: str) -> SensorProtocol:
    """Return the protocol of a name; ConfigurationError where there is none."""
    if name not in PROTOCOLS:
        raise ConfigurationError(f'protocol is {name!r}, must be one of {", ".join(PROTOCOLS)}')
    return PROTOCOLS[name]
