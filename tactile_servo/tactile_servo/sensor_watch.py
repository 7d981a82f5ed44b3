"""Check that a sensor which sends images is alive, by its noise and its unloaded values."""

import math

import numpy as np

from tactile_sensing.types.image import TactileImage
from tactile_servo.reasons import Reason, ReasonCode
from tactile_servo.types import pressure_layer

LIVELY = 4.0  # a tactel that changes after fewer images on average is lively: noise shows its life
# Least share of lively tactels, of those that are not clipped. With fewer, the noise is so small
# that a tactel in the middle between two counts hardly changes, as any of them may under load.
LEAST_LIVELY = 0.8
TOGETHER = 0.1  # share of lively tactels, at least two, that must be silent to be reported
CHANCE = 1e-9  # probability that so many are silent by chance
INTERVAL_WEIGHT = 0.2  # weight of the newest interval in its running mean
SURE = 4.0  # standard deviations above which a force is no noise
MEDIAN_NOISE = 1.25  # standard deviation of a median, relative to that of a mean
PULLED = 0.25  # largest pull at the whole pad that an image may show, as a share of the force
SAME = 0.01  # m of travel within which even an image without noise must change under load


class SensorWatch:
    """
    Monitors the sensor by successive images.

    It learns the intervals between changes of the tactels without load, when only noise changes
    them. Clipped readings do not count, because they are constant.
    """

    def __init__(self) -> None:
        self._before = np.empty(0)
        self._quiet = self._interval = np.empty(0)  # images since a tactel changed; mean interval
        self._place, self._same = np.zeros(3), 0.0  # where the image changed; travel since [m]
        self._silent = 0.0  # share of silent tactels among the lively ones
        self._below = 0.0  # force that seems to pull at the whole pad [N]
        self.watches = False  # whether there is enough noise to detect that the sensor is silent

    def see(self, image: TactileImage, loaded: bool, place: np.ndarray) -> None:
        """Process an image of a pad at a position (3,) [m]; `loaded` if something presses it."""
        layer = pressure_layer(image.layers)
        if layer is None or not layer.stress.size:
            return
        stress = np.array(layer.stress).ravel()  # a copy
        if stress.size != self._before.size:
            self._quiet, self._interval = np.zeros(stress.size), np.full(stress.size, np.inf)
            self._before, self._place = stress, place.copy()
            return
        inside = (stress > (layer.floor if layer.floor else -np.inf)) & (stress < np.inf)
        changed = inside & (stress != self._before)
        self._before = stress
        if not loaded or changed.any():
            self._place = place.copy()
        self._same = math.dist(place, self._place)
        self._count_intervals(changed, inside, loaded)
        pad = image.array.pitch_x * image.array.pitch_y * stress.size
        self._below, ordered = 0.0, np.sort(stress[inside])
        if layer.unit == 'Pa' and image.tared and ordered.size:
            half = ordered.size // 2  # np.median takes five times as long
            pull = -0.5 * pad * float(ordered[half] + ordered[~half])
            noise = SURE * MEDIAN_NOISE * pad * float(layer.noise_std) / math.sqrt(stress.size)
            self._below = pull - min(0.5 * pull, noise)

    def _count_intervals(self, changed: np.ndarray, inside: np.ndarray, loaded: bool) -> None:
        """
        Update the intervals between changes (N,), and the shares of lively and silent tactels.

        Rounded noise stays long at one value and short at its neighbours. With a mean interval i
        between changes, the long intervals last at most 2 i - 1 images on average. The probability
        that a tactel does not change for k times as long is e^-k. The probability that any m of N
        do not change together is below (N choose m) e^-km < (e N / m)^m e^-km. k is chosen so that
        this bound equals CHANCE.
        """
        self._quiet += 1.0
        if not loaded:
            quiet, mean = self._quiet[changed], self._interval[changed]
            mean[np.isinf(mean)] = quiet[np.isinf(mean)]
            self._interval[changed] = mean + INTERVAL_WEIGHT * (quiet - mean)
        self._quiet[changed | ~inside] = 0.0
        lively = self._interval < LIVELY
        quiet, interval = self._quiet[lively], self._interval[lively]
        self.watches = bool(len(interval) > LEAST_LIVELY * np.count_nonzero(inside))
        self._silent, enough = 0.0, max(math.ceil(TOGETHER * len(interval)), 2)
        if len(interval) >= enough:
            most = 1.0 + math.log(len(interval) / enough) - math.log(CHANCE) / enough
            silent = quiet > most * (2.0 * np.maximum(interval, interval.mean()) - 1.0)
            if (count := int(np.count_nonzero(silent))) >= enough:
                self._silent = count / len(interval)

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
