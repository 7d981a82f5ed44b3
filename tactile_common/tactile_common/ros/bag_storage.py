"""Files of recordings that are not trusted: bounded chunks and types, bags that end too early."""
from collections.abc import Callable, Collection, Generator, Mapping
from pathlib import Path
from typing import Any

from lz4.frame import LZ4FrameDecompressor
from rosbags.interfaces import Connection, Nodetype
from rosbags.rosbag2 import Reader, ReaderError, storage_mcap
from rosbags.rosbag2.reader import DirectoryReader
from rosbags.rosbag2.storage_mcap import McapReader
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

from tactile_common.errors import ConfigurationError

MAX_CHUNK = 64 << 20  # bytes of a decompressed MCAP chunk; writers use 1 to 4 MB
MAX_DEFINITION = 128 << 10  # characters of a message definition with nested types
_DATA_END = 0x0F  # opcode of the end of the data
_HEADER = 9  # bytes of an opcode and a length


def check_types(types: Mapping[str, Any]) -> None:
    """
    Refuse message types, as parsed by rosbags, that can take more memory than their bytes.

    These are sequences of empty types, and arrays of fixed length, for which rosbags generates
    code for each item, unless they are of numbers. Raises a ConfigurationError.
    """
    for name, (_, fields) in types.items():
        if not fields:
            raise ConfigurationError(f'the definition of {name} has no field')
        for field, (node, detail) in fields:
            if node == Nodetype.ARRAY:
                (inner, kind), _ = detail
                if inner != Nodetype.BASE or kind[0] in ('string', 'wstring'):
                    raise ConfigurationError(
                        f'{field} of {name} is an array of fixed length, only read of numbers')


def _bounded(make: Callable[[], Any]) -> Callable[[bytes, int], bytes]:
    """Return a decompressor of chunks to the size that they declare, at most `MAX_CHUNK`."""
    def decompress(data: bytes, size: int) -> bytes:
        if size > MAX_CHUNK:
            raise ReaderError(
                f'a chunk of {size / 1e6:.0f} MB, at most {MAX_CHUNK / 1e6:.0f} MB are read')
        try:  # one more byte reveals a chunk larger than declared
            return make().decompress(data, max_length=size + 1)
        except (storage_mcap.zstd.ZstdError, RuntimeError, EOFError) as error:
            raise ReaderError(f'a chunk of {len(data)} bytes is damaged: {error}') from error
    return decompress


storage_mcap.DECOMPRESSORS.update(
    lz4=_bounded(LZ4FrameDecompressor), zstd=_bounded(storage_mcap.zstd.ZstdDecompressor))


class _WholePart(McapReader):
    """Reader of an MCAP file; a truncated file is read up to its last whole record."""

    cut = ''  # description of the truncation, if any

    def _open(self) -> None:
        try:
            super()._open()
        except (ReaderError, OSError, TypeError, AssertionError) as error:
            if not self.data_start:
                raise
            self.data_end = self._end_of_whole_records()
            self.cut = (f'{Path(str(self.path)).name} ends at byte {self.path.stat().st_size} '
                        f'without its index, whole up to byte {self.data_end}: {error}')
            for known in (self.schemas, self.channels, self.connections, self.chunks):
                known.clear()
            self.meta_scan()
            assert self.statistics
            counts, found = self.statistics.channel_message_counts, self.statistics
            self.connections = [it._replace(msgcount=counts.get(it.id, 0))
                                for it in self.connections]
            self.metadata = self.metadata._replace(
                message_count=found.message_count, start_time=found.start_time,
                end_time=found.end_time, duration=max(found.end_time - found.start_time, 0))

    def _end_of_whole_records(self) -> int:
        assert self.bio
        size, end = self.path.stat().st_size, self.data_start
        while True:
            self.bio.seek(end)
            head = self.bio.read(_HEADER)
            after = end + _HEADER + int.from_bytes(head[1:], 'little')
            if len(head) < _HEADER or head[0] in (0, _DATA_END) or after > size:
                return end
            end = after

    def messages(self, connections: Collection[Connection], start: int | None = None,
                 stop: int | None = None) -> Generator[tuple[Connection, int, bytes], None, None]:
        """Read messages; those of a truncated file come in the order of writing."""
        read = self.messages_scan if self.cut else super().messages
        yield from read(connections, start, stop)


class _Folder(DirectoryReader):
    STORAGE_PLUGINS = {'mcap': _WholePart, 'sqlite3': Sqlite3Reader}


class WholeReader(Reader):
    """
    Reader of a bag, complete or truncated; it is open.

    A recorder that was killed leaves a folder without metadata; then its file is read.
    """

    STORAGE_PLUGINS = {'dir': _Folder, '.mcap': _WholePart, '.db3': Sqlite3Reader}

    def __init__(self, path: Path):
        files = list(path.glob('*.mcap')) if path.is_dir() else []
        whole = len(files) != 1 or (path / 'metadata.yaml').exists()
        super().__init__(path if whole else files[0])
        self.open()

    @property
    def cut(self) -> str:
        """Where the bag is truncated, and how this is known; empty if it is complete."""
        storages = getattr(self.storage, 'storages', [self.storage])
        return '; '.join(filter(None, (getattr(storage, 'cut', '') for storage in storages)))
