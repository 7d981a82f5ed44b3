"""Counts of all converters: from raw counts to pressure to contacts."""
import numpy as np
import point_load as point
import pytest

from tactile_common.errors import ConfigurationError
from tactile_sensing.contact.estimator import ContactEstimator, EstimatorConfig
from tactile_sensing.devices.calibration import Calibration, load_calibration, save_calibration
from tactile_sensing.devices.counts import Counts
from tactile_sensing.devices.tare import unloaded_statistics
from tactile_sensing.thesis import line
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import ContactType, Reason
from tactile_sensing.types.image import TactileImage

ARRAY, DEPTH, COUNT = TactelArray(16, 16, 0.0254 / 16, 0.0254 / 16), 0.002, 300
NOISE = 0.01  # of the peak
# Bits, signed; counts of the baseline, of the peak above it and of the threshold (or None).
SENSORS = {
    'signed': (12, True, 0.0, 1000.0, None), 'offset': (10, False, 100.0, 800.0, None),
    'clipped': (10, False, 0.0, 800.0, None), 'clipped, 8 bits': (8, False, 0.0, 200.0, None),
    '6 bits': (6, False, 5.0, 50.0, None), 'signed, 6 bits': (6, True, 0.0, 25.0, None),
    'clipped, 6 bits': (6, False, 0.0, 50.0, None), 'thresholded': (10, False, 0.0, 800.0, 40),
    '16 bits': (16, False, 500.0, 40000.0, None)}


def loads(kind):
    """Return images (COUNT, rows, columns) with a peak of about 1 Pa, and the loads' places."""
    rng = np.random.default_rng(5)
    if kind == 'line':
        place = rng.uniform((-6e-3, -0.6), (6e-3, 0.6), (COUNT, 2))
        clean = np.array([line.pressure(ARRAY.x, ARRAY.y[:, None], *each, 1.0, DEPTH)
                          for each in place])
    else:
        place = rng.uniform(-7e-3, 7e-3, (COUNT, 2))
        clean = np.array([point.stress('zz', ARRAY.x, ARRAY.y[:, None], a, b, 1.0, 0.0, 0.0,
                                       DEPTH) for a, b in place])
    clean /= clean.max()
    return clean, place, rng.standard_normal(clean.shape)


def digitised(pressure, sensor):
    """Return the raw counts of `sensor` for a pressure relative to the peak."""
    bits, signed, baseline, peak, threshold = sensor
    counts = np.rint(pressure * peak + baseline)
    low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)
    counts = np.clip(counts, low, high)
    return counts if threshold is None else np.where(counts < threshold, 0.0, counts)


def estimated(frames, sensor, unloaded):
    bits, signed, baseline, peak, threshold = sensor
    calibration = Calibration(ARRAY, gain=1.0 / peak, bits=bits, signed=signed, baseline=baseline,
                              threshold=threshold, depth=DEPTH)
    tare = calibration.make_tare(digitised(NOISE * unloaded, sensor))
    return ContactEstimator(EstimatorConfig(tactel='point')).estimate_batch(
        calibration.stress(digitised(frames, sensor), tare), ARRAY, [calibration.layer(tare)])


@pytest.fixture(scope='module', params=['point', 'line'])
def reference(request):
    """A kind of load, and its estimates from 16-bit signed counts, in effect real numbers."""
    clean, place, noise = loads(request.param)
    unloaded = np.random.default_rng(6).standard_normal((100, *ARRAY.shape))
    found = estimated(clean + NOISE * noise, (16, True, 0.0, 30000.0, None), unloaded)
    return request.param, clean + NOISE * noise, place, unloaded, found


