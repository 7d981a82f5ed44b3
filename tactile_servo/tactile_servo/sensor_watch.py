"""Check that a sensor which sends images is alive, by its noise and its unloaded values."""

import math

import numpy as np

from tactile_common.kernels import njit
from tactile_sensing.types.image import TactileImage
from tactile_servo.reasons import Reason, ReasonCode

LIVELY = 4.0  # a tactel that changes after fewer images on average is lively: noise shows its life
LEAST_LIVELY = 0.25  # least share of lively tactels, of all: with fewer, noise shows nothing
TOGETHER = 0.1  # share of lively tactels, at least two, that must be silent to be reported
CHANCE = 1e-9  # probability that so many are silent by chance
INTERVAL_WEIGHT = 0.2  # weight of the newest interval in its running mean
PULLED = 0.25  # largest pull at the whole pad that an image may show, as a share of the force
SAME = 0.01  # m of travel within which even an image without noise must change under load


class SensorWatch:
    """
    Monitors the sensor by successive images.

    It learns the intervals between changes of the tactels without load, when only noise changes
    them.
    """

    def __init__(self) -> None:
        self._before = np.empty(0, np.float32)
        self._quiet = self._interval = np.empty(0)  # images since a tactel changed; mean interval
        self._place, self._same = np.zeros(3), 0.0  # where the image changed; travel since [m]
        self._lively = self._silent = 0.0  # share of lively tactels; of these, of silent ones
        self._below = 0.0  # force that seems to pull at the whole pad [N]

    def see(self, image: TactileImage, loaded: bool, place: np.ndarray) -> None:
        """Process an image of a pad at a position (3,) [m]; `loaded` if something presses it."""
        layer = next((one for one in image.layers if one.component == 'zz'), None)
        if layer is None or not layer.stress.size:
            return
        # A copy, of the only array type for which the kernel is compiled.
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
        """Whether there is enough noise to detect that the sensor falls silent."""
        return self._lively > LEAST_LIVELY

    def problem(self, force: float) -> Reason | None:
        """Return why the sensor cannot be trusted while a force [N] is wanted, or None."""
        if self._below > PULLED * force:
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
    Compare an image (N,) with the previous one, and update `quiet` and `interval` (N,).

    Returns whether any tactel has changed; the share of lively tactels; of these, the share of
    silent ones, 0 if it may be due to chance; and the median of the readings within the range.
    Clipped readings do not count, because they are constant.

    Rounded noise stays long at one value and short at its neighbours. With a mean interval i
    between changes, the long intervals last at most 2 i - 1 images on average. The probability
    that a tactel does not change for k times as long is e^-k. The probability that any m of N do
    not change together is below (N choose m) e^-km < (e N / m)^m e^-km. k is chosen so that this
    bound equals CHANCE.
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
                interval[n] = mean + INTERVAL_WEIGHT * (quiet[n] - mean)
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
