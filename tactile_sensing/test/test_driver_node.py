"""The driver node on a pseudo-terminal, in a private context per test."""
from contextlib import contextmanager, ExitStack
import dataclasses
import math
from pathlib import Path
import signal
import subprocess
import sys
import time

from diagnostic_msgs.msg import DiagnosticStatus
from driver_bench import Bench
import numpy as np
import pytest
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger
from terminal import Terminal

from tactile_common.errors import ConfigurationError
from tactile_common.ros.conversions import stamp_to_ns
from tactile_sensing.conversions import image_from_msg
from tactile_sensing.devices.calibration import Calibration
from tactile_sensing.devices.flexitac import FlexiTacDevice, MARKER
from tactile_sensing.devices.image_converter import TARE_FRAMES
from tactile_sensing.nodes.driver import DriverNode

SHAPE = (4, 5)
BASELINE = 10
CALIBRATION = Calibration.uncalibrated(*SHAPE, 0.001, baseline=BASELINE, acquisition_delay=0.0025)
ERROR, WARN, OK = DiagnosticStatus.ERROR, DiagnosticStatus.WARN, DiagnosticStatus.OK


def unloaded(value=BASELINE):
    return np.full(SHAPE, value, np.uint8)


class Device(Terminal):
    """A sensor that sends continuously."""

    def plug_in(self):
        super().plug_in()
        self.write(MARKER)

    def send(self, counts):
        """Send one image and, like a free-running device, directly the next marker."""
        self.write(FlexiTacDevice().encode(counts))


class Graph(Bench):
    def __init__(self, device, calibration=CALIBRATION, **parameters):
        self.device = device
        super().__init__(calibration, '/tactile', port=str(device.link), **parameters)
        self.tare_client = self.node.create_client(Trigger, 'driver/tare')

    def connect(self):
        self.until(lambda: self.node.count_publishers('image') == 1
                   and self.driver.count_subscribers('image') == 1
                   and self.tare_client.service_is_ready(), 'discovery')
        # Matched is not yet connected: send until images arrive in lock.
        self.stream(unloaded(), lambda: len(self.images) >= 3)
        sent = [-math.inf]

        def send() -> None:
            if time.monotonic() > sent[-1] + 1.0:  # it is dropped if the reader was held up
                sent.append(time.monotonic())
                self.device.send(unloaded(99))
        self.until(
            lambda: self.images[-1].layers[0].stress[0] == 99 - BASELINE, 'the last one', send)
        self.images.clear()

    def stream(self, counts, condition):
        """Send one image repeatedly until a condition holds."""
        self.until(condition, 'what is awaited', lambda: self.device.send(counts))

    def tare(self):
        answer = self.tare_client.call_async(Trigger.Request())
        self.until(answer.done, 'an answer')
        return answer.result()


@pytest.fixture
def device(tmp_path):
    device = Device(tmp_path / 'port')
    yield device
    device.unplug()


@pytest.fixture
def make_graph(device):
    with ExitStack() as graphs:
        yield lambda **values: graphs.enter_context(Graph(device, **values))


@pytest.fixture
def graph(make_graph):
    """Give a driver whose images arrive."""
    graph = make_graph()
    graph.connect()
    return graph


def test_pictures_are_published_as_sent(graph):
    rng = np.random.default_rng(0)
    sent = [rng.integers(0, 256, SHAPE, np.uint8) for _ in range(50)]
    for k, counts in enumerate(sent):
        before = graph.driver.get_clock().now().nanoseconds
        graph.device.send(counts)
        graph.until(lambda k=k: len(graph.images) > k, f'picture {k}')
        stamp = stamp_to_ns(graph.images[k].header.stamp)
        assert before - 2_500_000 <= stamp <= graph.driver.get_clock().now().nanoseconds
    for counts, message in zip(sent, graph.images, strict=True):
        image = image_from_msg(message)
        want = np.where(counts == 255, np.nan, counts.astype(np.float32) - BASELINE)
        np.testing.assert_array_equal(image.layers[0].stress, want)
        assert image.saturated == np.count_nonzero(counts == 255)
        assert (image.frame_id, image.sensor, image.tared) == ('tactile_pad', 'flexitac', False)
    sequences = [message.sequence for message in graph.images]
    assert sequences == list(range(sequences[0], sequences[0] + len(sent)))


def test_tare_on_request(graph):
    graph.until(lambda: graph.infos, 'sensor_info')
    assert stamp_to_ns(graph.infos[-1].tared_at) == 0
    graph.stream(unloaded(12), lambda: len(graph.images) >= TARE_FRAMES)
    answer = graph.tare()
    assert answer.success, answer.message
    graph.stream(unloaded(15), lambda: graph.images[-1].tared
                 and graph.images[-1].layers[0].stress[0] > 2.0)
    np.testing.assert_array_equal(graph.images[-1].layers[0].stress, 3.0)
    graph.until(lambda: stamp_to_ns(graph.infos[-1].tared_at) > 0, 'sensor_info of the tare')
    before = graph.infos[-1]
    graph.driver.trigger_deactivate()
    graph.driver.trigger_activate()
    graph.until(lambda: graph.infos[-1] is not before, 'sensor_info of the activation')
    assert graph.infos[-1].tared_at == before.tared_at


