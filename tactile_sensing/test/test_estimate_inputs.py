"""Command `estimate` on other input: counts, volts, tables, flat arrays, unknown skin."""
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from tactile_sensing.cli import estimate
from tactile_sensing.devices.calibration import Calibration, load_calibration, save_calibration
from tactile_sensing.thesis import line
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import ContactType, Reason, RECORD

ROWS, COLUMNS, PITCH, DEPTH, FORCE = 12, 14, 0.001, 0.002, 200.0
ARRAY = TactelArray(ROWS, COLUMNS, PITCH, PITCH)
PEAK = line.peak_pressure(FORCE, DEPTH)
BARE = ['--pitch', '0.001']
KNOWN = [*BARE, '--layers', 'zz@0.002']
SHAPE = ['--shape', str(ROWS), str(COLUMNS)]
BASELINE, GAIN = 50.0, PEAK / 600.0  # counts, Pa per count: of ten bits


def edges(count=4):
    """Return the pressure of edges along y, shape (count, rows, columns) [Pa], with noise."""
    rng = np.random.default_rng(1)
    frames = np.array([line.pressure(ARRAY.x[None, :], ARRAY.y[:, None], rho, 0.0, FORCE, DEPTH)
                       for rho in rng.uniform(-4e-3, 4e-3, count)])
    return frames + rng.normal(0.0, 0.01 * PEAK, frames.shape)


def counts(frames):
    return np.rint(BASELINE + frames / GAIN).astype(np.uint16)


