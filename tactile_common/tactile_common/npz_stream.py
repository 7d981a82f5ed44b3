"""Read and write files of arrays: `.npz`, `.npy`, `.csv`; sizes are checked before expansion."""
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
import csv
from io import BytesIO
import math
import os
from pathlib import Path
from typing import Any, IO
import zipfile
import zlib

import numpy as np
from numpy.lib import format as npy

from tactile_common.atomic_file import replacing
from tactile_common.errors import ConfigurationError

MAX_WHOLE = 64 << 20  # bytes of arrays that are read at once
MAX_ROW = 4 << 20  # bytes of one row, the smallest unit of reading
_HEADERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}
_DAMAGED = (ValueError, EOFError, RuntimeError, MemoryError, zipfile.BadZipFile, zlib.error)
# NumPy writes only these. Others may allocate gigabytes before they return a byte.
_COMPRESSIONS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)


@contextmanager
def clear_errors(path: str | os.PathLike) -> Iterator[None]:
    """Raise errors of a file of arrays as a ConfigurationError: one line that names the file."""
    try:
        yield
    except ConfigurationError as error:
        raise ConfigurationError(f'{path}: {error}') from error
    except OSError as error:
        raise ConfigurationError(f'{path}: cannot be read: {error.strerror or error}') from error
    except _DAMAGED as error:
        kind = '.npy array' if Path(path).suffix.lower() == '.npy' else '.npz archive'
        raise ConfigurationError(f'{path}: is not an {kind} of numbers, or damaged') from error


def read_arrays(path: str | os.PathLike, names: Collection[str],
                optional: Collection[str] = ()) -> dict[str, np.ndarray]:
    """
    Read whole arrays of an `.npz` archive; optional ones only if they exist.

    Raises
    ------
    ConfigurationError
        `ArrayReader` refuses an array, or all arrays together exceed `MAX_WHOLE` bytes.
    """
    with clear_errors(path), zipfile.ZipFile(path) as archive:
        there = set(archive.namelist())
    readers = {name: ArrayReader(path, name)
               for name in (*names, *(name for name in optional if f'{name}.npy' in there))}
    with clear_errors(path):
        refuse_above(MAX_WHOLE, sum(reader.size for reader in readers.values()),
                     ' and '.join(f'{name} {reader.shape}' for name, reader in readers.items()))
    return {name: reader.read() for name, reader in readers.items()}


def write_arrays(path: str | os.PathLike, **arrays: Any) -> None:
    """Write an `.npz` archive atomically: if the process dies, the earlier file remains."""
    with replacing(path) as part, part.open('wb') as file:
        np.savez(file, **arrays)


def write_records(path: str | os.PathLike, records: np.ndarray) -> None:
    """Write records (N,): in an `.npz` an array for each field, in a `.csv` a row for each one."""
    if Path(path).suffix.lower() == '.npz':
        write_arrays(path, **{name: records[name] for name in records.dtype.names or ()})
        return
    columns = dict(_columns(records))
    with open(path, 'w', encoding='utf-8', newline='') as file:
        table = csv.writer(file, lineterminator='\n')
        table.writerow(['frame', *columns])
        table.writerows(zip(range(len(records)), *(
            values.tolist() for values in columns.values()), strict=True))


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


def scalar(name: str, value: np.ndarray) -> float:
    """Return the number in an array of size one; ConfigurationError if it is not finite."""
    if value.size != 1 or value.dtype.kind not in 'uif' or not math.isfinite(value.item()):
        raise ConfigurationError(
            f'{name} is {(value if value.size < 10 else value.ravel()[:10]).tolist()!r:.60}, '
            'must be one finite number')
    return float(value.item())


def refuse_above(most: int, size: int, what: str) -> None:
    """Raise a ConfigurationError if something has more bytes than allowed."""
    if size > most:
        raise ConfigurationError(
            f'{what} would take {size / 1e6:.0f} MB, at most {most / 1e6:.0f} MB are read')


