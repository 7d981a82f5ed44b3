"""A sensor's noise that ends is noticed soon, and one that lives on is never taken for dead."""
import numpy as np
import pytest

from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.image import Layer, TactileImage
from tactile_servo.reasons import ReasonCode
from tactile_servo.sensor_watch import SensorWatch

PLACE = np.zeros(3)


def images(rows, columns, noise, count, seed=0, means=0.0):
    """Rounded noise, in units of a count's 100 Pa, of which tactels may be taken out."""
    array, random = TactelArray(rows, columns, 1e-3, 1e-3), np.random.default_rng(seed)
    for number in range(count):
        counts = np.rint(random.normal(means, noise, (rows, columns)))
        yield TactileImage(number, number, (Layer('zz', 1e-3, 100.0 * counts),), array, True)


def test_a_pad_that_was_loaded_before_its_first_image_has_not_moved():
    watch, place = SensorWatch(), np.array([0.4, 0.1, 0.3])
    for image in images(4, 4, 0.0, 3, means=50.0):  # without noise
        watch.see(image, True, place)
        assert watch.problem(5.0) is None


@pytest.mark.parametrize('noise', [0.4, 0.6, 1.0, 3.0])  # .4: changed by every third image
@pytest.mark.parametrize('shape', [(1, 7), (2, 2), (4, 4), (5, 5), (16, 16)])
def test_living_noise_is_no_alarm(shape, noise):
    watch = SensorWatch()
    for number, image in enumerate(images(*shape, noise, 4000)):  # 20 s at 200 Hz
        watch.see(image, number > 400, PLACE)
        reason = watch.problem(5.0)
        assert reason is None or reason.code is not ReasonCode.SENSOR_SILENT, (number, reason)


@pytest.mark.parametrize('noise', [0.1, 0.2, 0.3, 0.4])
@pytest.mark.parametrize('shape', [(4, 4), (5, 5), (16, 16)])
@pytest.mark.parametrize('seed', range(3))
def test_a_load_that_moves_readings_to_the_middle_of_a_count_is_no_alarm(shape, noise, seed):
    """Noise of a third of a count and less changes only readings between two counts."""
    watch, random = SensorWatch(), np.random.default_rng(seed)
    for loaded in (False, True):
        means = random.uniform(-0.5, 0.5, shape)
        for image in images(*shape, noise, 600, seed, means):
            watch.see(image, loaded, PLACE)
            reason = watch.problem(1e3)
            assert reason is None or reason.code is not ReasonCode.SENSOR_SILENT, reason


@pytest.mark.parametrize('shape, within', [((4, 4), 40), ((5, 5), 30), ((16, 16), 12)])
def test_half_of_a_pad_that_falls_silent_is_noticed(shape, within):
    watch = SensorWatch()
    for number, image in enumerate(images(*shape, 1.0, 1000)):
        if number > 900:
            image.layers[0].stress[:, :shape[1] // 2] = 0.0
        watch.see(image, number > 400, PLACE)
        reason = watch.problem(5.0)
        if reason is not None and reason.code is ReasonCode.SENSOR_SILENT:
            break
    assert 900 < number <= 900 + within