def rms(found, place, kind):
    good = found['valid'] & (found['type'] == (2 if kind == 'line' else 1))
    claimed, offset = found['covariance'][good], place[good, 0]
    if kind == 'point':
        off, claimed = found['x'][good] - offset, claimed[:, 0, 0]
    else:  # across the edge, at the estimated place
        yaw = place[good, 1]
        off = found['x'][good] * np.cos(yaw) + found['y'][good] * np.sin(yaw) - offset
        claimed = claimed[:, 0, 0] + claimed[:, 1, 1]
    return np.sqrt(np.mean(off**2)), good.mean(), np.sqrt(np.mean(off**2 / claimed))


@pytest.mark.parametrize('name', SENSORS)
def test_every_converter_is_as_good_as_its_noise_allows(reference, name):
    kind, frames, place, unloaded, plain = reference
    sensor = SENSORS[name]
    found = estimated(frames, sensor, unloaded)
    error, valid, claims = rms(found, place, kind)
    best, best_valid, _ = rms(plain, place, kind)
    # Rounding adds a variance of 1/12 count^2. Clipping at the mean leaves .82 of the information
    # of an unloaded tactel (Tobin: 1/2 + 1/pi). A threshold of 5 % of the peak hides the flanks,
    # which separate shear from place: the claims include that.
    lost = (0.5 + 1.0 / np.pi)**-0.5 if name.startswith('clipped') else 1.0
    rounding = np.sqrt(1.0 + (1.0 / (NOISE * sensor[3]))**2 / 12.0)
    assert valid > best_valid - 0.02
    assert claims < 1.3
    # The RMS of this number of frames is known within 4 %.
    assert sensor[4] or error < 1.04 * 1.1 * rounding * best * lost


@pytest.mark.parametrize('values, words', [
    ({'bits': 0}, 'bits is 0, must be between 1 and 16'), ({'bits': 17}, 'bits is 17'),
    ({'bits': 8.0}, 'bits is 8.0, must be an integer'),
    ({'signed': 1}, 'signed is 1, must be a boolean'),
    ({'threshold': 0}, 'threshold is 0, must be an integer from 1 to 256'),
    ({'saturation': 300}, 'saturation is 300')])
def test_impossible_ranges(values, words):
    with pytest.raises(ConfigurationError, match=words):
        Counts(**values)


@pytest.mark.parametrize('offset, noise', [(0.0, 2.0), (0.8, 1.0), (50.0, 3.0), (20.0, 0.2)])
def test_noise_and_offset_despite_clipping_and_rounding(offset, noise):
    rng = np.random.default_rng(8)
    true = offset + rng.uniform(-0.5, 0.5, ARRAY.shape)
    frames = np.maximum(np.rint(true + noise * rng.standard_normal((200, *ARRAY.shape))), 0.0)
    found_offset, found_noise = unloaded_statistics(frames, 1, 0, np.ones(ARRAY.shape, bool))
    expected = np.hypot(noise, 12**-0.5)
    assert np.sqrt(np.mean(found_noise**2)) == pytest.approx(expected, rel=0.1)
    assert found_noise.min() >= 12**-0.5
    assert abs(np.mean(found_offset - true)) < 0.1 * expected


def test_a_tactel_that_is_noisier_keeps_its_noise():
    frames = 100.0 + np.random.default_rng(9).standard_normal((200, 8, 8))
    frames[:, 2, 3] = 100.0 + 4.0 * (frames[:, 2, 3] - 100.0)
    _, noise = unloaded_statistics(frames, 1, 0, np.ones((8, 8), bool))
    assert noise[2, 3] == pytest.approx(4.0, rel=0.2)
    others = np.delete(noise.ravel(), 2 * 8 + 3)
    assert np.abs(others - 1.0).max() < 0.35


