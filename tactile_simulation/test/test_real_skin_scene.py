"""A sensor as it is bought, on bone: what it reports, its calibration, and an edge followed."""
from pathlib import Path

import numpy as np
import pytest
import yaml

from tactile_common.errors import ConfigurationError
from tactile_sensing.cli import calibrate
from tactile_sensing.devices.calibration import load_calibration
from tactile_servo.types import EdgeGoal, State
from tactile_simulation.cli import press_ball
from tactile_simulation.closed_loop import Simulation
from tactile_simulation.scene import load_scene
from tactile_simulation.sensor import Sensor, TactelResponse

LAUNCH = Path(__file__).parents[2] / 'launch'
PRESS = ['--force', '1', '--radius', '0.003']
CALIBRATE = ['--pitch', '0.0015875', '--unloaded', 'unloaded.npz', '--ball', 'ball.npz',
             '--ball-radius', '0.003', '--flat', 'flat.npz']


@pytest.fixture(scope='module')
def scene():
    if not LAUNCH.exists():
        pytest.skip('no scenes beside this package')
    return load_scene(LAUNCH / 'scenes' / 'real_skin.yaml')


def test_a_rested_load_creeps_and_is_forgotten():
    response = TactelResponse(Sensor(noise_std=0.0, creep=0.1, creep_time=2.0, bits=16,
                                     pa_per_count=1.0, baseline=0.0))
    rng, load = np.random.default_rng(0), np.full((16, 16), 10e3)

    def read(pressure, until):
        for now in np.arange(read.now, until, 0.01):
            counts = response.counts(pressure, rng, now)
        read.now = until
        return counts[3, 4]
    read.now = 0.0
    read(0.0 * load, 1.0)
    assert read(load, 1.02) == pytest.approx(10e3, rel=2e-3)
    assert read(load, 3.0) == pytest.approx(10e3 * (1.0 + 0.1 * (1.0 - np.exp(-1.0))), rel=2e-3)
    assert read(load, 40.0) == pytest.approx(11e3, rel=1e-3)
    assert read(0.0 * load, 42.0) == pytest.approx(1e3 * np.exp(-1.0), rel=0.02)


def exact(**flaws):
    """Response without noise, in counts of a pascal, and a function that reads it."""
    response = TactelResponse(Sensor(noise_std=0.0, bits=16, pa_per_count=1.0, baseline=0.0,
                                     **flaws))
    return lambda pressure: response.counts(pressure, np.random.default_rng(0), 0.0).astype(float)


def test_a_load_taken_away_reads_higher_and_neighbours_get_their_share():
    read, load = exact(hysteresis=0.1), np.full((16, 16), 10e3)
    up = [read(share * load)[3, 4] for share in (0.0, 0.5, 1.0)]
    down = [read(share * load)[3, 4] for share in (0.95, 0.5, 0.0)]
    assert up == [0.0, 5e3, 10e3]
    assert down == [10e3, 5.5e3, 0.0]
    read, load = exact(crosstalk=0.05), np.zeros((16, 16))
    load[3, 4], load[0, 0] = 10e3, 10e3
    found = read(load)
    assert found[3, 4] == 8e3 and found[3, 5] == found[2, 4] == 500.0 and found[2, 3] == 0.0
    assert found[0, 0] == 9e3 and found.sum() == load.sum()


def test_counts_have_the_bits_of_the_converter():
    load = np.full((16, 16), 1e9)
    for bits, highest, kind in ((8, 255, np.uint8), (10, 1023, np.uint16), (6, 63, np.uint8)):
        counts = TactelResponse(Sensor(bits=bits)).counts(load, np.random.default_rng(0), 0.0)
        assert counts.dtype == kind and (counts == highest).all()
    with pytest.raises(ConfigurationError, match='sensor.baseline is 64, must be below 64'):
        Sensor(bits=6, baseline=64)


