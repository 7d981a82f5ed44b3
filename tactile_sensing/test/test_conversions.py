"""Conversion of core data to ROS messages and back."""
from dataclasses import replace

import numpy as np
import pytest
from sensor_msgs.msg import Image
from std_msgs.msg import Float32MultiArray, MultiArrayDimension, UInt16MultiArray

from tactile_common.errors import TactileError
from tactile_sensing.conversions import (
    contact_from_msg,
    contact_to_msg,
    contact_to_wrench,
    counts_from_msg,
    image_from_msg,
    image_to_msg,
    sensor_info_from_msg,
    sensor_info_to_msg,
)
from tactile_sensing.devices.calibration import Calibration
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import Contact, ContactType, Reason
from tactile_sensing.types.image import Layer, TactileImage
from tactile_sensing.types.moments import Moments

ARRAY = TactelArray(3, 4, 0.0015, 0.0025)


def image():
    stress = np.arange(12, dtype=np.float32).reshape(3, 4)
    stress[1, 2] = np.nan
    layers = (Layer('zz', 0.002, stress, 160e3, 630.0, 'Pa', 0.004, 0.4375, 0.0625,
                    force_std=0.125),
              Layer('yz', 0.004, -stress, 0.0, 0.0, 'counts'))
    return TactileImage(1_700_000_000_123_456_789, 2 ** 40, layers, ARRAY, True, 1, 'pad', 'left')


def test_image_round_trip():
    sent = image()
    message = image_to_msg(sent)
    assert (message.rows, message.columns, message.header.stamp.nanosec) == (3, 4, 123_456_789)
    back = image_from_msg(message)
    for name in ('stamp_ns', 'sequence', 'tared', 'saturated', 'frame_id', 'sensor'):
        assert getattr(back, name) == getattr(sent, name)
    assert back.array.shape == ARRAY.shape
    assert back.array.pitch_y == pytest.approx(ARRAY.pitch_y, rel=1e-6)
    for got, want in zip(back.layers, sent.layers, strict=True):
        np.testing.assert_array_equal(got.stress, want.stress)
        assert got.stress.dtype == np.float32
        assert (got.component, got.unit) == (want.component, want.unit)
        assert got.depth == pytest.approx(want.depth)
        assert (got.full_scale, got.noise_std) == (want.full_scale, want.noise_std)
        assert got.thickness == pytest.approx(want.thickness)
        assert (got.poisson, got.gain_spread) == (want.poisson, want.gain_spread)
        assert got.force_std == want.force_std


def contact(**values):
    numbers = dict.fromkeys(('x', 'y', 'yaw', 'normal_force', 'shear_force_x', 'shear_force_y',
                             'line_force', 'patch', 'start', 'end', 'snr', 'residual'),
                            0.5)
    return Contact(ContactType.POINT, True, Reason.SATURATED, 'fit', 'point/zz',
                   covariance=np.arange(49.0).reshape(7, 7), iterations=3, force_valid=True,
                   moments=Moments(4.0, 1.0, 2.0, 3.0, 4.0, 5.0), **(numbers | values))


def test_a_message_that_is_filled_again_is_as_a_new_one():
    one, other = image(), image()
    for layer in (*one.layers, *other.layers):
        layer.stress[1, 2] = 0.0  # NaN is not equal to itself
    other = replace(other, layers=other.layers[:1], tared=False, sequence=5, saturated=0)
    filled = image_to_msg(one)
    for sent in (other, one):
        assert image_to_msg(sent, filled) is filled and filled == image_to_msg(sent)
    message, wrench = contact_to_msg(contact(), filled, 10**18), contact_to_wrench(
        contact(), filled)
    sent = contact(x=0.25, normal_force=3.0, snr=30.0)
    assert contact_to_msg(sent, filled, 2 * 10**18, message) is message
    assert message == contact_to_msg(sent, filled, 2 * 10**18)
    assert contact_to_wrench(sent, filled, wrench) == contact_to_wrench(sent, filled)


def test_contact_round_trip():
    header = image_to_msg(image())
    sent = contact(x=0.25)
    message = contact_to_msg(sent, header, 1_700_000_000_124_000_000)
    back = contact_from_msg(message)
    for name in ('type', 'valid', 'force_valid', 'reasons', 'method', 'model', 'iterations',
                 'moments', 'x', 'y', 'yaw', 'normal_force', 'snr'):
        assert getattr(back, name) == getattr(sent, name)
    np.testing.assert_array_equal(back.covariance, sent.covariance)
    assert (message.latency.sec, message.latency.nanosec) == (0, 543_211)
    assert (message.header, message.sequence) == (header.header, 2**40)
    centre = message.centre_of_pressure
    assert (centre.x, centre.y) == sent.moments.centre_of_pressure and centre.z == 0.0
    message.type = 9
    with pytest.raises(TactileError, match='contact type is 9'):
        contact_from_msg(message)


@pytest.mark.parametrize('shear', [(0.3, -0.4), (np.nan, np.nan)])
def test_wrench_is_the_force_at_its_place(shear):
    x, y = 0.002, -0.003
    wrench = contact_to_wrench(contact(x=x, y=y, normal_force=5.0, shear_force_x=shear[0],
                                       shear_force_y=shear[1]), image_to_msg(image())).wrench
    force = np.array([*np.nan_to_num(shear), -5.0])
    assert [wrench.force.x, wrench.force.y, wrench.force.z] == force.tolist()
    np.testing.assert_allclose([wrench.torque.x, wrench.torque.y, wrench.torque.z],
                               np.cross([x, y, 0.0], force), atol=1e-15)


