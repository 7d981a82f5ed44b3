"""
Protocol of the Robotiq TSF-85: two fingers of 7x4 tactels, with inertial sensors.

A packet is `9A`, a CRC-8 of everything behind it, a command, the size of its data (at most 60)
and the data: a sequence of tags, each followed by its values, big-endian. A tag has four bits for
the kind of the values (upper), two for the finger and two for an index. The polynomial of the CRC
is not public, so the CRC is not checked; a CRC of 00 means none. Data that is not a sequence of
tags is no packet.
"""
import re

import numpy as np
from numpy.typing import DTypeLike

from tactile_common.errors import ConfigurationError
from tactile_sensing.devices.protocol import Device, PacketDecoder, Piece

START = 0x9A
AUTOSEND = 0x58
COMMAND = 0x0F  # bits of the command itself; the upper bits are flags
LARGEST = 60  # bytes of data
SHAPE = (7, 4)
STATIC = 0x10  # kind of the values of the tactels
SIZES = {STATIC: 56, 0x20: 2, 0x30: 6, 0x40: 6, 0x50: 6, 0x60: 2}  # bytes by kind
AUTOSENDS = re.compile(rb'\x9a.\x58\x01(.)', re.DOTALL)  # a command, and its period


def packet(data: bytes) -> bytes:
    """Return a packet with the command for sending, without CRC."""
    return bytes([START, 0, AUTOSEND, len(data)]) + data


class TsfDecoder(PacketDecoder):
    """Decoder of one `finger` (0 or 1)."""

    PREAMBLE, HEAD = bytes([START]), 4
    buffer_bound = 4 + LARGEST

    def __init__(self, rows: int, columns: int, kind: DTypeLike = np.uint16, *, finger: int = 0):
        super().__init__(rows, columns, kind)
        if (rows, columns) != SHAPE:
            raise ConfigurationError(f'the array is {rows}x{columns}, of this sensor it is 7x4')
        if finger not in (0, 1):
            raise ConfigurationError(f'finger is {finger}, must be 0 or 1')
        self._finger = finger

    def start(self, rate: float) -> bytes:
        return packet(bytes([min(max(round(1e3 / rate), 1), 255)]))

    def stop(self) -> bytes:
        return packet(b'\0')

    def _size(self) -> int:
        command, size = self._buffer[2:self.HEAD]
        sound = command & COMMAND == AUTOSEND & COMMAND and size <= LARGEST
        return self.HEAD + size if sound else 0

    def _parse(self, packet: bytes) -> Piece | None:
        at, counts = self.HEAD, None
        while at < len(packet):
            kind, finger = packet[at] & 0xF0, packet[at] >> 2 & 3
            end = at + 1 + SIZES.get(kind, LARGEST)
            if end > len(packet):
                return None
            if finger == self._finger and kind == STATIC:
                counts = np.frombuffer(packet[at + 1:end], '>u2')
            at = end
        return Piece(len(packet)) if counts is None else self._image(counts, len(packet))


class TsfDevice(Device):
    """A finger that sends frames after a start command."""

    def __init__(self, finger: int = 0):
        self.running, self._finger, self._commands = False, finger, b''

    def encode(self, counts: np.ndarray, time_ns: int = 0) -> bytes:
        """Return the packets of both fingers; the other finger is unloaded."""
        other = bytes([STATIC | (1 - self._finger) << 2]) + bytes(56)
        own = bytes([STATIC | self._finger << 2]) + counts.astype('>u2').tobytes()
        return packet(own) + packet(other)

    def answer(self, commands: bytes) -> bytes:
        """Execute the commands; the sensor sends no answers."""
        self._commands += commands
        for period in re.findall(AUTOSENDS, self._commands):
            self.running = period > b'\0'
        self._commands = self._commands[-4:]  # possibly the begin of a command
        return b''
