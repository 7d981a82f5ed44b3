"""Serial port of a sensor: opening it for low latency and reading what is there."""
import os
import termios
import time

import serial

# Longest wait for a byte; bounds how long a reader takes to notice that it should stop [s].
READ_TIMEOUT = 0.02


class SensorPort:
    """
    An open serial port, 8N1, to be used as a context manager.

    The path is a device or a link to one, baud the line speed [bit/s]. Raises an OSError where
    the port is absent, in use or gone; `read` as well.

    Attributes
    ----------
    caught_up_at : float
        When fewer bytes than `frame_size` were waiting last, by `time.monotonic()` [s]. What is
        read came after that: a reader that comes late cannot know more.
    """

    def __init__(self, path: str, baud: int, frame_size: int = 1):
        self._path, self._frame_size = path, frame_size
        self.caught_up_at = time.monotonic()
        self._device = os.path.realpath(path)
        try:
            self._serial = serial.Serial(path, baud, timeout=READ_TIMEOUT, exclusive=True)
        except (termios.error, ValueError) as error:  # gone while it was opened; impossible baud
            raise OSError(f'could not configure port {path}: {error}') from error
        try:
            # USB adapters hold bytes back for up to 16 ms otherwise.
            self._serial.set_low_latency_mode(True)
        except (AttributeError, ValueError):  # other systems; pseudo-terminals and other drivers
            pass

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._serial.close()

    def read(self) -> bytes:
        """Return what has arrived, waiting up to `READ_TIMEOUT` for a first byte."""
        waiting = self._serial.in_waiting
        if waiting < self._frame_size:
            self.caught_up_at = time.monotonic()
        data = self._serial.read(waiting or 1)
        if not data and os.path.realpath(self._path) != self._device:
            raise OSError(f'{self._path} is another device now')
        return data
