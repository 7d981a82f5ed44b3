"""Raw counts of one array to images: its calibration, its tare, what was seen lately."""
from collections import deque
import threading
import time

import numpy as np

from tactile_sensing.devices.calibration import Calibration
from tactile_sensing.devices.tare import Tare, TareRefusedError
from tactile_sensing.types.image import TactileImage


class Pad:
    """
    Convert frames to images, tare, and follow the drift of the unloaded pad; thread-safe.

    A tare averages `tare_frames`. `at_start`: tare as soon as frames without load have come.
    `track_drift`: tare again and again while nothing touches: a tactel that is off its offset by
    more than its noise is a touch.
    """

    def __init__(self, calibration: Calibration, tare_frames: int, at_start: bool = False,
                 track_drift: bool = False):
        self.calibration, self._tare_frames = calibration, tare_frames
        self._at_start, self._track = at_start, track_drift
        self._lock = threading.Lock()
        self._recent: deque[np.ndarray] = deque(maxlen=tare_frames)
        self._seen_at = 0.0
        self._until_tare = tare_frames
        self._convert = calibration.converter()
        self.tare: Tare | None = None
        self.refusal = 'frames are awaited' if at_start else 'not asked to'  # why there is none
        self.saturated = 0  # tactels at full scale in the last image
        self.impossible = False  # whether counts came that `bits` excludes

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
        """Whether the last image makes a tare by itself due; says so once in `tare_frames`."""
        if not (self._at_start if self.tare is None else self._track):
            return False
        self._until_tare = (self._until_tare - 1) % self._tare_frames
        return self._until_tare == 0

    def forget(self) -> None:
        """Forget the frames that were seen; the tare stays."""
        with self._lock:
            self._recent.clear()

    def resume(self, tare: Tare) -> None:
        """Go on with a tare."""
        with self._lock:
            self.tare, self._convert = tare, self.calibration.converter(tare)

    def take_tare(self, anew: bool = True) -> Tare:
        """
        Tare with the newest frames; where not `anew`, about the tare that there is.

        Raises a TareRefusedError where there is a load, or there are no frames; the tare that
        there is stays.
        """
        with self._lock:
            frames, age = list(self._recent), time.monotonic() - self._seen_at
        try:
            if len(frames) < self._tare_frames:
                raise TareRefusedError(
                    f'no frames: {len(frames)} of {self._tare_frames} have arrived')
            if age > 1.0:
                raise TareRefusedError('no frames: the last one is older than a second')
            tare = self.calibration.make_tare(frames, None if anew else self.tare)
        except TareRefusedError as error:
            self.refusal = str(error)
            raise
        self.resume(tare)
        return tare
