"""Serial port of a sensor: find it, open it for low latency, read available bytes."""
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
READ_TIMEOUT = 0.02  # longest wait for a byte: a reader notices its end after this time [s]
MAX_READ = 1 << 16  # bytes of one read
_USB = re.compile(r'usb:([0-9a-f]{4}):([0-9a-f]{4})(?::(.+))?', re.IGNORECASE)


def device_path(port: str) -> str:
    """
    Return the path of a port, given as a path or as `usb:VENDOR:PRODUCT[:SERIAL NUMBER]`.

    Vendor and product have four hexadecimal digits. Raises an OSError unless exactly one device
    matches.
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
    An open serial port, 8N1, for exclusive use.

    `port` is the path of a device, a link to it, or the form of `device_path`; `baud` is the line
    speed [bit/s]. The constructor, `read` and `write` raise an OSError if the port is absent, in
    use or lost. `caught_up_at` is the last `time.monotonic()` [s] at which fewer than
    `frame_size` bytes were waiting: bytes that are read now arrived later.
    """

    def __init__(self, port: str, baud: int, frame_size: int = 1):
        self._path, self._frame_size = device_path(port), frame_size
        self.caught_up_at = time.monotonic()
        self._device = os.path.realpath(self._path)
        try:
            self._serial = serial.Serial(
                self._path, baud, timeout=READ_TIMEOUT, write_timeout=1.0, exclusive=True)
        except (OSError, termios.error, ValueError) as error:  # ValueError: impossible baud
            raise OSError(f'{self._path} {_refusal(error, self._path)}') from error
        try:
            # Otherwise USB adapters delay bytes by up to 16 ms.
            self._serial.set_low_latency_mode(True)
        except (AttributeError, ValueError):  # other systems; pseudo-terminals and other drivers
            pass

    def read(self) -> bytes:
        """Return arrived bytes, at most `MAX_READ`; wait `READ_TIMEOUT` [s] for the first."""
        waiting = self._serial.in_waiting
        if waiting < self._frame_size:
            self.caught_up_at = time.monotonic()
        data = self._serial.read(min(waiting, MAX_READ) or 1)
        if not data and os.path.realpath(self._path) != self._device:
            raise OSError(f'{self._path} is another device now')
        return data

    def write(self, data: bytes) -> None:
        """Send bytes."""
        if data:
            self._serial.write(data)

    def close(self) -> None:
        """Close the port, so that other programs can open it."""
        self._serial.close()
