"""A force sensor at the wrist beside the pad, in the whole graph."""
from geometry_msgs.msg import WrenchStamped
import pytest
from rclpy.qos import qos_profile_sensor_data
from tactile_tests.graph import bench, half_rates

from tactile_common.errors import ConfigurationError
from tactile_msgs.msg import ServoReason


def test_a_pad_that_disagrees_with_the_wrist_is_lifted_off(tmp_path):
    """The sensor at the wrist feels the tool's weight alone, whatever the pad presses."""
    with bench(parameters=half_rates(tmp_path)) as it:
        it.add_all(wrist='/wrist/wrench')
        silent = it.track(length=0.03)
        assert not silent.success and silent.reason_code == ServoReason.NO_WRENCH
        assert '/wrist/wrench' in silent.reason
        message, listener = WrenchStamped(), it.listener
        message.wrench.force.z = 4.0
        publisher = listener.create_publisher(
            WrenchStamped, '/wrist/wrench', qos_profile_sensor_data)
        listener.create_timer(0.01, lambda: publisher.publish(message))
        it.wait(lambda: it.node('edge_servo')._servo.inputs.wrist.heard, 'the wrist')
        client = it.track(length=0.03)
        assert not client.success and client.reason_code == ServoReason.SENSOR_DISAGREES
        assert '0.0 N at the wrist' in client.reason


def test_the_pad_is_not_compared_with_itself(tmp_path):
    with bench(parameters=half_rates(tmp_path)) as it, pytest.raises(
            ConfigurationError, match='the force of the pad itself'):
        it.add_all(wrist='wrench')
