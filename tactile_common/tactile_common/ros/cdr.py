"""
Messages between Python and the bytes that go over the wire (CDR).

rosbags reads them several times as fast as rclpy, whose messages check every field:
`python3 -m benchmarks.latency.shortcuts` shows what that is of the servo's cycle.
"""
from collections.abc import Iterable
from functools import cache
from struct import calcsize, Struct, unpack_from
from struct import error as StructError
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.serde import SerdeError
from rosbags.typesys import get_types_from_msg, get_typestore, Stores
from rosbags.typesys.store import Typestore

from tactile_common.errors import TactileError
from tactile_common.ros.message_definitions import definition_of
from tactile_common.state_buffer import NS

HEAD = b'\0\1\0\0'  # of plain CDR, little endian; offsets count from behind it
# What a damaged message raises, or one that lacks a field.
DAMAGE = (SerdeError, StructError, LookupError, AttributeError, TypeError, ValueError,
          OverflowError, MemoryError, RecursionError)
_DTYPES = {'char': 'uint8'}  # others are named alike
_installed = get_typestore(Stores.EMPTY)


def register(types: Typestore, found: dict[str, Any]) -> None:
    """Add types to a store, those that it has already excepted."""
    types.register({name: fields for name, fields in found.items()
                    if name not in types.fielddefs})


def deserialised(types: Typestore, name: str, data: Any) -> Any:
    """
    Return the message of a known type that bytes hold; sequences of numbers are ndarrays.

    Bytes after the last value are ignored, unlike by rosbags' deserialize_cdr: some middlewares
    write them after an empty sequence of doubles.

    Raises
    ------
    One of `DAMAGE`
        The bytes are no such message.
    """
    encoding, little_endian = bytes(data[:2])
    if encoding or little_endian > 1:
        raise SerdeError(f'its first bytes are {bytes(data[:4]).hex()}, not those of CDR')
    kind = types.get_msgdef(name)
    read = kind.deserialize_cdr_le if little_endian else kind.deserialize_cdr_be
    return read(data[4:], 0, kind.cls, types)[0]


def stamp_of(data: Any) -> int:
    """Stamp [ns] of the header that a message's bytes begin with; one of `DAMAGE` if too few."""
    seconds, rest = unpack_from('<iI' if data[1] else '>iI', data, len(HEAD))
    return int(seconds * NS + rest)


def unpacked(raw: bytes, kind: type) -> Any:
    """
    Return what is in the bytes of a raw subscription, with the fields of a message of that kind.

    Its arrays can be written to. TactileError of bytes that are no such message, which the
    middleware would pass over.
    """
    try:
        return deserialised(_installed, known(kind), bytearray(raw))
    except DAMAGE as error:
        raise TactileError(f'{len(raw)} bytes that are no {kind.__name__}') from error


def packed(message: Any) -> bytes:
    """Return the bytes of a message of rclpy's: always the same, which leaves chance in gaps."""
    kind: Any = type(message)
    name = known(kind)
    try:
        return bytes(_installed.serialize_cdr(message, name))
    except AttributeError:  # a sequence of numbers, which rosbags awaits as an ndarray
        return bytes(_installed.serialize_cdr(_with_arrays(message, name), name))


def _with_arrays(message: Any, name: str) -> Any:
    """Message of rosbags' class of a type with the values of one, sequences of numbers arrays."""
    fields: Any = _installed.fielddefs[name][1]
    values = []
    for field, (node, detail) in fields:
        value = getattr(message, field)
        if node == Nodetype.NAME:
            value = _with_arrays(value, detail)
        elif node != Nodetype.BASE:
            (inner, kind), _ = detail
            if inner == Nodetype.NAME:
                value = [_with_arrays(it, kind) for it in value]
            elif kind[0] != 'string':
                value = np.asarray(value, _DTYPES.get(kind[0], kind[0]))
        values.append(value)
    return _installed.types[name](*values)


@cache
def known(kind: type) -> str:
    """Name of an installed type, which is registered and has its readers from here on."""
    name, text, _ = definition_of(kind)
    register(_installed, get_types_from_msg(text, name))
    _installed.get_msgdef(name)
    return name


def padded(codes: Iterable[str]) -> Struct:
    """
    Values one after the other, each at a multiple of its size.

    Codes are those of `struct`, one letter each; of bytes a count and `s`.
    """
    parts, at = ['<'], 0
    for code in codes:
        pad = -at % (1 if code.endswith('s') else calcsize(code))
        parts.append(f'{pad}x{code}')
        at += pad + calcsize(f'<{code}')
    return Struct(''.join(parts))
