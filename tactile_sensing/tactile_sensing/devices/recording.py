"""Recordings of tactile frames in `.npz` files, with `frames` and `rate_hz`."""
from dataclasses import dataclass

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_common.npz_stream import read_arrays, scalar

MAX_RATE = 10e3


@dataclass(frozen=True, eq=False)
class Recording:
    """
    Frames of one sensor, evenly spaced in time.

    Raises a ConfigurationError where a shape, type or value is impossible.
    """

    frames: np.ndarray  # in the recorder's unit, shape (N, rows, columns), N >= 1; NaN = no tactel
    rate_hz: float  # frames per second [Hz]
    pitch: float | None = None  # distance between tactels [m]; None = unknown

    def __post_init__(self):
        frames = np.asarray(self.frames)
        if frames.ndim != 3 or 0 in frames.shape:
            raise ConfigurationError(
                f'frames has shape {frames.shape}, must be (N, rows, columns), none of them 0')
        if frames.dtype.kind not in 'uif':
            raise ConfigurationError(f'frames is of type {frames.dtype}, must be of real numbers')
        object.__setattr__(self, 'frames', frames)
        if not 0.0 < self.rate_hz <= MAX_RATE:  # NaN fails as well
            raise ConfigurationError(
                f'rate_hz is {self.rate_hz}, must be above 0 and at most {MAX_RATE:g} Hz')
        if self.pitch is not None and not 0.0 < self.pitch < 1.0:
            raise ConfigurationError(f'pitch_m is {self.pitch}, must be between 0 and 1 m')

    @property
    def shape(self) -> tuple:
        """Shape of one frame, `(rows, columns)`."""
        return self.frames.shape[1:]

    @property
    def absent(self) -> list[int]:
        """Row-major indices of the tactels that are NaN in every frame: there are none."""
        return np.flatnonzero(np.isnan(self.frames).all(axis=0)).tolist()

    def counts(self) -> tuple[np.ndarray, int]:
        """
        Return the frames as bytes that a sensor of eight bits could have sent.

        NaN becomes 0; everything else is rounded and clipped to 0..255. The second item is how
        many values were clipped by more than rounding.
        """
        with np.errstate(invalid='ignore'):
            values = np.where(np.isnan(self.frames), 0, np.rint(self.frames))
        clipped = int(np.count_nonzero((values < 0) | (values > 255)))
        return np.clip(values, 0, 255).astype(np.uint8), clipped


def load_recording(path) -> Recording:
    """
    Read a NumPy archive with `frames` `(N, rows, columns)`, `rate_hz` and perhaps `pitch_m`.

    Raises
    ------
    ConfigurationError
        The file cannot be read, or an array in it is missing or impossible.
    """
    try:
        arrays = read_arrays(path, ('frames', 'rate_hz'), ('pitch_m',))
        return Recording(arrays['frames'], scalar('rate_hz', arrays['rate_hz']),
                         scalar('pitch_m', arrays['pitch_m']) if 'pitch_m' in arrays else None)
    except ConfigurationError as error:
        where = '' if str(error).startswith(str(path)) else f'{path}: '
        raise ConfigurationError(f'recording {where}{error}') from error
