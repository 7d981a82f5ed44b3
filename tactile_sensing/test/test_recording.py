"""Recordings: round trip, conversion to counts, wrong files of every kind."""
import os
from pathlib import Path

import numpy as np
import pytest

from tactile_common.errors import ConfigurationError
from tactile_sensing.contact.estimator import ContactEstimator
from tactile_sensing.devices.counts import Counts
from tactile_sensing.devices.recording import load_recording, Recording
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import ContactType
from tactile_sensing.types.image import Layer

SHARED = Path(os.environ.get('TACTILE_SHARED_DATA', Path(__file__).parents[3] / 'shared' / 'data'))
FINGER = SHARED / 'tekscan_finger' / 'iscan_finger.npz'
FRAMES = np.arange(24, dtype=np.float32).reshape(2, 3, 4)


def saved(folder, **arrays):
    path = folder / 'recording.npz'
    np.savez_compressed(path, **arrays)
    return path


def test_round_trip(tmp_path):
    recording = load_recording(saved(tmp_path, frames=FRAMES, rate_hz=10.0, pitch_m=0.00127))
    np.testing.assert_array_equal(recording.frames, FRAMES)
    assert recording.shape == (3, 4)
    assert recording.rate_hz == 10.0
    assert recording.pitch == 0.00127


def test_counts_of_any_range_round_clip_and_say_so():
    frames = np.array([[[np.nan, -0.4, 0.6], [254.6, 255.4, 256.0], [-3.0, np.inf, -np.inf]]])
    counts, clipped = Recording(frames, 10.0).counts()
    assert counts.dtype == np.uint8
    np.testing.assert_array_equal(counts, [[[0, 0, 1], [255, 255, 255], [0, 255, 0]]])
    assert clipped == 4
    frames = np.array([[[-0.6, 0.25, 5.12]]])
    counts, clipped = Recording(frames, 10.0).counts(Counts(10, signed=True), 0.01)
    assert counts.dtype == np.int16 and clipped == 1
    np.testing.assert_array_equal(counts, [[[-60, 25, 511]]])


def test_arrays_and_tables_with_rate_and_shape(tmp_path):
    np.save(tmp_path / 'f.npy', FRAMES)
    np.savetxt(tmp_path / 'f.csv', FRAMES.reshape(2, -1), delimiter=',')
    for name in ('f.npy', 'f.csv'):
        recording = load_recording(tmp_path / name, 25.0, (3, 4))
        np.testing.assert_array_equal(recording.frames, FRAMES)
        assert recording.rate_hz == 25.0 and recording.pitch is None
        with pytest.raises(ConfigurationError, match='rate_hz is 0.0, must be above 0'):
            load_recording(tmp_path / name, 0.0, (3, 4))
    for name, shape, words in (
            ('f.npy', None, "'rate_hz' is missing: --rate HZ"), ('f.csv', None, '--shape R C'),
            ('f.csv', (4, 4), '--shape says 4 x 4 = 16')):
        with pytest.raises(ConfigurationError, match=words):
            load_recording(tmp_path / name, shape=shape)


def test_tactels_that_are_never_there():
    frames = FRAMES.astype(float)
    frames[:, 0, 1] = frames[:, 2, 3] = frames[0, 1, 1] = np.nan
    assert Recording(frames, 10.0).absent == [1, 11]


@pytest.mark.parametrize('arrays, words', [
    ({'rate_hz': 10.0}, "array 'frames' is missing"),
    ({'frames': FRAMES}, "array 'rate_hz' is missing"),
    ({'frames': FRAMES[0], 'rate_hz': 10.0}, 'frames has shape (3, 4)'),
    ({'frames': FRAMES.astype(str), 'rate_hz': 10.0}, 'must be of real numbers'),
    ({'frames': FRAMES.astype(object), 'rate_hz': 10.0}, 'is not an .npz archive of numbers'),
    ({'frames': FRAMES, 'rate_hz': 0.0}, 'rate_hz is 0.0'),
    ({'frames': FRAMES, 'rate_hz': np.nan}, 'rate_hz is nan'),
    ({'frames': FRAMES, 'rate_hz': 'fast'}, "rate_hz is 'fast'"),
    ({'frames': FRAMES, 'rate_hz': 10.0, 'pitch_m': -1.0}, 'pitch_m is -1.0'),
    ({'frames': FRAMES, 'rate_hz': 10.0, 'pitch_m': 1.27}, 'pitch_m is 1.27'),
])
def test_wrong_arrays_are_named_in_one_line(tmp_path, arrays, words):
    with pytest.raises(ConfigurationError) as error:
        load_recording(saved(tmp_path, **arrays))
    assert words in str(error.value)
    assert 'recording.npz' in str(error.value)
    assert '\n' not in str(error.value)


def test_files_that_are_no_archives(tmp_path):
    path = tmp_path / 'recording.npz'
    with pytest.raises(ConfigurationError, match='No such file'):
        load_recording(path)
    with pytest.raises(ConfigurationError, match='Is a directory'):
        load_recording(tmp_path)
    whole = saved(tmp_path, frames=FRAMES, rate_hz=10.0).read_bytes()
    for content in (b'', b'words', whole[:len(whole) // 2], whole[:80] + b'?' * 40 + whole[120:]):
        path.write_bytes(content)
        with pytest.raises(ConfigurationError, match='is not an .npz archive'):
            load_recording(path)
    with open(path, 'wb') as file:
        np.save(file, FRAMES)
    with pytest.raises(ConfigurationError, match='is not an .npz archive'):
        load_recording(path)


@pytest.mark.skipif(not FINGER.exists(), reason=f'no {FINGER.name} in the shared data')
def test_recorded_finger():
    recording = load_recording(FINGER)
    assert recording.frames.shape == (309, 28, 28)
    assert recording.rate_hz == 10.0
    assert recording.pitch == pytest.approx(0.00127)
    counts, clipped = recording.counts()
    assert clipped == 0
    loaded = np.zeros(recording.shape, bool)
    loaded[15:26, 15:26] = True
    assert counts[:, loaded].max() == 100
    assert counts[:, ~loaded].max() == 9  # stray cells of the other three pads
    assert counts[:, loaded].sum() > 0.95 * counts.sum()


@pytest.mark.skipif(not FINGER.exists(), reason=f'no {FINGER.name} in the shared data')
@pytest.mark.parametrize('noise', [0.5, 0.0])  # 0: unknown
def test_a_recorded_finger_is_a_point_and_two_are_none(noise):
    recording = load_recording(FINGER)
    loaded = recording.frames[np.nanmax(recording.frames, axis=(1, 2)) > 10.0].astype(float)
    found = ContactEstimator().estimate_batch(
        loaded.copy(), TactelArray(28, 28, recording.pitch, recording.pitch),
        [Layer('zz', 0.0, None, noise_std=noise)])
    second = np.nanmax(loaded[:, 15:26, 15:17], axis=(1, 2)) > 8.0  # a spot at the pad's border
    assert second.sum() > 80 and (~second).sum() > 80
    assert (found['type'][found['valid']] == ContactType.POINT).all()
    assert found['valid'][~second].mean() > 0.95 and found['valid'][second].mean() < 0.1
