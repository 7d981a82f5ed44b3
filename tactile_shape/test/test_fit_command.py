"""Command `fit`: what it writes and says, every way to get it wrong, and bags."""
from pathlib import Path
import re
import textwrap

from geometry_msgs.msg import PoseStamped
import numpy as np
import pytest
from rclpy.serialization import serialize_message
from scipy.spatial.transform import Rotation

from benchmarks.shape.surfaces import add_noise, cylinder, sphere, Weave
from tactile_common.ros.conversions import stamp_from_ns
from tactile_common.ros.message_definitions import definition_of
from tactile_msgs.msg import Contact as ContactMsg
from tactile_shape.cli import fit
from tactile_shape.cli.fit import COLUMNS
from tactile_shape.local_surface.local_quadric import LocalQuadric
from tactile_shape.types.patch import Kind

RADIUS = 0.035


@pytest.fixture
def there(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def contacts(surface=None, noise=True, length=0.04):
    position, normal = Weave().trace(surface or sphere(RADIUS), length)
    if noise:
        position, normal = add_noise(position, normal, np.random.default_rng(1))
    return {'t': 0.005 * np.arange(len(position)), 'position': position, 'normal': normal}


def run(*options, out='out.npz', **arrays):
    """Run the command on a file of arrays; returns the exit status."""
    np.savez('in.npz', **arrays)
    return fit.main(['in.npz', '-o', out, *options])


def result(name='out.npz'):
    with np.load(name) as archive:
        return {key: archive[key] for key in archive.files}


def test_same_as_the_estimator(there, capsys):
    arrays = contacts()
    assert run(**arrays) == 0
    found = result()
    assert list(found) == list(COLUMNS)
    assert all(len(values) == len(arrays['t']) for values in found.values())
    estimator = LocalQuadric()
    for k, (point, normal) in enumerate(
            zip(arrays['position'], arrays['normal'], strict=True)):
        patch = estimator.update(point, normal)
        assert (found['kind'][k], found['valid'][k]) == (patch.kind, patch.valid)
        np.testing.assert_array_equal(found['curvature'][k], patch.curvature)
        np.testing.assert_array_equal(found['surface_matrix'][k], patch.surface_matrix)
        np.testing.assert_array_equal(found['directions'][k], patch.frame[:3, :2].T)
        np.testing.assert_array_equal(found['origin'][k], patch.frame[:3, 3])
        assert found['n'][k] == patch.samples and found['window'][k] == patch.extent
    assert np.mean(found['kind'] == Kind.SPHERE) > 0.6
    np.testing.assert_allclose(found['curvature'][-1], 1 / RADIUS, rtol=0.02)
    out, err = capsys.readouterr()
    assert out == '' and 'contacts/s' in err and 'sphere (28.' in err and 'not valid' in err
    assert 'hint' not in err


def test_the_path_begins_anew_where_nothing_is_touched(there):
    arrays = contacts()
    for name in ('position', 'normal'):
        arrays[name][100] = np.nan
    assert run(**arrays) == 0
    found = result()
    assert found['valid'][99] and not found['valid'][100:103].any() and found['valid'][-1]
    assert np.isnan(found['curvature'][100]).all() and found['n'][101] == 1
    assert found['t'][100] == arrays['t'][100]


def test_a_round_finger_and_the_method_of_the_thesis(there):
    assert run('--finger-radius', '0.01', **contacts(noise=False)) == 0
    np.testing.assert_allclose(result()['curvature'][-1], 1 / RADIUS, rtol=1e-3)
    assert run('--method', 'surface_matrix', **contacts(noise=False)) == 0
    np.testing.assert_allclose(result()['curvature'][-1], 1 / RADIUS, rtol=1e-6)


def test_outline_ply_and_plot(there, capsys):
    arrays = contacts(cylinder(0.05))
    assert run('--outline', '--ply', 'patches.ply', '--plot', 'patches.png', **arrays) == 0
    assert 'outline' in capsys.readouterr().err
    assert (there / 'patches.ply').read_text().startswith('ply')
    assert (there / 'patches.png').read_bytes().startswith(b'\x89PNG')


def test_the_example_of_the_help(there, capsys):
    with pytest.raises(SystemExit):
        fit.main(['--help'])
    text = capsys.readouterr().out
    for name in (*COLUMNS, 'position', 'normal'):
        assert re.search(rf'^  {name}\b', text, re.M), name
    exec(textwrap.dedent(re.search(r'-c "\n(.*?)\n  "\n', fit.EXAMPLE, re.S)[1]), {})
    assert fit.main(['trace.npz', '-o', 'patches.npz']) == 0
    np.testing.assert_allclose(1 / result('patches.npz')['curvature'][-1], 0.035, rtol=0.01)


GOOD = contacts(length=0.01)


def test_an_outline_that_is_refused_leaves_nothing_behind(there, capsys):
    np.savez('short.npz', **contacts(length=0.003))
    assert fit.main(['short.npz', '-o', 'patches.npz', '--outline']) == 2
    assert 'contour' in capsys.readouterr().err and not Path('patches.npz').exists()


def test_infinite_positions_are_no_warning_of_numpy(there, recwarn):
    position = GOOD['position'].copy()
    position[4:6] = np.inf
    np.savez('odd.npz', **{**GOOD, 'position': position})
    assert fit.main(['odd.npz', '-o', 'patches.npz']) == 0
    assert not [str(it.message) for it in recwarn]


@pytest.mark.parametrize('change, options, message', [
    ({'t': None}, (), "array 't' is missing"),
    ({'position': GOOD['position'][:-1]}, (), 'position has shape'),
    ({'normal': GOOD['normal'][:, :2]}, (), 'normal has shape'),
    ({'t': GOOD['t'][::-1]}, (), 't falls from row 0'),
    ({'t': GOOD['t'] * np.nan}, (), 't: a number is not finite'),
    ({'position': GOOD['position'] * np.nan}, (), 'no row is finite'),
    ({'finger_radius': 0.01}, (), 'holds finger_radius, but fit takes settings from its options'),
    ({}, ('--finger-radius', '-1'), 'finger_radius is -1'),
    ({}, ('--window', '0'), 'window is 0'),
    ({}, ('--ply', 'none/x.ply'), 'there is no such folder'),
    ({}, ('--plot', 'x.unknown'), 'must end in .png or'),
    ({}, ('--method', 'magic'), 'invalid choice')])
def test_refusals_are_one_line(there, capsys, change, options, message):
    arrays = {name: value for name, value in {**GOOD, **change}.items() if value is not None}
    assert run(*options, **arrays) == 2
    out, err = capsys.readouterr()
    assert out == '' and err.count('\n') == 1 and err.startswith('fit: ') and message in err


@pytest.mark.parametrize('args, message', [
    (['none.npz', '-o', 'out.npz'], 'no such file'), (['in.npz', '-o', 'out.csv'], 'end in .npz'),
    (['in.npz', '-o', 'in.npz'], 'is the input as well'), (['junk.npz', '-o', 'o.npz'], 'damaged'),
    (['folder', '-o', 'out.npz'], 'folder'), (['in.npz'], 'required')])
def test_refused_files(there, capsys, args, message):
    np.savez('in.npz', **GOOD)
    (there / 'junk.npz').write_bytes(b'PK junk')
    (there / 'folder').mkdir()
    assert fit.main(args) == 2
    out, err = capsys.readouterr()
    assert out == '' and err.count('\n') == 1 and message in err
    assert not (there / 'out.npz').exists()


def test_endings_in_capitals_are_the_same(there):
    np.savez('in.npz', **GOOD)
    (there / 'in.npz').rename('IN.NPZ')
    assert fit.main(['IN.NPZ', '-o', 'OUT.NPZ']) == 0
    assert result('OUT.NPZ')


def write_bag(path):
    """Recording of a pad pressed flat against a sphere of 70 mm diameter."""
    pytest.importorskip('rosbags')
    from rosbags.rosbag2 import StoragePlugin, Writer
    points, normals = Weave(speed=0.05).trace(sphere(RADIUS), 0.03)
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        known = {topic: definition_of(kind) for topic, kind in (
            ('/tactile/sensor_pose', PoseStamped), ('/tactile/contact', ContactMsg))}
        topics = [writer.add_connection(topic, it.name, msgdef=it.text, rihs01=it.digest)
                  for topic, it in known.items()]
        for k, (point, normal) in enumerate(zip(points, normals, strict=True)):
            stamp = 5_000_000 * (k + 1)
            for topic, message in zip(topics, messages(point, normal, stamp), strict=True):
                writer.write(topic, stamp + 1000, serialize_message(message))
    return points


def messages(point, normal, stamp_ns, offset=(0.001, -0.002)):
    """Pose of a pad whose point `offset` touches a surface at a point, and the contact on it."""
    up = np.array([0.0, 0.0, 1.0])
    turn, _ = Rotation.align_vectors([normal], [up])
    origin = point - turn.apply([*offset, 0.0])
    pose = PoseStamped()
    pose.header.stamp = stamp_from_ns(stamp_ns)
    pose.header.frame_id = 'base'
    for axis, value in zip('xyz', origin, strict=True):
        setattr(pose.pose.position, axis, float(value))
    for axis, value in zip('xyzw', turn.as_quat(), strict=True):
        setattr(pose.pose.orientation, axis, float(value))
    contact = ContactMsg(type=ContactMsg.TYPE_POINT, valid=True, x=offset[0], y=offset[1])
    contact.header.stamp = stamp_from_ns(stamp_ns)
    contact.header.frame_id = 'tactile_pad'
    return pose, contact


def test_a_bag_gives_patches_and_its_contour(there, capsys):
    points = write_bag(there / 'run')
    assert fit.main(['run', '-o', 'out.npz', '--contour', 'contour.csv']) == 0
    found = result()
    np.testing.assert_allclose(found['origin'][-1], points[-1], atol=2e-5)
    np.testing.assert_allclose(1 / found['curvature'][-1], RADIUS, rtol=0.02)
    assert 'sphere' in capsys.readouterr().err
    rows = np.genfromtxt('contour.csv', delimiter=',', skip_header=1)
    away = np.linalg.norm(rows[:, None, 1:] - points[None], axis=2).min(axis=1)
    assert len(rows) > 20 and away.max() < 1e-6  # m


def test_a_damaged_bag_is_refused_by_name(there, capsys):
    write_bag(there / 'run')
    (mcap,) = (there / 'run').glob('*.mcap')
    mcap.write_bytes(mcap.read_bytes()[:3000])
    assert fit.main(['run', '-o', 'out.npz']) == 2
    assert 'run: ' in capsys.readouterr().err


def test_contour_table(there, capsys):
    """Two strokes of an edge, 20 mm and 10 mm; contour points are 1 mm apart."""
    from tactile_shape.contour.object_model import ObjectModel
    model = ObjectModel()
    for begin, length in ((0.0, 0.02), (0.05, 0.01)):
        for x in np.arange(begin, begin + length + 1e-9, 1e-3):
            model.add_contact(np.array([x, 0.0, 0.1]))
        model.begin_stroke()
    model.save_points('contour.csv')
    rows = np.genfromtxt('contour.csv', delimiter=',', names=True)
    assert rows.dtype.names == ('stroke', 'x', 'y', 'z')
    assert [np.ptp(rows['x'][rows['stroke'] == k]) for k in (0, 1)] == pytest.approx(
        [0.02, 0.01], abs=1.1e-3)
    assert (rows['z'] == 0.1).all()
    assert run('--contour', 'contour.txt', **contacts()) == 2
    assert 'contour.txt: must end in .csv' in capsys.readouterr().err


@pytest.mark.parametrize('changed, said', [
    (lambda p, n: (1e3 * p, n), r'hint: .* are 0\.2\d* m apart, .* are positions in metres\?'),
    (lambda p, n: (p, 3 * n), '160 contact is not finite or its normal not of length 1'),
    (lambda p, n: (p, -n), 'hint: .*normals point out of it and must point into it'),
    (lambda p, n: (0.02 * p, n), 'too short, or too noisy, to show any curvature')],
    ids=['millimetres', 'normals too long', 'sign', 'short'])
def test_why_most_contacts_are_refused_or_concave(there, capsys, changed, said):
    arrays = contacts()
    arrays['position'], arrays['normal'] = changed(arrays['position'], arrays['normal'])
    assert run(**arrays) == 0
    assert re.search(said, capsys.readouterr().err, re.M)
