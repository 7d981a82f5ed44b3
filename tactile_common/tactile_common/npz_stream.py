"""Read `.npz` and `.npy` arrays a few rows at a time; sizes are checked before expansion."""
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from io import BytesIO
import math
import os
from pathlib import Path
import shutil
import tempfile
from typing import Any, IO
import zipfile
import zlib

import numpy as np
from numpy.lib import format as npy

from tactile_common.errors import ConfigurationError

MAX_WHOLE = 64 << 20  # bytes of arrays that are read at once
MAX_ROW = 4 << 20  # bytes of one row, the smallest unit of reading
MAX_MEMBERS = 1000  # arrays of an archive
_HEADERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}
_DAMAGED = (ValueError, EOFError, RuntimeError, MemoryError, zipfile.BadZipFile, zlib.error)
# NumPy writes only these. Others may allocate gigabytes before they return a byte.
_COMPRESSIONS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)


@contextmanager
def clear_errors(path: str | os.PathLike) -> Iterator[None]:
    """Raise errors of an archive as a ConfigurationError: one line that names the file."""
    try:
        yield
    except ConfigurationError as error:
        raise ConfigurationError(f'{path}: {error}') from error
    except OSError as error:
        raise ConfigurationError(f'{path}: cannot be read: {error.strerror or error}') from error
    except _DAMAGED as error:
        raise ConfigurationError(
            f'{path}: is not an {_kind(path)} of numbers, or damaged') from error


def _kind(path: str | os.PathLike) -> str:
    return '.npy array' if _is_plain(path) else '.npz archive'


def _is_plain(path: str | os.PathLike) -> bool:
    """Return True if a file is a single array, not an archive."""
    return Path(path).suffix == '.npy'


def read_arrays(path: str | os.PathLike, names: Collection[str],
                optional: Collection[str] = ()) -> dict[str, np.ndarray]:
    """
    Read whole arrays of an `.npz` archive; optional ones only if they exist.

    Raises
    ------
    ConfigurationError
        `ArrayReader` refuses an array, or all arrays together exceed `MAX_WHOLE` bytes.
    """
    with clear_errors(path), _archive(path) as archive:
        there = set(archive.namelist())
    readers = {name: ArrayReader(path, name)
               for name in (*names, *(name for name in optional if f'{name}.npy' in there))}
    with clear_errors(path):
        _refuse_above(MAX_WHOLE, sum(reader.size for reader in readers.values()),
                      ' and '.join(f'{name} {reader.shape}' for name, reader in readers.items()))
    return {name: reader.read() for name, reader in readers.items()}


def write_arrays(path: str | os.PathLike, **arrays: Any) -> None:
    """Write an `.npz` archive atomically: if the process dies, the earlier file remains."""
    part = Path(f'{path}.{os.getpid()}.part')
    try:
        with open(part, 'wb') as file:
            np.savez(file, **arrays)
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def scalar(name: str, value: np.ndarray) -> float:
    """Return the number in an array of size one; ConfigurationError if it is not finite."""
    if value.size != 1 or value.dtype.kind not in 'uif' or not math.isfinite(value.item()):
        raise ConfigurationError(
            f'{name} is {(value if value.size < 10 else value.ravel()[:10]).tolist()!r:.60}, '
            'must be one finite number')
    return float(value.item())


def _archive(path: str | os.PathLike) -> zipfile.ZipFile:
    archive = zipfile.ZipFile(path)
    if len(archive.filelist) > MAX_MEMBERS:
        archive.close()
        raise ConfigurationError(
            f'has {len(archive.filelist)} arrays, at most {MAX_MEMBERS} are allowed')
    return archive


def _names(members: list[str]) -> str:
    names = sorted(member.removesuffix('.npy')[:40] for member in members)
    return f'{names[:20]}{" and more" if len(names) > 20 else ""}'


def _refuse_above(most: int, size: int, what: str) -> None:
    if size > most:
        raise ConfigurationError(
            f'{what} would take {size / 1e6:.0f} MB, at most {most / 1e6:.0f} MB are read')


def _header(stream: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype, int]:
    """Read shape, order, type and length of the header of a `.npy` stream."""
    head = BytesIO(stream.read(10_000))  # bounded: do not trust the length in the header
    version = npy.read_magic(head)
    if version not in _HEADERS:
        raise ConfigurationError(f'.npy format {version} is not of plain numbers')
    return *_HEADERS[version](head), head.tell()


@contextmanager
def _opened(path: str | os.PathLike, name: str) -> Iterator[tuple[IO[bytes], int]]:
    """Open an `.npy` file, or one array of an archive; yields the stream and its length."""
    if _is_plain(path):
        with open(path, 'rb') as stream:
            yield stream, os.fstat(stream.fileno()).st_size
        return
    with _archive(path) as archive:
        members = archive.namelist()
        if f'{name}.npy' not in members:
            raise ConfigurationError(f'array {name!r} is missing, there are {_names(members)}')
        member = archive.getinfo(f'{name}.npy')
        if member.compress_type not in _COMPRESSIONS:
            raise ConfigurationError(f'{name} is compressed in a way that NumPy does not write')
        with archive.open(member) as stream:
            yield stream, member.file_size


