"""Core of `calibrate --live`: record the presses of a running sensor one by one."""
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_common.npz_stream import read_arrays, write_arrays
from tactile_sensing.calibration.presses import highest, LEAST_PEAK, why_not
from tactile_sensing.calibration.survey import MOST_NOISE
from tactile_sensing.devices.tare import unloaded_statistics
from tactile_sensing.types.array import TactelArray

HELD = 20  # a press must be steady for this number of frames
KEPT = 10  # frames of it that are kept
STEADY = 0.05  # a steady press changes by less than this share of its peak, beside noise
RELEASED = 0.5  # a press ends below this share of the peak at which one begins


@dataclass(frozen=True)
class Step:
    """One recording and its file name."""

    name: str
    count: int  # number of frames or presses
    ask: str  # instruction for the user
    presses: bool = True  # False: consecutive frames without presses
    anywhere: bool = False  # accept any press: a finger at the border
    frames: int = 1  # frames of each press, for averaging


STEPS = (
    Step('unloaded', 100, 'Take everything off the pad.', presses=False),
    Step('corners', 4, 'Press with a finger: first row and column; first row, last column; last '
         'row and column; last row, first column.', anywhere=True),
    Step('ball', 20, 'Press the small ball, each time elsewhere; hold it until it counts.',
         frames=KEPT),
    Step('flat', 40, 'Press the same ball, straight, evenly all over the pad.',
         frames=KEPT))


class PressCatcher:
    """
    Find presses in a stream of frames.

    A press is taken once, when it has been steady for HELD frames, and the next one begins after
    the pad was released. Tactels that are faulty in the unloaded frames are left out.
    """

    def __init__(self, array: TactelArray, unloaded: np.ndarray, full: float = np.inf):
        self._array, self._full = array, full
        offset, noise = unloaded_statistics(unloaded, -np.inf, 0.0, np.ones(array.shape, bool))
        self._live = (noise <= MOST_NOISE * np.median(noise)) & (offset < full - 1.0)
        self._offset, self._noise = unloaded_statistics(unloaded, -np.inf, 0.0, self._live)
        self._recent: deque[np.ndarray] = deque(maxlen=HELD)
        self._taken = True  # ignore a press at the start

    def see(self, frame: np.ndarray) -> str | None:
        """
        Examine the next frame [counts], (rows, columns).

        Returns None if there is no new steady press, '' for a usable press of a ball, else what
        is wrong with it.
        """
        values = np.where(self._live, frame - self._offset, np.nan)
        peak = highest(values)
        strength = values[peak] / (LEAST_PEAK * self._noise[peak])
        if strength < (RELEASED if self._taken else 1.0):
            self._recent.clear()
            self._taken = False
            return None
        self._recent.append(values)
        if self._taken or len(self._recent) < HELD:
            return None
        half, frames = HELD // 2, np.array(self._recent)
        change = np.abs(frames[half:].mean(axis=0) - frames[:half].mean(axis=0))
        by_chance = 5.0 * self._noise * np.sqrt(2.0 / half)
        if (change >= STEADY * values[peak] + by_chance).any():
            return None
        self._taken = True
        full = int((frame[self._live] >= self._full).sum())
        return why_not(values, self._noise, self._array, full)


@dataclass
class Recorder:
    """
    Ask for every recording in turn, and save it in a folder after each press.

    Existing recordings are kept, so that an interrupted session can be continued.
    """

    folder: Path
    array: TactelArray
    look: Callable[[], np.ndarray]  # returns the next frame [counts], (rows, columns)
    ask: Callable[[str], str]  # shows a text and returns the answer; 's' skips a recording
    tell: Callable[[str], None]  # shows a line
    full: float = np.inf  # count from which on a tactel is at full scale

    def run(self, steps: tuple[Step, ...] = STEPS) -> None:
        """Record the steps that are missing in the folder."""
        self.folder.mkdir(parents=True, exist_ok=True)
        for step in steps:
            path = self._file(step.name)
            frames = list(self._stored(path)) if path.exists() else []
            if len(frames) >= step.count * step.frames:
                self.tell(f'{step.name}: {len(frames)} frames are there')
            elif step.presses and not self._file('unloaded').exists():
                self.tell(f'{step.name}: needs unloaded')
            elif self.ask(f'{step.name}: {step.ask} Enter to begin, s to skip: ').strip() != 's':
                (self._presses if step.presses else self._stream)(step, frames)

    def _stream(self, step: Step, frames: list[np.ndarray]) -> None:
        while len(frames) < step.count:
            frames.append(self.look())
        write_arrays(self._file(step.name), frames=np.array(frames))
        self.tell(f'{step.name}: {len(frames)} frames')

    def _presses(self, step: Step, frames: list[np.ndarray]) -> None:
        catcher = PressCatcher(self.array, self._stored(self._file('unloaded')), self.full)
        last: deque[np.ndarray] = deque(maxlen=step.frames)
        while len(frames) < step.count * step.frames:
            last.append(self.look())
            wrong = catcher.see(last[-1])
            if wrong is None:
                continue
            if wrong and not step.anywhere:
                self.tell(f'{step.name}: not taken: {wrong}; press again')
                continue
            frames.extend(last)
            write_arrays(self._file(step.name), frames=np.array(frames))
            self.tell(f'{step.name}: {len(frames) // step.frames} of {step.count}')

    def _stored(self, path: Path) -> np.ndarray:
        frames = read_arrays(path, ('frames',))['frames']
        if frames.shape[1:] != self.array.shape:
            raise ConfigurationError(
                f'{path}: frames has shape {frames.shape}, but the sensor has '
                f'{self.array.rows} x {self.array.columns} tactels: choose another folder')
        return frames

    def _file(self, name: str) -> Path:
        return self.folder / f'{name}.npz'
