"""`calibrate --live`: which presses are taken or repeated, and continuation."""
from contextlib import suppress

import numpy as np
import pytest

from tactile_common.errors import ConfigurationError
from tactile_common.npz_stream import read_arrays, write_arrays
from tactile_sensing.calibration.presses import Presses
from tactile_sensing.calibration.recorder import HELD, PressCatcher, Recorder, Step
from tactile_sensing.skin.pressure import SkinPressure
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.skin import Skin

ARRAY = TactelArray(12, 12, 1.5e-3, 1.5e-3)
SKIN = SkinPressure(Skin(2e-3), 1.5e-3, 1.5e-3)
FULL = 1023
STEPS = (Step('unloaded', 40, 'Off.', presses=False), Step('corners', 1, 'Corner.', anywhere=True),
         Step('ball', 3, 'Ball.'))


def ball(a, b, peak=400.0):
    picture = SKIN.point(ARRAY.x, ARRAY.y[:, None], a, b, 1.0)
    return peak * picture / picture.max()


def held(picture, frames=2 * HELD):
    """Return the counts of a press that rises, is held and is released, without noise."""
    levels = [*np.linspace(0.0, 1.0, 6), *np.ones(frames), *np.linspace(1.0, 0.0, 6), *np.zeros(5)]
    return [level * picture for level in levels]


class Sensor:
    """Frames of a script; at its end the user stops."""

    def __init__(self, script):
        self._script, self._rng = iter(script), np.random.default_rng(4)

    def look(self):
        try:
            clean = next(self._script)
        except StopIteration:
            raise KeyboardInterrupt from None
        counts = np.rint(20.0 + clean + 2.0 * self._rng.standard_normal(ARRAY.shape))
        return np.clip(counts, 0, FULL)


def wizard(folder, script, answers=()):
    asked, lines, left = [], [], iter(answers)
    recorder = Recorder(folder, ARRAY, Sensor(script).look,
                        lambda text: asked.append(text) or next(left, ''), lines.append, FULL)
    return recorder, asked, lines


NOTHING = [np.zeros(ARRAY.shape)] * 40
CORNER = held(ball(ARRAY.x[0], ARRAY.y[0]))


def test_bad_presses_are_named_and_asked_for_again(tmp_path):
    two = ball(-5e-3, -5e-3) + ball(5e-3, 5e-3)
    script = [*NOTHING, *CORNER, *held(ball(0.0, 0.0)), *held(two), *held(ball(1e-3, 0.0, 3e3)),
              *held(ball(ARRAY.x[0], 0.0)), *held(ball(2e-3, 1e-3)), *held(ball(-3e-3, 2e-3))]
    recorder, asked, lines = wizard(tmp_path, script)
    recorder.run(STEPS)
    assert [text.split(':')[0] for text in asked] == ['unloaded', 'corners', 'ball']
    wrong = [text for text in lines if 'not taken' in text]
    assert len(wrong) == 3 and all(text.endswith('press again') for text in wrong)
    assert [words in text for words, text in zip(
        ('elsewhere', 'full scale', 'border'), wrong, strict=True)] == [True] * 3
    with np.load(tmp_path / 'ball.npz') as file:
        frames = file['frames']
    peaks = [np.unravel_index(frame.argmax(), frame.shape) for frame in frames]
    assert len(frames) == 3 and len(set(peaks)) == 3


@pytest.mark.parametrize('fault', [2.0 * FULL, 300.0], ids=['at full scale', 'noisy'])
def test_a_faulty_tactel_prevents_no_press(tmp_path, fault):
    script, rng = [*NOTHING, *(frame for a in (0.0, 2e-3, -2e-3) for frame in held(ball(a, 0.0)))
                   ], np.random.default_rng(6)
    for k, frame in enumerate(script):
        script[k] = frame = frame.copy()
        frame[8, 9] = fault if fault > FULL else rng.normal(500.0, fault)
    recorder, _, lines = wizard(tmp_path, script)
    with suppress(KeyboardInterrupt):  # the script ends
        recorder.run((STEPS[0], STEPS[2]))
    assert lines[1:] == ['ball: 1 of 3', 'ball: 2 of 3', 'ball: 3 of 3']