class ArrayReader:
    """
    Reader of an `.npy` file, or of array `name` of an `.npz` archive, in chunks of rows.

    The constructor reads only the header. `chunks` and `read` read the data.

    Raises
    ------
    ConfigurationError
        The file cannot be read, is not an archive, is damaged or lacks the array, or one of its
        rows is larger than `MAX_ROW`.
    """

    def __init__(self, path: str | os.PathLike, name: str):
        self._path, self._name = path, name
        with clear_errors(path), _opened(path, name) as (stream, there):
            self.shape, self._column_major, self.dtype, self._begin = _header(stream)
            self.size = math.prod(self.shape) * self.dtype.itemsize  # [bytes]
            if min(self.shape, default=0) < 0 or (
                    not self.dtype.hasobject and self._begin + self.size != there):
                raise ConfigurationError(
                    f'{name} is damaged: {there} bytes do not hold an array of '
                    f'{self.shape} {self.dtype}')
            row = math.prod(self.shape[1:]) * self.dtype.itemsize
            _refuse_above(MAX_ROW, row, f'a row of {name}, {self.shape[1:]} {self.dtype},')
            if self._column_major:  # its rows are not contiguous
                _refuse_above(MAX_WHOLE, self.size, f'{name}, column-major '
                              '(numpy.ascontiguousarray makes it row-major),')

    def read(self) -> np.ndarray:
        """Return the whole array, at most `MAX_WHOLE` bytes; raises a ConfigurationError."""
        if self.dtype.hasobject:
            raise ConfigurationError(f'{self._path}: is not an {_kind(self._path)} of numbers')
        with clear_errors(self._path):
            _refuse_above(MAX_WHOLE, self.size, f'{self._name} {self.shape}')
            (values,) = self._read((math.prod(self.shape),))
            return values.reshape(self.shape, order='F' if self._column_major else 'C')

    def chunks(self, rows: int) -> Iterator[np.ndarray]:
        """Yield chunks of `rows` rows (the last may be shorter); raises a ConfigurationError."""
        count = self.shape[0]
        if self._column_major:
            whole = self.read()
            yield from (whole[first:first + rows] for first in range(0, count, rows))
            return
        row = math.prod(self.shape[1:])
        with clear_errors(self._path):
            for values in self._read(row * min(rows, count - k) for k in range(0, count, rows)):
                yield values.reshape(-1, *self.shape[1:])

    def _read(self, counts: Iterable[int]) -> Iterator[np.ndarray]:
        """Read values in sequence; each item of `counts` is the number of values in one chunk."""
        with _opened(self._path, self._name) as (stream, _):
            stream.seek(self._begin)
            for count in counts:
                yield np.frombuffer(stream.read(count * self.dtype.itemsize), self.dtype)


class RecordWriter:
    """
    Writer of `count` rows of a structured type; the file appears when all rows are written.

    The file is an `.npz` with one uncompressed array per field, so that it can be mapped, or a
    `.csv`. Use the writer as a context manager: after an exception it leaves no new file, and an
    existing file stays.

    Raises
    ------
    ConfigurationError
        The file name has another ending, or the folder does not exist or is not writable.
    """

    def __init__(self, path: str | os.PathLike, dtype: np.dtype, count: int):
        self._path, self._is_table, self._row = Path(path), Path(path).suffix == '.csv', 0
        if self._path.suffix not in ('.npz', '.csv'):
            raise ConfigurationError(f'{path}: must end in .npz or .csv')
        if self._path.is_dir():
            raise ConfigurationError(f'{path}: is a folder')
        try:
            self._folder = tempfile.TemporaryDirectory(
                prefix=f'.{self._path.stem}-', dir=self._path.parent)
        except OSError as error:
            raise ConfigurationError(
                f'{path}: folder {self._path.parent}: {error.strerror}') from error
        # Members of a zip archive are written one after the other, so collect each in a file.
        names = ('table',) if self._is_table else dtype.names or ()
        self._parts = {name: open(Path(self._folder.name, name), 'wb') for name in names}
        if self._is_table:
            header = ['frame', *(name for name, _ in _columns(np.empty(0, dtype)))]
            self._parts['table'].write(f'{",".join(header)}\n'.encode())
            return
        for name, part in self._parts.items():
            npy.write_array_header_1_0(part, {
                'descr': npy.dtype_to_descr(dtype[name].base), 'fortran_order': False,
                'shape': (count, *dtype[name].shape)})

    def __enter__(self) -> 'RecordWriter':
        return self

    def __exit__(self, kind: type | None, *_: Any) -> None:
        with self._folder:
            for part in self._parts.values():
                part.close()
            if kind is None:
                table = Path(self._folder.name, 'table')
                if not self._is_table:
                    self._gather(table)
                os.replace(table, self._path)

    def _gather(self, table: Path) -> None:
        with zipfile.ZipFile(table, 'w') as archive:
            for name, part in self._parts.items():
                with archive.open(f'{name}.npy', 'w', force_zip64=True) as member, \
                        open(part.name, 'rb') as values:
                    shutil.copyfileobj(values, member, 1 << 20)
                os.unlink(part.name)

    def append(self, records: np.ndarray) -> None:
        """Append rows (n,)."""
        if self._is_table:
            columns = (values.tolist() for _, values in _columns(records))
            rows = enumerate(zip(*columns, strict=True), start=self._row)
            self._parts['table'].write(''.join(
                f'{row},{",".join(map(repr, values))}\n' for row, values in rows).encode())
        else:
            for name, part in self._parts.items():
                part.write(np.ascontiguousarray(records[name]).data)
        self._row += len(records)


def _columns(records: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    """Yield names and values of the columns of a `.csv` file; of matrices the upper triangle."""
    for name in records.dtype.names or ():
        values = records[name]
        if values.ndim == 2:
            for column in range(values.shape[1]):
                yield f'{name}_{column}', values[:, column]
        elif values.ndim > 2:
            for row, column in zip(*np.triu_indices(values.shape[1]), strict=True):
                yield f'{name}_{row}_{column}', values[:, row, column]
        else:
            yield name, values.astype(np.uint8) if values.dtype == bool else values
