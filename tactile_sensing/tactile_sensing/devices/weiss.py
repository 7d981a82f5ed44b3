"""
Protocols of Weiss Robotics: `weiss_wts`, and `weiss_dsa` of the DSACON32m controller.

A packet is `AA AA AA`, its id, the size of its payload (u16), the payload and a CRC. WTS: the CRC
covers everything before it. DSA: it covers id, size and payload, and is absent without payload.
Frames have id 00: time [ms] (u32), flags (bit 0: run-length coded), cells (u16; if run-length
coded, the count in the upper four bits and the value in the lower twelve). All numbers are
little-endian.
"""
from binascii import crc_hqx
from collections import deque
from functools import partial
import struct
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from tactile_common.errors import ConfigurationError
from tactile_sensing.devices.protocol import Device, PacketDecoder, Piece

PREAMBLE = b'\xaa\xaa\xaa'
FRAME, DSA_CONFIGURE = 0x00, 0x03
START, STOP = 0x21, 0x22
HEAD = len(PREAMBLE) + 3
RUN_LENGTH, ACQUIRE = 0x01, 0x80  # flags
LARGEST_REPLY = 256  # largest payload of a reply [bytes]
MOST_REPLIES = 16  # the latest ones are kept
HIGHEST = 4095  # of a run-length coded count
NO_COMMAND = 4  # status of an unknown command; 0 is success


_TABLE = [crc_hqx(bytes([byte]), 0) for byte in range(256)]


def crc16(data: bytes) -> int:
    """Return the CRC of the protocol: table of the polynomial 0x1021, but shifted to the right."""
    crc = 0xFFFF
    for byte in data:
        crc = crc >> 8 ^ _TABLE[(crc ^ byte) & 0xFF]
    return crc


def packet(command: int, payload: bytes = b'', dsa: bool = False) -> bytes:
    """Return a packet of WTS or DSA."""
    body = struct.pack('<BH', command, len(payload)) + payload
    if dsa and not payload:
        return PREAMBLE + body
    return PREAMBLE + body + struct.pack('<H', crc16(body if dsa else PREAMBLE + body))


class WeissDecoder(PacketDecoder):
    """
    Decoder of `weiss_wts` and `weiss_dsa`.

    A frame may contain several matrices: `cells` is the number of all their cells (0: that of the
    image), and the image begins at cell `first`. `rle` asks for run-length coding. `replies`
    holds the latest answers of the device to commands: command and payload.
    """

    PREAMBLE, HEAD = PREAMBLE, HEAD
    tick_ns = 1_000_000

    def __init__(self, rows: int, columns: int, kind: DTypeLike = np.uint16, *, cells: int = 0,
                 first: int = 0, dsa: bool = False, rle: bool = False):
        super().__init__(rows, columns, kind)
        self._rle, size = rle, rows * columns
        self._cells, self._first, self._dsa = cells or first + size, first, dsa
        if not 0 <= first <= self._cells - size:
            raise ConfigurationError(
                f'first is {first}, must be from 0 to {self._cells - size} of {self._cells} cells')
        self.replies: deque[tuple[int, bytes]] = deque(maxlen=MOST_REPLIES)
        self._most = max(5 + 2 * self._cells, LARGEST_REPLY)  # of a payload [bytes]
        self.buffer_bound = HEAD + self._most + 2

    def start(self, rate: float) -> bytes:
        if self._dsa:
            return packet(
                DSA_CONFIGURE, struct.pack('<BH', ACQUIRE | self._rle, round(rate)), dsa=True)
        period = min(max(round(1e3 / rate), 1), 65535)  # ms
        return packet(START, struct.pack('<BH', self._rle, period))

    def stop(self) -> bytes:
        if self._dsa:
            return packet(DSA_CONFIGURE, struct.pack('<BH', 0, 0), dsa=True)
        return packet(STOP)

    def _size(self) -> int:
        command, size = struct.unpack_from('<BH', self._buffer, len(PREAMBLE))
        if size > self._most:
            if command == FRAME:
                self._mismatch = self._wrong_size((size - 5) // 2)
            return 0
        return HEAD + size + (0 if self._dsa and not size else 2)

    def _wrong_size(self, cells: int) -> str:
        return (f'the sensor sends {cells} cells a frame, {self._cells} are expected: '
                'rows x columns, or the option `cells`')

    def _parse(self, packet: bytes) -> Piece | None:
        command, size = struct.unpack_from('<BH', packet, len(PREAMBLE))
        payload, crc = packet[HEAD:HEAD + size], packet[HEAD + size:]
        if crc and crc16(packet[len(PREAMBLE) if self._dsa else 0:HEAD + size]) != (
                int.from_bytes(crc, 'little')):
            return None
        if command != FRAME or size < 5:
            if len(payload) >= 2 and any(payload[:2]):
                self._mismatch = (f'the sensor refuses command {command:#04x} with status '
                                  f'{int.from_bytes(payload[:2], "little")}')
            self.replies.append((command, payload))
            return Piece(len(packet))
        ticks, flags = struct.unpack_from('<IB', payload)
        values = np.frombuffer(payload[5:5 + (size - 5) // 2 * 2], '<u2')
        if flags & RUN_LENGTH:
            values = np.repeat(values & HIGHEST, values >> 12)
        if values.size != self._cells:
            return self._refuse(len(packet), self._wrong_size(values.size))
        image = values[self._first:self._first + self.shape[0] * self.shape[1]]
        return self._image(image, len(packet), ticks)


class WeissDevice(Device):
    """A sensor that sends frames after a start command, and answers; without run-length coding."""

    def __init__(self, dsa: bool = False, first: int = 0, cells: int = 0, **_: Any):
        self.running, self._dsa, self._first, self._cells = False, dsa, first, cells
        self._commands = WeissDecoder(1, 1, dsa=dsa)

    def encode(self, counts: np.ndarray, time_ns: int = 0) -> bytes:
        """Return a frame; the cells of other matrices are 0."""
        cells = np.zeros(max(self._cells, self._first + counts.size), np.uint16)
        cells[self._first:self._first + counts.size] = counts.ravel()
        head = struct.pack('<IB', time_ns // 1_000_000 % WeissDecoder.wrap, 0)
        return packet(FRAME, head + cells.astype('<u2').tobytes(), self._dsa)

    def answer(self, commands: bytes) -> bytes:
        """Return the status of every received command."""
        decoder, answer = self._commands, b''  # commands have the form of replies
        decoder.receive_data(commands)
        decoder.next_frame()
        while decoder.replies:
            command, payload = decoder.replies.popleft()
            status = 0
            if command in (DSA_CONFIGURE, START) and payload:
                self.running = not self._dsa or bool(payload[0] & ACQUIRE)
            elif command == STOP:
                self.running = False
            else:
                status = NO_COMMAND
            answer += packet(command, struct.pack('<H', status), self._dsa)
        return answer


DsaDecoder, DsaDevice = partial(WeissDecoder, dsa=True), partial(WeissDevice, dsa=True)
