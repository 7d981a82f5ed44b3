"""Raw values of messages that other drivers publish, and hostile ones."""
import numpy as np
import pytest
from sensor_msgs.msg import Image
from std_msgs.msg import Float32MultiArray, MultiArrayDimension, UInt16MultiArray

from tactile_common.errors import TactileError
from tactile_sensing.conversions import counts_from_msg

SHAPE = (3, 4)


def image(values, encoding, padding=0, big=False):
    values = values.astype(values.dtype.newbyteorder('>' if big else '<'))
    rows = [row.tobytes() + bytes(padding) for row in values]
    return Image(height=values.shape[0], width=values.shape[1], encoding=encoding,
                 is_bigendian=int(big), step=len(rows[0]), data=b''.join(rows))


def array(kind, values, layout=True, offset=0, padding=0):
    rows, columns = values.shape
    message = kind(data=[0] * offset + np.pad(values, ((0, 0), (0, padding))).ravel().tolist())
    message.layout.data_offset = offset
    if layout:
        message.layout.dim = [
            MultiArrayDimension(label='rows', size=rows, stride=rows * (columns + padding)),
            MultiArrayDimension(label='columns', size=columns, stride=columns + padding)]
    return message


@pytest.mark.parametrize('encoding, kind', [
    ('mono8', np.uint8), ('mono16', np.uint16), ('32FC1', np.float32)])
@pytest.mark.parametrize('padding', [0, 4])
@pytest.mark.parametrize('big', [False, True])
def test_a_pixel_is_a_tactel(encoding, kind, padding, big):
    values = (1000.5 * np.arange(12)).astype(kind).reshape(SHAPE)
    found = counts_from_msg(image(values, encoding, padding, big), SHAPE)
    assert found.dtype == kind and found.dtype.isnative
    np.testing.assert_array_equal(found, values)


@pytest.mark.parametrize('kind, dtype', [
    (Float32MultiArray, np.float32), (UInt16MultiArray, np.uint16)])
@pytest.mark.parametrize('layout', [
    {'layout': False}, {}, {'offset': 5}, {'padding': 2}, {'offset': 1, 'padding': 3}], ids=str)
def test_arrays_by_their_layout(kind, dtype, layout):
    values = np.arange(100, 112, dtype=dtype).reshape(SHAPE)
    found = counts_from_msg(array(kind, values, **layout), SHAPE)
    assert found.dtype == dtype
    np.testing.assert_array_equal(found, values)


def test_the_last_row_may_lack_its_padding():
    message = image(np.arange(12, dtype=np.uint8).reshape(SHAPE), 'mono8', 3)
    message.data = message.data[:-3]
    np.testing.assert_array_equal(counts_from_msg(message, SHAPE).ravel(), np.arange(12))


def changed(message, **values):
    for name, value in values.items():
        setattr(message, name, value)
    return message


@pytest.mark.parametrize('message, reason', [
    (image(np.zeros((3, 4), np.uint8), 'rgb8'), "encoding is 'rgb8', must be one of mono8"),
    (image(np.zeros((4, 3), np.uint8), 'mono8'), 'image is 4x3, must be 3x4'),
    (changed(image(np.zeros(SHAPE, np.uint8), 'mono8'), step=2), 'data holds 12 values'),
    (changed(image(np.zeros(SHAPE, np.uint8), 'mono8'), step=2**32 - 1), 'data holds 12 values'),
    (changed(image(np.zeros(SHAPE, np.uint8), 'mono8'), data=b''), 'data holds 0 values, 12 are'),
    (UInt16MultiArray(data=[1] * 11), 'data holds 11 values, 12 are needed'),
    (array(UInt16MultiArray, np.zeros((2, 2), int)), 'image is 2x2, must be 3x4'),
    (Float32MultiArray(layout=changed(
        UInt16MultiArray().layout, dim=[MultiArrayDimension(size=12)]), data=[0.0] * 12),
     'layout has 1 dimensions, must be rows and columns')])
def test_messages_that_are_no_image_of_the_array(message, reason):
    with pytest.raises(TactileError, match=reason):
        counts_from_msg(message, SHAPE)
