"""The servo's node as far as it is more than conversions."""

from pathlib import Path

import numpy as np
import pytest
from rclpy.action import GoalResponse
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message

from tactile_common.errors import ConfigurationError
from tactile_msgs.action import TrackEdge
from tactile_msgs.msg import Contact as ContactMsg
from tactile_msgs.msg import ServoReason
from tactile_sensing.conversions import image_to_msg
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.image import Layer, TactileImage
from tactile_servo.nodes import servo
from tactile_servo.nodes.servo import EdgeServoNode

PUMA = Path(__file__).resolve().parents[2] / 'launch/urdf/puma260.urdf'


@pytest.fixture
def node(context):
    made = EdgeServoNode(context=context, parameter_overrides=[
        Parameter('robot_description', value=str(PUMA))])
    yield made
    made.destroy_node()


@pytest.mark.parametrize('name, near', [
    ('speed.maks', 'speed.max'), ('force.gian', 'force.gain')])
def test_an_unknown_parameter_is_refused_with_the_nearest_known_one(context, name, near):
    with pytest.raises(ConfigurationError, match=f'no parameter {name}; did you mean {near}'):
        EdgeServoNode(context=context, parameter_overrides=[
            Parameter('robot_description', value=str(PUMA)), Parameter(name, value=1.0)])


def test_gains_reach_the_controllers_at_once_and_limits_stay(node):
    law = node._servo.law
    wanted = {'force.gain': 30.0, 'path.lateral_gain': 11.0}
    answers = node.set_parameters([Parameter(k, value=v) for k, v in wanted.items()])
    assert all(answer.successful for answer in answers)
    motion = law._motion
    assert (motion._force.gain, motion.config.lateral_gain, law.config.force_gain) == (
        30.0, 11.0, 30.0)
    for name in ('force.max_load', 'speed.max', 'joints.acceleration', 'workspace.lower',
                 'law', 'rate'):
        value = node.get_parameter(name).value
        assert not node.set_parameters([Parameter(name, value=value)])[0].successful


def picture(sequence):
    array = TactelArray(4, 4, 1e-3, 1e-3)
    layer = Layer('zz', 0.002, np.zeros(array.shape))
    return bytes(serialize_message(
        image_to_msg(TactileImage(sequence, sequence, (layer,), array))))


@pytest.fixture
def clock(monkeypatch):
    """Give the node's steady clock, as a list of one time [s]."""
    now = [100.0]
    monkeypatch.setattr(servo, 'perf_counter', lambda: now[0])
    return now


def test_a_picture_begins_a_cycle_that_looks_at_it(node, clock, monkeypatch):
    seen = []
    monkeypatch.setattr(node._servo, 'see_image', lambda image, _: seen.append(image.sequence))
    for sequence in range(4):
        clock[0] += 0.005
        node._on_image(picture(sequence))
    assert seen == [0, 1, 2, 3]
    assert node._pace.cycles == 4


def test_a_fast_sensor_takes_no_time_from_the_cycles(node, clock, monkeypatch):
    seen = []
    monkeypatch.setattr(node._servo, 'see_image', lambda image, _: seen.append(image.sequence))
    for sequence in range(9):  # three pictures a cycle, of which the newest counts
        clock[0] += 0.0005
        node._on_image(picture(sequence))
        if sequence % 3 == 2:
            node._on_cycle()
    node._on_cycle()
    assert seen == [0, 2, 5, 8]  # the first finds the node idle
    assert node._pace.cycles == 5


def test_the_status_is_told_at_its_rate_and_at_every_change(node, clock):
    told = []
    node._status.publish = lambda msg: told.append((msg.reason_code, msg.reason, msg.cycles))
    for _ in range(401):
        node._on_cycle()
        clock[0] += 0.0025
    assert len(told) == pytest.approx(100, abs=1)
    node._on_cycle()
    count = len(told)
    assert node._server._on_goal(TrackEdge.Goal(speed=0.03, force=5.0)) == GoalResponse.REJECT
    node._on_cycle()
    assert told[count:] == [
        (ServoReason.NO_JOINT_STATE, 'no joint state: none has been received', 403)]


@pytest.mark.parametrize('raw', [
    b'', b'garbage', b'\x00\x01\x00\x00' + b'\xff' * 64,
    bytes(serialize_message(ContactMsg()))[:30]], ids=['empty', 'text', 'lengths', 'cut'])
def test_bytes_that_are_no_message_are_passed_over(node, monkeypatch, raw):
    warnings = []
    monkeypatch.setattr(
        node.get_logger(), 'warning', lambda text, **_: warnings.append(text))
    for hear in (node._on_image, node._on_contact):
        hear(raw)
    node._on_cycle()
    assert warnings == [
        f'image ignored: {len(raw)} bytes that are no TactileImage',
        f'contact ignored: {len(raw)} bytes that are no Contact']
    warnings.clear()
    node._on_joints(raw)
    assert len(warnings) == 1 and warnings[0].startswith('joint state')
    assert node._servo.inputs.joints is None
