"""The command `replay`: what it writes, what it refuses, what it says of bags that are broken."""
from contextlib import ExitStack, nullcontext
import csv
import errno
from functools import partial
from itertools import count
import json
import math
from pathlib import Path
import shutil
import sys
import time
from types import SimpleNamespace

from builtin_interfaces.msg import Duration
from geometry_msgs.msg import PoseStamped as Pose
import numpy as np
import pytest
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from rosbags.rosbag2 import StoragePlugin, Writer
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from edge_tracking.recording.record_bag import BagWriter
from edge_tracking.replay import one
from edge_tracking.replay.command import bags_in, main, mapped, result_name
from edge_tracking.replay.comparison import COMPARED, Comparison, distance, TOLERANCES, unequal
from tactile_common.errors import ConfigurationError
from tactile_common.ros.bag_reader import Bag, Recorded
from tactile_common.ros.cdr import packed, unpacked
from tactile_common.ros.message_definitions import definition
from tactile_msgs.msg import ServoCalls
from tactile_servo.journal import Call

GOLDEN = Path(__file__).resolve().parents[2] / 'test/golden/noise'


def run(capsys, *args):
    status = main([str(arg) for arg in args])
    return status, capsys.readouterr().err


def file_of(folder):
    return next(folder.glob('*.mcap'))


def test_two_replays_are_the_same_bytes(capsys, tmp_path):
    for name in ('one', 'two'):
        (tmp_path / name).mkdir()
        assert run(capsys, GOLDEN, '-o', tmp_path / name / 'out')[0] == 0
    for name in ('bag/bag.mcap', 'bag/metadata.yaml', 'contacts.csv', 'cycles.csv'):
        one, two = ((tmp_path / it / 'out' / name).read_bytes() for it in ('one', 'two'))
        assert one == two


def test_a_replay_can_be_replayed_and_compared(capsys, tmp_path):
    status, text = run(capsys, GOLDEN, '-o', tmp_path / 'out', '--compare')
    assert status == 0 and 'equal within the tolerance' in text
    assert run(capsys, tmp_path / 'out/bag', '--compare')[0] == 0
    assert run(capsys, GOLDEN, '--compare', tmp_path / 'out/bag')[0] == 0
    with (tmp_path / 'out/cycles.csv').open() as file:
        rows = list(csv.DictReader(file))
    assert rows[-1]['state'] == 'track' and math.isfinite(float(rows[-1]['normal_force']))
    assert json.loads((tmp_path / 'out/result.json').read_text())['status'] == 0


def test_recorded_contacts_give_the_same(capsys):
    status, text = run(capsys, GOLDEN, '--from', 'contact', '--compare')
    assert status == 0 and 'joint_trajectory' in text and '\ncontact ' not in text


def test_what_if(capsys, tmp_path):
    change = '--set', 'edge_servo.approach.speed=0.02'
    status, text = run(capsys, GOLDEN, *change, '--compare', '-o', tmp_path / 'out')
    assert status == 1 and 'they differ' in text and 'servo_status at 1.' in text
    # What was changed is in the bag that was written.
    assert run(capsys, tmp_path / 'out/bag', '--compare')[0] == 0
    assert run(capsys, GOLDEN, *change, '--compare', tmp_path / 'out/bag')[0] == 0


def test_tolerances_are_by_field(capsys):
    change = GOLDEN, '--from', 'contact', '--set', 'edge_servo.approach.speed=0.0100001'
    assert run(capsys, *change, '--compare')[0] == 1
    assert run(capsys, *change, '--compare', '--tolerance', '1')[0] == 0
    assert run(capsys, *change, '--compare', '--tolerance', 'speed=1')[0] == 1
    own = Comparison({'contact.x': 0.1, 'covariance': 0.2}, (), [])
    assert [own._tolerance('contact', name) for name in ('x', 'covariance[3]', 'y')] == [
        0.1, 0.2, 1e-7]
    assert own._tolerance('joint_trajectory', 'points') == 2e-9
    assert Comparison({'': 1.0}, (), [])._tolerance('contact', 'covariance[0]') == 1.0


