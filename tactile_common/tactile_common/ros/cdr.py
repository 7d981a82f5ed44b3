"""
Conversion between Python messages and their serialised bytes (CDR).

rosbags deserialises several times faster than rclpy, whose messages check every field.
`python3 -m benchmarks.latency.shortcuts` measures the share of this in the servo's cycle.
"""
from functools import cache
from struct import error as StructError
from struct import unpack_from
from typing import Any

from rclpy.serialization import serialize_message
from rosbags.serde import SerdeError
from rosbags.typesys import get_types_from_msg, get_typestore, Stores
from rosbags.typesys.store import Typestore

from tactile_common.errors import TactileError
from tactile_common.ros.message_definitions import definition_of
from tactile_common.state_buffer import NS

HEAD = b'\0\1\0\0'  # header of plain CDR, little endian; offsets are counted from its end
# Exceptions of a message that is damaged or lacks a field.
DAMAGE = (SerdeError, StructError, LookupError, AttributeError, TypeError, ValueError,
          OverflowError, MemoryError, RecursionError)
_installed = get_typestore(Stores.EMPTY)


def register(types: Typestore, found: dict[str, Any]) -> None:
    """Add types to a store, except those that it already has."""
    types.register({name: fields for name, fields in found.items()
                    if name not in types.fielddefs})


def deserialised(types: Typestore, name: str, data: Any) -> Any:
    """
    Decode the bytes of a message of a known type; sequences of numbers become ndarrays.

    Bytes after the last value are ignored, unlike in rosbags' deserialize_cdr, because some
    middlewares write them after an empty sequence of doubles.

    Raises
    ------
    One of `DAMAGE`
        The bytes are not a message of this type.
    """
    encoding, little_endian = bytes(data[:2])
    if encoding or little_endian > 1:
        raise SerdeError(f'its first bytes are {bytes(data[:4]).hex()}, not those of CDR')
    kind = types.get_msgdef(name)
    read = kind.deserialize_cdr_le if little_endian else kind.deserialize_cdr_be
    return read(data[4:], 0, kind.cls, types)[0]


def stamp_of(data: Any) -> int:
    """Return the header's stamp [ns] of a message's bytes; one of `DAMAGE` if they are too few."""
    seconds, rest = unpack_from('<iI' if data[1] else '>iI', data, len(HEAD))
    return int(seconds * NS + rest)


def unpacked(raw: bytes, kind: type) -> Any:
    """
    Decode the bytes of a raw subscription into an object with the fields of that message type.

    Its arrays are writable. Invalid bytes, which the middleware would silently ignore, raise a
    TactileError.
    """
    try:
        return deserialised(_installed, known(kind), bytearray(raw))
    except DAMAGE as error:
        raise TactileError(f'{len(raw)} bytes that are no {kind.__name__}') from error


def packed(message: Any) -> bytes:
    """Serialise an rclpy message; padding bytes are always the same, not random."""
    kind: Any = type(message)
    name = known(kind)
    try:
        return bytes(_installed.serialize_cdr(message, name))
    except AttributeError:  # rosbags expects sequences of numbers as ndarrays
        return bytes(_installed.serialize_cdr(unpacked(serialize_message(message), kind), name))


@cache
def known(kind: type) -> str:
    """Register an installed type, create its reader and return its name."""
    name, text, _ = definition_of(kind)
    register(_installed, get_types_from_msg(text, name))
    _installed.get_msgdef(name)
    return name