def test_a_transposed_view_is_sent_row_major():
    stress = np.arange(12, dtype=np.float64).reshape(4, 3).T
    message = image_to_msg(TactileImage(0, 0, (Layer('zz', 0.0, stress),), ARRAY))
    np.testing.assert_array_equal(image_from_msg(message).layers[0].stress, stress)


def test_sensor_info_round_trip():
    pad = Calibration(ARRAY, 100.0, dead_tactels=(2, 5), depth=0.002, max_load=40.0,
                      skin_stiffness=2e5, acquisition_delay=0.0025, nominal_rate=200.0,
                      serial_number='7', source='pad.yaml')
    sent = pad.sensor_info('left', 'pad', 12, tared_at_ns=11)
    assert (sent.max_load, sent.dead_tactels, sent.array) == (40.0, (2, 5), ARRAY)
    back = sensor_info_from_msg(sensor_info_to_msg(sent))
    for name in ('stamp_ns', 'frame_id', 'sensor', 'model', 'serial_number', 'dead_tactels',
                 'calibration', 'tared_at_ns'):
        assert getattr(back, name) == getattr(sent, name)
    for name in ('max_load', 'skin_stiffness', 'acquisition_delay', 'nominal_rate'):
        assert getattr(back, name) == pytest.approx(getattr(sent, name))
    assert back.layers[0].full_scale == 25500.0 and back.layers[0].stress.size == 0


def change_layer(name, value):
    def change(message):
        setattr(message.layers[0], name, value)
    return change


@pytest.mark.parametrize('change, reason', [
    (change_layer('stress', [1.0, 2.0]), 'stress has 2 values, must be 3 x 4'),
    (change_layer('stress', []), 'stress has 0 values'),
    (change_layer('component', 9), 'component is 9'),
    (lambda message: setattr(message, 'rows', 0), 'rows is 0'),
    (lambda message: setattr(message, 'pitch_x', float('nan')), 'pitch_x is nan'),
])
def test_malformed_messages(change, reason):
    message = image_to_msg(image())
    change(message)
    with pytest.raises(TactileError, match=reason):
        image_from_msg(message)


# Raw values of messages that other drivers publish, and hostile ones.
def pixels(values, encoding, big=False):
    values = values.astype(values.dtype.newbyteorder('>' if big else '<'))
    return Image(height=values.shape[0], width=values.shape[1], encoding=encoding,
                 is_bigendian=int(big), step=values[0].nbytes, data=values.tobytes())


def multi_array(kind, values, layout=True):
    message, (rows, columns) = kind(data=values.ravel().tolist()), values.shape
    if layout:
        message.layout.dim = [
            MultiArrayDimension(label='rows', size=rows, stride=rows * columns),
            MultiArrayDimension(label='columns', size=columns, stride=columns)]
    return message


@pytest.mark.parametrize('encoding, kind', [
    ('mono8', np.uint8), ('mono16', np.uint16), ('32FC1', np.float32)])
@pytest.mark.parametrize('big', [False, True])
def test_a_pixel_is_a_tactel(encoding, kind, big):
    values = (1000.5 * np.arange(12)).astype(kind).reshape(ARRAY.shape)
    found = counts_from_msg(pixels(values, encoding, big), ARRAY.shape)
    assert found.dtype == kind and found.dtype.isnative
    np.testing.assert_array_equal(found, values)


@pytest.mark.parametrize('kind, dtype', [
    (Float32MultiArray, np.float32), (UInt16MultiArray, np.uint16)])
@pytest.mark.parametrize('layout', [False, True])
def test_arrays_with_and_without_layout(kind, dtype, layout):
    values = np.arange(100, 112, dtype=dtype).reshape(ARRAY.shape)
    found = counts_from_msg(multi_array(kind, values, layout), ARRAY.shape)
    assert found.dtype == dtype
    np.testing.assert_array_equal(found, values)


def changed(message, **values):
    for name, value in values.items():
        setattr(message, name, value)
    return message


@pytest.mark.parametrize('message, reason', [
    (pixels(np.zeros((3, 4), np.uint8), 'rgb8'), "encoding is 'rgb8', must be one of mono8"),
    (pixels(np.zeros((4, 3), np.uint8), 'mono8'), 'image is 4x3, must be 3x4'),
    (changed(pixels(np.zeros(ARRAY.shape, np.uint8), 'mono8'), step=8, data=bytes(24)),
     'data holds 24 values, must hold 12, without padding'),
    (changed(pixels(np.zeros(ARRAY.shape, np.uint8), 'mono8'), data=b''), 'data holds 0 values'),
    (changed(pixels(np.zeros(ARRAY.shape, np.uint16), 'mono16'), data=b'123'),
     'data holds 1 values'),
    (UInt16MultiArray(data=[1] * 11), 'data holds 11 values, must hold 12'),
    (multi_array(UInt16MultiArray, np.zeros((2, 2), int)), 'image is 2x2, must be 3x4'),
    (Float32MultiArray(layout=changed(
        UInt16MultiArray().layout, dim=[MultiArrayDimension(size=12)]), data=[0.0] * 12),
     'image is 12, must be 3x4')])
def test_messages_that_are_no_image_of_the_array(message, reason):
    with pytest.raises(TactileError, match=reason):
        counts_from_msg(message, ARRAY.shape)
