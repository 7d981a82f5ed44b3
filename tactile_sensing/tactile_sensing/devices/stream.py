"""A sensor on a serial port that may come and go: frames with their times, without a thread."""
from collections.abc import Callable, Mapping
import logging
import threading
import time
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from tactile_common.errors import TactileError
from tactile_sensing.devices.frame_clock import FrameClock, SensorImage
from tactile_sensing.devices.registry import options_of, protocol_named
from tactile_sensing.devices.serial_port import SensorPort

BACK_OFF = 0.02, 0.5  # s from one attempt to open the port to the next: at first, at most
ASK_AGAIN = 2.0  # s without a frame after which a device is asked to send again: it has restarted
SILENCE = 1.0  # s without a byte or a frame that is reported
PATIENCE = 5.0  # s for the first image


class SensorSilentError(TactileError):
    """The port is open and no image comes; the message says what does come."""


class SensorStream:
    """
    Open the port of a sensor, start it and read it; open it again whenever it is lost.

    Iterate its images until it is closed, or `read` what has come; it is a context manager as
    well. See `open_sensor`; a rate or baud of 0 and a kind of None are the protocol's. `now_ns`
    is the clock of the stamps; `tell` takes a line whenever the port has come or gone, and whether
    it has gone.
    """

    def __init__(self, port: str, protocol: str, shape: tuple[int, int], *,
                 kind: DTypeLike = None, rate: float = 0.0, baud: int = 0,
                 options: Mapping[str, Any] | None = None,
                 now_ns: Callable[[], int] = time.time_ns,
                 tell: Callable[[str, bool], None] = lambda text, gone: None):
        row = protocol_named(protocol)
        kind = np.dtype(row.kind if kind is None else kind)
        self.decoder = row.decoder(*shape, kind, **options or {})
        self._start = self.decoder.start(rate or 100.0)
        self.frames = FrameClock(self.decoder, rate)
        self.port, self._frame_size = port, shape[0] * shape[1] * kind.itemsize
        self._baud, self._now_ns, self._tell = baud or row.baud_rate, now_ns, tell
        self.fault = f'{port} is not open yet'  # why; empty where it is
        self.connections = 0  # how often the port was opened
        self.skipped = 0  # frames that were passed over as newer ones were there
        self.last_byte_at = self.last_frame_at = self._asked_at = time.monotonic()
        self._back_off, self._news = BACK_OFF[0], False
        self._line: SensorPort | None = None
        self._last = b''
        self._images: list[SensorImage] = []  # that iteration has not given, the oldest one last
        self.closed = threading.Event()

    def __enter__(self) -> 'SensorStream':
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    def __iter__(self) -> 'SensorStream':
        return self

    def __next__(self) -> SensorImage:
        begin = time.monotonic()
        while not self._images:
            if self.closed.is_set():
                raise StopIteration
            self._images = self.read()[::-1]
            if not self.decoder.frames and time.monotonic() - begin > PATIENCE:
                raise SensorSilentError(self.trouble() or 'no image')
        return self._images.pop()

    def forget(self) -> None:
        """Drop what waits: the next image is a new one."""
        self._images = []
        for _ in range(2):
            self.read()

    def connect(self) -> None:
        """Open the port and start the sensor; raises an OSError where that fails."""
        self._line = SensorPort(self.port, self._baud, self._frame_size)
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
        """Return the images that have come, soon; without a port none, and after a while."""
        if self._line is None:
            self._wait()
            return []
        try:
            data, caught_up_at = self._line.read(), self._line.caught_up_at
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
        frames = self.frames.receive(data, now_ns, now_ns - round(1e9 * (now - caught_up_at)))
        if not frames:
            return []
        self.last_frame_at = now
        # Only the last .1 s of a read: a reader that is too slow gets the latest.
        recent = [item for item in frames if frames[-1].stamp_ns - item.stamp_ns < 100_000_000]
        self.skipped += len(frames) - len(recent)
        return recent

    def trouble(self) -> str:
        """Return why no frames come; empty where they do."""
        now = time.monotonic()
        if self.fault:
            return self.fault
        if now - self.last_byte_at > SILENCE:
            return f'{self.port} is silent: is it the right port, and has the sensor power?'
        if now - self.last_frame_at <= SILENCE:
            return ''
        rows, columns = self.decoder.shape
        reason = self.decoder.explain() or (
            f'wrong protocol, size or line speed ({self._baud} bit/s); they end with '
            f'{self._last!r}')
        return f'bytes arrive on {self.port}, but no frame of {rows}x{columns}: {reason}'

    def counters(self) -> dict[str, Any]:
        """Return what is reported: numbers since the start, and what is the case."""
        decoder, frames = self.decoder, self.frames
        found = {name: getattr(decoder, name) for name in (
            'frames', 'lost_frames', 'resyncs', 'dropped_bytes', 'check_errors', 'locked')}
        found |= {'stalled_frames': frames.stalled, 'thinned_frames': frames.thinned,
                  'skipped_frames': self.skipped, 'connections': self.connections,
                  'jitter_ms': f'{1e-6 * frames.jitter_ns:.2f}'}
        if decoder.temperature is not None:
            found['temperature'] = f'{decoder.temperature:g}'
        return found

    def close(self) -> None:
        """Stop the sensor and close the port; no image comes any more."""
        self.closed.set()
        self._images = []
        if self._line is not None:
            try:
                self._line.write(self.decoder.stop())
            except OSError:  # it is gone
                pass
        self._release()

    def _release(self) -> None:
        if self._line is not None:
            self._line.close()
        self._line = None

    def _wait(self) -> None:
        """Wait for the next attempt, and make it."""
        if self.closed.wait(self._back_off):
            return
        if self._news:  # not at once: what ends together with its sensor warns of nothing
            self._news = False
            self._tell(self.fault, True)
        self._back_off = min(2.0 * self._back_off, BACK_OFF[1])
        try:
            self.connect()
        except OSError as error:
            self.fault = str(error)


def open_sensor(port: str, protocol: str = 'csv_lines', rows: int = 16, columns: int = 16,
                rate: float = 200.0, **options: Any) -> SensorStream:
    """
    Open a tactile array: iterate its images; it is a context manager as well.

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
    return stream
