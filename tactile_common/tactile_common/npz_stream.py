"""Arrays in `.npz` archives, read and written a few rows at a time."""
from contextlib import contextmanager
import lzma
import math
import os
from pathlib import Path
import shutil
import tempfile
import zipfile
import zlib

import numpy as np
from numpy.lib import format as npy

from tactile_common.errors import ConfigurationError

_HEADERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}
_DAMAGED = (ValueError, EOFError, RuntimeError, zipfile.BadZipFile, zlib.error, lzma.LZMAError)


@contextmanager
def _clear_errors(path):
    """Tell what is wrong with an archive in one line that names it."""
    try:
        yield
    except ConfigurationError as error:
        raise ConfigurationError(f'{path}: {error}') from error
    except OSError as error:
        raise ConfigurationError(
            f'{path}: cannot be read: {error.strerror or error}') from error
    except _DAMAGED as error:
        raise ConfigurationError(
            f'{path}: is not an .npz archive of numbers, or damaged') from error


class ArrayReader:
    """
    One array of an `.npz` archive, compressed or not, in chunks along its first axis.

    Parameters
    ----------
    path : str or os.PathLike
        Archive, as numpy.savez or numpy.savez_compressed write it.
    name : str
        Which array.

    Attributes
    ----------
    shape : tuple of int
    dtype : np.dtype

    Raises
    ------
    ConfigurationError
        The file cannot be read, is no archive, is damaged or lacks the array.
    """

    def __init__(self, path, name):
        self._path, self._name = path, name
        with _clear_errors(path), zipfile.ZipFile(path) as archive:
            members = archive.namelist()
            if f'{name}.npy' not in members:
                there = sorted(member.removesuffix('.npy') for member in members)
                raise ConfigurationError(f'array {name!r} is missing, there are {there}')
            with archive.open(f'{name}.npy') as stream:
                self.shape, self._column_major, self.dtype = self._header(stream)
                size = math.prod(self.shape) * self.dtype.itemsize
                whole = archive.getinfo(f'{name}.npy').file_size
                if min(self.shape, default=0) < 0 or (
                        not self.dtype.hasobject and stream.tell() + size != whole):
                    raise ConfigurationError(
                        f'{name} is damaged: {whole} bytes do not hold an array of '
                        f'{self.shape} {self.dtype}')

    @staticmethod
    def _header(stream):
        version = npy.read_magic(stream)
        if version not in _HEADERS:
            raise ConfigurationError(f'.npy format {version} is not of plain numbers')
        return _HEADERS[version](stream)

    def chunks(self, rows):
        """
        Yield the array in order, `rows` at a time; the last chunk may be shorter.

        Parameters
        ----------
        rows : int
            Rows in a chunk.

        Raises
        ------
        ConfigurationError
            The archive is damaged.
        """
        with _clear_errors(self._path), zipfile.ZipFile(self._path) as archive, \
                archive.open(f'{self._name}.npy') as stream:
            self._header(stream)
            yield from (self._mapped if self._column_major else self._streamed)(stream, rows)

    def _streamed(self, stream, rows):
        row_size = math.prod(self.shape[1:]) * self.dtype.itemsize
        for first in range(0, self.shape[0], rows):
            count = min(rows, self.shape[0] - first)
            values = np.frombuffer(stream.read(count * row_size), self.dtype)
            yield values.reshape(count, *self.shape[1:])

    def _mapped(self, stream, rows):
        """Rows of a column-major array lie apart: copy it to a file that allows jumps."""
        with tempfile.TemporaryFile() as copy:
            shutil.copyfileobj(stream, copy)
            copy.flush()
            values = np.memmap(copy, self.dtype, 'r', shape=self.shape, order='F')
            for first in range(0, self.shape[0], rows):
                yield np.array(values[first:first + rows], order='C')


class RecordWriter:
    """
    Rows of a table, appended chunk by chunk; the file appears when all of them are written.

    Use as a context manager: after an exception no file is left, and an old one stays.

    Parameters
    ----------
    path : str or os.PathLike
        File to write: `.npz`, one array per field (uncompressed, so that they can be mapped),
        or `.csv`, one line per row.
    dtype : np.dtype
        Structured type of a row.
    count : int
        Rows that will be appended.

    Raises
    ------
    ConfigurationError
        The ending is neither of the two, or the folder does not exist or cannot be written.
    """

    def __init__(self, path, dtype, count):
        self._path, self._dtype, self._count = Path(path), dtype, count
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
        self._table = self._path.suffix == '.csv'
        names = ['table'] if self._table else dtype.names
        self._parts = {name: open(self._part(name), 'wb') for name in names}
        self._row = 0

    def _part(self, name):
        return Path(self._folder.name, name)

    def __enter__(self):
        if self._table:
            header = ','.join(['frame', *csv_columns(self._dtype)])
            self._parts['table'].write(f'{header}\n'.encode())
        return self

    def __exit__(self, kind, *_):
        with self._folder:
            for part in self._parts.values():
                part.close()
            if kind is None:
                if not self._table:
                    self._gather()
                os.replace(self._part('table'), self._path)

    def append(self, records):
        """
        Append rows.

        Parameters
        ----------
        records : np.ndarray
            Structured array, shape `(n,)`.
        """
        if self._table:
            self._parts['table'].write(self._lines(records).encode())
        else:
            for name, part in self._parts.items():
                part.write(np.ascontiguousarray(records[name]).data)
        self._row += len(records)

    def _lines(self, records):
        fields = []
        for name in self._dtype.names:
            values = records[name]
            if values.dtype == bool:
                values = values.astype(np.uint8)
            if values.ndim > 1:
                upper = np.triu_indices(values.shape[1])
                fields += values[:, upper[0], upper[1]].T.tolist()
            else:
                fields.append(values.tolist())
        rows = enumerate(zip(*fields, strict=True), start=self._row)
        return ''.join(f'{row},{",".join(map(repr, values))}\n' for row, values in rows)

    def _gather(self):
        # Entries of a zip archive follow each other, hence a file for each until now.
        with zipfile.ZipFile(self._part('table'), 'w') as archive:
            for name in self._dtype.names:
                item, shape = self._dtype[name].base, self._dtype[name].shape
                with archive.open(f'{name}.npy', 'w', force_zip64=True) as member:
                    npy.write_array_header_1_0(member, {
                        'descr': npy.dtype_to_descr(item), 'fortran_order': False,
                        'shape': (self._count, *shape)})
                    with open(self._part(name), 'rb') as part:
                        shutil.copyfileobj(part, member, 1 << 20)
                self._part(name).unlink()


def csv_columns(dtype):
    """
    Names of the columns that a row becomes in a `.csv` file.

    Of a symmetric matrix only the upper triangle: `NAME_0_0, NAME_0_1, ...`.
    """
    names = []
    for name in dtype.names:
        if dtype[name].shape:
            pairs = zip(*np.triu_indices(dtype[name].shape[0]), strict=True)
            names += [f'{name}_{row}_{column}' for row, column in pairs]
        else:
            names.append(name)
    return names
