"""Driver without a port: topics, the user's own images; lifecycle transitions."""
from pathlib import Path
import re
import signal
import subprocess
import sys
import time

from diagnostic_msgs.msg import DiagnosticStatus
from driver_bench import Bench, DEADLINE
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
import numpy as np
import pytest
import rclpy
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import Image
from std_msgs.msg import Float32MultiArray, UInt16MultiArray

from tactile_common.ros import runner
from tactile_common.ros.conversions import stamp_from_ns, stamp_to_ns
from tactile_msgs.msg import TactileImage
from tactile_sensing.contact.estimator import ContactEstimator, EstimatorConfig
from tactile_sensing.conversions import image_from_msg
from tactile_sensing.devices.calibration import Calibration, load_calibration
from tactile_sensing.nodes import driver

SHAPE = (3, 4)
CALIBRATION = Calibration.uncalibrated(*SHAPE, 0.002, bits=10, resolution=0.5)


def hearing(**parameters):
    """Return the bench of a driver that reads a topic."""
    return Bench(CALIBRATION, topic='raw', **parameters)


VALUES = np.arange(12).reshape(SHAPE) * 10


@pytest.mark.parametrize('message, gain', [
    (Image(height=3, width=4, encoding='mono16', step=8, data=VALUES.astype('<u2').tobytes()),
     1.0),
    # Floats are in the unit of `resolution`: 0.5 is one count.
    (Float32MultiArray(data=VALUES.ravel().astype(float).tolist()), 2.0)],
    ids=lambda it: getattr(it, 'encoding', type(it).__name__))
def test_images_of_a_topic(message, gain):
    with hearing() as bench:
        bench.until(lambda: bench.shows('nobody publishes /raw'), 'a report')
        assert bench.reports[-1].level == DiagnosticStatus.ERROR
        publisher = bench.node.create_publisher(type(message), 'raw', 5)
        stamp = bench.node.get_clock().now().nanoseconds - 50_000_000
        if isinstance(message, Image):
            message.header.stamp = stamp_from_ns(stamp)
        bench.until(lambda: bench.images, 'an image', lambda: publisher.publish(message))
        image = image_from_msg(bench.images[-1])
        np.testing.assert_array_equal(image.layers[0].stress, gain * VALUES)
        if isinstance(message, Image):
            assert stamp_to_ns(bench.images[-1].header.stamp) == stamp
        else:
            assert stamp_to_ns(bench.images[-1].header.stamp) > stamp


def test_topics_that_are_no_images_of_the_array_are_explained():
    with hearing() as bench:
        bench.node.create_publisher(TactileImage, 'raw', 5)
        bench.until(lambda: bench.shows('is of tactile_msgs/msg/TactileImage, must be'), 'a type')
    with hearing() as bench:
        publisher = bench.node.create_publisher(UInt16MultiArray, 'raw', 5)
        bench.until(lambda: bench.shows('data holds 3 values, must hold 12'), 'a size',
                    lambda: publisher.publish(UInt16MultiArray(data=[1, 2, 3])))
        assert bench.images == []


def change(bench, transition):
    client = bench.node.create_client(ChangeState, 'driver/change_state')
    bench.until(client.service_is_ready, 'the service')
    answer = client.call_async(ChangeState.Request(transition=Transition(id=transition)))
    bench.until(answer.done, 'an answer')
    return answer.result().success


def test_a_manager_starts_and_stops_it():
    with hearing(autostart=False) as bench:
        publisher = bench.node.create_publisher(UInt16MultiArray, 'raw', 5)
        message = UInt16MultiArray(data=VALUES.ravel().tolist())

        def send():
            publisher.publish(message)
        bench.until(lambda: bench.shows('not active'), 'a report', send)
        assert bench.images == [] and bench.driver.source is None
        assert change(bench, Transition.TRANSITION_CONFIGURE)
        assert change(bench, Transition.TRANSITION_ACTIVATE)
        bench.until(lambda: bench.images, 'an image', send)
        assert change(bench, Transition.TRANSITION_DEACTIVATE)
        assert bench.driver.source is None
        bench.until(lambda: bench.reports[-1].message == 'not active', 'a report', send)
        assert change(bench, Transition.TRANSITION_ACTIVATE)
        bench.images.clear()
        bench.until(lambda: bench.images, 'an image', send)


