"""Recording and calibrating from a port, without a ROS graph."""
import threading
import time

import numpy as np
import pytest
from terminal import Terminal

from tactile_common.errors import TactileError
from tactile_sensing.calibration import recorder
from tactile_sensing.cli import calibrate, record
from tactile_sensing.devices.flexitac import FlexiTacDevice
from tactile_sensing.devices.frame_clock import SensorImage
from tactile_sensing.devices.lines import CsvDevice
from tactile_sensing.devices.recording import load_recording
from tactile_sensing.skin.pressure import SkinPressure
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.skin import Skin

pytestmark = pytest.mark.graph  # real time: must not run in parallel with other tests
ARRAY = TactelArray(8, 8, 2e-3, 2e-3)
SKIN = SkinPressure(Skin(2e-3), 2e-3, 2e-3)
RATE = 200.0


def ball(a, b):
    picture = SKIN.point(ARRAY.x, ARRAY.y[:, None], a, b, 1.0)
    return 400.0 * picture / picture.max()


@pytest.fixture
def port(tmp_path):
    """An array that prints: it sends the lines of a list, then nothing."""
    terminal, end, script = Terminal(tmp_path / 'port'), threading.Event(), []

    def run():
        device, rng, at = CsvDevice(), np.random.default_rng(1), time.monotonic()
        while not end.wait(max(at - time.monotonic(), 0.0)):
            at += 1.0 / RATE
            clean = script.pop(0) if script else np.zeros(ARRAY.shape)
            counts = np.clip(np.rint(20.0 + clean + 2.0 * rng.standard_normal(ARRAY.shape)), 0,
                             1023)
            terminal.write(device.encode(counts.astype(int)))
    thread = threading.Thread(target=run)
    thread.start()
    yield str(terminal.link), script
    end.set()
    thread.join()
    terminal.unplug()


def test_a_recording_is_what_the_other_commands_read(port, tmp_path, capsys):
    path = tmp_path / 'unloaded.npz'
    assert record.main([str(path), '--port', port[0], '--shape', '8', '8', '--seconds', '0.5',
                        '--pitch', '0.002']) == 0
    recording = load_recording(path)
    assert recording.shape == (8, 8) and recording.pitch == 0.002
    assert abs(len(recording.frames) - 100) < 10 and abs(recording.rate_hz - RATE) < 20.0
    assert abs(recording.frames.mean() - 20.0) < 0.2
    assert '8 8' not in capsys.readouterr().err


def test_a_recording_that_is_full_says_so(port, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(record, 'MOST', 10 * 64 * 4)
    assert record.main([str(tmp_path / 'x.NPZ'), '--port', port[0], '--shape', '8', '8']) == 0
    assert [path.name for path in tmp_path.iterdir() if path.name != 'port'] == ['x.NPZ']
    text = capsys.readouterr().err
    assert ' 11 images' in text and 'lost; ended early, as more than' in text


@pytest.mark.parametrize('bits, signed, kind', [
    ('8', 'no', np.uint8), ('8', 'yes', np.int8), ('12', 'no', np.uint16),
    ('12', 'yes', np.int16)])
def test_counts_of_every_converter_are_recorded(tmp_path, bits, signed, kind):
    terminal, counts = Terminal(tmp_path / 'port'), np.full((2, 3), 100, kind)
    end = threading.Event()

    def run():
        terminal.write(FlexiTacDevice.preamble)
        while not end.wait(0.01):
            terminal.write(FlexiTacDevice().encode(counts))
    thread = threading.Thread(target=run)
    thread.start()
    path = tmp_path / 'x.npz'
    status = record.main([
        str(path), '--port', str(terminal.link), '--protocol', 'flexitac', '--shape', '2', '3',
        '--seconds', '0.2', '--bits', bits, '--signed', signed])
    end.set()
    thread.join()
    terminal.unplug()
    assert status == 0
    frames = load_recording(path).frames
    assert frames.dtype == kind and np.all(frames == 100)


def test_the_rate_is_that_of_the_images_that_are_kept():
    """Every third one of 90 Hz is kept, as of a sensor that is faster than six times its rate."""
    arrays, lost = record.record(
        (SensorImage(k * 100_000_000 // 9, k, np.zeros((2, 2))) for k in range(0, 91, 3)), 1.0)
    assert len(arrays['frames']) == 31 and lost == 60
    assert arrays['rate_hz'] == pytest.approx(30.0)


def test_images_before_a_sensor_falls_silent_are_kept(capsys):
    def images(count):
        yield from (SensorImage(k * 10_000_000, k, np.zeros((2, 2))) for k in range(count))
        raise TactileError('the port is silent')
    arrays, _ = record.record(images(5), 1.0)
    assert len(arrays['frames']) == 5
    assert capsys.readouterr().err == 'record: ended early: the port is silent\n'
    with pytest.raises(TactileError, match='is silent'):
        record.record(images(1), 1.0)


def test_a_drawing_shows_where_it_is_pressed(capsys):
    press = 100.0 * np.eye(3)
    images = [SensorImage(k, k, np.rint(k * press + 7).astype(int)) for k in range(2)]
    record.look(images[:1])
    shown = capsys.readouterr().out
    assert '0 Hz' in shown or 'counts 7 to 7' in shown
    assert record.drawing(images[1].counts - images[0].counts) == '@@    \n  @@  \n    @@'
    assert set(record.drawing(np.ones((3, 3)))) == set('.\n')


def test_calibrate_asks_for_presses_of_a_port(port, tmp_path, monkeypatch, capsys):
    name, script = port
    steps = (recorder.Step('unloaded', 40, 'Off.', presses=False),
             recorder.Step('ball', 6, 'Ball.'))
    monkeypatch.setattr(recorder.Recorder.run, '__defaults__', (steps,))

    def answer(text):
        if text.startswith('ball'):
            for a in (-3e-3, -1.5e-3, 0.0, 1e-3, 2e-3, 3e-3):
                script.extend([np.zeros(ARRAY.shape)] * 60 + [ball(a, 1e-3)] * 60)
        return ''
    monkeypatch.setattr('builtins.input', answer)
    status = calibrate.main([
        '--live', str(tmp_path), '--port', name, '--shape', '8', '8', '--bits', '10', '--pitch',
        '0.002', '--out', str(tmp_path / 'pad.yaml'), '--ball-radius', '0.001'])
    captured = capsys.readouterr()
    assert 'ball: 6 of 6' in captured.out
    with np.load(tmp_path / 'ball.npz') as file:
        assert file['frames'].shape == (6, 8, 8)
    assert status in (0, 1) and (tmp_path / 'pad.yaml').exists(), captured.err


@pytest.mark.parametrize('arguments, reason', [
    (['x.csv', '--port', '/dev/none', '--shape', '8', '8'], 'x.csv: must end in .npz'),
    (['none/x.npz', '--port', '/dev/none', '--shape', '8', '8'], 'there is no such folder'),
    (['--port', '/dev/none', '--shape', '8', '8'], '/dev/none is not there; serial'),
    (['--port', '/dev/none'], '--shape'),
    (['--port', '/dev/none', '--shape', '8', '8', '--pitch', '.002', '.003'],
     '--pitch is 0.002 0.003, a recording holds only one length'),
    (['--port', '/dev/none', '--shape', '8', '8', '--options', 'a=1'], "no option 'a'")])
def test_wrong_arguments(arguments, reason, capsys):
    assert record.main(arguments) == 2
    text = capsys.readouterr().err
    assert reason in text and len(text.splitlines()) == 1
