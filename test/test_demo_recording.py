"""The demo with recordings of a real array: counts, volts and offsets."""
import json

import numpy as np
import pytest

from edge_tracking import demo
from tactile_sensing.devices.calibration import Calibration, save_calibration
from tactile_sensing.types.array import TactelArray

ARRAY = TactelArray(10, 12, 0.002, 0.002)
BASELINE, X, Y = 300, 0.003, -0.002  # counts; centre of the press [m]


def pressed(height):
    """Thirty frames in which a ball presses, then lets go: counts above the unloaded pad."""
    bump = np.exp(-((ARRAY.x - X)**2 + (ARRAY.y[:, None] - Y)**2) / (2 * 0.002**2))
    ramp = np.clip(np.sin(np.linspace(-4.0, 7.0, 30)), 0.0, 1.0)
    noise = np.random.default_rng(0).normal(0.0, 0.003 * height, (30, *bump.shape))
    return height * ramp[:, None, None] * bump + noise


@pytest.fixture(autouse=True)
def there(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def play(capfd, frames, *args):
    """Run the demo on frames; returns its summary, or the line that says what is wrong."""
    np.savez('in.npz', frames=frames, rate_hz=60.0)
    status = demo.main(['--recording', 'in.npz', '--json', '--out', 'result', *args])
    out, err = capfd.readouterr()
    return json.loads(out) if status == 0 else err


def calibration(**values):
    values = {'bits': 10, 'baseline': BASELINE, 'gain': 100.0, 'depth': 0.002, **values}
    save_calibration(Calibration(ARRAY, **values), 'pad.yaml')
    return '--calibration', 'pad.yaml'


def check(summary):
    assert summary['frames'] == 30 and summary['lost_frames'] == 0
    assert summary['force_max_centre'] == pytest.approx((X, Y), abs=1e-3)


def test_ten_bits_by_a_calibration(capfd):
    frames = np.rint(BASELINE + pressed(600.0)).astype(np.uint16)
    summary = play(capfd, frames, *calibration())
    check(summary)
    assert summary['force_unit'] == 'N'


def test_volts_by_a_calibration(capfd):
    frames = (BASELINE + pressed(600.0)) * 0.005
    check(play(capfd, frames, *calibration(resolution=0.005)))


@pytest.mark.parametrize('frames', [
    pressed(0.8), np.maximum(np.rint(pressed(4000.0)), 0.0).astype(np.uint16)],
    ids=['tared volts', 'twelve bits from zero'])
def test_without_a_calibration(capfd, frames):
    summary = play(capfd, frames, '--pitch', '0.002')
    check(summary)
    assert summary['force_unit'] == 'counts m^2'


@pytest.mark.parametrize('frames', [
    np.rint(BASELINE + pressed(600.0)).astype(np.uint16), 1.5 + pressed(0.8)],
    ids=['counts', 'volts'])
def test_an_offset_without_a_calibration_is_refused(capfd, tmp_path, frames):
    text = play(capfd, frames, '--pitch', '0.002')
    assert text.startswith('demo: in.npz: tactels without a load read +') and '\n' not in text[:-1]
    assert '--calibration CAL.yaml' in text and 'subtract the unloaded picture' in text
    assert not (tmp_path / 'result').exists()


def test_a_load_that_is_held_is_no_offset(capfd):
    x = ARRAY.x[None, None, :] - X
    edge = np.tile(800.0 / (1.0 + (x / 0.002)**2)**2, (30, ARRAY.rows, 1))
    summary = play(capfd, edge, '--pitch', '0.002')
    assert summary['frames'] == 30


def test_a_baseline_of_another_pad_is_told(capfd):
    frames = np.rint(BASELINE + pressed(600.0)).astype(np.uint16)
    np.savez('in.npz', frames=frames, rate_hz=60.0)
    assert demo.main(['--recording', 'in.npz', '--out', 'result', *calibration(baseline=100)]) == 0
    err = capfd.readouterr().err
    assert 'in.npz: nearly all tactels read +200 and more off the baseline of pad.yaml' in err


def test_counts_beyond_the_calibration_are_refused(capfd):
    frames = np.rint(BASELINE + pressed(600.0)).astype(np.uint16)
    text = play(capfd, frames, *calibration(bits=8, baseline=50))
    assert 'values are outside 0 to 255, what `bits: 8` of pad.yaml allows' in text


def test_a_recording_has_no_goal_that_could_be_too_fast(capfd, tmp_path):
    (tmp_path / 'slow.yaml').write_text(
        '/**/edge_servo: {ros__parameters: {speed.max: 0.01}}')
    check(play(capfd, pressed(0.8), '--pitch', '0.002', '--parameters', 'slow.yaml'))


def test_a_demo_whose_recording_cannot_be_read_has_a_summary_of_its_reason(capfd, monkeypatch):
    known = {'ok': False, 'reason': 'bag out/bag: ends at byte 5'}
    monkeypatch.setattr(demo, 'run_scene', lambda _: (known, None))
    assert demo.main(['--json']) == 1
    out, err = capfd.readouterr()
    assert json.loads(out) == known and err == 'demo: bag out/bag: ends at byte 5\n'
