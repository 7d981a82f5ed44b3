"""Serial port of a sensor: finding it, opening it for low latency, reading what is there."""
import errno
import os
import re
import termios
import time

import serial
from serial.tools import list_ports

REFUSALS = {
    errno.EACCES: 'may not be opened: join its group (often dialout), then log in anew',
    errno.EAGAIN: 'is in use by another program', errno.EBUSY: 'is in use by another program'}
_USB = re.compile(r'usb:([0-9a-f]{4}):([0-9a-f]{4})(?::(.+))?', re.IGNORECASE)


def device_path(port: str) -> str:
    """
    Return the path of a port: what is given, or that of `usb:VENDOR:PRODUCT[:SERIAL NUMBER]`.

    Vendor and product have four hexadecimal digits. Raises an OSError where no device or several
    ones are of that kind.
    """
    usb = _USB.fullmatch(port)
    if not usb:
        return port
    vendor, product, number = int(usb[1], 16), int(usb[2], 16), usb[3]
    found = [item for item in list_ports.comports() if (item.vid, item.pid) == (vendor, product)
             and number in (None, item.serial_number)]
    if len(found) != 1:
        there = ', '.join(f'{item.device} ({item.serial_number})' for item in found) or 'none'
        raise OSError(f'{port} must be one device, there are: {there}')
    return found[0].device


def _refusal(error: Exception, path: str) -> str:
    if not os.path.exists(path):
        there = ', '.join(item.device for item in list_ports.comports()) or 'none'
        return f'is not there; serial ports there are: {there}'
    return REFUSALS.get(getattr(error, 'errno', 0), f'cannot be opened: {error}')


class SensorPort:
    """
    An open serial port, 8N1.

    The port is a device, a link to one, or see `device_path`; baud the line speed [bit/s]. Nobody
    else can open it meanwhile. Raises an OSError where the port is absent, in use or gone; `read`
    and `write` as well. `caught_up_at` is when fewer bytes than `frame_size` were waiting last,
    by `time.monotonic()` [s]: what is read came after that.
    """

    def __init__(self, port: str, baud: int, frame_size: int = 1):
        self._path, self._frame_size = device_path(port), frame_size
        self.caught_up_at = time.monotonic()
        self._device = os.path.realpath(self._path)
        try:
            self._serial = serial.Serial(
                self._path, baud, timeout=0.02, write_timeout=1.0, exclusive=True)
        except (OSError, termios.error, ValueError) as error:  # the last one: impossible baud
            raise OSError(f'{self._path} {_refusal(error, self._path)}') from error
        try:
            # USB adapters hold bytes back for up to 16 ms otherwise.
            self._serial.set_low_latency_mode(True)
        except (AttributeError, ValueError):  # other systems; pseudo-terminals and other drivers
            pass

    def read(self) -> bytes:
        """Return what has arrived, 64 kB at most, waiting up to 20 ms for a first byte."""
        waiting = self._serial.in_waiting
        if waiting < self._frame_size:
            self.caught_up_at = time.monotonic()
        data = self._serial.read(min(waiting, 1 << 16) or 1)
        if not data and os.path.realpath(self._path) != self._device:
            raise OSError(f'{self._path} is another device now')
        return data

    def write(self, data: bytes) -> None:
        """Send bytes."""
        if data:
            self._serial.write(data)

    def close(self) -> None:
        """Let others have it."""
        self._serial.close()
