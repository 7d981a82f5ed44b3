"""Whether one core takes the frames of every protocol, from bytes to published messages."""
import pytest
import rclpy

from benchmarks.devices.__main__ import CASES, ratio
from tactile_sensing.devices.registry import PROTOCOLS


@pytest.fixture(scope='module')
def node():
    context = rclpy.Context()
    rclpy.init(context=context)
    node = rclpy.create_node('bench', context=context)
    yield node
    node.destroy_node()
    context.try_shutdown()


@pytest.mark.parametrize('side, rate', CASES)
@pytest.mark.parametrize('protocol', PROTOCOLS)
def test_one_core_is_enough(node, protocol, side, rate):
    times, share = ratio(node, protocol, side, rate)  # of processor time: what else runs is none
    assert times > 1.2 and share == 1.0
