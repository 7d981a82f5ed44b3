"""Serial port of a sensor: open it for low latency, read available bytes."""
import errno
import os
import termios

import serial
from serial.tools import list_ports

REFUSALS = {
    errno.EACCES: 'may not be opened: join its group (often dialout), then log in anew',
    errno.EAGAIN: 'is in use by another program', errno.EBUSY: 'is in use by another program'}
READ_TIMEOUT = 0.02  # longest wait for a byte: a reader notices its end after this time [s]
MAX_READ = 1 << 16  # bytes of one read


def _refusal(error: Exception, path: str) -> str:
    if not os.path.exists(path):
        there = ', '.join(item.device for item in list_ports.comports()) or 'none'
        return f'is not there; serial ports there are: {there}'
    return REFUSALS.get(getattr(error, 'errno', 0), f'cannot be opened: {error}')


class SensorPort:
    """
    An open serial port, 8N1, for exclusive use.

    `path` is that of a device or of a link to it; `baud` is the line speed [bit/s]. The
    constructor, `read` and `write` raise an OSError if the port is absent, in use or lost.
    """

    def __init__(self, path: str, baud: int):
        self._path, self._device = path, os.path.realpath(path)
        try:
            self._serial = serial.Serial(
                path, baud, timeout=READ_TIMEOUT, write_timeout=1.0, exclusive=True)
        except (OSError, termios.error, ValueError) as error:  # ValueError: impossible baud
            raise OSError(f'{path} {_refusal(error, path)}') from error
        try:
            # Otherwise USB adapters delay bytes by up to 16 ms.
            self._serial.set_low_latency_mode(True)
        except (AttributeError, ValueError):  # other systems; pseudo-terminals and other drivers
            pass

    def read(self) -> bytes:
        """Return arrived bytes, at most `MAX_READ`; wait `READ_TIMEOUT` [s] for the first."""
        data = self._serial.read(min(self._serial.in_waiting, MAX_READ) or 1)
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
