"""Reader of numbers in a text file (`.csv`), a few rows at a time."""

from collections.abc import Iterator
import os

import numpy as np

from tactile_common.errors import ConfigurationError

MAX_LINE = 4 << 20  # bytes
_SEPARATORS = (b',', b';', b'\t')  # otherwise white space
_BYTE_ORDER_MARK = b'\xef\xbb\xbf'
_WHOLE = b'0123456789+-,; \t\r\n'  # characters of integers and separators


class TableReader:
    """
    A table in a text file, read in chunks of rows; same interface as `ArrayReader`.

    Commas, semicolons, tabs or blanks separate the numbers. The first line may be a header. Empty
    lines and lines that begin with # are ignored. The type is integer if all numbers are integers.

    Raises
    ------
    ConfigurationError
        The file cannot be read, has no row, or a line has not as many numbers as the first.
    """

    def __init__(self, path: str | os.PathLike):
        self._path, self._columns, self._separator, self._header = path, 0, None, 0
        count, whole = 0, True
        for number, line in self._lines():
            if self._columns == 0:
                self._separator = next((it for it in _SEPARATORS if it in line), None)
                try:
                    self._columns = len(np.array(self._cells(line), dtype=float))
                except ValueError:
                    if self._header:
                        raise self._refusal(number, 'is not a row of numbers') from None
                    self._header = number
                    continue
            count += 1
            whole &= not line.translate(None, _WHOLE)
        if count == 0:
            raise ConfigurationError(f'{path}: holds no row of numbers')
        self.shape = count, self._columns
        self.dtype = np.dtype(np.int64 if whole else np.float64)

    def chunks(self, rows: int) -> Iterator[np.ndarray]:
        """Yield chunks of `rows` rows (the last may be shorter); raises a ConfigurationError."""
        part = []
        for number, line in self._lines():
            if number == self._header:
                continue
            cells = self._cells(line)
            if len(cells) != self._columns:
                raise self._refusal(
                    number, f'has {len(cells)} numbers, the first row has {self._columns}')
            try:
                part.append(np.array(cells, dtype=float))
            except ValueError as error:
                raise self._refusal(number, str(error)) from None
            if len(part) == rows:
                yield np.array(part).astype(self.dtype)
                part.clear()
        if part:
            yield np.array(part).astype(self.dtype)

    def _lines(self) -> Iterator[tuple[int, bytes]]:
        """Yield the lines with content and their numbers from 1."""
        try:
            with open(self._path, 'rb') as stream:
                number = 0
                while line := stream.readline(MAX_LINE + 1):
                    number += 1
                    if len(line) > MAX_LINE:
                        raise self._refusal(number, f'is longer than {MAX_LINE} bytes')
                    line = line.removeprefix(_BYTE_ORDER_MARK).strip()
                    if line and not line.startswith(b'#'):
                        yield number, line
        except OSError as error:
            raise ConfigurationError(f'{self._path}: cannot be read: {error.strerror}') from error

    def _cells(self, line: bytes) -> list[bytes]:
        return line.split(self._separator)

    def _refusal(self, number: int, text: str) -> ConfigurationError:
        return ConfigurationError(f'{self._path}: line {number} {text}')
