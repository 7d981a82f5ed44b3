"""
Protocol of the Robotiq TSF-85: two fingers of 7x4 tactels, with inertial sensors.

A packet is `9A`, a CRC-8 of everything behind it, a command, the size of its data (at most 60)
and the data. The data is a sequence of tags, each followed by its values, big-endian. A tag has
four bits for the kind of the values (upper), two for the finger and two for an index. The
polynomial of the CRC is not public, and a CRC of 00 means none. It is only checked if `crc` gives
the polynomial. In any case, data that is not a sequence of tags is no packet.
"""
import re
import struct

import numpy as np
from numpy.typing import DTypeLike

from tactile_common.errors import ConfigurationError
from tactile_sensing.devices.protocol import Device, PacketDecoder, Piece

START = 0x9A
AUTOSEND = 0x58
COMMAND = 0x0F  # bits of the command itself; the upper bits are flags
LARGEST = 60  # bytes of data
SHAPE = (7, 4)
TEMPERATURE, STATIC = 0x60, 0x10
SIZES = {STATIC: 56, 0x20: 2, 0x30: 6, 0x40: 6, 0x50: 6, TEMPERATURE: 2}  # bytes by kind
AUTOSENDS = re.compile(rb'\x9a.\x58\x01(.)', re.DOTALL)  # a command, and its period


def crc8(data: bytes, polynomial: int) -> int:
    """Return the CRC-8 of bytes, most significant bit first, with initial value 0."""
    crc = 0
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ (polynomial if crc & 0x80 else 0)) & 0xFF
    return crc


def packet(data: bytes, polynomial: int = 0) -> bytes:
    """Return a packet with the command for sending; without polynomial its CRC is 00."""
    body = bytes([AUTOSEND, len(data)]) + data
    return bytes([START, crc8(body, polynomial) if polynomial else 0]) + body


class TsfDecoder(PacketDecoder):
    """Decoder of one `finger` (0 or 1); `crc`: the polynomial in hexadecimal digits."""

    PREAMBLE, HEAD = bytes([START]), 4
    buffer_bound = 4 + LARGEST

    def __init__(self, rows: int, columns: int, kind: DTypeLike = np.uint16, *, finger: int = 0,
                 crc: str = ''):
        super().__init__(rows, columns, kind)
        if (rows, columns) != SHAPE:
            raise ConfigurationError(f'the array is {rows}x{columns}, of this sensor it is 7x4')
        self._finger, self._polynomial = finger, int(crc or '0', 16)

    def start(self, rate: float) -> bytes:
        """Return the command that starts frames at a rate [Hz]."""
        return packet(bytes([min(max(round(1e3 / rate), 1), 255)]))

    def stop(self) -> bytes:
        """Return the command that makes the device stop sending frames."""
        return packet(b'\0')

    def _size(self, at: int) -> int:
        command, size = self._buffer[at + 2:at + 4]
        sound = command & COMMAND == AUTOSEND & COMMAND and size <= LARGEST
        return self.HEAD + size if sound else 0

    def _parse(self, packet: bytes) -> Piece | None:
        if packet[1] and self._polynomial and crc8(packet[2:], self._polynomial) != packet[1]:
            return None
        at, counts = self.HEAD, None
        while at < len(packet):
            kind, finger = packet[at] & 0xF0, packet[at] >> 2 & 3
            values = packet[at + 1:at + 1 + SIZES.get(kind, LARGEST)]
            at += 1 + SIZES.get(kind, LARGEST)
            if at > len(packet):
                return None
            if finger == self._finger and kind == STATIC:
                counts = np.frombuffer(values, '>u2')
            elif finger == self._finger and kind == TEMPERATURE:
                self.temperature = float(struct.unpack('>h', values)[0])
        return Piece(len(packet)) if counts is None else self._image(counts, len(packet))


class TsfDevice(Device):
    """A finger that sends frames after a start command."""

    def __init__(self, finger: int = 0, crc: str = ''):
        self.running, self._finger, self._polynomial = False, finger, int(crc or '0', 16)
        self._commands = b''

    def encode(self, counts: np.ndarray, time_ns: int = 0) -> bytes:
        """Return the packets of both fingers; the other finger is unloaded."""
        other = bytes([STATIC | (1 - self._finger) << 2]) + bytes(56)
        own = bytes([STATIC | self._finger << 2]) + counts.astype('>u2').tobytes()
        return packet(own, self._polynomial) + packet(other, self._polynomial)

    def answer(self, commands: bytes) -> bytes:
        """Execute the commands; the sensor sends no answers."""
        self._commands += commands
        for period in re.findall(AUTOSENDS, self._commands):
            self.running = period > b'\0'
        self._commands = self._commands[-4:]  # possibly the begin of a command
        return b''
