"""Convert raw counts of one array to images, with its calibration and tare."""
from collections import deque
import threading
import time

import numpy as np

from tactile_sensing.devices.calibration import Calibration
from tactile_sensing.devices.tare import Tare, TareRefusedError
from tactile_sensing.types.image import TactileImage

TARE_FRAMES = 50  # averaged by a tare: a seventh of the noise of a frame


class ImageConverter:
    """
    Convert frames to images, tare, and follow the drift of the unloaded pad; thread-safe.

    A tare averages `TARE_FRAMES` frames. With `at_start`, the pad is tared as soon as enough
    frames without load have arrived. With `track_drift`, it is tared repeatedly while nothing
    touches it; a tactel that differs from its offset by more than the noise counts as a touch.
    """

    def __init__(self, calibration: Calibration, at_start: bool = False,
                 track_drift: bool = False):
        self.calibration, self._at_start, self._track = calibration, at_start, track_drift
        self._lock = threading.Lock()
        self._recent: deque[np.ndarray] = deque(maxlen=TARE_FRAMES)
        self._seen_at = 0.0
        self._until_tare = TARE_FRAMES
        self._convert = calibration.converter()
        self.tare: Tare | None = None
        self.refusal = 'frames are awaited' if at_start else 'not asked to'  # why there is no tare
        self.saturated = 0  # number of tactels at full scale in the last image
        self.impossible = False  # whether any count was outside the range of `bits`

    def image(self, counts: np.ndarray, stamp_ns: int, sequence: int) -> TactileImage:
        """Return the image of raw counts (rows, columns)."""
        with self._lock:
            self._recent.append(counts)
            self._seen_at = time.monotonic()
            convert, tared = self._convert, self.tare is not None
        self.impossible |= bool(self.calibration.counts.outside(counts).any())
        layer, self.saturated = convert(counts)
        return TactileImage(
            stamp_ns, sequence, (layer,), self.calibration.array, tared, self.saturated)

    def due(self) -> bool:
        """Return whether an automatic tare is due; at most once in `TARE_FRAMES` images."""
        if not (self._at_start if self.tare is None else self._track):
            return False
        self._until_tare = (self._until_tare - 1) % TARE_FRAMES
        return self._until_tare == 0

    def forget(self) -> None:
        """Forget the recent frames; keep the tare."""
        with self._lock:
            self._recent.clear()

    def take_tare(self, anew: bool = True) -> Tare:
        """
        Tare with the newest frames; if not `anew`, check them against the present tare.

        Raises a TareRefusedError if the pad is loaded or frames are missing; the present tare
        then remains.
        """
        with self._lock:
            frames, age = list(self._recent), time.monotonic() - self._seen_at
        try:
            if len(frames) < TARE_FRAMES:
                raise TareRefusedError(
                    f'no frames: {len(frames)} of {TARE_FRAMES} have arrived')
            if age > 1.0:  # they do not show the present pad
                raise TareRefusedError('no frames: the last one is older than a second')
            tare = self.calibration.make_tare(frames, None if anew else self.tare)
        except TareRefusedError as error:
            self.refusal = str(error)
            raise
        with self._lock:
            self.tare, self._convert = tare, self.calibration.converter(tare)
        return tare
