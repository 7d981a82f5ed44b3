"""Calibration file, tare, invalid tactels."""
from pathlib import Path

import numpy as np
import pytest
import yaml

from tactile_common.errors import ConfigurationError
from tactile_sensing.devices.calibration import Calibration, load_calibration, save_calibration
from tactile_sensing.devices.tare import TareRefusedError
from tactile_sensing.types.array import TactelArray

SHIPPED = Path(__file__).parents[1] / 'config'
ARRAY, RNG_SEED = TactelArray(4, 5, 0.001, 0.002), 3


def calibration(**values):
    return Calibration(ARRAY, **{'gain': 100.0, 'baseline': 10, 'depth': 0.002, **values})


def frames(count=50, level=10.0, noise=1.0):
    rng = np.random.default_rng(RNG_SEED)
    values = level + noise * rng.standard_normal((count, *ARRAY.shape))
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)


def test_shipped_files():
    pad = load_calibration(SHIPPED / 'flexitac_16x16.yaml')
    assert pad.array.shape == (16, 16)
    assert pad.array.size_x == pytest.approx(0.0254)
    assert pad.gain[0, 0] * 255 == pytest.approx(160e3, rel=1e-4)
    assert (pad.unit, pad.depth, pad.skin_stiffness) == ('Pa', 0.002, 2e5)
    assert pad.acquisition_delay == 0.0025
    finger = load_calibration(SHIPPED / 'tekscan_finger_28x28.yaml')
    assert (finger.array.shape, finger.unit, finger.array.pitch_x) == ((28, 28), 'counts', 0.00127)


def test_counts_to_pressure_without_and_with_tare():
    counts = np.full(ARRAY.shape, 30, np.uint8)
    gain = np.arange(1.0, 21.0).reshape(ARRAY.shape)
    np.testing.assert_allclose(
        calibration(gain=gain.tolist()).converter()(counts)[0].stress, 20.0 * gain)
    pad = calibration()
    layer, saturated = pad.converter()(counts)
    assert layer.stress.dtype == np.float32
    np.testing.assert_allclose(layer.stress, 2000.0)
    assert (layer.component, layer.depth, layer.unit, saturated) == ('zz', 0.002, 'Pa', 0)
    assert (layer.full_scale, layer.noise_std) == (24500.0, 0.0)
    tare = pad.make_tare(frames(level=12.0))
    layer, _ = pad.converter(tare)(counts)
    np.testing.assert_allclose(layer.stress, 100.0 * (30 - tare.offset), rtol=1e-5)
    assert layer.noise_std == pytest.approx(100.0, rel=0.1)
    assert layer.full_scale == pytest.approx(100.0 * (255 - tare.offset.max()))


def test_dead_and_saturated_tactels_are_nan():
    pad = calibration(dead_tactels=(0, 7), saturation=250)
    counts = np.full(ARRAY.shape, 20, np.uint8)
    counts[0, 0] = counts[2, 3] = 250
    counts[3, 4] = 249
    layer, saturated = pad.converter()(counts)
    assert saturated == 1  # a dead tactel is not counted
    assert np.argwhere(np.isnan(layer.stress)).tolist() == [[0, 0], [1, 2], [2, 3]]
    # The previous image has no effect.
    assert np.isnan(pad.converter()(counts * 0 + 20)[0].stress).sum() == 2


@pytest.mark.parametrize('count', [20, 50, 200])
def test_noise_alone_is_never_refused(count):
    pad = Calibration.uncalibrated(16, 16, 0.001, baseline=10)
    rng = np.random.default_rng(RNG_SEED)
    for _ in range(20):
        values = np.rint(10 + rng.standard_normal((count, 16, 16)))
        pad.make_tare(values.astype(np.uint8))


def test_a_noisy_sensor_is_tared_and_a_load_on_it_is_not():
    pad = Calibration.uncalibrated(16, 16, 0.001, baseline=10)
    rng = np.random.default_rng(RNG_SEED)
    for _ in range(20):
        values = np.clip(np.rint(10 + 20 * rng.standard_normal((50, 16, 16))), 0, 255)
        pad.make_tare(values.astype(np.uint8))
        values[:, 3, 4] += 30
        with pytest.raises(TareRefusedError, match='row 3 column 4'):
            pad.make_tare(values.astype(np.uint8))


def loaded(add, frame=slice(None), row=1, column=2):
    """Return frames with a tactel that is off."""
    values = frames().astype(np.float32)
    values[frame, row, column] += add
    return values


@pytest.mark.parametrize('bad, reason', [
    (loaded(6), 'under load: 1 tactels.*row 1 column 2 by [+]'),
    (loaded(np.nan, 3), '1 tactels send no number.*row 1 column 2: see'),
    (loaded(4, slice(25, None), 0, 0), 'not steady: a tactel changes by [34]'),
    (frames(level=300.0), 'under load: 20 tactels'),
    (frames(19), '19 frames, at least 20'), (frames()[:, :3], 'shape'), (frames()[0], 'shape')])
def test_no_tare_of_frames_that_do_not_show_the_unloaded_pad(bad, reason):
    with pytest.raises(TareRefusedError, match=reason):
        calibration().make_tare(bad)