def test_tare_is_refused_under_load_and_without_frames(graph):
    load = unloaded()
    load[1, 2] = 100
    graph.stream(load, lambda: len(graph.images) >= TARE_FRAMES)
    answer = graph.tare()
    assert not answer.success
    assert 'under load: 1 tactels' in answer.message and 'row 1 column 2' in answer.message
    assert not graph.images[-1].tared
    graph.device.unplug()
    graph.until(lambda: graph.shows('is not there', ERROR), 'a loss')
    answer = graph.tare()
    assert not answer.success and 'no frames' in answer.message


def test_tare_at_start_waits_for_the_load_to_go(make_graph):
    graph = make_graph(tare_at_start=True)
    graph.stream(unloaded(200), lambda: len(graph.images) >= 2 * TARE_FRAMES)
    assert not any(message.tared for message in graph.images)
    graph.until(lambda: graph.shows('under load'), 'a warning')
    graph.stream(unloaded(), lambda: graph.images[-1].tared)
    np.testing.assert_array_equal(graph.images[-1].layers[0].stress, 0.0)


def test_port_absent_at_the_start_lost_and_back(make_graph, device):
    device.unplug()
    graph = make_graph()
    graph.until(lambda: graph.shows('is not there', ERROR), 'a report')
    device.plug_in()
    graph.connect()
    graph.stream(unloaded(), lambda: len(graph.images) >= TARE_FRAMES)
    assert graph.tare().success
    graph.device.unplug()
    graph.until(lambda: graph.shows('is not there', ERROR), 'a report of the loss')
    graph.images.clear()
    graph.device.plug_in()
    graph.stream(unloaded(20), lambda: len(graph.images) >= 5)
    assert graph.images[-1].tared
    np.testing.assert_array_equal(graph.images[-1].layers[0].stress, 10.0)
    graph.stream(unloaded(), lambda: graph.shows('', OK))


def test_lost_bytes_cost_one_picture_and_show(graph):
    graph.device.write(FlexiTacDevice().encode(unloaded())[3:])
    for value in (1, 2, 3):
        graph.device.send(unloaded(value))
    graph.until(lambda: len(graph.images) == 3, 'the pictures behind the loss')
    assert [message.layers[0].stress[0] for message in graph.images] == [-9.0, -8.0, -7.0]
    graph.until(lambda: graph.value('lost_frames') == '1', 'a report')


def test_random_bytes_make_no_picture_and_do_no_harm(graph):
    rng = np.random.default_rng(1)
    for _ in range(100):
        graph.device.write(rng.bytes(1000))
        graph.executor.spin_once(timeout_sec=0.001)
    graph.until(lambda: int(graph.value('dropped_bytes') or 0) > 50_000, 'a report')
    assert graph.images == []
    graph.stream(unloaded(50), lambda: graph.images)
    assert graph.images[0].layers[0].stress[0] == 50 - BASELINE


def test_counts_that_the_bits_exclude_are_named(make_graph):
    graph = make_graph(calibration=dataclasses.replace(CALIBRATION, bits=10, saturation=None))
    words = 'counts outside 0 to 1023 arrive, which `bits: 10` of the calibration excludes'
    graph.stream(np.full(SHAPE, 3000, np.uint16), lambda: graph.shows(words))


def test_rate_is_reported(graph):
    graph.stream(unloaded(), lambda: len(graph.reports) >= 3)
    assert float(graph.value('rate')) > 20.0
    assert graph.shows('not tared', WARN)


@pytest.mark.parametrize('parameters, reason', [
    ({}, "parameter 'port' is empty"),
    ({'port': 'x', 'baud': -1}, "parameter 'baud'.*-1"),
    ({'port': 'x', 'sensor': 4}, "parameter 'sensor' is 4, must be a text"),
    ({'port': 'x', 'calibration': '/none.yaml'}, 'calibration /none.yaml: cannot be read: No'),
    ({'port': 'x', 'protocol': 'csv_lines'}, "'calibration' is empty: csv_lines needs"),
])
def test_wrong_parameters(context, parameters, reason):
    overrides = [Parameter(name, value=value) for name, value in parameters.items()]
    with pytest.raises(ConfigurationError, match=reason):
        DriverNode(context=context, parameter_overrides=overrides)


PROGRAM = 'import sys; from tactile_sensing.nodes.driver import main; sys.exit(main())'
# Reads of the port do not return, like those of a device with a hanging kernel driver.
HANGING = f"""
import sys, threading
import serial
def read(port, size):
    print('asleep', file=sys.stderr, flush=True)
    threading.Event().wait()
serial.Serial.read = read
{PROGRAM}
"""
CALIBRATION_FILE = Path(__file__).parents[1] / 'config' / 'flexitac_16x16.yaml'


@contextmanager
def process(*arguments, program=PROGRAM):
    with subprocess.Popen([sys.executable, '-c', program, '--ros-args', *arguments],
                          stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as child:
        try:
            yield child
        finally:
            child.kill()


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_process_ends_well_on_signals(device, number):
    with process('-p', f'port:={device.link}', '-p', f'calibration:={CALIBRATION_FILE}') as child:
        line = child.stderr.readline()
        assert 'reading' in line
        child.send_signal(number)
        child.send_signal(number)
        assert child.wait(timeout=30) == 0
        assert 'Traceback' not in child.stderr.read()


def test_process_ends_though_a_read_of_its_port_does_not(device):
    with process('-p', f'port:={device.link}', program=HANGING) as child:
        assert any(line == 'asleep\n' for line in child.stderr)
        child.send_signal(signal.SIGINT)
        assert child.wait(timeout=30) == 0
        lines = child.stderr.read().splitlines()
    assert [line for line in lines if 'does not answer' in line]
    assert not [line for line in lines if 'Traceback' in line]
