"""Read frames with stamps from a serial port that may disappear and return; without a thread."""
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, suppress
import errno
import logging
import os
import re
import termios
import threading
import time
from typing import Any

import numpy as np
from numpy.typing import DTypeLike
import serial
from serial.tools import list_ports

from tactile_common.errors import TactileError
from tactile_sensing.devices.frame_clock import FrameClock, SensorImage
from tactile_sensing.devices.registry import options_of, protocol_named

REFUSALS = {
    errno.EACCES: 'may not be opened: join its group (often dialout), then log in anew',
    errno.EAGAIN: 'is in use by another program', errno.EBUSY: 'is in use by another program'}
READ_TIMEOUT = 0.02  # longest wait for a byte: a reader notices its end after this time [s]
MAX_READ = 1 << 16  # bytes of one read
USUAL_RATE = 100.0  # image rate that a device is asked for if none is known [Hz]
LAG_NS = 100_000_000  # frames older by this than the newest of a read are discarded [ns]
BACK_OFF = 0.02, 0.5  # first and largest time between attempts to open the port [s]
ASK_AGAIN = 2.0  # repeat the start command after this time without a frame: device restarted? [s]
SILENCE = 1.0  # time without a byte or a frame after which this is reported [s]
PATIENCE = 5.0  # longest wait for an image while the port is open [s]
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


def open_port(port: str, baud: int) -> serial.Serial:
    """Open a port, 8N1, for exclusive use; raise an OSError that says why it cannot be opened."""
    path = device_path(port)
    try:
        line = serial.Serial(
            path, baud, timeout=READ_TIMEOUT, write_timeout=1.0, exclusive=True)
    except (OSError, termios.error, ValueError) as error:  # ValueError: impossible baud
        why = REFUSALS.get(getattr(error, 'errno', 0), f'cannot be opened: {error}')
        if not os.path.exists(path):
            there = ', '.join(item.device for item in list_ports.comports()) or 'none'
            why = f'is not there; serial ports there are: {there}'
        raise OSError(f'{path} {why}') from error
    # Otherwise USB adapters delay bytes by up to 16 ms. Not on pseudo-terminals, other systems.
    with suppress(AttributeError, ValueError):
        line.set_low_latency_mode(True)
    return line