@pytest.mark.parametrize('args, text', [
    (['--set', 'edge_servo.force.gian=1'], 'no parameter force.gian; did you mean'),
    (['--set', 'edge_servoo.rate=1'], 'no node edge_servoo is replayed; did you mean edge_servo?'),
    (['--set', 'edge_servo.rate=1e9'], 'rate is 1000000000.0, must be between 25 and 2000 Hz'),
    (['--set', 'edge_servo.rate'], 'must be NODE.PARAM=VALUE'),
    (['--set', 'contact_estimator.method=[1'], '--set contact_estimator.method=[1'),
    (['--set', 'contact_estimator.method=fit', '--from', 'contact'],
     'contact_estimator is not replayed, the recorded contacts are taken'),
    (['--set', 'edge_servo.law=tactile_jacobian'], 'works on goals of track_surface; '),
    (['--tolerance', 'speed=1'], '--tolerance: needs --compare'),
    (['--tolerance', 'contact.covarianc=1', '--compare'], 'did you mean contact.covariance?'),
    (['--tolerance', 'x=-1'], '--tolerance: value is -1.0, must be'),
    (['--namespace', 'left'], 'has no image and no contact of a tactile sensor in /left'),
    (['--parquet'], '--parquet: needs -o'),
    (['-o', GOLDEN], 'File exists')])
def test_what_is_wrong_is_refused_in_a_line(capsys, args, text):
    status, said = run(capsys, GOLDEN, *args)
    assert status == 2 and text in said and said.count('\n') == 1


def test_a_wrong_option_leaves_no_folder(capsys, tmp_path):
    status, said = run(
        capsys, GOLDEN, '-o', tmp_path / 'out', '--set', 'edge_servo.tip_frame=nope')
    assert status == 2 and 'nope' in said and not (tmp_path / 'out').exists()


def test_tables_are_written_as_parquet_too(capsys, tmp_path):
    pytest.importorskip('pyarrow', reason='pyarrow is not installed: pip install pyarrow')
    from pyarrow import parquet
    assert run(capsys, GOLDEN, '-o', tmp_path / 'out', '--parquet')[0] == 0
    lines = (tmp_path / 'out/contacts.csv').read_text().splitlines()
    table = parquet.read_table(tmp_path / 'out/contacts.parquet')
    assert (table.num_rows, table.column_names) == (len(lines) - 1, lines[0].split(','))


def test_a_bag_that_was_cut_is_replayed_up_to_there(capsys, tmp_path):
    whole = file_of(GOLDEN).read_bytes()
    cut = tmp_path / 'cut.mcap'
    cut.write_bytes(whole[:-200])
    status, text = run(capsys, cut, '--compare')
    assert status == 2 and 'equal within the tolerance' in text
    assert f'cut.mcap ends at byte {len(whole) - 200} without its index' in text.splitlines()[-1]
    assert cut.read_bytes() == whole[:-200]


