"""Runs read from bags: as written, in part, of several sensors, and damaged."""

import numpy as np
import pytest
from rclpy.serialization import serialize_message
from recorded_run import pose_at, START, TOPICS, write_bag
from rosbags.rosbag2 import StoragePlugin, Writer

from edge_tracking.recording import run as run_module
from edge_tracking.recording.run import read_run
from edge_tracking.recording.summary import lost_images, summarise_recording
from tactile_common.errors import ConfigurationError
from tactile_common.ros.cdr import packed, unpacked
from tactile_common.ros.conversions import stamp_from_ns
from tactile_common.ros.message_definitions import definition_of
from tactile_msgs.msg import TactileImage, TactileLayer


def test_run_reads_back_as_written(bag, scene):
    run = read_run(bag)
    assert run.namespace == '/tactile' and run.info.sensor == 'pad'
    assert run.info.acquisition_delay == pytest.approx(0.0025)
    images = run.images
    assert images.frames.shape == (len(images.stamp_ns), 16, 16)
    assert images.unit == 'Pa' and images.array.pitch_x > 0
    assert (images.sequence == np.arange(len(images.sequence))).all()
    assert len(run.contacts.stamp_ns) == len(images.stamp_ns)
    touching = run.contacts.valid
    assert (run.contacts.normal_force[touching] > 0.0).all()
    assert (run.contacts.force_valid == touching).all()
    assert np.isnan(run.contacts.x[~touching]).all()
    assert run.poses.matrix.shape == (len(run.statuses.stamp_ns), 4, 4)
    np.testing.assert_allclose(run.poses.matrix[200], pose_at(scene, 0.5), atol=1e-12)
    assert run.start_ns == START
    assert run.seconds(START + 1_500_000_000) == pytest.approx(1.5)


def test_time_begins_with_the_stamps_which_may_be_simulated(tmp_path):
    first, stamp_ns = TOPICS[0], 5_000_000_000
    kind, definition, digest = definition_of(first[1])
    image = TactileImage(rows=1, columns=1)
    image.header.stamp = stamp_from_ns(stamp_ns)
    with Writer(tmp_path / 'run', version=9) as writer:
        connection = writer.add_connection(first[0], kind, msgdef=definition, rihs01=digest)
        writer.write(connection, START, serialize_message(image))
    run = read_run(tmp_path / 'run')
    assert run.seconds(stamp_ns) == 0.0 and run.received_ns == START


def test_a_pressure_that_is_not_finite_is_an_invalid_tactel():
    image = TactileImage(rows=2, columns=2, pitch_x=1e-3, pitch_y=1e-3, layers=[
        TactileLayer(stress=[np.inf, -np.inf, 3.0, 4.0])])
    image = unpacked(packed(image), TactileImage)
    images = run_module._images(run_module._image(image))
    np.testing.assert_array_equal(images.frames, [[[np.nan, np.nan], [3.0, 4.0]]])


def test_of_a_long_run_some_messages_are_read_and_all_stamps(bag, monkeypatch):
    whole = read_run(bag)
    monkeypatch.setattr(run_module, 'MOST', 100)
    thin, every = read_run(bag, joints=False), -(-len(whole.images.stamp_ns) // 100)
    np.testing.assert_array_equal(thin.images.frames, whole.images.frames[::every])
    np.testing.assert_array_equal(thin.stamps['image'], whole.images.stamp_ns)
    np.testing.assert_array_equal(thin.statuses.stamp_ns, whole.statuses.stamp_ns)
    assert thin.every['image'] == every > 1 and not thin.joint_acceleration.size
    assert lost_images(thin) == lost_images(whole) == 0
    some, all_ = (summarise_recording(it) for it in (thin, whole))
    assert some['frames'] == all_['frames'] and some['sensor_rate'] == all_['sensor_rate']
    assert some['force_max'] == pytest.approx(all_['force_max'], rel=0.1)


def test_sqlite3_and_single_files_are_read_as_well(tmp_path, bag):
    write_bag(tmp_path / 'run', topics=TOPICS[:2], storage=StoragePlugin.SQLITE3)
    run, (file,) = read_run(tmp_path / 'run'), bag.glob('*.mcap')
    for other in (read_run(bag), read_run(file)):
        np.testing.assert_array_equal(run.images.frames, other.images.frames)


def test_namespace_is_that_of_the_bag(tmp_path):
    path = write_bag(tmp_path / 'left', topics=TOPICS[:1],
                     rename=lambda name: name.replace('tactile', 'left'))
    assert read_run(path).namespace == '/left'
    assert len(read_run(path, 'left').images.stamp_ns)
    assert not len(read_run(path, 'right').images.stamp_ns)


def test_two_sensors_need_a_choice(tmp_path):
    names = {'/tactile/image': '/left/image', '/tactile/contact': '/right/contact'}
    path = write_bag(tmp_path / 'two', topics=[TOPICS[0], TOPICS[2]], rename=names.get)
    with pytest.raises(ConfigurationError, match='/left, /right; choose a namespace'):
        read_run(path)
    assert len(read_run(path, '/right').contacts.stamp_ns)


def test_of_several_sensors_the_one_of_the_default_namespace_is_taken(tmp_path):
    path = write_bag(tmp_path / 'two', topics=[TOPICS[0], TOPICS[2]],
                     rename={'/tactile/image': '/tactile/image',
                             '/tactile/contact': '/right/contact'}.get)
    assert read_run(path).namespace == '/tactile'


def overwritten(path):
    file, = path.glob('*.mcap')
    data = bytearray(file.read_bytes())
    data[2000:40000] = bytes([0xff]) * 38000
    file.write_bytes(data)
    return path


def without_yaml(path):
    (path / 'metadata.yaml').write_text('{ not: [yaml')
    return path


@pytest.mark.parametrize('damage', [lambda path: path / 'nothing', without_yaml, overwritten])
def test_what_is_no_bag_gets_one_clear_line(tmp_path, damage):
    path = damage(write_bag(tmp_path / 'run', topics=TOPICS[:1]))
    with pytest.raises(ConfigurationError) as caught:
        read_run(path)
    assert str(path) in str(caught.value) and '\n' not in str(caught.value)


def test_a_whole_file_is_read_without_metadata(tmp_path):
    # As a recorder leaves it that was killed before it had written these.
    path = write_bag(tmp_path / 'run', topics=TOPICS[:1])
    whole = read_run(path)
    (path / 'metadata.yaml').unlink()
    assert len(whole.images.stamp_ns) and (
        read_run(path).images.stamp_ns == whole.images.stamp_ns).all()


def test_contacts_of_another_version_are_refused_by_name(tmp_path):
    text = 'std_msgs/Header header\nuint8 type\nbool valid\nfloat64 a\n' + '=' * 80 + (
        '\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n') + '=' * 80 + (
        '\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n')
    with Writer(tmp_path / 'run', version=9) as writer:
        connection = writer.add_connection(
            '/tactile/contact', 'tactile_msgs/msg/Contact', msgdef=text,
            rihs01='RIHS01_' + 64 * '0')
        writer.write(connection, 1000, b'\x00\x01\x00\x00' + 8 * b'\x00'
                     + b'\x01\x00\x00\x00\x00\x02\x01\x00' + 8 * b'\x00')
    with pytest.raises(ConfigurationError, match='messages on /tactile/contact are of another '
                       "version of tactile_msgs/msg/Contact: they have no field 'force_valid'"):
        read_run(tmp_path / 'run')
