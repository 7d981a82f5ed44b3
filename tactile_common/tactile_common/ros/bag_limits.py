"""Size limits of untrusted recordings, checked before anything is expanded."""
from collections.abc import Callable, Mapping
from typing import Any

from lz4.frame import LZ4FrameDecompressor
from rosbags.interfaces import Nodetype
from rosbags.rosbag2 import ReaderError, storage_mcap

from tactile_common.errors import ConfigurationError

MAX_CHUNK = 64 << 20  # bytes of a decompressed MCAP chunk; writers use 1 to 4 MB
MAX_DEFINITION = 128 << 10  # characters of a message definition with nested types
MAX_VALUES = 10_000  # of a message with empty sequences; an array of numbers counts once


def bound_chunks() -> None:
    """Limit the MCAP reader to the size that a chunk declares, and to `MAX_CHUNK`."""
    storage_mcap.DECOMPRESSORS['lz4'] = _bounded(LZ4FrameDecompressor)
    storage_mcap.DECOMPRESSORS['zstd'] = _bounded(storage_mcap.zstd.ZstdDecompressor)


def _bounded(make: Callable[[], Any]) -> Callable[[bytes, int], bytes]:
    def decompress(data: bytes, size: int) -> bytes:
        if size > MAX_CHUNK:
            raise ReaderError(
                f'a chunk of {size / 1e6:.0f} MB, at most {MAX_CHUNK / 1e6:.0f} MB are read')
        try:  # one more byte reveals a chunk larger than declared
            return make().decompress(data, max_length=size + 1)
        except (storage_mcap.zstd.ZstdError, RuntimeError, EOFError) as error:
            raise ReaderError(f'a chunk of {len(data)} bytes is damaged: {error}') from error
    return decompress


def check_text(name: str, text: str) -> None:
    """Raise a ConfigurationError if the text of a message definition is too long."""
    if len(text) > MAX_DEFINITION:
        raise ConfigurationError(f'the definition of {name} has {len(text)} characters, at most '
                                 f'{MAX_DEFINITION} are read')


def check_types(types: Mapping[str, Any], known: Mapping[str, Any]) -> None:
    """
    Refuse message types, as parsed by rosbags, that have too many values.

    `known` are the types that they may contain. Raises a ConfigurationError.
    """
    everything = {**known, **types}
    counts: dict[str, int] = {}

    def of_type(name: str, inside: tuple[str, ...]) -> int:
        if name in inside:
            raise ConfigurationError(f'the definition of {name} contains itself')
        if name not in counts:
            fields = everything[name][1] if name in everything else ()
            counts[name] = sum(of_field(kind, (*inside, name)) for _, kind in fields)
        return counts[name]

    def of_field(kind: Any, inside: tuple[str, ...]) -> int:
        node, detail = kind
        if node == Nodetype.BASE:
            return 1
        if node == Nodetype.NAME:
            return of_type(detail, inside)
        (inner, inner_detail), length = detail
        number = inner == Nodetype.BASE and inner_detail[0] not in ('string', 'wstring')
        each = 1 if inner == Nodetype.BASE else of_type(inner_detail, inside)
        if each == 0:
            raise ConfigurationError(f'{inside[-1]} has an array of {inner_detail}, of nothing')
        return each if number or node == Nodetype.SEQUENCE else length * each

    for name in types:
        count = of_type(name, ())
        if count > MAX_VALUES:
            raise ConfigurationError(
                f'a message of type {name} has at least {count} values, at most {MAX_VALUES} '
                'are read')
