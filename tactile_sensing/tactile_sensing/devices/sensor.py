"""A tactile array in three lines of Python, without ROS."""
import logging
import time
from typing import Any

from tactile_common.errors import TactileError
from tactile_sensing.devices.frame_clock import SensorImage
from tactile_sensing.devices.registry import options_of
from tactile_sensing.devices.stream import SensorStream

PATIENCE = 5.0  # s for the first image


class SensorSilentError(TactileError):
    """The port is open and no image comes; the message says what does come."""


class Sensor:
    """Iterate the images of an open sensor; also a context manager. See `open_sensor`."""

    def __init__(self, stream: SensorStream):
        self.stream = stream
        self._images: list[SensorImage] = []  # the oldest one last

    def __enter__(self) -> 'Sensor':
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    def close(self) -> None:
        """Close the port; no image comes any more."""
        self._images = []
        self.stream.close()

    def forget(self) -> None:
        """Drop what waits: the next image is a new one."""
        self._images = []
        for _ in range(2):
            self.stream.read()

    def __iter__(self) -> 'Sensor':
        return self

    def __next__(self) -> SensorImage:
        begin = time.monotonic()
        while not self._images:
            if self.stream.closed.is_set():
                raise StopIteration
            self._images = self.stream.read()[::-1]
            if not self.stream.decoder.frames and time.monotonic() - begin > PATIENCE:
                raise SensorSilentError(self.stream.trouble() or 'no image')
        return self._images.pop()


def open_sensor(port: str, protocol: str = 'csv_lines', rows: int = 16, columns: int = 16,
                rate: float = 200.0, **options: Any) -> Sensor:
    """
    Open a tactile array and return an iterator of its images, also a context manager.

    A port that is lost is opened again as soon as it is back; a line of the log
    `tactile_sensing` says so.

    Parameters
    ----------
    port : str
        Path of the serial port, or `usb:VENDOR:PRODUCT[:SERIAL NUMBER]`.
    protocol : str
    rows, columns : int
    rate : float
        Images a second [Hz], about; no more than six times as many are given.
    options
        `baud` [bit/s], `kind`, the type of the counts, and the protocol's own.

    Raises
    ------
    OSError
        The port is not there or in use.
    ConfigurationError
        Protocol, size or an option is wrong.
    """
    log = logging.getLogger('tactile_sensing')
    stream = SensorStream(
        port, protocol, (rows, columns), rate=rate, baud=options.pop('baud', 0),
        kind=options.pop('kind', None), options=options_of(protocol, options),
        tell=lambda text, gone: log.log(logging.WARNING if gone else logging.INFO, text))
    stream.connect()
    return Sensor(stream)
