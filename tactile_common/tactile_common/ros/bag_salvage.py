"""Reader of the intact part of a bag that its recorder did not finish."""
from collections.abc import Collection, Generator
from pathlib import Path

from rosbags.interfaces import Connection
from rosbags.rosbag2 import Reader, ReaderError
from rosbags.rosbag2.reader import DirectoryReader
from rosbags.rosbag2.storage_mcap import McapReader
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

_DATA_END = 0x0F  # opcode of the end of the data
_HEADER = 9  # bytes of an opcode and a length


class _WholePart(McapReader):
    """Reader of an MCAP file; a truncated file is read up to its last whole record."""

    cut = ''  # description of the truncation, if any

    def _open(self) -> None:
        try:
            super()._open()
        except (ReaderError, OSError, TypeError, AssertionError) as error:
            if not self.data_start:
                raise
            self._find_end()
            name, size = Path(str(self.path)).name, self.path.stat().st_size
            self.cut = (f'{name} ends at byte {size} without its index, whole up to byte '
                        f'{self.data_end}: {error}')
            self.schemas.clear()
            self.channels.clear()
            self.connections.clear()
            self.chunks.clear()
            self.meta_scan()
            assert self.statistics
            counts, found = self.statistics.channel_message_counts, self.statistics
            self.connections = [it._replace(msgcount=counts.get(it.id, 0))
                                for it in self.connections]
            self.metadata = self.metadata._replace(
                message_count=found.message_count, start_time=found.start_time,
                end_time=found.end_time, duration=max(found.end_time - found.start_time, 0))

    def messages(self, connections: Collection[Connection], start: int | None = None,
                 stop: int | None = None) -> Generator[tuple[Connection, int, bytes], None, None]:
        """Read messages; those of a truncated file come in the order of writing."""
        read = self.messages_scan if self.cut else super().messages
        yield from read(connections, start, stop)

    def _find_end(self) -> None:
        """Set `data_end` to the end of the last whole record."""
        assert self.bio
        size, self.data_end = self.path.stat().st_size, self.data_start
        while True:
            self.bio.seek(self.data_end)
            head = self.bio.read(_HEADER)
            end = self.data_end + _HEADER + int.from_bytes(head[1:], 'little')
            if len(head) < _HEADER or head[0] in (0, _DATA_END) or end > size:
                return
            self.data_end = end


class _Folder(DirectoryReader):
    STORAGE_PLUGINS = {'mcap': _WholePart, 'sqlite3': Sqlite3Reader}


class WholeReader(Reader):
    """
    Reader of a bag; `cut` says where a truncated bag ends.

    A recorder that was killed leaves a folder without metadata; then its file is read.
    """

    STORAGE_PLUGINS = {'dir': _Folder, '.mcap': _WholePart, '.db3': Sqlite3Reader}

    @property
    def cut(self) -> str:
        """Where the bag is truncated, and how this is known; empty if it is complete."""
        storages = getattr(self.storage, 'storages', [self.storage])
        return '; '.join(filter(None, (getattr(storage, 'cut', '') for storage in storages)))


def open_whole(path: Path) -> WholeReader:
    """Open a bag, complete or truncated."""
    if path.is_dir() and not (path / 'metadata.yaml').exists():
        files = sorted(path.glob('*.mcap'))
        if len(files) == 1:
            path = files[0]
    reader = WholeReader(path)
    reader.open()
    return reader
