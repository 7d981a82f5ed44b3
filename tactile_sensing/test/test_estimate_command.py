"""Command `estimate`: its output, wrong input of every kind, constant memory."""
import re
import runpy
import sys
import tracemalloc
import zipfile

from hypothesis import given, HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
import numpy as np
import pytest

from tactile_sensing.cli import estimate
from tactile_sensing.contact.estimator import ContactEstimator, EstimatorConfig
from tactile_sensing.thesis import line
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import ContactType, Reason

ROWS, COLUMNS, PITCH, DEPTH, FORCE = 12, 14, 0.001, 0.002, 200.0
ARRAY = TactelArray(ROWS, COLUMNS, PITCH, PITCH)
NOISE = 0.01 * line.peak_pressure(FORCE, DEPTH)
OPTIONS = ['--pitch', '0.001', '--layers', 'zz@0.002']

# The arrays of an output file are an interface: users' scripts read them.
OUTPUT = ['type', 'valid', 'force_valid', 'reasons', 'x', 'y', 'yaw', 'normal_force',
          'shear_force_x', 'shear_force_y', 'line_force', 'patch', 'start', 'end', 'covariance',
          'snr', 'residual', 'iterations', 'moments']


def edges(count, seed=1, depth=DEPTH):
    """Return edges across the pad, shape (count, rows, columns), and their places [m]."""
    rng = np.random.default_rng(seed)
    a = rng.uniform(-4e-3, 4e-3, count)
    frames = np.array([line.pressure(
        ARRAY.x[None, :], ARRAY.y[:, None], rho, 0.0, FORCE, depth) for rho in a])
    return (frames + rng.normal(0.0, NOISE, frames.shape)).astype(np.float32), a


