"""Protocol with one frame per line, two hexadecimal digits per tactel."""
import numpy as np

from tactile_sensing.devices.lines import LineDecoder
from tactile_sensing.devices.protocol import Device, Piece, SensorProtocol


class HexDecoder(LineDecoder):
    """Decoder of `hex_lines`."""

    def _parse(self, text, size):
        try:
            values = np.frombuffer(bytes.fromhex(text.decode('ascii')), np.uint8)
        except ValueError:
            return Piece(size, good=False)
        return self._image(values, size)


class HexDevice(Device):
    """The sensor side of `hex_lines`."""

    preamble = b'\n'

    def encode(self, counts, time_ns=0):
        """Return a line."""
        return counts.astype(np.uint8).tobytes().hex().encode() + b'\n'


PROTOCOL = SensorProtocol(HexDecoder, HexDevice, 115200)
