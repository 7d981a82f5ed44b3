"""Whether a sensor that keeps sending is alive: its noise, and what it says where nothing is."""

import math

import numpy as np

from tactile_common.kernels import njit
from tactile_sensing.types.image import TactileImage
from tactile_servo.reasons import Reason, ReasonCode

LIVELY = 4.0  # images between two changes of a tactel whose noise tells that it is alive
TOGETHER = 0.1  # of the lively tactels, two at least, that do not fall silent by chance
CHANCE = 1e-9  # that they do
SAME = 0.01  # m of way, on which even an image without noise changes under load


class SensorWatch:
    """
    What successive images say of the sensor itself.

    The intervals at which the tactels' noise changes them are learnt without load, when nothing
    else does.
    """

    def __init__(self) -> None:
        self._before = np.empty(0, np.float32)
        self._quiet = self._interval = np.empty(0)  # images since a tactel changed; its mean
        self._place, self._same = np.zeros(3), 0.0  # way [m] since the image changed, and whence
        self._lively = self._silent = 0.0  # share of the tactels, and of these if it is no chance
        self._below = 0.0  # force with which all of the pad seems to be pulled [N]

    def see(self, image: TactileImage, loaded: bool, place: np.ndarray) -> None:
        """Take an image, which may be `loaded`, of a pad at a place (3,) [m]."""
        layer = next((one for one in image.layers if one.component == 'zz'), None)
        if layer is None or not layer.stress.size:
            return
        # A copy, of the one kind of array that the kernel is compiled for.
        stress = np.array(layer.stress, np.float32, order='C').ravel()
        if stress.size != self._before.size:
            self._quiet, self._interval = np.zeros(stress.size), np.full(stress.size, np.inf)
            self._before = stress
            return
        floor = layer.floor if layer.floor else -np.inf
        changed, self._lively, self._silent, median = _compare(
            stress, self._before, self._quiet, self._interval, loaded, floor)
        if changed or not loaded:
            self._place = place.copy()
        self._same = float(np.linalg.norm(place - self._place))
        pad = image.array.pitch_x * image.array.pitch_y * stress.size
        self._below = -median * pad if layer.unit == 'Pa' and image.tared else 0.0
        self._before = stress

    @property
    def watches(self) -> bool:
        """Whether the noise is enough to tell whether the sensor is alive."""
        return self._lively > 0.25

    def problem(self, force: float) -> Reason | None:
        """Why the sensor is not to be believed while a force [N] is wanted, or None."""
        if self._below > 0.25 * force:
            return Reason(ReasonCode.SENSOR_DRIFTED, 'the pad seems to be pulled by '
                          f'{self._below:.1f} N; tare it')
        if self._same > SAME:
            return Reason(ReasonCode.SENSOR_SILENT, f'the same image over {1e3 * SAME:g} mm')
        if self.watches and self._silent:
            return Reason(ReasonCode.SENSOR_SILENT,
                          f'{100.0 * self._silent:.0f} % of them do not change any more')
        return None


@njit(cache=True)
def _compare(stress: np.ndarray, before: np.ndarray, quiet: np.ndarray, interval: np.ndarray,
             loaded: bool, floor: float) -> tuple[bool, float, float, float]:
    """
    Compare an image (N,) with the one before, and count on in `quiet` and `interval` (N,).

    Returns whether any tactel has changed, the share of lively tactels and, of these, that of
    silent ones, 0 where it may be chance; and the median of what is measured: at either end of
    its range a tactel says the same whatever it feels.

    Rounded noise stays long at one value and short at its neighbours: at an interval i between
    changes the long ones last 2 i - 1 images in the mean, at most. For k times as long a tactel
    does not change with a chance of e^-k, and any m of N together with one below
    (N choose m) e^-km < (e N / m)^m e^-km, which is CHANCE for the k that is taken.
    """
    changed, count, total, measured = False, 0, 0.0, np.empty(stress.size)
    known = 0
    for n in range(stress.size):
        quiet[n] += 1.0
        inside = floor < stress[n] < np.inf
        if inside:
            measured[known] = stress[n]
            known += 1
        if inside and stress[n] != before[n]:
            changed = True
            if not loaded:
                mean = interval[n] if interval[n] < np.inf else quiet[n]
                interval[n] = mean + 0.2 * (quiet[n] - mean)
        if not inside or stress[n] != before[n]:
            quiet[n] = 0.0
        if interval[n] < LIVELY:
            count += 1
            total += interval[n]
    silent, enough = 0, max(math.ceil(TOGETHER * count), 2)
    intervals = 1.0 + math.log(max(count, 1) / enough) - math.log(CHANCE) / enough
    for n in range(stress.size):
        longest = 2.0 * max(interval[n], total / max(count, 1)) - 1.0
        if interval[n] < LIVELY and quiet[n] > intervals * longest:
            silent += 1
    if silent < enough:
        silent = 0
    median = float(np.median(measured[:known])) if known else 0.0
    return changed, count / stress.size, silent / max(count, 1), median
