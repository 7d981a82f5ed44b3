"""Command `calibrate`, on images by finite elements, which are independent of its model."""
from contextlib import nullcontext
import os
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from tactile_common.errors import ConfigurationError
from tactile_sensing.calibration.likelihood import expected_forces
from tactile_sensing.calibration.procedure import order_of
from tactile_sensing.calibration.survey import range_of, survey
from tactile_sensing.cli import calibrate, estimate
from tactile_sensing.devices.calibration import Calibration, load_calibration
from tactile_sensing.devices.counts import Counts
from tactile_sensing.types.array import TactelArray

REPOSITORY = Path(__file__).parents[2]
PROFILES = REPOSITORY / 'benchmarks' / 'contact' / 'fe_frames.npz'
SHARED = Path(os.environ.get('TACTILE_SHARED_DATA', REPOSITORY.parent / 'shared' / 'data'))
RADII = np.concatenate([np.linspace(0.0, 8e-3, 161), np.linspace(8.1e-3, 36e-3, 100)])
ARRAY = TactelArray(16, 16, 25.4e-3 / 16, 25.4e-3 / 16)
DEPTH, BACKING, BALL = 2e-3, 6e-3, 1e-3  # of the finite elements [m]
PEAK, BASELINE, NOISE = 400.0, 20.0, 4.0  # counts: 40 dB
OPTIONS = ['--out', 'pad.yaml', '--pitch', f'{ARRAY.pitch_x}']
SKIN = ['--depth', f'{DEPTH}', '--thickness', f'{BACKING}']  # known: the fit is faster


@pytest.fixture(scope='module')
def profile():
    if not PROFILES.exists():
        pytest.skip(f'no {PROFILES.name} beside this package')
    profiles = np.load(PROFILES)['profiles']
    return next(it for it in profiles if it['kind'] == 'ball' and it['radius'] == BALL
                and it['backing'] == BACKING and it['poisson'] == 0.45)


def presses(profile, count, rng, reach=8e-3):
    """Return images (count, rows, columns) over their peak, and places (count, 2) [m]."""
    nodes, weights = np.polynomial.legendre.leggauss(5)
    dx, dy = np.meshgrid(0.5 * ARRAY.pitch_x * nodes, 0.5 * ARRAY.pitch_y * nodes)
    share = np.multiply.outer(weights, weights)[..., None, None] / 4.0
    x = ARRAY.x + dx[..., None, None]
    y = ARRAY.y[:, None] + dy[..., None, None]
    places = rng.uniform(-reach, reach, (count, 2))
    pictures = np.array([(share * np.interp(
        np.hypot(x - a, y - b), RADII, profile['pressure'])).sum(axis=(0, 1)) for a, b in places])
    return pictures / profile['pressure'].max(), places


def digitised(pictures, rng, gains=1.0):
    counts = PEAK * gains * pictures + BASELINE + NOISE * rng.standard_normal(pictures.shape)
    return np.clip(np.rint(counts), 0, 1023).astype(np.uint16)


