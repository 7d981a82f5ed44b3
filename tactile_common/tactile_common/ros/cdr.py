"""
Messages read from the bytes that go over the wire (CDR, little endian), and laid out as such.

rclpy makes a message of them through its setters and checks, several times as slow. What is read
here has the fields of the message and cannot be assigned to; sequences of numbers are ndarrays.
"""
from collections import namedtuple
from collections.abc import Callable, Iterable
from functools import cache
from importlib import import_module
from itertools import groupby
from struct import calcsize, Struct
from typing import Any

import numpy as np
from rosidl_parser.definition import (
    AbstractSequence,
    AbstractString,
    Array,
    BasicType,
    NamespacedType,
)

HEAD = b'\0\1\0\0'  # of plain CDR, little endian; offsets count from behind it
CODES = {'boolean': '?', 'int8': 'b', 'uint8': 'B', 'int16': 'h', 'uint16': 'H', 'int32': 'i',
         'uint32': 'I', 'int64': 'q', 'uint64': 'Q', 'float': 'f', 'double': 'd'}
_COUNT = Struct('<I')


def padded(codes: Iterable[str], at: int = 0) -> Struct:
    """
    Values one after the other, each at a multiple of its size, the first at an offset.

    Codes are those of `struct`, one letter each; of bytes a count and `s`.
    """
    parts = ['<']
    for code in codes:
        size = 1 if code.endswith('s') else calcsize(code)
        pad = -at % size
        parts.append(f'{pad}x{code}')
        at += pad + calcsize(f'<{code}')
    return Struct(''.join(parts))


@cache
def reader(kind: Any) -> Callable:
    """
    Return a function of the bytes behind `HEAD` and an offset: the message, and where it ends.

    It raises `struct.error` or ValueError where the bytes are none of this kind. The bytes must
    be a bytearray, so that the arrays in what is read can be written to. TypeError of a message
    that has wide strings or the like.
    """
    names, types = tuple(kind.get_fields_and_field_types()), kind.SLOT_TYPES
    make: Any = namedtuple(kind.__name__, names)._make  # type: ignore[attr-defined, misc]
    parts: list[tuple[list[Struct] | None, Any]] = []
    for basic, group in groupby(types, lambda one: isinstance(one, BasicType)):
        if basic:
            codes = [_code(one) for one in group]
            parts.append(([padded(codes, at) for at in range(8)], None))
        else:
            parts += [(None, _reader_of(one)) for one in group]

    def read(body, at):
        values = []
        for structs, inner in parts:
            if structs is None:
                value, at = inner(body, at)
                values.append(value)
            else:
                struct = structs[at & 7]
                values += struct.unpack_from(body, at)
                at += struct.size
        return make(values), at
    return read


def _code(kind):
    try:
        return CODES[kind.typename]
    except KeyError:
        raise TypeError(f'fields of type {kind.typename} are not read') from None


def _reader_of(kind):
    """Return the reader of a field that is not a plain number."""
    if isinstance(kind, NamespacedType):
        return reader(getattr(import_module('.'.join(kind.namespaces)), kind.name))
    if isinstance(kind, AbstractString):
        return _string
    if not isinstance(kind, (Array, AbstractSequence)):
        raise TypeError(f'fields of type {kind} are not read')
    count = kind.size if isinstance(kind, Array) else None
    if isinstance(kind.value_type, BasicType):
        return _numbers(np.dtype(f'<{_code(kind.value_type)}'), count)
    return _several(_reader_of(kind.value_type), count)


def _count(body, at):
    at = at + 3 & ~3
    return _COUNT.unpack_from(body, at)[0], at + 4


def _string(body, at):
    count, at = _count(body, at)
    text = body[at:at + count]
    if len(text) < count:
        raise ValueError('a string is longer than the message')
    return text.removesuffix(b'\0').decode(), at + count


def _numbers(dtype, size):
    align = dtype.itemsize - 1

    def read(body, at):
        count = size
        if count is None:
            count, at = _count(body, at)
            if not count:
                return np.empty(0, dtype), at
        at = at + align & ~align
        return np.frombuffer(body, dtype, count, at), at + count * dtype.itemsize
    return read


def _several(inner, size):
    def read(body, at):
        count = size
        if count is None:
            count, at = _count(body, at)
        values = []
        for _ in range(count):  # ends with the bytes at the latest
            value, at = inner(body, at)
            values.append(value)
        return values, at
    return read
