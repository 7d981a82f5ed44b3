"""
Arrays that print their counts as text.

`csv_lines`: a frame a line, numbers with anything between them. A first number may be the
device's time (`stamp`: ms or us), a last one the sum of all others modulo 65536 (`checksum`).
`vitac`: a row a line, each number followed by a space; an empty line ends the frame.

What was sent before the port was opened may be cut off, so that nothing counts before the first
end of a frame. Without a checksum a digit that changes on the way makes another count.
"""
import numpy as np
from numpy.typing import DTypeLike

from tactile_common.errors import ConfigurationError
from tactile_sensing.devices.protocol import Decoder, Device, Piece

DIGITS = 12  # bytes a number, with what is around it
MODULUS = 1 << 16  # of the checksum
TICKS = {'ms': 1_000_000, 'us': 1000}  # ns
# Letters stay, so that text is no number; `_` would be skipped within one.
_NUMBERS = bytes(byte if chr(byte).isalnum() and byte < 128 or chr(byte) in '+-.' else 32
                 for byte in range(256))


def numbers(text: bytes) -> np.ndarray:
    """Return the numbers of a text, whatever separates them; empty if it holds something else."""
    try:
        return np.array(list(map(float, text.translate(_NUMBERS).split())))
    except ValueError:
        return np.empty(0)


class LineDecoder(Decoder):
    """Frames that end with `END`; see `protocol.Decoder`."""

    END = b'\n'

    def __init__(self, rows: int, columns: int, kind: DTypeLike = np.uint8):
        super().__init__(rows, columns, kind)
        self.buffer_bound = DIGITS * (rows * columns + 2) + 2 * rows + 64
        self._bounds = np.iinfo(self._kind)

    def _begin(self):
        super()._begin()
        self._looked = 0  # bytes without an end
        self._cut = True  # whether the beginning of the text is missing

    def _scan(self):
        end = self._buffer.find(self.END, self._looked)
        if end < 0:
            if len(self._buffer) > self.buffer_bound:
                self._looked, self._cut = 0, True
                return Piece(len(self._buffer) - len(self.END) + 1, good=False)
            self._looked = max(len(self._buffer) - len(self.END) + 1, 0)
            return None
        size, self._looked, cut = end + len(self.END), 0, self._cut
        text, self._cut = bytes(self._buffer[:end]), False
        if not text.strip():
            return Piece(size)
        return Piece(size, good=False) if cut else self._parse(text, size)

    def _parse(self, text: bytes, size: int) -> Piece:
        """Return what is in a text that is whole."""
        raise NotImplementedError

    def _counts(self, values, size, ticks=None):
        """Piece of a frame's values, if they are as many as tactels and fit their type."""
        fits = values.size == self.shape[0] * self.shape[1]
        low, high = (values.min(), values.max()) if values.size else (0, 0)
        if not fits or not self._bounds.min <= low <= high <= self._bounds.max:
            if values.size:
                self._refuse(values.size, high if high > self._bounds.max else low)
            return Piece(size, good=False)
        return Piece(size, np.rint(values).astype(self._kind).reshape(self.shape), ticks)


class CsvDecoder(LineDecoder):
    """Decoder of `csv_lines`."""

    def __init__(self, rows: int, columns: int, kind: DTypeLike = np.uint8, stamp: str = '',
                 checksum: bool = False):
        super().__init__(rows, columns, kind)
        self._stamped, self._checksum = tick_of(stamp) > 0, checksum
        self.tick_ns = tick_of(stamp)

    def _parse(self, text, size):
        values = numbers(text)
        if self._checksum and values.size:
            total = values[:-1].sum()
            if not np.isfinite(total) or total % MODULUS != values[-1]:
                self._refuse(values.size - self._stamped - 1, values.max())
                return Piece(size, good=False, failed=True)
            values = values[:-1]
        if self._stamped and values.size:
            if not 0 <= values[0] < self.wrap:
                return Piece(size, good=False)
            return self._counts(values[1:], size, int(values[0]))
        return self._counts(values, size)


class CsvDevice(Device):
    """A microcontroller that prints."""

    preamble = b'\r\n'

    def __init__(self, stamp: str = '', checksum: bool = False):
        self._tick_ns, self._checksum = tick_of(stamp), checksum

    def encode(self, counts: np.ndarray, time_ns: int = 0) -> bytes:
        """Return a line, separated by commas."""
        values = counts.ravel().tolist()
        if self._tick_ns:
            values.insert(0, time_ns // self._tick_ns % Decoder.wrap)
        if self._checksum:
            values.append(sum(values) % MODULUS)
        return ','.join(map(str, values)).encode() + b'\r\n'


def tick_of(stamp: str) -> int:
    """Return the unit of the device's time [ns]; 0 where it sends none."""
    if stamp and stamp not in TICKS:
        raise ConfigurationError(f'stamp is {stamp!r}, must be one of {", ".join(TICKS)}')
    return TICKS.get(stamp, 0)


class VitacDecoder(LineDecoder):
    """Decoder of `vitac`."""

    END = b'\n\r\n'

    def _parse(self, text, size):
        rows = [numbers(row) for row in text.rstrip(b'\r').split(b'\r\n')]
        if len({row.size for row in rows}) > 1:
            return Piece(size, good=False)
        values = np.concatenate(rows)
        if len(rows) != self.shape[0] and values.size == self.shape[0] * self.shape[1]:
            self._mismatch = f'the sensor sends {len(rows)} rows of {rows[0].size} values'
            return Piece(size, good=False)
        return self._counts(values, size)


class VitacDevice(Device):
    """The ancestor of the FlexiTac's circuit."""

    preamble = b'\r\n\r\n'

    def encode(self, counts: np.ndarray, time_ns: int = 0) -> bytes:
        """Return the rows and an empty line."""
        rows = (''.join(f'{value} ' for value in row) for row in counts.tolist())
        return ''.join(f'{row}\r\n' for row in rows).encode() + b'\r\n'