def test_a_dead_tactel_or_a_wide_tolerance_prevents_no_tare():
    for bad in (loaded(6), loaded(np.nan, 3)):
        assert np.isfinite(calibration(dead_tactels=(7,)).make_tare(bad).noise_std)
    calibration(tare_tolerance=10).make_tare(loaded(6))


@pytest.mark.parametrize('noise', [0.2, 0.4])
def test_a_dead_tactel_without_a_number_changes_no_noise(noise):
    whole = np.rint(10.3 + noise * np.random.default_rng(RNG_SEED).standard_normal(
        (50, *ARRAY.shape)))
    dead = calibration(dead_tactels=(7,))
    expected = dead.make_tare(whole).noise_std
    whole[:, 1, 2] = np.nan
    assert dead.make_tare(whole).noise_std == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize('values, reason', [
    ({'gain': 0.0}, 'gain is 0.0'),
    ({'gain': [[1.0]]}, 'gain must be a number or 4 rows of 5'),
    ({'gain': float('nan')}, 'all finite'),
    ({'unit': 'kPa'}, "unit is 'kPa', must be one of"),
    ({'component': 'xx'}, "component is 'xx'"),
    ({'baseline': 255}, 'below saturation = 255'),
    ({'saturation': 0}, 'saturation is 0, must be an integer from 1'),
    ({'dead_tactels': (20,)}, 'dead_tactels holds 20, must be integers from 0 to 19'),
    ({'dead_tactels': tuple(range(20))}, 'every tactel'),
    ({'depth': -0.001}, 'depth is -0.001'),
    ({'depth': '2 mm'}, "depth is '2 mm'"),
    ({'tare_tolerance': float('nan')}, 'tare_tolerance is nan'),
    ({'model': 3}, 'model is 3, must be a text'),
])
def test_impossible_values(values, reason):
    with pytest.raises(ConfigurationError, match=reason):
        calibration(**values)


GOOD = 'rows: 2\ncolumns: 3\npitch: 0.001\ngain: 1.5\n'


@pytest.mark.parametrize('text, reason', [
    ('', 'must be a mapping'),
    ('rows: [', 'is not YAML'),
    (GOOD + 'colour: red', "unknown key 'colour'"),
    (GOOD.replace('rows: 2', ''), "key 'rows' is missing"),
    (GOOD.replace('2', '2.5'), 'rows is 2.5, must be an integer'),
    (GOOD.replace('0.001', '[1, 2, 3]'), 'pitch is'),
    (GOOD.replace('0.001', 'wide'), "pitch_x is 'wide'"),
    (GOOD + 'dead_tactels: [[2, 0]]', 'dead_tactels holds'),
    (GOOD + 'dead_tactels: [3]', 'dead_tactels holds 3'),
    (GOOD + 'depth: null', 'depth is None'),
    (GOOD.replace('2', '1000000'), 'rows is 1000000, must be between 1 and 1024'),
    (GOOD.replace('1.5', '1' + '0' * 400), 'gain must be a number or 2 rows of 3'),
    (GOOD + 'bits: 1' + '0' * 400, 'bits is 1000'),
    (GOOD + 'nominal_rate: 20000', 'nominal_rate is 20000.*between 0 and 10000 Hz'),
])
def test_impossible_files(tmp_path, text, reason):
    path = tmp_path / 'pad.yaml'
    path.write_text(text)
    with pytest.raises(ConfigurationError, match=reason) as caught:
        load_calibration(path)
    assert str(caught.value).startswith(f'calibration {path}: ')
    assert '\n' not in str(caught.value)


def test_numbers_of_numpy_are_saved(tmp_path):
    path = tmp_path / 'pad.yaml'
    pad = Calibration(
        TactelArray(np.int64(4), np.int32(5), 0.001, 0.002), gain=2.0, depth=np.float64(0.003),
        dead_tactels=(np.int64(7),), row_order=tuple(np.arange(4)[::-1]))
    save_calibration(pad, path)
    found = load_calibration(path)
    assert (found.array, found.depth, found.dead_tactels) == (ARRAY, 0.003, (7,))
    assert found.row_order == [3, 2, 1, 0]


def test_a_file_that_cannot_be_written_stays_as_it_was(tmp_path):
    path = tmp_path / 'pad.yaml'
    path.write_text(GOOD)
    with pytest.raises(yaml.representer.RepresenterError):
        save_calibration(calibration(found={'when': object()}), path)
    assert list(tmp_path.iterdir()) == [path] and path.read_text() == GOOD


def test_good_file(tmp_path):
    path = tmp_path / 'pad.yaml'
    path.write_text(GOOD + 'dead_tactels: [[1, 2], [0, 1]]')
    pad = load_calibration(path)
    assert (pad.dead_tactels, pad.source) == ((5, 1), str(path))
    path.write_text(GOOD.replace('0.001', '[0.001]'))
    assert load_calibration(path).array.pitch_y == 0.001
    with pytest.raises(ConfigurationError, match='No such file'):
        load_calibration(tmp_path / 'none.yaml')
