"""Raw counts of one array to images: its calibration, its tare, what was seen lately."""
from collections import deque
import threading
import time

import numpy as np

from tactile_sensing.devices.calibration import Calibration
from tactile_sensing.devices.tare import Tare, TareRefusedError
from tactile_sensing.types.image import TactileImage

STALE = 1.0  # s; frames that are older are no picture of the pad as it is


class Pad:
    """
    Convert frames to images, tare, and follow the drift of the unloaded pad; thread-safe.

    Parameters
    ----------
    tare_frames : int
        Averaged by a tare.
    at_start : bool
        Whether to tare as soon as frames without load have come.
    track_drift : bool
        Whether to tare again and again while nothing touches: a tactel that is off its offset by
        more than its noise is a touch.

    Attributes
    ----------
    tare : Tare or None
    refusal : str
        Why there is none.
    saturated, impossible : int, bool
        Tactels at full scale in the last image; whether counts came that `bits` excludes.
    """

    def __init__(self, calibration: Calibration, tare_frames: int, at_start: bool = False,
                 track_drift: bool = False):
        self.calibration, self._track = calibration, track_drift
        self._lock = threading.Lock()
        self._recent: deque[np.ndarray] = deque(maxlen=tare_frames)
        self._seen_at = 0.0
        self._at_start, self._until_tare = at_start, tare_frames
        self._convert = calibration.converter()
        self.tare: Tare | None = None
        self.refusal = 'frames are awaited' if at_start else 'not asked to'
        self.saturated, self.impossible = 0, False

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
        self._until_tare = (self._until_tare - 1) % (self._recent.maxlen or 1)
        return self._until_tare == 0

    def forget(self) -> None:
        """Forget the frames that were seen; the tare stays."""
        with self._lock:
            self._recent.clear()

    def resume(self, tare: Tare) -> None:
        """Go on with a tare of earlier."""
        with self._lock:
            self.tare, self._convert = tare, self.calibration.converter(tare)

    def take_tare(self, anew: bool = True) -> Tare:
        """
        Tare with the newest frames; where not `anew`, about the tare that there is.

        Raises
        ------
        TareRefusedError
            There is a load, or there are no frames; the tare that there is stays.
        """
        with self._lock:
            frames, before = list(self._recent), self.tare
            try:
                if len(frames) < (self._recent.maxlen or 0):
                    raise TareRefusedError(f'no frames: {len(frames)} of {self._recent.maxlen} '
                                           'have arrived')
                if time.monotonic() - self._seen_at > STALE:
                    raise TareRefusedError('no frames: the last one is older than a second')
                tare = self.calibration.make_tare(frames, None if anew else before)
            except TareRefusedError as error:
                self.refusal = str(error)
                raise
            self.tare, self._convert = tare, self.calibration.converter(tare)
        return tare