def test_the_folder_of_another_array_is_refused(tmp_path):
    write_arrays(tmp_path / 'unloaded.npz', frames=np.zeros((40, 8, 8)))
    recorder, asked, _ = wizard(tmp_path, NOTHING)
    with pytest.raises(ConfigurationError, match=r'unloaded.npz: frames has shape \(40, 8, 8\), '
                                                 'but the sensor has 12 x 12 tactels'):
        recorder.run(STEPS)
    assert not asked


def test_an_interrupted_session_goes_on(tmp_path):
    first = [*NOTHING, *CORNER, *held(ball(0.0, 0.0))]
    recorder, _, _ = wizard(tmp_path, first)
    with pytest.raises(KeyboardInterrupt):
        recorder.run(STEPS)
    recorder, asked, lines = wizard(tmp_path, [*held(ball(2e-3, 0.0)), *held(ball(0.0, 3e-3))])
    recorder.run(STEPS)
    assert len(asked) == 1 and asked[0].startswith('ball')
    assert lines == ['unloaded: 40 frames are there', 'corners: 1 frames are there',
                    'ball: 2 of 3', 'ball: 3 of 3']
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        'ball.npz', 'corners.npz', 'unloaded.npz']


def test_a_file_is_whole_or_as_it_was(tmp_path, monkeypatch):
    path = tmp_path / 'ball.npz'
    write_arrays(path, frames=np.arange(3))

    def interrupted(file, **_):
        file.write(b'half')
        raise KeyboardInterrupt
    monkeypatch.setattr(np, 'savez', interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_arrays(path, frames=np.arange(4))
    assert list(tmp_path.iterdir()) == [path]
    np.testing.assert_array_equal(read_arrays(path, ('frames',))['frames'], np.arange(3))


def test_a_press_that_is_held_keeps_some_frames_which_are_one_press(tmp_path):
    script = [*NOTHING, *held(ball(0.0, 0.0)), *held(ball(1e-3, 0.0)), *held(ball(0.0, 2e-3))]
    recorder, _, lines = wizard(tmp_path, script)
    recorder.run((STEPS[0], Step('ball', 3, 'Ball.', frames=4)))
    assert lines[1:] == ['ball: 1 of 3', 'ball: 2 of 3', 'ball: 3 of 3']
    with np.load(tmp_path / 'ball.npz') as file:
        values = file['frames'] - 20.0
    values[5, 0, 0] = floor = -10.0  # hidden in one frame of the second press: no value
    presses = Presses(ARRAY, values, np.full(values.shape, 2.0), np.full(ARRAY.shape, floor),
                      np.arange(12), np.zeros(12, int), np.ones(12)).averaged()
    assert presses.number.tolist() == [0, 4, 8]
    np.testing.assert_allclose(presses.noise, 1.0)
    assert np.argwhere(np.isnan(presses.values)).tolist() == [[1, 0, 0]]
    np.testing.assert_allclose(presses.values[2], values[8:].mean(axis=0))


def test_what_is_skipped_is_not_there_and_presses_need_the_unloaded_pad(tmp_path):
    recorder, asked, lines = wizard(tmp_path, [], 's')
    recorder.run(STEPS)
    assert len(asked) == 1 and lines == ['corners: needs unloaded', 'ball: needs unloaded']
    assert not list(tmp_path.iterdir())


def test_a_press_that_moves_or_slackens_is_awaited():
    rng = np.random.default_rng(5)
    catcher = PressCatcher(ARRAY, 20.0 + 2.0 * rng.standard_normal((100, *ARRAY.shape)))

    def see(clean):
        return catcher.see(20.0 + clean + 2.0 * rng.standard_normal(ARRAY.shape))
    nothing = np.zeros(ARRAY.shape)
    see(nothing)
    sliding = [ball(a, 0.0) for a in np.linspace(-4e-3, 4e-3, 60)]
    assert {see(picture) for picture in sliding} == {None}
    assert [see(sliding[-1]) for _ in range(2 * HELD)].count('') == 1  # it is taken once
    rising = [ball(0.0, 0.0, peak) for peak in np.linspace(100.0, 900.0, 60)]
    assert {see(nothing)} | {see(picture) for picture in rising} == {None}
