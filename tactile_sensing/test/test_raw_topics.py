"""Raw values of messages that other drivers publish, and hostile ones."""
import numpy as np
import pytest
from sensor_msgs.msg import Image
from std_msgs.msg import Float32MultiArray, MultiArrayDimension, UInt16MultiArray

from tactile_common.errors import TactileError
from tactile_sensing.conversions import counts_from_msg

SHAPE = (3, 4)


def image(values, encoding, big=False):
    values = values.astype(values.dtype.newbyteorder('>' if big else '<'))
    return Image(height=values.shape[0], width=values.shape[1], encoding=encoding,
                 is_bigendian=int(big), step=values[0].nbytes, data=values.tobytes())


def array(kind, values, layout=True):
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
    values = (1000.5 * np.arange(12)).astype(kind).reshape(SHAPE)
    found = counts_from_msg(image(values, encoding, big), SHAPE)
    assert found.dtype == kind and found.dtype.isnative
    np.testing.assert_array_equal(found, values)


@pytest.mark.parametrize('kind, dtype', [
    (Float32MultiArray, np.float32), (UInt16MultiArray, np.uint16)])
@pytest.mark.parametrize('layout', [False, True])
def test_arrays_with_and_without_layout(kind, dtype, layout):
    values = np.arange(100, 112, dtype=dtype).reshape(SHAPE)
    found = counts_from_msg(array(kind, values, layout), SHAPE)
    assert found.dtype == dtype
    np.testing.assert_array_equal(found, values)


def changed(message, **values):
    for name, value in values.items():
        setattr(message, name, value)
    return message


@pytest.mark.parametrize('message, reason', [
    (image(np.zeros((3, 4), np.uint8), 'rgb8'), "encoding is 'rgb8', must be one of mono8"),
    (image(np.zeros((4, 3), np.uint8), 'mono8'), 'image is 4x3, must be 3x4'),
    (changed(image(np.zeros(SHAPE, np.uint8), 'mono8'), step=8, data=bytes(24)),
     'data holds 24 values, must hold 12, without padding'),
    (changed(image(np.zeros(SHAPE, np.uint8), 'mono8'), data=b''), 'data holds 0 values'),
    (changed(image(np.zeros(SHAPE, np.uint16), 'mono16'), data=b'123'), 'data holds 1 values'),
    (UInt16MultiArray(data=[1] * 11), 'data holds 11 values, must hold 12'),
    (array(UInt16MultiArray, np.zeros((2, 2), int)), 'image is 2x2, must be 3x4'),
    (Float32MultiArray(layout=changed(
        UInt16MultiArray().layout, dim=[MultiArrayDimension(size=12)]), data=[0.0] * 12),
     'image is 12, must be 3x4')])
def test_messages_that_are_no_image_of_the_array(message, reason):
    with pytest.raises(TactileError, match=reason):
        counts_from_msg(message, SHAPE)
