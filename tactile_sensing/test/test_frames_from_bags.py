"""Commands give the same for `.npy` files and bags as for an archive or a node."""
import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message

from tactile_common.ros.message_definitions import definition_of
from tactile_msgs.msg import TactileImage as TactileImageMsg
from tactile_sensing.cli import calibrate, estimate
from tactile_sensing.contact.estimator import ContactEstimator
from tactile_sensing.conversions import image_from_msg, image_to_msg
from tactile_sensing.devices.calibration import Calibration, load_calibration, save_calibration
from tactile_sensing.thesis import line
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.image import Layer, TactileImage

rosbag2 = pytest.importorskip('rosbags.rosbag2')

ARRAY = TactelArray(10, 12, 1e-3, 1e-3)
DEPTH, FORCE, GAIN, BASELINE = 2e-3, 200.0, 100.0, 20.0
PLAIN = ['--pitch', '0.001', '--layers', f'zz@{DEPTH}']


@pytest.fixture
def there(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def pressures(count):
    """Return edges across the pad, then one unloaded frame (count, rows, columns) [Pa]."""
    rng = np.random.default_rng(1)
    frames = [line.pressure(ARRAY.x[None, :], ARRAY.y[:, None], rho, 0.0, FORCE, DEPTH)
              for rho in rng.uniform(-3e-3, 3e-3, count - 1)]
    frames.append(np.zeros(ARRAY.shape))
    return (np.array(frames) + rng.normal(0.0, 300.0, (count, *ARRAY.shape))).astype(np.float32)


def counts(frames):
    return np.clip(np.rint(frames / GAIN + BASELINE), 0, 1023).astype(np.uint16)


def pictures(frames, *, tared=True, array=ARRAY, **layer):
    """Return images of frames, with stamps from 5 s on at 100 Hz."""
    return [TactileImage(5_000_000_000 + 10_000_000 * k, k,
                         (Layer('zz', DEPTH, frame.astype(np.float32), **layer),), array, tared)
            for k, frame in enumerate(frames)]


def received(image):
    """Return an image as a node receives it, in single precision."""
    return image_from_msg(deserialize_message(
        serialize_message(image_to_msg(image)), TactileImageMsg))


def write_bag(path, **sensors):
    """Write a bag with images of sensors, by name."""
    with rosbag2.Writer(path, version=9) as writer:
        for name, images in sensors.items():
            messages = [image_to_msg(image) for image in images]
            known = definition_of(type(messages[0]))
            topic = writer.add_connection(f'/{name}/image', known.name, msgdef=known.text,
                                          rihs01=known.digest)
            for image, message in zip(images, messages, strict=True):
                writer.write(topic, image.stamp_ns, serialize_message(message))


def run(*args):
    assert estimate.main([*args, '-o', 'out.npz']) == 0
    with np.load('out.npz') as archive:
        return {name: archive[name] for name in archive.files}


def same(found, expected):
    for name, values in expected.items():
        np.testing.assert_array_equal(found[name], values)


def refused(capsys, *args):
    assert estimate.main([*args, '-o', 'none.npz']) == 2
    out, err = capsys.readouterr()
    assert out == '' and err.count('\n') == 1
    return err


def test_a_damaged_file_of_one_array_is_refused(there, capsys):
    np.save('in.npy', pressures(3))
    whole = (there / 'in.npy').read_bytes()
    for content in (b'', b'words', whole[:200], whole + b'more'):
        (there / 'in.npy').write_bytes(content)
        assert 'damaged' in refused(capsys, 'in.npy', *PLAIN)
    np.save('in.npy', np.array([{}]), allow_pickle=True)
    assert 'is not an .npy array of numbers' in refused(capsys, 'in.npy', *PLAIN)


def test_a_bag_gives_the_contacts_of_the_node(there):
    images = pictures(pressures(300), noise_std=300.0, gain_spread=0.03)
    images[2].layers[0].stress[3, 4] = np.nan
    write_bag('run', pad=images)
    found = run('run')
    np.testing.assert_allclose(found['t'], 5.0 + 0.01 * np.arange(300), atol=1e-6)
    assert found['valid'].sum() == 299
    for k, image in enumerate(images):
        contact = ContactEstimator().estimate(received(image))
        assert (found['type'][k], found['valid'][k], found['reasons'][k]) == (
            contact.type, contact.valid, contact.reasons)
        assert np.isnan(found['x'][k]) if not contact.valid else found['x'][k] == contact.x
        np.testing.assert_array_equal(found['covariance'][k], contact.covariance)
        assert found['moments'][k][0] == contact.moments.m0
    narrow = run('run', '--noise', '600')
    assert np.nanmedian(narrow['snr']) == pytest.approx(np.nanmedian(found['snr']) - 6.0, abs=1.0)


def test_a_sensor_of_several_is_named(there, capsys):
    left, right = pictures(pressures(4)), pictures(pressures(7))
    write_bag('run', left=left, right=right)
    assert 'has 2 topics image; name one by --namespace' in refused(capsys, 'run')
    assert 'has no /middle/image' in refused(capsys, 'run', '--namespace', 'middle')
    assert len(run('run', '--namespace', 'right')['t']) == 7
    assert calibrate.main(['--out', 'pad.yaml', '--pitch', '0.001', '--rolling', 'run',
                           '--namespace', 'middle']) == 2
    assert 'has no /middle/image' in capsys.readouterr().err


def test_arrays_that_differ_are_refused(there, capsys):
    other = TactelArray(4, 4, 1e-3, 1e-3)
    write_bag('run', pad=pictures(pressures(2)) + pictures(np.zeros((1, 4, 4)), array=other))
    assert 'images on /pad/image are of' in refused(capsys, 'run')


def test_images_without_a_layer_or_a_full_scale_are_refused(there, capsys):
    save_calibration(Calibration(ARRAY, depth=DEPTH), 'pad.yaml')
    pad = ['--calibration', 'pad.yaml']
    empty = TactileImage(5_000_000_000, 0, (), ARRAY, False)
    write_bag('empty', pad=[empty])
    for args in ([], pad):
        assert 'bag empty: the first image on /pad/image has no layer' in refused(
            capsys, 'empty', *args)
    frames = np.full((2, *ARRAY.shape), 20.0)
    write_bag('late', pad=[*pictures(frames, tared=False, unit='counts'), empty])
    assert 'no raw counts' in refused(capsys, 'late', *pad)
    frames[1, 3, 4] = np.nan
    write_bag('unknown', pad=pictures(frames, tared=False, unit='counts'))
    assert 'image at 5.010000 s: 1 tactels are NaN, but `full_scale` is 0' in refused(
        capsys, 'unknown', *pad)


def test_raw_counts_of_a_bag_are_calibrated(there, capsys):
    frames = counts(pressures(8))
    frames[2, 3, 4] = 1023  # full scale, which a driver replaces by NaN
    unloaded = counts(np.random.default_rng(2).normal(0.0, 300.0, (100, *ARRAY.shape)))
    np.savez('frames.npz', frames=frames)
    np.save('unloaded.npy', unloaded)
    raw = np.where(frames == 1023, np.nan, frames.astype(float))
    write_bag('run', pad=pictures(raw, tared=False, unit='counts', full_scale=1023.0))
    write_bag('rest', pad=pictures(unloaded, tared=False, unit='counts', full_scale=1023.0))
    save_calibration(Calibration(ARRAY, gain=GAIN, baseline=BASELINE, noise=3.0, bits=10,
                                 depth=DEPTH), 'pad.yaml')
    with_tare = run('frames.npz', '--calibration', 'pad.yaml', '--tare', 'unloaded.npy')
    assert with_tare['valid'].sum() == 7
    same(run('run', '--calibration', 'pad.yaml', '--tare', 'rest'), with_tare)
    # The bits follow from the full scale in the images; unloaded frames do not show them.
    assert calibrate.main(['--out', 'own.yaml', '--pitch', '0.001', '--unloaded', 'rest']) == 0
    assert load_calibration('own.yaml').bits == 10
    write_bag('tared', pad=pictures(pressures(2)))
    capsys.readouterr()
    assert 'no raw counts in the images' in refused(capsys, 'tared', '--calibration', 'pad.yaml')
