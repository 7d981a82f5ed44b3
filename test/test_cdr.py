"""Bytes of messages, read without making the message, against the middleware's own reading."""

import array

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from rosidl_parser.definition import AbstractString, Array, BasicType, NamespacedType
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from tactile_common.errors import TactileError
from tactile_common.ros.cdr import HEAD, unpacked
from tactile_msgs.msg import Contact, ServoStatus, TactileImage

KINDS = [Contact, JointState, JointTrajectory, PoseStamped, ServoStatus, TactileImage]
NUMBERS = {'boolean': st.booleans(), 'float': st.floats(width=32, allow_nan=False),
           'double': st.floats(allow_nan=False),
           **{f'{sign}int{bits}': st.integers(0 if sign else -2**(bits - 1),
                                              2**(bits - (not sign)) - 1)
              for sign in ('', 'u') for bits in (8, 16, 32, 64)}}
# The middleware's strings end at the first NUL.
TEXT = st.text(st.characters(exclude_characters='\0', exclude_categories=['Cs']), max_size=9)


def values_of(kind):
    """Strategy for the value of a field."""
    if isinstance(kind, BasicType):
        return NUMBERS[kind.typename]
    if isinstance(kind, AbstractString):
        return TEXT
    if isinstance(kind, NamespacedType):
        module = __import__('.'.join(kind.namespaces), fromlist=[kind.name])
        return messages(getattr(module, kind.name))
    fixed = kind.size if isinstance(kind, Array) else None
    return st.lists(values_of(kind.value_type), min_size=fixed or 0, max_size=fixed or 4)


def messages(kind):
    """Strategy for messages of a kind."""
    names = kind.get_fields_and_field_types()
    return st.builds(kind, **{name: values_of(one)
                              for name, one in zip(names, kind.SLOT_TYPES, strict=True)})


def plain(value, like):
    """Message, or what was read of one, as tuples and plain numbers, in the fields of `like`."""
    if hasattr(like, 'get_fields_and_field_types'):
        return tuple(plain(getattr(value, name), getattr(like, name))
                     for name in like.get_fields_and_field_types())
    if isinstance(like, (list, tuple, array.array, np.ndarray)):
        items = value.tolist() if isinstance(value, (np.ndarray, array.array)) else value
        return tuple(plain(one, other) for one, other in zip(items, like, strict=True))
    return value


@pytest.mark.parametrize('kind', KINDS, ids=lambda kind: kind.__name__)
@settings(max_examples=40)
@given(data=st.data())
def test_every_field_is_what_was_written(kind, data):
    message = data.draw(messages(kind))
    raw = bytes(serialize_message(message))
    read = unpacked(raw, kind)
    again = deserialize_message(raw, kind)
    assert plain(read, message) == plain(message, message) == plain(again, message)


@pytest.mark.parametrize('kind', KINDS, ids=lambda kind: kind.__name__)
@settings(max_examples=40)
@given(data=st.data())
def test_bytes_that_are_no_message_are_refused(kind, data):
    raw = bytearray(serialize_message(data.draw(messages(kind))))
    for at, byte in data.draw(st.lists(st.tuples(
            st.integers(len(HEAD), len(raw) - 1), st.integers(0, 255)), max_size=8)):
        raw[at] = byte
    cut = bytes(raw[:data.draw(st.integers(0, len(raw)))])
    try:
        read = unpacked(cut, kind)
    except TactileError as error:
        assert str(error) == f'{len(cut)} bytes that are no {kind.__name__}'
    else:
        assert read is not None


def test_lengths_orders_and_encodings_of_others_are_read_or_refused():
    for kind in KINDS:
        with pytest.raises(TactileError):
            unpacked(HEAD + b'\xff' * 64, kind)
    swapped = b'\0\0\0\0' + (3).to_bytes(4, 'big') + (5).to_bytes(4, 'big')
    read = unpacked(swapped, Time)
    assert (read.sec, read.nanosec) == (3, 5)
    with pytest.raises(TactileError, match='12 bytes that are no Time'):
        unpacked(b'\0\7\0\0' + bytes(8), Time)


def test_arrays_can_be_written_to():
    raw = bytes(serialize_message(JointState(position=[1.0, 2.0])))
    positions = unpacked(raw, JointState).position
    positions[0] = 3.0
    assert unpacked(raw, JointState).position[0] == 1.0