@pytest.mark.parametrize('parameters, reason', [
    ({'topic': '/my-sensor/image'}, '/my-sensor/image cannot be read: failed to resolve name'),
    ({'port': '/dev/none'}, '/dev/none cannot be read: a protocol failed')])
def test_a_source_that_cannot_be_opened_is_explained(parameters, reason, capfd, monkeypatch):
    def fail(*_, **__):
        raise ValueError('a protocol\nfailed')
    monkeypatch.setattr(driver, 'SensorStream', fail)
    with Bench(CALIBRATION, **parameters) as bench:
        bench.until(lambda: bench.shows(reason), 'a report')
        assert not change(bench, Transition.TRANSITION_ACTIVATE)
    lines = capfd.readouterr().err.splitlines()
    assert sum('ERROR' in line and reason in line for line in lines) == 2


def test_drift_is_followed_while_nothing_touches():
    rng = np.random.default_rng(8)
    with hearing(tare_at_start=True, track_drift=True) as bench:
        publisher = bench.node.create_publisher(UInt16MultiArray, 'raw', 5)
        level, touch = 0.0, 0

        def send():
            nonlocal level
            level += 0.02
            counts = np.rint(level + rng.normal(0.0, 2.0, SHAPE) + 6)
            counts[0, 0] += touch
            publisher.publish(UInt16MultiArray(data=np.clip(counts, 0, 999).astype(int).ravel()
                                               .tolist()))
        bench.until(lambda: len(bench.images) > 10 and level > 30.0, 'images', send)
        stress = np.mean([image_from_msg(it).layers[0].stress for it in bench.images[-10:]], 0)
        assert bench.images[-1].tared and np.abs(stress).max() < 5.0  # of 30 counts
        touch = 40
        before = len(bench.images)
        bench.until(lambda: len(bench.images) > before + 60, 'images', send)
        stress = np.mean([image_from_msg(it).layers[0].stress for it in bench.images[-10:]], 0)
        assert stress[0, 0] > 35.0


PAGE = (Path(__file__).parents[2] / 'docs/array.md').read_text('utf-8')


def block(kind, words):
    """Return the code block of the page that contains these words."""
    blocks = re.findall(rf'^ *```{kind}\n(.*?)^ *```$', PAGE, re.M | re.S)
    found, = (text for text in blocks if words in text)
    return found


def test_images_of_ones_own_are_estimated(tmp_path):
    """The publisher of the page sends 5 N at (1, -2) mm."""
    program = block('python', 'my_sensor')
    assert program.index('if __name__') > 0
    (tmp_path / 'mine.py').write_text(program)
    context, images = rclpy.Context(), []
    rclpy.init(context=context)
    node = Node('listener', context=context, namespace='tactile')
    node.create_subscription(TactileImage, 'image', images.append, qos_profile_sensor_data)
    executor = runner.make_executor(context)
    executor.add_node(node)
    child = subprocess.Popen(
        [sys.executable, str(tmp_path / 'mine.py')], stderr=subprocess.DEVNULL)
    try:
        end = time.monotonic() + 2.0 * DEADLINE
        runner.spin(executor, context, lambda: len(images) > 5 or time.monotonic() > end)
    finally:
        child.send_signal(signal.SIGINT)
        child.wait(DEADLINE)
        end = time.monotonic() + 1.0  # no participant may leave while this node is destroyed
        runner.spin(executor, context, lambda: time.monotonic() > end)
        executor.shutdown()
        node.destroy_node()
        context.try_shutdown()
    estimator = ContactEstimator(EstimatorConfig(tactel='point'))
    contact = estimator.estimate(image_from_msg(images[-1]))
    assert contact.valid and contact.type.name == 'POINT'
    assert abs(contact.x - 1e-3) < 1e-4 and abs(contact.y + 2e-3) < 1e-4
    assert abs(contact.normal_force - 5.0) < 0.3


def test_the_calibration_of_the_page_is_one(tmp_path):
    (tmp_path / 'mine.yaml').write_text(block('yaml', 'gain').strip())
    calibration = load_calibration(tmp_path / 'mine.yaml')
    assert calibration.array.shape == (8, 8) and calibration.counts.highest == 1023