@pytest.fixture(autouse=True)
def there(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def run(capsys):
    """Run the command; return its records, or the line of its error."""
    def run(*args):
        status = estimate.main([*args, '-o', 'out.npz'])
        out, err = capsys.readouterr()
        assert out == '' and err.count('\n') == 1 and err.startswith('estimate: ')
        if status:
            return err
        with np.load('out.npz') as archive:
            return {name: archive[name] for name in archive.files}
    return run


def calibrate(**values):
    values = {'gain': GAIN, 'baseline': BASELINE, 'noise': 6.0, 'depth': DEPTH, 'bits': 10,
              'tactel': 'point', **values}
    save_calibration(Calibration(ARRAY, **values), 'cal.yaml')
    return ['--calibration', 'cal.yaml']


def same(found, expected):
    for name in found:
        np.testing.assert_array_equal(found[name], expected[name], name)


def test_the_pitch_of_a_file_is_taken_unless_another_is_given(run):
    np.savez('in.npz', frames=edges(), pitch_m=PITCH)
    np.savez('other.npz', frames=edges(), pitch_m=2.0 * PITCH)
    expected = run('in.npz', *BARE)
    same(run('in.npz'), expected)
    same(run('other.npz', *BARE), expected)
    np.savez('in.npz', frames=edges(), pitch_m=1e3 * PITCH)
    assert 'in.npz: pitch_m is 1.0, must be between 1e-06 and 0.1 m; did you mean 0.001?' in (
        run('in.npz'))
    np.savez('in.npz', frames=edges(), pitch_m='wide')
    assert run('in.npz').count('in.npz') == 1
    np.savez('bare.npz', frames=edges())
    for name in ('bare.npz', 'in.npy', 'in.csv'):
        assert '--calibration is missing, or --pitch' in run(name)


def test_without_a_skin_records_come_out(run):
    np.savez('in.npz', frames=edges() / 1e5)  # volts
    found = run('in.npz', *BARE, '--noise', '0.01')
    assert set(found) == set(RECORD.names) and len(found['valid']) == 4
    assert found['valid'].all() and not found['force_valid'].any()
    assert (found['reasons'] & int(Reason.UNCALIBRATED)).all()
    assert (found['type'] == ContactType.LINE).all() and np.isnan(found['line_force']).all()
    assert run('in.npz', *BARE)['valid'].shape == (4,)  # noise is estimated


def test_archive_array_and_table_say_the_same(run):
    frames = edges()
    np.savez('in.npz', frames=frames)
    np.save('in.npy', frames)
    np.save('flat.npy', frames.reshape(4, -1))
    np.savetxt('in.csv', frames.reshape(4, -1), delimiter=',')
    np.savetxt('head.csv', frames.reshape(4, -1), delimiter=';', comments='', header='a;b')
    expected = run('in.npz', *KNOWN)
    assert expected['valid'].all() and (expected['type'] == ContactType.LINE).all()
    same(run('in.npy', *KNOWN), expected)
    same(run('in.npz', *KNOWN, *SHAPE), expected)
    for name in ('flat.npy', 'in.csv', 'head.csv'):
        same(run(name, *KNOWN, *SHAPE), expected)


def test_endings_in_capitals_are_the_same(run):
    np.savez('in.npz', frames=edges())
    np.save('in.npy', edges())
    np.savetxt('in.csv', edges().reshape(4, -1), delimiter=',')
    expected = run('in.npz', *KNOWN)
    for name in ('in.npy', 'in.csv', 'in.npz'):
        other = Path(name).rename(name.upper())
        same(run(str(other), *KNOWN, *SHAPE), expected)
    assert estimate.main(['IN.NPZ', *KNOWN, '-o', 'OUT.NPZ']) == 0
    same(np.load('OUT.NPZ'), expected)


def test_a_text_file_is_a_table(run):
    for name in ('in.txt', 'in.csv'):
        np.savetxt(name, edges().reshape(4, -1))
    same(run('in.txt', *KNOWN, *SHAPE), run('in.csv', *KNOWN, *SHAPE))


def test_the_summary_names_causes_if_most_loads_are_unexplained():
    np.save('flat.npy', edges(8).reshape(8, -1))

    def summary(*args):
        return estimate.run(estimate.parse(['flat.npy', *BARE, *args, '-o', 'out.npz']))
    wrong = summary('--shape', str(COLUMNS), str(ROWS))
    assert '8 bad_fit' in wrong and '; most loads are neither a point nor a line: check' in wrong
    assert summary(*SHAPE).endswith('0 not valid')


def test_flat_arrays_ask_for_their_shape(run):
    np.save('flat.npy', edges().reshape(4, -1))
    np.savetxt('flat.csv', edges().reshape(4, -1))
    np.save('cube.npy', edges())
    assert '(N, rows*columns), --shape R C says' in run('flat.npy', *KNOWN)
    assert 'flat.csv: a row of 168 numbers is a frame: --shape R C' in run('flat.csv', *KNOWN)
    for name in ('flat.npy', 'flat.csv'):
        assert ('frames has shape (4, 168), --shape says 16 x 16 = 256 tactels'
                in run(name, *KNOWN, '--shape', '16', '16'))
    assert '--shape says 14 x 12 = 168' in run('cube.npy', *KNOWN, '--shape', '14', '12')
    assert '--shape: value is 0, must be between 1' in run('flat.npy', *KNOWN, '--shape', '0', '1')
    for given in (SHAPE, ['--scale', '2']):
        assert f'{given[0]} is given by the calibration' in run('flat.npy', *calibrate(), *given)


def test_a_closed_form_asks_for_its_layers(run):
    np.savez('in.npz', frames=edges())
    assert '--method moments needs --layers' in run('in.npz', *BARE, '--method', 'moments')


def test_integers_need_a_meaning(run):
    np.savez('in.npz', frames=counts(edges()))
    np.savetxt('in.csv', counts(edges()).reshape(4, -1), fmt='%d', delimiter=',')
    for args in (BARE, KNOWN):
        text = run('in.npz', *args)
        assert 'in.npz: frames are counts (uint16): --calibration CAL.yaml says' in text
        assert 'save floats' in text and '--scale PA_PER_COUNT' in text
        assert 'frames are counts (int64)' in run('in.csv', *args, *SHAPE)
    tared = np.rint(edges() / GAIN).astype(np.int16)
    np.savez('in.npz', frames=tared)
    found = run('in.npz', *KNOWN, '--scale', f'{GAIN}')
    np.savez('in.npz', frames=tared * GAIN)
    same(found, run('in.npz', *KNOWN))


def test_volts_with_a_calibration_are_not_rounded_away(run):
    exact = BASELINE + edges() / GAIN
    np.savez('in.npz', frames=exact)
    expected = run('in.npz', *calibrate())
    assert expected['valid'].all()
    volt = 5.0 / 1023.0
    assert load_calibration('cal.yaml').resolution == 1.0
    np.savez('in.npz', frames=exact * volt)
    np.savez('unloaded.npz', frames=volt * np.random.default_rng(3).normal(
        BASELINE, 6.0, (40, ROWS, COLUMNS)))
    found = run('in.npz', *calibrate(resolution=volt))
    for name in ('x', 'line_force'):
        np.testing.assert_allclose(found[name], expected[name], rtol=1e-6)
    tared = run('in.npz', *calibrate(resolution=volt), '--tare', 'unloaded.npz')
    assert tared['valid'].all()
    np.testing.assert_allclose(tared['line_force'], expected['line_force'], rtol=0.03)


def test_no_recording_is_overwritten_and_a_namespace_needs_a_bag(run):
    for name in ('in.npz', 'out.npz'):
        np.savez(name, frames=counts(np.zeros((20, ROWS, COLUMNS))))
    assert 'out.npz: is the input as well' in run('in.npz', *calibrate(), '--tare', 'out.npz')
    assert '--namespace needs a bag, in.npz is none' in run('in.npz', *BARE, '--namespace', 'pad')


def test_a_calibration_knows_the_shape_of_flat_counts(run):
    np.savez('in.npz', frames=counts(edges()))
    np.savetxt('in.csv', counts(edges()).reshape(4, -1), fmt='%d', delimiter=',')
    same(run('in.csv', *calibrate()), run('in.npz', *calibrate()))
    np.save('in.npy', counts(edges()).reshape(4, -1)[:, :-1])
    assert '(4, 167), the calibration says 12 x 14 = 168 tactels' in run('in.npy', *calibrate())


def test_counts_beyond_the_bits_are_refused_by_name(run):
    frames = counts(edges())
    frames[:2] = BASELINE
    np.savez('in.npz', frames=frames)
    text = run('in.npz', *calibrate(bits=8))
    k, row, column = np.argwhere(frames > 255)[0]
    assert (f'in.npz: frame {k}, row {row}, column {column} reads {frames[k, row, column]} counts,'
            ' but `bits: 8` of cal.yaml allows 0 to 255: set `bits`') in text
    np.savez('in.npz', frames=frames.astype(float) - BASELINE)
    frames = np.clip(frames, 0, 255)
    np.savez('in.npz', frames=frames)
    assert isinstance(run('in.npz', *calibrate(bits=8)), dict)
    np.savez('in.npz', frames=edges() / GAIN)  # tared twice
    assert 'reads -' in run('in.npz', *calibrate())


def test_saturated_counts_are_no_dead_tactels(run, monkeypatch):
    frames = np.minimum(counts(1.9 * edges(1)), 1023)
    assert 0 < (frames == 1023).sum() < 40
    np.savez('in.npz', frames=frames)
    reasons = run('in.npz', *calibrate())['reasons']
    assert reasons & Reason.SATURATED and not reasons & Reason.DEAD_TACTELS
    stub = SimpleNamespace(estimate_batch=lambda stress, array, layers: (stress, layers[0]))
    with monkeypatch.context() as patch:
        patch.setattr(estimate, 'estimator_of', lambda options: stub)
        _, records = estimate.estimates_of(
            estimate.parse(['in.npz', *calibrate(), '-o', 'out.npz']))
    (stress, layer), = records
    np.testing.assert_array_equal(stress >= layer.full_scale, frames == 1023)
    found = run('in.npz', *calibrate(dead_tactels=(3,)))
    both = Reason.SATURATED | Reason.DEAD_TACTELS
    assert found['reasons'] & both == both
