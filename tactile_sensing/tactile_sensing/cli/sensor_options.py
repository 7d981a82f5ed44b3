"""What commands on a sensor's port share: which sensor it is, and how it is opened."""
import argparse

from tactile_common.command_line import between
from tactile_common.errors import ConfigurationError
from tactile_sensing.devices.registry import options_of, PROTOCOLS
from tactile_sensing.devices.sensor import open_sensor, Sensor


def add_sensor(arguments: argparse.ArgumentParser, required: bool = False) -> None:
    """Add the options that `opened` reads, but `--shape`."""
    add = arguments.add_argument
    add('--port', required=required, metavar='PORT', help='serial port of the sensor, for '
        'instance /dev/ttyUSB0 or usb:VENDOR:PRODUCT[:SERIAL NUMBER]')
    add('--protocol', choices=PROTOCOLS, default='csv_lines',
        help='byte protocol (default: %(default)s)')
    add('--options', default='', metavar='TEXT', help='of the protocol, for instance '
        "'stamp=us checksum=true'")
    add('--rate', type=between(0.1, 10e3, 'Hz'), default=200.0, metavar='HZ',
        help='images a second, about (default: %(default)g)')
    add('--baud', type=between(0, 12_000_000, 'bit/s', int), default=0, metavar='BAUD',
        help="line speed (default: the protocol's)")


def opened(options: argparse.Namespace) -> Sensor:
    """Open the sensor of the options; OSError, ConfigurationError: see `open_sensor`."""
    if not options.shape:
        raise ConfigurationError('--shape R C is missing: rows and columns of the sensor')
    rows, columns = options.shape
    return open_sensor(options.port, options.protocol, rows, columns, options.rate,
                       baud=options.baud, **options_of(options.protocol, options.options))
