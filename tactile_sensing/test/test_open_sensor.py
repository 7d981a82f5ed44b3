"""A sensor without ROS, on a pseudo-terminal: images, unplugging, silence, overload."""
import errno
import logging
import os
import threading
import time

import numpy as np
import pytest
from terminal import Terminal

from tactile_common.errors import ConfigurationError, TactileError
from tactile_sensing import open_sensor
from tactile_sensing.devices import stream
from tactile_sensing.devices.registry import options_of, protocol_named, PROTOCOLS

pytestmark = pytest.mark.graph  # real time: must not run in parallel with other tests
RATE = 100.0
DEADLINE = 20.0  # s


class Array(Terminal):
    """A device that sends frames, numbered in their first tactel, and receives commands."""

    def __init__(self, link, protocol='csv_lines', rate=RATE):
        row = protocol_named(protocol)
        self.shape, self._period = row.shape or (4, 6), 1.0 / rate
        self.device = row.device(**options_of(protocol, ''))
        self.sent = 0
        super().__init__(link)

    def plug_in(self):
        super().plug_in()
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(self.master, self._end))
        self._thread.start()

    def unplug(self):
        self._end.set()
        self._thread.join()
        super().unplug()

    def _run(self, master, end):
        begun = False
        while not end.wait(self._period):
            try:
                self.write(self.device.answer(os.read(master, 4096)))
            except BlockingIOError:
                pass
            if self.device.running:
                counts = np.full(self.shape, 7, np.uint8)
                counts[0, 0] = self.sent % 100
                self.write((b'' if begun else self.device.preamble) + self.device.encode(
                    counts, round(1e9 * self._period * self.sent)))
                begun, self.sent = True, self.sent + 1


@pytest.fixture
def plug(tmp_path):
    arrays = []

    def make(*args):
        arrays.append(Array(tmp_path / 'port', *args))
        return arrays[-1]
    yield make
    for array in arrays:
        array.unplug()


@pytest.mark.parametrize('protocol', PROTOCOLS)
def test_images_of_every_protocol(plug, protocol):
    array = plug(protocol)
    rows, columns = array.shape
    before = time.time_ns()
    with open_sensor(str(array.link), protocol, rows, columns, RATE) as sensor:
        images = [image for image, _ in zip(sensor, range(20), strict=False)]
    numbers = [int(image.counts[0, 0]) for image in images]
    assert numbers == list(range(numbers[0], numbers[0] + 20))
    assert all((image.counts.ravel()[1:] == 7).all() for image in images)
    assert [image.sequence for image in images] == list(range(20))
    stamps = np.array([image.stamp_ns for image in images])
    assert before < stamps[0] and np.all(np.diff(stamps) > 0) and stamps[-1] <= time.time_ns()
    assert list(sensor) == []  # it is closed


def test_a_device_is_started_and_stopped(plug):
    array = plug('weiss_wts')
    with open_sensor(str(array.link), 'weiss_wts', 4, 6, RATE) as sensor:
        next(sensor)
        assert array.device.running
    deadline = time.monotonic() + DEADLINE
    while array.device.running and time.monotonic() < deadline:
        time.sleep(0.01)
    assert not array.device.running


def test_a_device_that_restarts_is_asked_again(plug, monkeypatch):
    """A device may need seconds after power-up, or be switched off without its adapter."""
    monkeypatch.setattr(stream, 'ASK_AGAIN', 0.1)
    array = plug('robotiq_tsf85')
    with open_sensor(str(array.link), 'robotiq_tsf85', 7, 4, RATE) as sensor:
        next(sensor)
        array.device.running = False
        for _ in range(30):
            next(sensor)
    assert array.sent >= 30  # it is counted after it is sent


def test_unplugs(plug, caplog):
    """Recovers within two seconds without leaking threads or descriptors; one line per change."""
    array, waits = plug('csv_lines'), []
    caplog.set_level(logging.INFO, 'tactile_sensing')
    with open_sensor(str(array.link), rows=4, columns=6, rate=RATE) as sensor:
        next(sensor)
        threads, files = threading.active_count(), len(os.listdir('/proc/self/fd'))
        for _ in range(15):
            array.unplug()
            while not sensor.fault:
                sensor.read()
            array.plug_in()
            begin = time.monotonic()
            sensor.forget()
            next(sensor)
            waits.append(time.monotonic() - begin)
        assert (threading.active_count(), len(os.listdir('/proc/self/fd'))) == (threads, files)
    assert max(waits) < 2.0
    assert sensor.connections == 16
    lines = [record.getMessage() for record in caplog.records]
    assert len([line for line in lines if line.startswith('reading')]) == 16
    lost = [line for line in lines if 'is lost' in line]
    assert len(lost) == 15 and len(lines) == 31


def test_attempts_are_spaced_out_to_a_bound(tmp_path, monkeypatch):
    waits = []
    it = stream.SensorStream(str(tmp_path / 'none'), 'csv_lines', (4, 6))
    monkeypatch.setattr(it.closed, 'wait', lambda seconds: waits.append(seconds))
    for _ in range(10):
        assert it.read() == []
    np.testing.assert_allclose(waits, np.minimum(0.02 * 2.0**np.arange(10), 0.5))
    assert 'is not there' in it.trouble()