class SensorStream(Iterator[SensorImage], AbstractContextManager['SensorStream']):
    """
    Open the port of a sensor, start the sensor and read it; reopen the port whenever it is lost.

    Iterate over its images until it is closed, or call `read`; it is also a context manager. The
    iteration raises a TactileError if no image comes from an open port for `PATIENCE`. For the
    arguments see `open_sensor`. A baud of 0 and a kind of None mean those of the protocol. A
    rate of 0 means unknown; the device is then asked for `USUAL_RATE`. `now_ns` is the clock of
    the stamps. `tell(text, gone)` is called whenever the port is opened or lost.
    """

    def __init__(self, port: str, protocol: str, shape: tuple[int, int], *,
                 kind: DTypeLike = None, rate: float = 0.0, baud: int = 0,
                 options: Mapping[str, Any] | None = None,
                 now_ns: Callable[[], int] = time.time_ns,
                 tell: Callable[[str, bool], None] = lambda text, gone: None):
        row = protocol_named(protocol)
        kind = np.dtype(row.kind if kind is None else kind)
        self.decoder = row.decoder(*shape, kind, **options or {})
        self._start = self.decoder.start(rate or USUAL_RATE)
        self.frames = FrameClock(self.decoder, rate)
        self.port, self._frame_size = port, shape[0] * shape[1] * kind.itemsize
        self._baud, self._now_ns, self._tell = baud or row.baud_rate, now_ns, tell
        self.fault = f'{port} is not open yet'  # empty if it is open
        self.connections = 0  # how often the port was opened
        self.skipped = 0  # frames that were discarded because newer ones had arrived
        self.last_byte_at = self.last_frame_at = self._asked_at = time.monotonic()
        self._stalled = 0  # frames that were rejected before the last image
        self._back_off, self._news = BACK_OFF[0], False
        self._line: serial.Serial | None = None
        self._device = ''  # path of the open port without links
        # The last time at which less than a frame was waiting: bytes read now arrived later.
        self._caught_up_at = 0.0
        self._last = b''
        self._images: list[SensorImage] = []  # not yet returned by iteration, the oldest last
        self.closed = threading.Event()

    def __exit__(self, *_: Any) -> None:
        self.close()

    def __next__(self) -> SensorImage:
        begin = time.monotonic()
        while not self._images:
            if self.closed.is_set():
                raise StopIteration
            self._images = self.read()[::-1]
            since = max(begin, self.last_frame_at)
            if not (self._images or self.fault) and time.monotonic() - since > PATIENCE:
                raise TactileError(self.trouble())
        return self._images.pop()

    def forget(self) -> None:
        """Discard waiting images, so that the next image is a new one."""
        self._images = []
        for _ in range(2):
            self.read()

    def connect(self) -> None:
        """Open the port and start the sensor; raise an OSError if that fails."""
        self._caught_up_at = time.monotonic()
        self._line = open_port(self.port, self._baud)
        self._device = os.path.realpath(self._line.port)
        try:
            self._line.write(self._start)
        except OSError:
            self._release()
            raise
        self.frames.restart()
        self.fault, self._back_off = '', BACK_OFF[0]
        self.last_byte_at = self.last_frame_at = self._asked_at = time.monotonic()
        self.connections += 1
        self._tell(f'reading {self.port}', False)

    def read(self) -> list[SensorImage]:
        """Return the new images; without a port, wait, try to open it and return none."""
        if self._line is None:
            self._wait()
            return []
        try:
            waiting = self._line.in_waiting
            if waiting < self._frame_size:
                self._caught_up_at = time.monotonic()
            data = self._line.read(min(waiting, MAX_READ) or 1)
            if not data and os.path.realpath(self._line.port) != self._device:
                raise OSError(f'{self._line.port} is another device now')
            now, now_ns = time.monotonic(), self._now_ns()
            if now - max(self.last_frame_at, self._asked_at) > ASK_AGAIN:
                self._asked_at = now
                self._line.write(self._start)
        except OSError as error:
            self._release()
            self.fault, self._news = f'{self.port} is lost: {error}', True
            return []
        if not data:
            return []
        self.last_byte_at, self._last = now, (self._last + data)[-24:]
        frames = self.frames.receive(
            data, now_ns, now_ns - round(1e9 * (now - self._caught_up_at)))
        if not frames:
            return []
        self.last_frame_at, self._stalled = now, self.frames.stalled
        # A slow reader gets only the latest images.
        recent = [item for item in frames if frames[-1].stamp_ns - item.stamp_ns < LAG_NS]
        self.skipped += len(frames) - len(recent)
        return recent

    def trouble(self) -> str:
        """Return why no frames arrive; empty if they do."""
        now = time.monotonic()
        if self.fault:
            return self.fault
        if now - self.last_byte_at > SILENCE:
            return f'{self.port} is silent: is it the right port, and has the sensor power?'
        if now - self.last_frame_at <= SILENCE:
            return ''
        rows, columns = self.decoder.shape
        if self.frames.stalled > self._stalled:
            return (f'frames of {rows}x{columns} arrive on {self.port}, but take '
                    f'{1e-6 * self.frames.stall_ns():.0f} ms or longer, too long at the stated '
                    'rate: lower it, or raise the line speed')
        reason = self.decoder.explain() or (
            f'wrong protocol, size or line speed ({self._baud} bit/s); they end with '
            f'{self._last!r}')
        return f'bytes arrive on {self.port}, but no frame of {rows}x{columns}: {reason}'

    def counters(self) -> dict[str, Any]:
        """Return the values for diagnostics: counters since the start, and the present state."""
        frames = self.frames
        found = {name: getattr(self.decoder, name) for name in (
            'frames', 'lost_frames', 'dropped_bytes', 'check_errors', 'locked')}
        return found | {
            'stalled_frames': frames.stalled, 'thinned_frames': frames.thinned,
            'skipped_frames': self.skipped, 'connections': self.connections,
            'jitter_ms': f'{1e-6 * frames.jitter_ns:.2f}'}

    def close(self) -> None:
        """Stop the sensor and close the port; iteration then ends."""
        self.closed.set()
        self._images = []
        if self._line is not None:
            try:
                self._line.write(self.decoder.stop())
            except OSError:  # the port is lost
                pass
        self._release()

    def _release(self) -> None:
        if self._line is not None:
            self._line.close()
        self._line = None

    def _wait(self) -> None:
        """Wait for the time of the next attempt, then try to open the port."""
        if self.closed.wait(self._back_off):
            return
        if self._news:  # only now: no warning if the program ends together with the sensor
            self._news = False
            self._tell(self.fault, True)
        self._back_off = min(2.0 * self._back_off, BACK_OFF[1])
        try:
            self.connect()
        except OSError as error:
            self.fault = str(error)


def open_sensor(port: str, protocol: str = 'csv_lines', rows: int = 16, columns: int = 16,
                rate: float = 0.0, **options: Any) -> SensorStream:
    """
    Open a tactile array and return a stream to iterate over; it is also a context manager.

    A lost port is reopened as soon as it returns; both events are logged to `tactile_sensing`.

    Parameters
    ----------
    port : str
        Path of the serial port, or `usb:VENDOR:PRODUCT[:SERIAL NUMBER]`.
    protocol : str
    rows, columns : int
    rate : float
        Approximate image rate [Hz]; at most six times this rate is returned, and no frame whose
        bytes take three periods or more. 0: unknown.
    options
        `baud` [bit/s]; `kind`, the type of the counts; and the options of the protocol.

    Raises
    ------
    OSError
        If the port does not exist or is in use.
    ConfigurationError
        If protocol, size or an option is wrong.
    """
    log = logging.getLogger('tactile_sensing')
    stream = SensorStream(
        port, protocol, (rows, columns), rate=rate, baud=options.pop('baud', 0),
        kind=options.pop('kind', None), options=options_of(protocol, options),
        tell=lambda text, gone: log.log(logging.WARNING if gone else logging.INFO, text))
    stream.connect()
    return stream
