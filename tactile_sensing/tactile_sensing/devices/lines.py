"""
Protocols of arrays that print their counts as text.

`csv_lines`: one frame per line; numbers with any separator. The first number may be the device's
time (`stamp`: ms or us), the last one the sum of all others modulo 65536 (`checksum`).
`vitac`: one row per line, each number followed by a space; an empty line ends the frame.

The first frame after opening the port may be incomplete, so everything before the first end of a
frame is discarded. Without a checksum, a corrupted digit results in a wrong count.
"""
import numpy as np
from numpy.typing import DTypeLike

from tactile_common.errors import ConfigurationError
from tactile_sensing.devices.protocol import Decoder, Device, Piece

MODULUS = 1 << 16  # of the checksum
TICKS = {'ms': 1_000_000, 'us': 1000}  # ns
# Replaces separators by spaces. Letters stay, so that text is not parsed as a number; `_` is
# replaced, because float() accepts it within a number.
_NUMBERS = bytes(byte if chr(byte).isalnum() and byte < 128 or chr(byte) in '+-.' else 32
                 for byte in range(256))


def numbers(text: bytes) -> np.ndarray:
    """Return the numbers of a text with any separators; empty if it contains anything else."""
    try:
        values = np.array(list(map(float, text.translate(_NUMBERS).split())))
    except ValueError:
        return np.empty(0)
    return values if np.isfinite(values).all() else np.empty(0)


class LineDecoder(Decoder):
    """Decoder of text frames that end with `END`."""

    END = b'\n'

    def __init__(self, rows: int, columns: int, kind: DTypeLike = np.uint8):
        super().__init__(rows, columns, kind)
        # A number takes at most 12 bytes, including separators.
        self.buffer_bound = 12 * (rows * columns + 2) + 2 * rows + 64

    def _begin(self) -> None:
        super()._begin()
        self._looked = 0  # bytes that were searched and contain no END
        self._cut = True  # whether the begin of the text is missing

    def _scan(self) -> Piece | None:
        end = self._buffer.find(self.END, self._looked)
        if end < 0:
            if len(self._buffer) > self.buffer_bound:
                self._looked, self._cut = 0, True
                return self._refuse(
                    len(self._buffer) - len(self.END) + 1,
                    f'no end of a frame ({self.END!r}) in {len(self._buffer)} bytes, such as '
                    f'{bytes(self._buffer[:24])!r}')
            self._looked = max(len(self._buffer) - len(self.END) + 1, 0)
            return None
        size, self._looked, cut = end + len(self.END), 0, self._cut
        text, self._cut = bytes(self._buffer[:end]), False
        if not text.strip():
            return Piece(size)
        return Piece(size, good=False) if cut else self._parse(text, size)

    def _parse(self, text: bytes, size: int) -> Piece:
        """Parse the text of a complete frame."""
        raise NotImplementedError


class CsvDecoder(LineDecoder):
    """Decoder of `csv_lines`."""

    def __init__(self, rows: int, columns: int, kind: DTypeLike = np.uint8, stamp: str = '',
                 checksum: bool = False):
        super().__init__(rows, columns, kind)
        self._stamped, self._checksum = bool(stamp), checksum
        self.tick_ns = tick_of(stamp)

    def _parse(self, text: bytes, size: int) -> Piece:
        values, (rows, columns) = numbers(text), self.shape
        if not values.size:
            return self._refuse(
                size, f'lines must hold numbers alone, this one does not: {text[:40]!r}')
        if values.size != rows * columns + self._stamped + self._checksum:
            return self._refuse(
                size, f'a line holds {values.size} numbers, must hold {rows}x{columns} = '
                f'{rows * columns}' + ', a stamp' * self._stamped + ', a checksum' * self._checksum
                + ': see the options `stamp` and `checksum`', failed=self._checksum)
        if self._checksum:
            last, values = values[-1], values[:-1]
            if values.sum() % MODULUS != last:
                return self._refuse(size, 'the last number of a line is not the sum of the others '
                                    f'modulo {MODULUS}: see the option `checksum`', failed=True)
        if not self._stamped:
            return self._image(values, size)
        return self._image(values[1:], size, int(values[0]) % self.wrap)


class CsvDevice(Device):
    """Device of `csv_lines`: a microcontroller that prints its counts."""

    preamble = b'\r\n'

    def __init__(self, stamp: str = '', checksum: bool = False):
        self._tick_ns, self._checksum = tick_of(stamp), checksum

    def encode(self, counts: np.ndarray, time_ns: int = 0) -> bytes:
        """Return a line of numbers, separated by commas."""
        values = counts.ravel().tolist()
        if self._tick_ns:
            values.insert(0, time_ns // self._tick_ns % Decoder.wrap)
        if self._checksum:
            values.append(sum(values) % MODULUS)
        return ','.join(map(str, values)).encode() + b'\r\n'


def tick_of(stamp: str) -> int:
    """Return the unit of the device's time [ns]; 0: the device sends no time."""
    if stamp and stamp not in TICKS:
        raise ConfigurationError(f'stamp is {stamp!r}, must be one of {", ".join(TICKS)}')
    return TICKS.get(stamp, 0)


class VitacDecoder(LineDecoder):
    """Decoder of `vitac`."""

    END = b'\n\r\n'

    def _parse(self, text: bytes, size: int) -> Piece:
        rows = [numbers(row) for row in text.rstrip(b'\r').split(b'\r\n')]
        if [row.size for row in rows] != [self.shape[1]] * self.shape[0]:
            return self._refuse(
                size, f'the sensor sends {len(rows)} rows of {rows[0].size} values, '
                f'{self.shape[0]} of {self.shape[1]} are expected')
        return self._image(np.concatenate(rows), size)


class VitacDevice(Device):
    """Device of `vitac`, the predecessor of the FlexiTac circuit."""

    preamble = b'\r\n\r\n'

    def encode(self, counts: np.ndarray, time_ns: int = 0) -> bytes:
        """Return the rows as lines, and an empty line."""
        rows = (''.join(f'{value} ' for value in row) for row in counts.tolist())
        return ''.join(f'{row}\r\n' for row in rows).encode() + b'\r\n'
