"""Faults of a serial line that change the bytes of a frame, on request."""
from dataclasses import dataclass, fields

import numpy as np

from tactile_common.config import bounded, check_fields
from tactile_common.errors import ConfigurationError

MOST_GARBAGE = 400  # bytes before a frame are always fewer than this


@dataclass(frozen=True)
class LineFaults:
    """Probability of each fault, per byte or per frame."""

    flip: float = bounded(0.0, 'share of bytes of which a bit changes', '', 0.0, 1.0)
    lose: float = bounded(0.0, 'share of bytes that get lost', '', 0.0, 1.0)
    garbage: float = bounded(0.0, 'share of frames before which random bytes come', '', 0.0, 1.0)
    cut: float = bounded(0.0, 'share of frames that end in the middle', '', 0.0, 1.0)
    drop: float = bounded(0.0, 'share of frames that are not sent', '', 0.0, 1.0)
    stall: float = bounded(0.0, 'share of frames that pause in the middle', '', 0.0, 1.0)
    hang_up: float = bounded(0.0, 'share of frames after which the port is away', '', 0.0, 1.0)

    def __post_init__(self):
        check_fields(self, 'fault ')

    @classmethod
    def from_text(cls, text: str) -> 'LineFaults':
        """Parse a text `name=share name=share`; raises a ConfigurationError."""
        names, values = [item.name for item in fields(cls)], {}
        for word in text.split():
            name, _, share = word.partition('=')
            try:
                values[name] = float(share)
            except ValueError:
                values[name] = -1.0
            if name not in names:
                raise ConfigurationError(
                    f'fault {name!r} is unknown, there are: {", ".join(names)}')
        return cls(**values)

    def spoil(self, data: bytes, rng: np.random.Generator) -> bytes:
        """Return the bytes of a frame after the faults."""
        if rng.random() < self.drop:
            return b''
        if rng.random() < self.cut:
            data = data[:rng.integers(len(data))]
        values = np.frombuffer(data, np.uint8)
        bits = np.where(rng.random(values.size) < self.flip,
                        1 << rng.integers(8, size=values.size), 0).astype(np.uint8)
        kept = (values ^ bits)[rng.random(values.size) >= self.lose]
        garbage = rng.random() < self.garbage
        return rng.bytes(int(rng.integers(1, MOST_GARBAGE))) * garbage + kept.tobytes()