@contextmanager
def _opened(path: str | os.PathLike, name: str) -> Iterator[tuple[IO[bytes], int]]:
    """Open an `.npy` file, or one array of an archive; yields the stream and its length."""
    if Path(path).suffix.lower() == '.npy':
        with open(path, 'rb') as stream:
            yield stream, os.fstat(stream.fileno()).st_size
        return
    with zipfile.ZipFile(path) as archive:
        members = archive.namelist()
        if f'{name}.npy' not in members:
            there = sorted(member.removesuffix('.npy')[:40] for member in members)
            raise ConfigurationError(f'array {name!r} is missing, there are {there[:20]}'
                                     + ' and more' * (len(there) > 20))
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
        The file cannot be read, is not an archive of numbers, is damaged or lacks the array, or
        one of its rows is larger than `MAX_ROW`.
    """

    def __init__(self, path: str | os.PathLike, name: str):
        self._path, self._name = path, name
        with clear_errors(path), _opened(path, name) as (stream, there):
            head = BytesIO(stream.read(10_000))  # bounded: do not trust the length in the header
            version = npy.read_magic(head)
            if version not in _HEADERS:
                raise ConfigurationError(f'.npy format {version} is not of plain numbers')
            self.shape, self._column_major, self.dtype = _HEADERS[version](head)
            if self.dtype.hasobject:
                raise ValueError
            self._begin = head.tell()
            self.size = math.prod(self.shape) * self.dtype.itemsize  # [bytes]
            if min(self.shape, default=0) < 0 or self._begin + self.size != there:
                raise ConfigurationError(
                    f'{name} is damaged: {there} bytes do not hold an array of '
                    f'{self.shape} {self.dtype}')
            row = math.prod(self.shape[1:]) * self.dtype.itemsize
            refuse_above(MAX_ROW, row, f'a row of {name}, {self.shape[1:]} {self.dtype},')

    def read(self) -> np.ndarray:
        """Return the whole array, at most `MAX_WHOLE` bytes; raises a ConfigurationError."""
        with clear_errors(self._path):
            refuse_above(MAX_WHOLE, self.size, f'{self._name} {self.shape}')
            (values,) = self._read((math.prod(self.shape),))
            return values.reshape(self.shape, order='F' if self._column_major else 'C')

    def chunks(self, rows: int) -> Iterator[np.ndarray]:
        """Yield chunks of `rows` rows (the last may be shorter); raises a ConfigurationError."""
        count = self.shape[0]
        if self._column_major:  # its rows are not contiguous
            yield from chunks_of(self.read(), rows)
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


def chunks_of(values: np.ndarray, rows: int) -> Iterator[np.ndarray]:
    """Yield chunks of `rows` rows of an array; the last may be shorter."""
    yield from (values[first:first + rows] for first in range(0, len(values), rows))


def read_table(path: str | os.PathLike) -> np.ndarray:
    """
    Read a table of numbers (rows, columns) from a text file (`.csv`).

    Commas, semicolons, tabs or blanks separate the numbers; between semicolons or tabs, a comma is
    a decimal point. The first line may be a header, also of column numbers 0, 1, 2 and so on.
    Empty lines, lines that begin with # and separators at the end of all lines are ignored. The
    type is integer if all numbers are integers.

    Raises
    ------
    ConfigurationError
        The file cannot be read, has more than `MAX_WHOLE` bytes, or is not such a table.
    """
    with clear_errors(path):
        refuse_above(MAX_WHOLE, os.path.getsize(path), 'the table (save it as .npy)')
        text = Path(path).read_text('utf-8-sig', errors='replace')
        lines = [line for line in map(str.strip, text.splitlines())
                 if line and not line.startswith('#')]
        separator = next((it for line in (*lines[-1:], *lines[:1])  # the first: a header?
                          for it in ';\t,' if it in line), None)
        if separator in (';', '\t'):
            lines = [line.replace(',', '.') for line in lines]
        if lines and _is_header(lines[0].removesuffix(separator or ' ').split(separator)):
            del lines[0]
        if not lines:
            raise ConfigurationError('holds no row of numbers')
        if separator and all(line.endswith(separator) for line in lines):
            lines = [line[:-1] for line in lines]
        whole = not set(''.join(lines)) - set('0123456789+-,; \t')
        try:
            return np.loadtxt(
                lines, np.int64 if whole else np.float64, delimiter=separator, ndmin=2)
        except ValueError as error:
            raise ConfigurationError(f'is not a table of numbers: {error}') from error


def _is_header(cells: list[str]) -> bool:
    try:
        [float(cell) for cell in cells]
    except ValueError:
        return True
    return len(cells) > 1 and [cell.strip() for cell in cells] == [*map(str, range(len(cells)))]