@pytest.fixture
def there(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(1)
    np.savez('u.npz', frames=digitised(np.zeros((100, *ARRAY.shape)), rng))
    return tmp_path


def test_from_twenty_presses_to_honest_contacts(there, profile, capsys):
    rng = np.random.default_rng(2)
    np.savez('b.npz', frames=digitised(presses(profile, 20, rng)[0], rng))
    pictures, places = presses(profile, 60, rng)
    np.savez('t.npz', frames=digitised(pictures, rng))
    assert calibrate.main([
        *OPTIONS, '--unloaded', 'u.npz', '--ball', 'b.npz', '--ball-radius', '0.001',
        '--force', f'{profile["force"]}', '--report', 'r.png']) == 0
    pad = load_calibration('pad.yaml')
    assert pad.unit == 'Pa' and pad.tactel == 'area' and pad.found['skin']['presses'] == 20
    assert pad.depth == pytest.approx(DEPTH, rel=0.05)
    assert pad.thickness == pytest.approx(BACKING, rel=0.1)
    assert np.sqrt(np.mean(pad.noise**2)) == pytest.approx(NOISE, rel=0.05)
    assert np.median(pad.gain) == pytest.approx(profile['pressure'].max() / PEAK, rel=0.03)
    assert (there / 'r.png').stat().st_size > 10_000
    assert "assumed: a Poisson's ratio" in capsys.readouterr().err
    assert estimate.main(['t.npz', '--calibration', 'pad.yaml', '--tare', 'u.npz',
                          '-o', 'o.npz']) == 0
    with np.load('o.npz') as found:
        good = found['valid'] & (found['type'] == 1)
        assert good.mean() >= 0.95
        assert np.hypot(found['x'] - places[:, 0], found['y'] - places[:, 1])[good].max() < 0.3e-3
        assert np.mean(found['normal_force'][good]) == pytest.approx(profile['force'], rel=0.03)


@pytest.mark.parametrize('held, left', [(1, 0.033), (10, 0.02)])
def test_gains_of_the_tactels(there, profile, held, left):
    """Each press has one frame, or is held for ten frames."""
    rng = np.random.default_rng(3)
    gains = 1.0 + 0.1 * rng.standard_normal(ARRAY.shape)
    for name, count, reach in (('b.npz', 20, 8e-3), ('f.npz', 40, 11e-3)):
        pictures = np.repeat(presses(profile, count, rng, reach)[0], held, axis=0)
        np.savez(name, frames=digitised(pictures, rng, gains))
    assert calibrate.main([
        *OPTIONS, *SKIN, '--unloaded', 'u.npz', '--ball', 'b.npz', '--ball-radius', '0.001',
        '--flat', 'f.npz']) == 0
    pad = load_calibration('pad.yaml')
    inner = (pad.gain * gains)[3:-3, 3:-3]
    assert pad.found['gains']['presses'] in (59, 60)
    assert np.std(inner / inner.mean()) < left  # of 0.1; in one frame .036 with forces unknown
    # The claim for all tactels must hold for the pressed ones.
    assert np.std(inner / inner.mean()) < pad.gain_spread < 0.06
    assert pad.found['gains']['spread'] == pytest.approx(0.1, abs=0.025)
    assert pad.unit == 'counts'
    assert any('no force is known' in text for text in pad.found['assumed'])


def test_volts_in_flat_tables_calibrate_as_counts_do(there, profile, capsys):
    rng, volt = np.random.default_rng(3), 5.0 / 1023.0
    frames = {'u': digitised(np.zeros((100, *ARRAY.shape)), rng),
              'b': digitised(presses(profile, 20, rng)[0], rng)}
    for name, counts in frames.items():
        np.savez(f'{name}.npz', frames=counts)
        np.savetxt(f'{name}.csv', counts.reshape(len(counts), -1) * volt, delimiter=',')
    ball = ['--ball-radius', f'{BALL}', '--force', '2', '--bits', '10', *SKIN]
    files = [word for name in ('unloaded', 'ball') for word in (f'--{name}', f'{name[0]}.npz')]
    tables = [word.replace('.npz', '.csv') for word in files]
    assert calibrate.main([*OPTIONS, *ball, *files]) == 0
    expected = load_calibration('pad.yaml')
    assert calibrate.main([*OPTIONS, *ball, *tables]) == 2
    assert '--shape' in capsys.readouterr().err
    assert calibrate.main([*OPTIONS, *ball, *tables, '--shape', '16', '16',
                           '--resolution', f'{volt}']) == 0
    found = load_calibration('pad.yaml')
    assert found.resolution == volt and found.bits == 10
    np.testing.assert_allclose(found.gain, expected.gain, rtol=1e-3)
    np.savez('balls.npz', frames=frames['b'] * volt)
    assert estimate.main(['balls.npz', '--calibration', 'pad.yaml', '-o', 'o.npz']) == 0
    assert np.load('o.npz')['valid'].all()


def test_a_wrong_ball_is_doubted_and_a_missing_recording_is_named(there, profile, capsys):
    rng = np.random.default_rng(9)
    np.savez('b.npz', frames=digitised(presses(profile, 8, rng)[0], rng))
    known = ['--ball', 'b.npz', *SKIN]
    for radius, doubted in ((BALL, False), (0.5 * BALL, True)):
        assert calibrate.main([*OPTIONS, '--unloaded', 'u.npz', *known, '--ball-radius',
                               f'{radius}']) == (calibrate.DOUBTFUL if doubted else 0)
        doubts = 'doubtful: the ball touches within' in capsys.readouterr().err
        assert doubts == doubted == ('doubtful' in load_calibration('pad.yaml').found)
    assert calibrate.main([*OPTIONS, *known, '--ball-radius', f'{BALL}']) == 2
    assert '--unloaded is missing' in capsys.readouterr().err


@pytest.mark.parametrize('unit, doubted', [(1.0, False), (1e3 / 9.81, True), (1e3, True)])
def test_forces_in_grams_or_millinewtons_are_doubted(there, profile, capsys, unit, doubted):
    rng = np.random.default_rng(9)
    np.savez('b.npz', frames=digitised(presses(profile, 8, rng)[0], rng), force=unit * np.ones(8))
    assert calibrate.main([*OPTIONS, *SKIN, '--unloaded', 'u.npz', '--ball', 'b.npz',
                           '--ball-radius', f'{BALL}']) == doubted
    assert ('MPa under the ball' in capsys.readouterr().err) == doubted


@pytest.mark.parametrize('first, frames, threshold', [(40, 5, 0), (60, 1, 12), (0, 20, 0)])
def test_unloaded_frames_that_somebody_touches_are_left_out(there, profile, capsys, first, frames,
                                                            threshold):
    rng = np.random.default_rng(13)
    pictures = np.zeros((100, *ARRAY.shape))
    pictures[first:first + frames] = 0.3 * presses(profile, 1, rng)[0]
    unloaded = digitised(pictures, rng)
    unloaded[unloaded < threshold] = 0
    np.savez('touched.npz', frames=unloaded)
    assert calibrate.main([*OPTIONS, '--unloaded', 'touched.npz', '--bits', '10']) == 0
    text = capsys.readouterr().err
    assert f'unloaded, frame {first} left out: something touches the pad' in text
    assert text.count('left out') == min(frames, calibrate.MOST_NAMED)
    assert f'frames {100 - frames}, ' in text


@pytest.mark.parametrize('share, words', [
    (1.0, 'tactels that nothing presses read 43 counts less than in --unloaded'),
    (0.4, 'unloaded: something touches the pad in 40 of 100 frames, first in frame 0')])
def test_unloaded_frames_that_are_loaded_are_refused(there, profile, capsys, share, words):
    rng, pictures = np.random.default_rng(14), np.zeros((100, *ARRAY.shape))
    pictures[:int(100 * share), 4:8] = 0.1
    np.savez('loaded.npz', frames=digitised(pictures, rng))
    np.savez('b.npz', frames=digitised(presses(profile, 20, rng)[0], rng))
    assert calibrate.main([*OPTIONS, *SKIN, '--unloaded', 'loaded.npz', '--ball', 'b.npz',
                           '--ball-radius', f'{BALL}']) == 2
    assert words in capsys.readouterr().err


def test_presses_on_another_pad_are_doubted(there, profile, capsys):
    """Its offsets differ; the likelihoods differ by more than an exponential function takes."""
    rng = np.random.default_rng(15)
    other = rng.integers(-5, 40, ARRAY.shape)
    for name, count, offset in (('b.npz', 8, 0), ('f.npz', 16, other)):
        np.savez(name, frames=digitised(presses(profile, count, rng)[0], rng) + offset)
    assert calibrate.main([
        *OPTIONS, '--unloaded', 'u.npz', '--ball', 'b.npz', '--ball-radius', '0.001',
        '--flat', 'f.npz']) == calibrate.DOUBTFUL
    assert '% of the pressure is not that of a ball' in capsys.readouterr().err


def test_presses_of_another_weight_are_left_alone():
    """All presses of a file have one weight within 1 %, except one that is twice as hard."""
    expected, known, source = np.repeat([1.0, 3.0], 20), np.ones(40), np.repeat([0, 1], 20)
    found = 2.0 * expected * (1.0 + 0.01 * np.random.default_rng(8).standard_normal(40))
    found[5] *= 2.0
    force, std = expected_forces(found, known, source)
    assert np.isinf(std[5]) and force[5] == found[5]
    others = np.delete(np.arange(40), 5)
    like = np.isfinite(std[others])
    assert like.mean() > 0.9
    np.testing.assert_allclose(force[others][like], 2.0 * expected[others][like], rtol=0.01)
    np.testing.assert_allclose(std[others][like] / force[others][like], 0.01, rtol=0.4)


def test_bad_presses_are_named_and_left_out(there, profile, capsys):
    rng = np.random.default_rng(4)
    pictures, _ = presses(profile, 14, rng)
    pictures[3] = 0.0
    pictures[5] *= 5.0
    pictures[7] += np.roll(pictures[7], 8, axis=(0, 1))
    np.savez('b.npz', frames=digitised(pictures, rng))
    assert calibrate.main([*OPTIONS, *SKIN, '--unloaded', 'u.npz', '--ball', 'b.npz',
                           '--ball-radius', '0.001']) == 0
    text = capsys.readouterr().err
    assert 'ball, frame 3 left out: nothing presses' in text
    assert 'ball, frame 5 left out' in text and 'full scale' in text
    assert 'ball, frame 7 left out: something presses elsewhere' in text


def test_silent_and_noisy_tactels_are_found():
    rng = np.random.default_rng(5)
    unloaded = np.rint(20.0 + rng.standard_normal((100, 8, 8)))
    unloaded[:, 2, 3] = np.rint(20.0 + 30.0 * rng.standard_normal(100))
    loaded = np.full((5, 8, 8), 200.0)
    loaded[:, 5, 5] = 20.0
    found = survey(unloaded, Counts(10), [loaded])
    assert set(found.dead) == {(2, 3), (5, 5)}
    assert 'noise' in found.dead[2, 3] and found.dead[5, 5] == 'shows nothing under load'


def test_a_dead_row_is_found_and_left_out(there, profile, capsys):
    rng = np.random.default_rng(10)
    frames = digitised(presses(profile, 20, rng)[0], rng)
    frames[:, 7] = np.rint(BASELINE + NOISE * rng.standard_normal(frames[:, 7].shape))
    np.savez('b.npz', frames=frames)
    assert calibrate.main([*OPTIONS, '--unloaded', 'u.npz', '--ball', 'b.npz', '--ball-radius',
                           '0.001', '--force', f'{profile["force"]}']) == 0
    pad = load_calibration('pad.yaml')
    assert pad.dead_tactels == tuple(range(7 * 16, 8 * 16))
    assert abs(pad.depth - DEPTH) < 3.0 * pad.found['skin']['depth_std'] < 0.3e-3
    last = capsys.readouterr().err.strip().splitlines()[-1]
    assert last.startswith('good for +-') and last.endswith('; row 7 dead')
    assert '% of force; depth ' in last


def test_a_pad_that_is_largely_dead_is_not_trusted(there, profile, capsys):
    rng = np.random.default_rng(11)
    frames = digitised(presses(profile, 20, rng)[0], rng)
    frames[:, :, 4:13:4] = 20
    np.savez('b.npz', frames=frames)
    assert calibrate.main([*OPTIONS, *SKIN, '--unloaded', 'u.npz', '--ball', 'b.npz',
                           '--ball-radius', '0.001']) == calibrate.DOUBTFUL
    text = capsys.readouterr().err
    assert '19 % of the tactels are dead' in text and text.strip().endswith('do not trust it')


def test_tactels_beside_an_edge_are_not_dead_but_not_loaded(there, capsys):
    rng, edge = np.random.default_rng(12), np.zeros((50, *ARRAY.shape))
    edge[:, :, 9:] = 1.0
    edge[:, 4, 12] = 0.0
    np.savez('r.npz', frames=digitised(edge, rng))
    assert calibrate.main([*OPTIONS, '--unloaded', 'u.npz', '--rolling', 'r.npz']) == 0
    assert load_calibration('pad.yaml').dead_tactels == (4 * 16 + 12,)
    assert 'not_loaded 144' in capsys.readouterr().err


def test_bits_are_asked_for_and_never_fewer_than_seen(there, capsys):
    assert calibrate.main([*OPTIONS, '--unloaded', 'u.npz']) == 2
    assert '--bits is missing' in capsys.readouterr().err
    np.savez('r.npz', frames=np.full((30, *ARRAY.shape), 3000))
    assert calibrate.main([*OPTIONS, '--rolling', 'r.npz', '--bits', '8']) == 2
    assert '--bits is 8, but counts of 3000 to 3000 need 12' in capsys.readouterr().err
    assert calibrate.main([*OPTIONS, '--unloaded', 'u.npz', '--bits', '12']) == 0
    assert load_calibration('pad.yaml').bits == 12


@pytest.mark.parametrize('low, signed, words', [
    (0, None, 'counts of 0 to 1000000 need 20 bits, at most 16 are possible: --resolution'),
    (-5, False, '--signed is no, but counts of -5 to 1000000 are signed')])
def test_counts_that_no_converter_sends_are_refused(low, signed, words):
    with pytest.raises(ConfigurationError, match=words):
        range_of([np.array([low, 1_000_000.0])], None, signed, None)


def test_a_threshold_of_zero_is_one():
    counts = np.array([-100.0, 100.0])
    assert range_of([counts], 8, None, 0)[0].threshold == 0


def test_a_threshold_is_seen_and_clipping_is_none():
    rng = np.random.default_rng(6)
    values = rng.exponential(60.0, 20_000) + 2.0 * rng.standard_normal(20_000)
    clipped = np.clip(np.rint(values), 0, 1023)
    assert range_of([clipped.reshape(1, 1, -1)], 10, False, None)[0].threshold == 1
    kept = np.where(clipped < 12, 0.0, clipped)
    assert range_of([kept.reshape(1, 1, -1)], 10, False, None)[0].threshold == 12


def test_a_threshold_that_hides_the_noise_bounds_it():
    """At 40 dB, a threshold of 5 standard deviations leaves zeros: noise = threshold / 4."""
    found = survey(np.zeros((100, 8, 8)), Counts(12, threshold=20), [])
    np.testing.assert_allclose(found.noise, 19.5 / 4.0)
    assert not found.dead and (found.offset == 0.0).all()


@pytest.mark.parametrize('transposed', [False, True])
@pytest.mark.parametrize('rows, columns', [('as they are', 'turned'), ('turned', 'as they are')])
def test_corners_say_how_rows_and_columns_come(rows, columns, transposed):
    shape, orders = (12, 9), [() if how == 'as they are' else tuple(range(size))[::-1]
                              for how, size in ((rows, 12), (columns, 9))]
    corners = np.zeros((4, *shape))
    corners[range(4), [0, 1, 11, 10], [1, 8, 7, 0]] = 1.0  # of the image
    raw = corners[:, ::-1] if rows == 'turned' else corners
    raw = raw[:, :, ::-1] if columns == 'turned' else raw
    raw = raw.swapaxes(1, 2) if transposed else raw
    assert order_of(raw) == (*orders, transposed)
    pad = Calibration(TactelArray(*shape, 1e-3, 1e-3), row_order=orders[0],
                      column_order=orders[1], transposed=transposed)
    np.testing.assert_array_equal(pad.arrange(raw), corners)
    with pytest.raises(ConfigurationError, match='of the corners are only 0 of'):
        order_of(np.repeat(raw[:1], 4, axis=0))


@pytest.mark.parametrize('options, words', [
    ([], 'no recordings'), (['--ball', 'u.npz'], '--ball-radius is missing'),
    (['--live', 'session'], '--live needs --port'),
    (['--live', 'session', '--port', 'p', '--resolution', '.005'], '--resolution is of files'),
    (['--unloaded', 'u.npz', '--bits', '8', '--threshold', '0'], 'threshold is 0, must be an'),
    (['--unloaded', 'u.npz', '--bits', '8', '--saturation', '0'], 'saturation is 0, must be an'),
    (['--unloaded', 'u.npz', '--namespace', 'pad'], '--namespace needs a bag'),
    (['--unloaded', 'none.npz'], 'No such file'),
    (['--unloaded', 'u.npz', '--force', '2'], '--force needs --ball'),
    (['--ball', 'u.npz', '--ball-radius', '1'], '--ball-radius: value is 1.0, must be between'),
    (['--ball', 'u.npz', '--ball-radius', '0.001'], 'only 0 of 100 frames show one press'),
    (['--unloaded', 'u.npz', '--bits', '17'], '--bits: value is 17, must be between 1 and 16'),
    (['--unloaded', 'u.npz', '--corners', 'u.npz'], 'corners: 100 frames, must be 4'),
    (['--unloaded', 'u.npz', '--bits', '10', '--report', 'gone/r.png'], 'there is no such folder'),
    (['--unloaded', 'u.npz', '--bits', '10', '--report', 'r.txt'], 'r.txt: must end in .png or'),
    (['--unloaded', 'u.npz', '--bits', '10', '--out', '.'], '--out: .: is a folder'),
    (['--unloaded', 'u.npz', '--thickness', '0.004'], '--thickness needs --depth')])
def test_mistakes_are_answered_in_one_line(there, capsys, options, words):
    assert calibrate.main([*OPTIONS, *options]) == 2
    text = capsys.readouterr().err
    assert text.startswith('calibrate: ') and text.count('\n') == 1 and words in text
    assert not (there / 'pad.yaml').exists()


@pytest.mark.parametrize('options, full', [
    (['--bits', '10'], 1023), (['--bits', '10', '--signed', 'yes'], 511),
    (['--bits', '10', '--saturation', '900'], 900), (['--saturation', '900'], 900),
    (['--saturation', '0'], 0)])
def test_a_live_press_is_at_full_scale_where_the_options_say(monkeypatch, options, full):
    seen = []
    monkeypatch.setattr(calibrate, 'opened', lambda _: nullcontext())
    monkeypatch.setattr(calibrate, 'Recorder', lambda *given: SimpleNamespace(
        run=lambda: seen.append(given[-1])))
    given = calibrate.parser().parse_args([
        *OPTIONS, '--live', 'none', '--port', 'none', '--shape', '16', '16', *options])
    given.pitch = 2 * given.pitch
    calibrate.record(given)
    assert seen == [full]


def test_a_force_that_is_no_number_is_refused(there, capsys):
    np.savez('b.npz', frames=np.zeros((5, *ARRAY.shape)), force=np.array(['1'] * 5))
    for name in ('b.npz', 'B.NPZ'):
        Path('b.npz').rename(name)
        assert calibrate.main([*OPTIONS, '--ball', name, '--ball-radius', '0.001']) == 2
        assert 'force is 5 of type <U1, must be one number or 5' in capsys.readouterr().err


def test_a_defect_costs_one_line(there, capsys, monkeypatch):
    monkeypatch.setattr(calibrate, 'calibrate', lambda *_: 1 // 0)
    assert calibrate.main([*OPTIONS, '--unloaded', 'u.npz']) == 1
    text = capsys.readouterr().err
    assert text.startswith('calibrate: defect: ZeroDivisionError: integer division or modulo by z')
    assert ' test_calibrate_command.py:' in text and text.count('\n') == 1


def test_a_report_that_cannot_be_drawn_costs_no_calibration(there, capsys, monkeypatch):
    def full(*_):
        raise OSError(28, 'No space left on device')
    monkeypatch.setattr(calibrate, 'draw_report', full)
    assert calibrate.main(
        [*OPTIONS, '--unloaded', 'u.npz', '--bits', '10', '--report', 'r.png']) == 2
    assert 'No space left' in capsys.readouterr().err
    assert load_calibration('pad.yaml').bits == 10


def test_recordings_are_bounded_before_they_are_read(there, capsys):
    np.save('long.npy', np.broadcast_to(np.uint8(0), (300_000, 16, 16)))
    assert calibrate.main([*OPTIONS, '--unloaded', 'long.npy']) == 2
    assert 'would take 77 MB, at most 67 MB are read' in capsys.readouterr().err


SHARED_ONLY = pytest.mark.skipif(
    not SHARED.exists(), reason=f'no recordings of real arrays in {SHARED}')


def estimated(name, *options):
    """Return the estimates of a recording, calibrated with the published data of its sensor."""
    assert calibrate.main(['--out', 'pad.yaml', *options]) == 0
    assert estimate.main([name, '--calibration', 'pad.yaml', '-o', 'o.npz']) == 0
    with np.load('o.npz') as found:
        return {key: found[key] for key in found.files}


@SHARED_ONLY
def test_a_finger_on_a_foil_has_no_force(there):
    """Tekscan 6900: pitch, foil of .1 mm, 8 bits; the quietest tenth is taken as unloaded."""
    finger = np.load(SHARED / 'tekscan_finger' / 'iscan_finger.npz')
    raw = finger['frames'][:, 15:26, 15:26]
    load = raw.sum(axis=(1, 2))
    np.savez('finger.npz', frames=raw[::8])
    np.savez('rest.npz', frames=raw[load <= np.quantile(load, 0.1)])
    found = estimated('finger.npz', '--pitch', str(finger['pitch_m']), '--unloaded', 'rest.npz',
                      '--rolling', 'finger.npz', '--depth', '0.0001', '--bits', '8')
    pad = load_calibration('pad.yaml')
    assert pad.threshold == 4 and (pad.noise < 1.0).all() and not pad.dead_tactels
    assert np.isnan(found['normal_force']).all() and not found['force_valid'].any()
    assert (found['type'][load[::8] == 0.0] == 0).all()
    beside = raw[::8, :, :2].max(axis=(1, 2)) > 2 * pad.threshold  # a second spot at the border
    alone = ~beside & (raw[::8].max(axis=(1, 2)) > 10)
    assert beside.sum() > 10 and alone.sum() > 10
    assert (found['type'][found['valid']] == 1).all()
    assert found['valid'][alone].mean() > 0.95 and found['valid'][beside].mean() < 0.1


@SHARED_ONLY
def test_a_step_on_a_platform_is_neither_point_nor_line(there):
    """Novel emed: cells of 5 mm, kPa, threshold 10 kPa; the device's own force is the truth."""
    step = np.load(SHARED / 'novel_emed' / 'emed_step.npz')
    np.save('foot.npy', step['pressure_kPa'][::35])
    np.save('rest.npy', np.zeros((20, *step['pressure_kPa'].shape[1:])))
    found = estimated('foot.npy', '--pitch', str(step['pitch_m']), '--unloaded', 'rest.npy',
                      '--threshold', '10', '--bits', '11', '--gain', '1000')
    assert (found['type'][1:-1] == 3).all()  # the first and last frame show only heel or toes
    assert not found['valid'][1:-1].any()
    np.testing.assert_allclose(found['moments'][:, 0], step['row_force_sum_N'][::35],
                               rtol=2e-4, atol=0.1)