def test_what_does_not_come_is_explained(plug, monkeypatch):
    monkeypatch.setattr('tactile_sensing.devices.stream.PATIENCE', 1.5)
    array = plug('csv_lines')
    with open_sensor(str(array.link), rows=5, columns=6, rate=RATE) as sensor, pytest.raises(
            TactileError, match='a line holds 24 numbers, must hold 5x6 = 30: see'):
        next(sensor)
    array.device.running = False
    with open_sensor(str(array.link), rows=4, columns=6, rate=RATE) as sensor, pytest.raises(
            TactileError, match='is silent'):
        time.sleep(0.1)
        sensor.forget()
        next(sensor)


class SlowLine(Array):
    """A line on which a frame takes 20 ms, as 60 tactels do at 115,200 bit/s."""

    def write(self, data):
        for part in (data[:-2], data[-2:]):
            super().write(part)
            time.sleep(0.02 * bool(data))


def test_frames_of_a_slow_line_arrive(tmp_path):
    array = SlowLine(tmp_path / 'port')
    with open_sensor(str(array.link), rows=4, columns=6) as sensor:
        images = [image for image, _ in zip(sensor, range(20), strict=False)]
    array.unplug()
    assert len(images) == 20 and sensor.frames.stalled < 3


def test_a_rate_that_the_line_cannot_reach_is_explained(tmp_path, monkeypatch):
    monkeypatch.setattr(stream, 'PATIENCE', 1.5)
    array = SlowLine(tmp_path / 'port')
    with open_sensor(str(array.link), rows=4, columns=6, rate=200.0) as sensor, pytest.raises(
            TactileError, match='frames of 4x6 arrive on .*, but take 15 ms or longer'):
        next(sensor)
    array.unplug()
    assert sensor.decoder.frames


def test_a_sensor_that_falls_silent_ends_the_iteration(plug, monkeypatch):
    monkeypatch.setattr(stream, 'PATIENCE', 1.5)
    array = plug('csv_lines')
    with open_sensor(str(array.link), rows=4, columns=6) as sensor, pytest.raises(
            TactileError, match='is silent'):
        for image in sensor:
            array.device.running = image.sequence < 3


def test_a_reader_that_comes_late_gets_the_latest_images(plug):
    array = plug('csv_lines')
    with open_sensor(str(array.link), rows=4, columns=6, rate=RATE) as sensor:
        for _ in range(30):
            next(sensor)
        before = sensor.skipped
        sent = array.sent
        while array.sent < sent + 40:
            time.sleep(0.01)
        first = next(sensor)
        last = [next(sensor) for _ in range(len(sensor._images))][-1]
        assert last.stamp_ns - first.stamp_ns < 100_000_000 and last.sequence >= sent + 35
        assert sensor.skipped >= before + 25


def test_ports_that_are_not_there_or_taken(plug, tmp_path):
    with pytest.raises(OSError, match='none is not there; serial ports there are: '):
        open_sensor(str(tmp_path / 'none'))
    array = plug('csv_lines')
    with open_sensor(str(array.link)), pytest.raises(OSError, match='is in use by another'):
        open_sensor(str(array.link))


@pytest.mark.parametrize('number, words', [
    (errno.EACCES, r'port may not be opened: join its group'),
    (errno.EBUSY, r'port is in use by another'), (errno.EIO, r'port cannot be opened: \[Errno 5')])
def test_a_port_that_is_refused_says_why(tmp_path, monkeypatch, number, words):
    def refuse(*_, **__):
        raise OSError(number, 'no')
    (tmp_path / 'port').touch()
    monkeypatch.setattr(stream.serial, 'Serial', refuse)
    with pytest.raises(OSError, match=words):
        open_sensor(str(tmp_path / 'port'))


def test_wrong_arguments(tmp_path):
    for words, arguments in (('morse', {'protocol': 'morse'}), ('rows is 0', {'rows': 0}),
                             ('no option', {'stampp': 'us'}), ('kind is float64', {'kind': float}),
                             ('rate is -1.0 Hz, must be from 0', {'rate': -1.0})):
        with pytest.raises(ConfigurationError, match=words):
            open_sensor(str(tmp_path / 'none'), **arguments)


class Usb:
    def __init__(self, device, vid, pid, serial_number):
        self.device, self.vid, self.pid = device, vid, pid
        self.serial_number = serial_number


def test_a_port_by_what_it_is(monkeypatch):
    monkeypatch.setattr(stream.list_ports, 'comports', lambda: [
        Usb('/dev/ttyS0', None, None, None), Usb('/dev/ttyUSB0', 0x0403, 0x6001, 'A1'),
        Usb('/dev/ttyUSB1', 0x0403, 0x6001, 'B2'), Usb('/dev/ttyACM0', 0x2341, 0x0043, 'C3')])
    assert stream.device_path('/dev/ttyUSB7') == '/dev/ttyUSB7'
    assert stream.device_path('usb:2341:0043') == '/dev/ttyACM0'
    assert stream.device_path('usb:0403:6001:B2') == '/dev/ttyUSB1'
    with pytest.raises(OSError, match=r'there are: /dev/ttyUSB0 \(A1\), /dev/ttyUSB1 \(B2\)'):
        stream.device_path('usb:0403:6001')
    with pytest.raises(OSError, match='there are: none'):
        stream.device_path('usb:0403:6001:Z9')