def test_order_of_rows_and_columns(tmp_path):
    array = TactelArray(3, 4, 1e-3, 2e-3)
    calibration = Calibration(array, row_order=(2, 0, 1), column_order=(3, 2, 1, 0),
                              transposed=True, bits=12, threshold=5, dead_tactels=(5,),
                              noise=np.arange(1.0, 13.0).reshape(3, 4), thickness=0.004,
                              depth=0.002, tactel='area', found={'assumed': ['nothing']})
    picture = np.arange(12.0).reshape(3, 4)
    raw = np.empty((4, 3))
    for row in range(3):
        for column in range(4):
            raw[3 - column, (2, 0, 1)[row]] = picture[row, column]
    np.testing.assert_array_equal(calibration.arrange(raw), picture)
    assert calibration.raw_shape == (4, 3)
    save_calibration(calibration, tmp_path / 'pad.yaml')
    again = load_calibration(tmp_path / 'pad.yaml')
    for name in ('row_order', 'column_order'):
        assert tuple(getattr(again, name)) == getattr(calibration, name)
    for name in ('transposed', 'bits', 'threshold', 'dead_tactels', 'thickness', 'depth',
                 'tactel', 'found'):
        assert getattr(again, name) == getattr(calibration, name), name
    np.testing.assert_allclose(again.noise, calibration.noise)


def test_a_pad_whose_noise_is_clipped_weighs_nothing():
    rng = np.random.default_rng(8)
    baseline, noise, count = 10.0, 20.0, 400
    calibration = Calibration(ARRAY, baseline=np.array(baseline), depth=DEPTH)
    frames = np.clip(np.rint(baseline + noise * rng.standard_normal((2 * count, *ARRAY.shape))),
                     0, 255).astype(np.uint8)
    tare = calibration.make_tare(frames[:count])
    convert = calibration.converter(tare)
    pictures = np.array([convert(frame)[0].stress for frame in frames[count:]])
    np.testing.assert_allclose(pictures, calibration.stress(frames[count:], tare), atol=1e-4)
    # The mean of a tactel over frames varies by chance, in the tare and afterwards.
    by_chance = noise * np.sqrt(2.0 / count / ARRAY.rows / ARRAY.columns)
    assert abs(pictures.mean()) < 5.0 * by_chance


def test_readings_that_are_no_noise_weigh_what_they_say():
    """Raw counts of a foil that hides weak pressure: its pattern is not the noise of zeros."""
    array = TactelArray(28, 28, 1.27e-3, 1.27e-3)
    calibration = Calibration.uncalibrated(28, 28, 1.27e-3)
    counts = np.zeros(array.shape)
    counts[10:16, 12:17] = np.random.default_rng(0).integers(20, 90, (6, 5))
    layer, saturated = calibration.converter()(counts)
    contact = ContactEstimator().estimate(
        TactileImage(0, 0, (layer,), array, tared=False, saturated=saturated))
    assert contact.moments.m0 == pytest.approx(counts.sum() * 1.27e-3**2)
    assert contact.type == ContactType.OTHER and contact.reasons & Reason.BAD_FIT  # not NO_CONTACT


def test_places_need_no_gain(reference):
    kind, frames, _, unloaded, _ = reference
    sensor = SENSORS['clipped, 8 bits']
    known = estimated(frames, sensor, unloaded)
    blind = Calibration.uncalibrated(16, 16, ARRAY.pitch_x, depth=DEPTH)
    tare = blind.make_tare(digitised(NOISE * unloaded, sensor))
    found = ContactEstimator(EstimatorConfig(tactel='point')).estimate_batch(
        blind.stress(digitised(frames, sensor), tare), ARRAY, [blind.layer(tare)])
    both = found['valid'] & known['valid'] & (found['type'] == known['type'])
    assert both.mean() > 0.98
    found, known = found[both], known[both]
    np.testing.assert_allclose(found['x'], known['x'], rtol=0, atol=1e-6)
    np.testing.assert_allclose(found['y'], known['y'], rtol=0, atol=1e-6)
    np.testing.assert_allclose(found['yaw'], known['yaw'], rtol=0, atol=1e-4)
    assert np.isnan(found['normal_force']).all() and not found['force_valid'].any()
