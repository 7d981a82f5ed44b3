"""Recordings of tactile frames in files, and their conversion to counts of a sensor."""
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_common.npz_stream import read_arrays, scalar
from tactile_sensing.devices.counts import Counts
from tactile_sensing.devices.frame_clock import MAX_RATE
from tactile_sensing.devices.frame_file import frame_reader, read_whole, Shape

BYTES = Counts(8)


@dataclass(frozen=True, eq=False)
class Recording:
    """
    Frames of one sensor, evenly spaced in time.

    Raises a ConfigurationError if a shape, type or value is impossible.
    """

    frames: np.ndarray  # in the recorder's unit, shape (N, rows, columns), N >= 1; NaN = no tactel
    rate_hz: float  # frames per second [Hz]
    pitch: float | None = None  # distance between tactels [m]; None = unknown

    def __post_init__(self) -> None:
        frames = self.frames
        if frames.ndim != 3 or 0 in frames.shape:
            raise ConfigurationError(
                f'frames has shape {frames.shape}, must be (N, rows, columns), none of them 0')
        if frames.dtype.kind not in 'uif':
            raise ConfigurationError(f'frames is of type {frames.dtype}, must be of real numbers')
        if not 0.0 < self.rate_hz <= MAX_RATE:  # NaN fails as well
            raise ConfigurationError(
                f'rate_hz is {self.rate_hz}, must be above 0 and at most {MAX_RATE:g} Hz')
        if self.pitch is not None and not 0.0 < self.pitch < 1.0:
            raise ConfigurationError(f'pitch_m is {self.pitch}, must be between 0 and 1 m')

    @property
    def shape(self) -> tuple[int, int]:
        """Shape of one frame, `(rows, columns)`."""
        return self.frames.shape[1], self.frames.shape[2]

    @property
    def absent(self) -> list[int]:
        """Row-major indices of tactels that do not exist, i.e. are NaN in every frame."""
        return np.flatnonzero(np.isnan(self.frames).all(axis=0)).tolist()

    def counts(self, limits: Counts = BYTES, resolution: float = 1.0) -> tuple[np.ndarray, int]:
        """
        Convert the frames to counts of a sensor with a given range.

        Frames are divided by the resolution, rounded and clipped to the range; NaN becomes 0. The
        second return value is the number of values that were clipped.
        """
        with np.errstate(invalid='ignore'):
            values = np.where(np.isnan(self.frames), 0, np.rint(self.frames / resolution))
        clipped = int(np.count_nonzero(limits.outside(values)))
        return np.clip(values, limits.lowest, limits.highest).astype(limits.dtype), clipped


def load_recording(path: str | PathLike, rate_hz: float | None = None,
                   shape: Shape | None = None) -> Recording:
    """
    Read an `.npz` archive with `frames` `(N, rows, columns)`, `rate_hz` and optional `pitch_m`.

    An `.npy` array, a `.csv` file or an archive without a rate needs `rate_hz` [Hz]; flat frames
    need `shape`. Raises a ConfigurationError if the file cannot be read, or an array in it is
    missing or impossible.
    """
    try:
        frames = read_whole(path, frame_reader(path, shape))
        arrays = {} if Path(path).suffix in ('.npy', '.csv') else read_arrays(
            path, (), ('rate_hz', 'pitch_m'))
        if rate_hz is None and 'rate_hz' not in arrays:
            raise ConfigurationError("array 'rate_hz' is missing: --rate HZ says it")
        told = {name: scalar(name, values) for name, values in arrays.items()}
        return Recording(frames, rate_hz or told['rate_hz'], told.get('pitch_m'))
    except ConfigurationError as error:
        where = '' if str(error).startswith(str(path)) else f'{path}: '
        raise ConfigurationError(f'recording {where}{error}') from error