def test_specimens_differ_in_their_flaws_and_are_the_same_at_every_run():
    load, rng = np.full((16, 16), 50e3), np.random.default_rng
    one, same, other = (TactelResponse(
        Sensor(gain_spread=0.1, dead=3, noise_std=0.0, baseline=0.0, specimen=number))
        .counts(load, rng(0), 0.0).astype(float) for number in (1, 1, 2))
    assert (one == same).all()
    assert (one == 0.0).sum() == (other == 0.0).sum() == 3
    alive = (one > 0.0) & (other > 0.0)
    assert np.std(one[alive] / other[alive]) == pytest.approx(0.1 * np.sqrt(2.0), rel=0.2)


def test_the_shipped_calibration_is_what_its_commands_make(scene, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert press_ball.main([str(LAUNCH / 'scenes' / 'real_skin.yaml'), '--out', '.', *PRESS]) == 0
    assert calibrate.main(['--out', 'pad.yaml', *CALIBRATE]) == 0
    made, shipped = load_calibration('pad.yaml'), load_calibration(scene.calibration)
    for name in ('gain', 'baseline', 'noise'):
        np.testing.assert_allclose(getattr(made, name), getattr(shipped, name), rtol=1e-3)
    for name in ('depth', 'thickness', 'gain_spread'):
        assert getattr(made, name) == pytest.approx(getattr(shipped, name), rel=1e-3)
    for name in ('bits', 'signed', 'threshold', 'unit', 'tactel', 'dead_tactels'):
        assert getattr(made, name) == getattr(shipped, name)
    # And that is the sensor of the scene, within what the file claims.
    skin, found = scene.skin, shipped.found['skin']
    assert abs(shipped.depth - skin.depth) < 3.0 * found['depth_std']
    assert abs(shipped.thickness - skin.thickness) < 3.0 * found['thickness_std']
    assert np.mean(shipped.gain) == pytest.approx(scene.sensor.pa_per_count, rel=0.02)


def test_the_edge_is_followed_with_it(scene):
    simulation = Simulation(scene, seed=1)
    status = simulation.run(EdgeGoal(0.03, 5.0, 1, 0.06), 30.0)
    truth = simulation.truth()
    assert status.state == State.DONE, status.reason
    assert np.sqrt(np.mean(truth.lateral[truth.settled]**2)) < 0.02e-3
    assert np.abs(truth.force[truth.settled] / 5.0 - 1.0).max() < 0.05


def test_a_corner_and_a_bend_are_followed_with_it():
    course = load_scene(LAUNCH / 'scenes' / 'real_skin_course.yaml')
    simulation = Simulation(course, seed=1)
    status = simulation.run(EdgeGoal(0.1, 5.0), 30.0)
    truth = simulation.truth()
    assert status.state == State.DONE and simulation.servo.success, status.reason
    assert np.sqrt(np.mean(truth.lateral[truth.settled]**2)) < 0.05e-3
    assert np.abs(truth.lateral[truth.settled]).max() < 0.3e-3


def test_a_calibration_is_named_from_the_folder_of_the_scene(scene, tmp_path):
    text = (LAUNCH / 'scenes' / 'real_skin.yaml').read_text()
    (tmp_path / 'other.yaml').write_text(text)
    with pytest.raises(ConfigurationError, match='calibration is .*folder of the scene'):
        load_scene(tmp_path / 'other.yaml')


def test_a_ball_does_not_fit_on_three_columns(tmp_path, capsys):
    scene = yaml.safe_load((LAUNCH / 'scenes' / 'real_skin.yaml').read_text())
    scene['calibration'] = str(LAUNCH / 'config' / 'real_skin.yaml')
    scene['sensor'] |= {'rows': 16, 'columns': 3}
    (tmp_path / 'narrow.yaml').write_text(yaml.safe_dump(scene))
    assert press_ball.main([str(tmp_path / 'narrow.yaml'), '--out', str(tmp_path / 'out')]) == 2
    assert '16 x 3 tactels: the ball stays' in capsys.readouterr().err