def test_a_damaged_bag_says_where(capsys, tmp_path):
    data = bytearray(file_of(GOLDEN).read_bytes())
    data[len(data) // 2] ^= 0xFF
    (tmp_path / 'bad.mcap').write_bytes(data)
    status, text = run(capsys, tmp_path / 'bad.mcap')
    assert status == 2 and 'bad.mcap' in text


def test_empty_and_foreign_bags(capsys, tmp_path):
    BagWriter(tmp_path / 'foreign', [('/chatter', String, QoSProfile(depth=1))]).close()
    (tmp_path / 'empty.mcap').touch()
    for name, text in (('foreign', 'has no image and no contact of a tactile sensor in /tactile; '
                        "there are ['/chatter']"), ('empty.mcap', 'seems to be empty'),
                       ('none', 'there is no such bag')):
        status, said = run(capsys, tmp_path / name, '-o', tmp_path / 'out')
        assert status == 2 and text in said
        assert not (tmp_path / 'out').exists()


def copy_without(path, *names, more=(), namespace='tactile', cut=('', 0)):
    """
    Write a golden bag again without some topics, and with more messages (topic, message).

    Of the 50th message of a topic, a number of bytes may be left.
    """
    with Bag(GOLDEN) as bag, Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        kept = [topic for topic in bag.topics if topic.rpartition('/')[2] not in names]
        to = {topic: writer.add_connection(
            topic.replace('/tactile/', f'/{namespace}/'), bag.topics[topic],
            msgdef=definition(bag.topics[topic]).text,
            rihs01=definition(bag.topics[topic]).digest) for topic in kept}
        number = count()
        for row in bag.messages(kept):
            damaged = row.topic == cut[0] and next(number) == 50
            writer.write(to[row.topic], row.received_ns,
                         row.data[:cut[1]] if damaged else row.data)
        for topic, message in more:
            writer.write(to[topic], bag.span[1], packed(message))


def test_bags_are_compared_by_what_they_have_in_common(capsys, tmp_path):
    copy_without(tmp_path / 'left', 'surface_patch', namespace='left')
    status, text = run(capsys, GOLDEN, '--compare', tmp_path / 'left')
    assert status == 0 and '\ncontact ' in text
    assert 'left: compared are messages of /left, here of /tactile' in text
    assert 'left: has no surface_patch: not compared' in text
    made = 'contact', 'joint_trajectory', 'sensor_pose', 'servo_status', 'surface_patch'
    copy_without(tmp_path / 'images', *made)
    status, text = run(capsys, GOLDEN, '--compare', tmp_path / 'images')
    assert status == 1 and f'images: has no {", ".join(made)}: not compared' in text
    assert text.splitlines()[-1].startswith('nothing was compared')


@pytest.mark.parametrize('name, left, said', [
    ('contact', 2, 'equal within the tolerance'), ('contact', 20, 'equal within the tolerance'),
    ('sensor_pose', 2, 'they differ'),  # without a stamp, it is no partner of the replayed one
    ('sensor_pose', 20, 'equal within the tolerance')])
def test_a_damaged_message_is_a_fault_and_all_others_are_compared(
        capsys, tmp_path, name, left, said):
    """It ended the replay, and with it the comparison of all readable messages."""
    copy_without(tmp_path / 'bad', cut=(f'/tactile/{name}', left))
    status, text = run(capsys, tmp_path / 'bad', '--compare')
    assert status == 2 and 'joint_trajectory' in text
    *_, verdict, fault = text.splitlines()
    assert verdict == said
    assert f'the message on /tactile/{name} at' in fault and 'is damaged' in fault


def test_a_bag_of_before_replays_without_the_servo(capsys, tmp_path):
    copy_without(tmp_path / 'old', 'servo_calls', 'parameters')
    status, text = run(capsys, tmp_path / 'old', '--compare')
    assert status == 0, text
    assert 'estimator and shape alone are replayed' in text and 'the defaults hold' in text
    assert 'surface_patch' in text and 'joint_trajectory ' not in text
    status, text = run(capsys, tmp_path / 'old', '--set', 'edge_servo.rate=100')
    assert status == 2 and 'edge_servo is not replayed, the bag is without its calls' in text


def test_inputs_that_were_not_recorded_are_told(capsys, tmp_path):
    copy_without(tmp_path / 'deaf', 'joint_states')
    assert 'joint_states' in str(Bag(GOLDEN).topics)
    status, text = run(capsys, tmp_path / 'deaf', '--compare')
    assert status == 1 and 'joint_trajectory' in text
    assert ' of joint_states that the servo used were not recorded' in text


def test_a_goal_that_ends_later_than_it_was_recorded_goes_on(capsys, tmp_path):
    """As after lost inputs: the result was read, but the servo of the replay still tracks."""
    copy_without(tmp_path / 'late', more=[
        ('/tactile/servo_calls', ServoCalls(call=[Call.FINISH], time=[0.0], value=[0]))])
    status, text = run(capsys, tmp_path / 'late', '--compare')
    assert status == 0, text


def test_many_bags_fail_alone_and_are_not_done_again(capsys, tmp_path):
    many, out = tmp_path / 'many', tmp_path / 'many/out'
    many.mkdir()
    (many / 'broken.mcap').touch()
    (many / 'good.mcap').write_bytes(file_of(GOLDEN).read_bytes())

    def rows(*more):
        assert main([str(many), '-o', str(out), *more]) == 2
        return capsys.readouterr().out.splitlines()
    first = rows('--jobs', '2')
    assert [row[0] for row in first] == ['2', '0'] and 'empty' in first[0]
    assert 'done before' in rows()[1]
    (many / 'good.mcap').touch()
    assert 'joint_trajectory' in rows()[1]  # the bag may be another one
    slower = '--set', 'edge_servo.approach.speed=0.02', '--compare'
    assert rows(*slower)[1] == f'1  {many / "good.mcap"}  they differ'
    assert rows(*slower)[1] == f'1  {many / "good.mcap"}  done before'


def test_a_change_of_the_code_asks_for_another_replay(tmp_path, monkeypatch):
    """A recording was "done before" with any code of the same version."""
    source = tmp_path / 'some_law/__init__.py'
    source.parent.mkdir()
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(one, 'PACKAGES', ('some_law',))
    made = []
    for text in ('GAIN = 30', 'GAIN = 30', 'GAIN = 31'):
        source.write_text(text)
        one.digest_of_sources.cache_clear()
        made.append(one.made_of(GOLDEN, one.Options()))
    one.digest_of_sources.cache_clear()
    assert made[0] == made[1] != made[2]


def test_every_recording_in_a_folder_is_found_once_and_has_its_own_result(tmp_path):
    made = ('a/b_c/metadata.yaml', 'a/b_c/bag.mcap', 'a_b/c/metadata.yaml',
            'a_b/c/bag.mcap.zstd', 'killed/killed.mcap', 'speed_0.01.mcap', 'speed_0.02.db3',
            'out/a+b/bag/metadata.yaml')
    for name in made:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    bags = bags_in([str(tmp_path)], tmp_path / 'out')
    assert {str(bag.relative_to(tmp_path)) for bag in bags} == {
        'a/b_c', 'a_b/c', 'killed', 'speed_0.01.mcap', 'speed_0.02.db3'}
    assert bags_in([str(tmp_path / 'killed')], None) == [tmp_path / 'killed']
    assert bags_in([str(tmp_path / 'a')], None) == [tmp_path / 'a/b_c']
    names = {result_name(Path(bag)) for bag in (*bags, tmp_path / 'a+b_c', tmp_path / 'a%2Bb_c')}
    assert len(names) == 7 and not any('/' in name for name in names)
    with pytest.raises(ConfigurationError, match='name another folder'):
        bags_in([str(tmp_path)], tmp_path)


def test_a_folder_of_one_recording_is_one_of_many(capsys, tmp_path):
    shutil.copytree(GOLDEN, tmp_path / 'runs/noise')
    assert main([str(tmp_path / 'runs'), '-o', str(tmp_path / 'out')]) == 0
    assert capsys.readouterr().out.startswith('0  ')
    assert [path.name for path in tmp_path.glob('out/*/*.json')] == ['result.json']


def test_an_interrupt_ends_the_workers():
    begin = time.monotonic()
    with pytest.raises(KeyboardInterrupt), ExitStack() as stack:
        next(mapped(2, '', stack)(time.sleep, [0.0, 100.0, 100.0]))
        raise KeyboardInterrupt
    assert time.monotonic() - begin < 50.0


def test_many_bags_on_a_cluster(capsys, tmp_path, monkeypatch):
    """A client that computes at once stands for the cluster."""
    (tmp_path / 'broken.mcap').touch()

    class Client(nullcontext):
        def __enter__(self):
            return self

        def map(self, function, items, pure):
            assert not pure  # a repetition must read the files again
            return [SimpleNamespace(result=partial(function, item)) for item in items]
    monkeypatch.setitem(sys.modules, 'distributed', SimpleNamespace(Client=Client))
    assert main([str(tmp_path), '--dask', 'tcp://cluster:8786']) == 2
    assert capsys.readouterr().out.startswith('2  ')
    monkeypatch.setitem(sys.modules, 'distributed', None)
    status, text = run(capsys, tmp_path, '--dask', 'tcp://cluster:8786')
    assert status == 2 and 'pip install distributed' in text


def test_a_full_disk_leaves_what_there_is(tmp_path, monkeypatch):
    writer = BagWriter(tmp_path / 'bag', [('/text', String, QoSProfile(depth=1))])
    for k in range(50):
        writer.write('text', k * 100_000_000, serialize_message(String(data=f'{k}')))

    def full(*_):
        raise OSError(errno.ENOSPC, 'No space left on device')
    monkeypatch.setattr(writer._writer.storage, 'close_chunk', full)
    with pytest.raises(OSError, match='No space left'):
        writer.write('text', 100_000_000_000, b'')
    writer.abort()
    with Bag(tmp_path / 'bag') as bag:
        assert bag.count('/text') > 35


def test_distances_of_values():
    assert distance(math.nan, math.nan) == 0.0 and distance(1.0, math.nan) == math.inf
    assert distance(math.inf, math.inf) == 0.0 and distance('a', 'b') == math.inf
    assert distance(np.array([1.0, math.nan]), np.array([1.5, math.nan])) == 0.5
    assert distance(np.zeros(2), np.zeros(3)) == math.inf


def test_durations_are_compared_in_seconds():
    def window(nanoseconds):
        point = JointTrajectoryPoint(time_from_start=Duration(
            sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9))
        return unpacked(packed(JointTrajectory(points=[point])), JointTrajectory)
    for off, differs in (1, False), (3, True):
        (name, *values), = unequal(window(10**9 - 1), window(10**9 - 1 + off))
        assert name == 'points[0].time_from_start'
        assert (distance(*values) > TOLERANCES['joint_trajectory.points']) == differs


def test_a_message_of_one_side_alone_differs_between_others():
    def at(second):
        message = Pose()
        message.header.stamp.sec = second
        return packed(message)

    def compared(*recorded, topic='contour', replayed=(1, 2, 3, 4, 5)):
        comparison = Comparison({}, COMPARED, [])
        for second in recorded:  # equal bytes are not decoded, so no bag is needed
            comparison.take(topic, Recorded(topic, 0, at(second), None))
        for second in replayed:
            comparison.take(topic, at(second))
        return comparison
    assert compared(1, 2, 3, 4, 5).equal
    assert compared(2, 3, 4).equal  # it began later and ended sooner
    gap = compared(1, 2, 4, 5)
    assert not gap.equal and gap.topics['contour'].only == [0, 1]
    assert not compared().equal and 'nothing was compared' in compared().table()
    one = compared(2, 4, 6, 8, replayed=(1, 3, 4, 5, 7))  # of two recordings at the same time
    assert not one.equal and one.topics['contour'].only == [2, 3]
    other = compared(6, 7)
    assert not other.equal and 'nothing was compared' in other.table()
    other.topics['contact'] = compared(1, 2).topics['contour']
    assert not other.equal and 'they differ' in other.table()
    # The recorded node had no time for an image; a replay that has none is a difference.
    assert compared(1, 2, 4, 5, topic='contact').equal
    assert not compared(1, 2, 3, 4, 5, topic='contact', replayed=(1, 2, 4, 5)).equal
    # Then the contour, which is made of all contacts, is another one.
    skipped = compared(1, 2, 4, 5, topic='contact')
    skipped.topics |= gap.topics
    assert skipped.equal