@pytest.fixture
def there(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(*options, out='out.npz', args=OPTIONS, **arrays):
    """Run the command on a file of arrays; returns the exit status."""
    np.savez('in.npz', **arrays)
    return estimate.main(['in.npz', *args, '-o', out, *options])


def result(name='out.npz'):
    with np.load(name) as archive:
        return {key: archive[key] for key in archive.files}


def message(capsys):
    """Return the only line on standard error; standard output is empty."""
    out, err = capsys.readouterr()
    assert out == '' and err.count('\n') == 1 and err.startswith('estimate: ')
    return err


def test_edges_and_empty_frames(there, capsys):
    frames, a = edges(20)
    frames[7] = np.random.default_rng(2).normal(0.0, NOISE, frames[7].shape)
    assert run('--noise', f'{NOISE}', frames=frames) == 0
    found = result()
    assert list(found) == OUTPUT
    assert all(len(found[name]) == 20 for name in found)
    assert found['covariance'].shape == (20, 7, 7)
    line_frames = np.arange(20) != 7
    np.testing.assert_array_equal(found['valid'], line_frames)
    np.testing.assert_array_equal(found['type'], 2 * line_frames)
    np.testing.assert_array_equal(found['force_valid'], line_frames)
    np.testing.assert_allclose(found['x'][line_frames], a[line_frames], atol=5e-5)
    np.testing.assert_allclose(found['line_force'][line_frames], FORCE, rtol=0.02)
    np.testing.assert_allclose(found['normal_force'][line_frames], FORCE * ROWS * PITCH, rtol=0.02)
    assert found['reasons'][7] == Reason.NO_CONTACT and not found['reasons'][line_frames].any()
    assert np.isfinite(found['covariance'][line_frames][:, [0, 1, 2, 3, 6], [0, 1, 2, 3, 6]]).all()
    for name, values in found.items():
        if values.dtype.kind == 'f' and name != 'moments':
            assert np.isnan(values[7]).all(), name
    text = message(capsys)
    assert '20 frames' in text and 'frames/s' in text
    assert '1 none, 19 line; 1 not valid: 1 no_contact' in text


@pytest.mark.parametrize('save', [np.savez, np.savez_compressed])
@pytest.mark.parametrize('order', ['C', 'F'])
def test_chunks_equal_one_go(there, monkeypatch, save, order):
    frames, _ = edges(23)
    assert run(frames=frames, out='whole.npz') == 0
    save('in.npz', other=np.ones(3), frames=np.asarray(frames, order=order))
    monkeypatch.setattr(estimate, 'CHUNK_BYTES', 5 * frames[0].nbytes)
    assert estimate.main(['in.npz', *OPTIONS, '-o', 'chunks.npz']) == 0
    whole, chunks = result('whole.npz'), result('chunks.npz')
    for name in whole:
        assert whole[name].dtype == chunks[name].dtype
        np.testing.assert_array_equal(whole[name], chunks[name])


def test_csv_equals_npz(there, monkeypatch):
    frames, _ = edges(11)
    frames[3] = 0.0
    monkeypatch.setattr(estimate, 'CHUNK_BYTES', 4 * frames[0].nbytes)
    assert run(frames=frames) == 0 and run(frames=frames, out='out.csv') == 0
    table = np.genfromtxt('out.csv', delimiter=',', names=True)
    np.testing.assert_array_equal(table['frame'], np.arange(11))
    for name, values in result().items():
        if name == 'covariance':
            for row in range(7):
                for column in range(row, 7):
                    np.testing.assert_array_equal(
                        table[f'covariance_{row}_{column}'], values[:, row, column])
        elif name == 'moments':
            for column in range(6):
                np.testing.assert_array_equal(table[f'moments_{column}'], values[:, column])
        else:
            np.testing.assert_array_equal(table[name], values)


def test_layers_with_dead_tactels(there):
    frames, a = edges(6)
    frames[:, 3, 4] = frames[:, 0, 0] = np.nan
    layers = np.stack([frames, edges(6, depth=2 * DEPTH)[0]], axis=1)
    args = ['--pitch', '0.001', '0.001', '--layers', 'zz@0.002,zz@0.004']
    assert run(frames=layers, args=args) == 0
    found = result()
    assert found['valid'].all() and (found['reasons'] == Reason.DEAD_TACTELS).all()
    np.testing.assert_allclose(found['x'], a, atol=5e-5)


def test_options_go_to_the_estimator():
    def config(*options):
        return estimate.estimator_of(estimate.parse(
            ['in.npz', *OPTIONS, '-o', 'o.npz', *options])).config

    assert config() == EstimatorConfig()
    assert config('--model', 'line', '--tactel', 'area') == EstimatorConfig(
        model='line', tactel='area')
    assert config('--method', 'compensated') == EstimatorConfig(method='compensated')


FRAMES = np.zeros((2, 8, 8))
WORDS = {
    'no frames': ({'other': FRAMES}, [], "array 'frames' is missing, there are ['other']"),
    'one frame': ({'frames': FRAMES[0]}, [], 'frames has shape (8, 8), must be (N, rows, columns)'
                  ' or (N, layers, rows, columns), none of them 0; a single frame is (1, rows'),
    'one frame and its shape': ({'frames': FRAMES[0]}, ['--shape', '8', '8'],
                                '= 64 tactels; a single frame is (1, rows, columns)'),
    'counts': ({'frames': FRAMES.astype('u2')}, [], 'frames are counts (uint16)'),
    'no rows': ({'frames': FRAMES[:, :0]}, [], 'none of them 0'),
    'bool': ({'frames': FRAMES > 0}, [], 'is of type bool'),
    'objects': ({'frames': FRAMES.astype(object)}, [], 'is not an .npz archive of numbers'),
    'one layer more': ({'frames': FRAMES}, ['--layers', 'zz@0.002,zz@0.004'], '--layers names 2'),
    'pitch 0': ({'frames': FRAMES}, ['--pitch', '0'], '--pitch: value is 0.0, must be between'),
    'pitch < 0': ({'frames': FRAMES}, ['--pitch', '1e-3', '-.001'], '--pitch: value is -0.001'),
    'pitch in mm': ({'frames': FRAMES}, ['--pitch', '1'],
                    '--pitch: value is 1.0, must be between 1e-06 and 0.1 m; did you mean 0.001?'),
    'pitch nan': ({'frames': FRAMES}, ['--pitch', 'nan'], '--pitch: value is nan'),
    'three pitches': ({'frames': FRAMES}, ['--pitch', '.1', '.1', '.1'], 'one length or two'),
    'depth 0': ({'frames': FRAMES}, ['--layers', 'zz@0'], 'depth of zz is 0.0, must be between'),
    'depth missing': ({'frames': FRAMES}, ['--layers', 'zz'], "depth of zz is ''"),
    'component': ({'frames': FRAMES}, ['--layers', 'zx@0.002'], "component 'zx' is not one of"),
    'only shear': ({'frames': FRAMES}, ['--layers', 'xz@0.002'], 'no layer of pressure'),
    'method': ({'frames': FRAMES}, ['--method', 'guess'], "method is 'guess', must be one of"),
    'noise': ({'frames': FRAMES}, ['--noise', '-1'], '--noise: value is -1.0, must be'),
    'suffix': ({'frames': FRAMES}, ['-o', 'out.txt'], 'out.txt: must end in .npz or .csv'),
    'folder': ({'frames': FRAMES}, ['-o', 'gone/out.npz'], 'there is no such folder'),
    'onto the input': ({'frames': FRAMES}, ['-o', 'in.npz'], 'in.npz: is the input as well'),
    'onto a folder': ({'frames': FRAMES}, ['-o', 'folder.npz'], 'folder.npz: is a folder'),
}


@pytest.mark.parametrize('arrays, options, words', WORDS.values(), ids=WORDS)
def test_mistakes_cost_one_line(there, capsys, arrays, options, words):
    (there / 'folder.npz').mkdir()
    (there / 'out.npz').write_text('old')
    assert run(*options, **arrays) == 2
    assert words in message(capsys)
    assert sorted(path.name for path in there.iterdir()) == ['folder.npz', 'in.npz', 'out.npz']
    assert (there / 'out.npz').read_text() == 'old'


@pytest.mark.parametrize('args, words', [
    ([], ', -o/--out'),
    (['in.npy', '-o', 'out.npz'], '--calibration is missing, or --pitch'),
    ([*OPTIONS, '-o', 'out.npz'], 'required: FRAMES.npz'),
    (['gone.npz', *OPTIONS, '-o', 'out.npz'], 'gone.npz: cannot be read: No such file'),
    (['.', '-o', 'out.npz'], 'bag .: has no metadata.yaml'),
    (['gone.mcap', '-o', 'out.npz'], 'bag gone.mcap: there is no such bag'),
    (['gone.mcap', *OPTIONS, '-o', 'out.npz'], '--pitch is given by the bag'),
])
def test_missing_input(there, capsys, args, words):
    assert estimate.main(args) == 2
    assert words in message(capsys)
    assert not list(there.iterdir())


def test_a_recording_of_ros_1_is_called_one(there, capsys):
    (there / 'in.bag').write_bytes(b'#ROSBAG V2.0\n')
    assert estimate.main(['in.bag', '-o', 'out.npz']) == 2
    assert 'bag in.bag: is not a rosbag2 recording' in message(capsys)


@pytest.mark.parametrize('save', [np.savez, np.savez_compressed])
def test_damaged_archives(there, capsys, save):
    path = there / 'in.npz'
    save(path, frames=edges(50)[0])
    whole = path.read_bytes()
    header = whole.index(b'NUMPY') if save is np.savez else 60
    half = len(whole) // 2
    for content in (b'', b'words', whole[:half], whole[:half] + b'?' * 40 + whole[half + 40:],
                    whole[:header] + b'?' * 60 + whole[header + 60:]):
        path.write_bytes(content)
        assert estimate.main([str(path), *OPTIONS, '-o', 'out.npz']) == 2
        assert 'damaged' in message(capsys)
        assert [file.name for file in there.iterdir()] == ['in.npz']


def test_interrupt_leaves_nothing(there, capsys, monkeypatch):
    def interrupt(*_):
        raise KeyboardInterrupt
    monkeypatch.setattr(ContactEstimator, 'estimate_batch', interrupt)
    assert run(frames=FRAMES) == 130
    assert 'interrupted' in message(capsys)
    assert [path.name for path in there.iterdir()] == ['in.npz']


@settings(max_examples=50, derandomize=True,
          suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
@given(npst.arrays(
    st.one_of(npst.floating_dtypes(sizes=(16, 32, 64)), npst.integer_dtypes(),
              npst.boolean_dtypes(), npst.complex_number_dtypes()),
    npst.array_shapes(min_dims=0, max_dims=5, min_side=0, max_side=6), fill=st.just(0)))
def test_any_array_gives_a_result_or_one_line(there, capsys, frames):
    status = run(frames=frames)
    message(capsys)
    good = frames.dtype.kind == 'f' and 0 not in frames.shape and (
        frames.ndim == 3 or frames.ndim == 4 and frames.shape[1] == 1)
    assert status == (0 if good else 2)
    if good:
        found = result()
        assert len(found['valid']) == len(frames)
        for name, valid in (('x', 'valid'), ('normal_force', 'force_valid'), ('snr', 'valid')):
            np.testing.assert_array_equal(np.isfinite(found[name]), found[valid])


@pytest.mark.parametrize('save', [np.savez, np.savez_compressed])
def test_frames_are_read_in_parts(there, save):
    peaks = {}
    for count in (1_100, 2_000, 12_000):  # the first is to warm up
        save('in.npz', frames=np.zeros((count, 32, 32), np.float32))
        tracemalloc.start()
        assert estimate.main(['in.npz', *OPTIONS, '-o', 'out.npz']) == 0
        peaks[count] = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert peaks[12_000] - peaks[2_000] < 10e6  # of 41 MB, for the records


def test_help_names_everything(capsys):
    with pytest.raises(SystemExit) as end:
        estimate.main(['--help'])
    assert end.value.code == 0
    text = capsys.readouterr().out
    for name in ('frames', *OUTPUT, *Reason.__members__, *ContactType.__members__):
        assert re.search(rf'\b{name}\b', text), name
    assert max(map(len, text.splitlines())) < 120


def test_header_that_promises_more_than_there_is(there, capsys):
    np.save('frames.npy', FRAMES)
    text = (there / 'frames.npy').read_bytes().replace(
        b'(2, 8, 8), }   ', b'(2000, 8, 8), }')
    with zipfile.ZipFile('in.npz', 'w') as archive:
        archive.writestr('frames.npy', text)
    assert estimate.main(['in.npz', *OPTIONS, '-o', 'out.npz']) == 2
    assert 'frames is damaged' in message(capsys)
    assert not (there / 'out.npz').exists()


@pytest.mark.parametrize('name', ['estimate', 'calibrate', 'record'])
def test_modules_run_as_commands(name, monkeypatch, capsys):
    module = f'tactile_sensing.cli.{name}'
    monkeypatch.setattr('sys.argv', [name, '--help'])
    monkeypatch.delitem(sys.modules, module, raising=False)
    with pytest.raises(SystemExit) as stopped:
        runpy.run_module(module, run_name='__main__')
    assert stopped.value.code == 0
    assert f'usage: {name}' in capsys.readouterr().out
