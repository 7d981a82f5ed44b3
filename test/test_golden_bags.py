"""Golden recordings, made by `tactile_tests.golden_bags`, replay to what they hold."""
from pathlib import Path

import pytest
from tactile_tests.golden_bags import CASES, make

from edge_tracking.replay.one import describe, Options, replay_one
from tactile_common.ros.bag_reader import Bag
from tactile_servo.motion import motion

FOLDER = Path(__file__).parent / 'golden'
SAME = Options(compare='')


@pytest.mark.parametrize('name', CASES)
def test_every_recording_replays_to_itself(name):
    result = replay_one(FOLDER / name, SAME, quiet=True)
    assert result.status == 0 and not result.notes, describe(result)
    assert result.counts['joint_trajectory'] > 100


def test_they_hold_what_they_are_named_for():
    with Bag(FOLDER / 'saturation') as bag:
        assert any(row.message.saturated for row in bag.messages(['/tactile/image']))
    states = {}
    for name in CASES:
        with Bag(FOLDER / name) as bag:
            states[name] = {row.message.state for row in bag.messages(['/tactile/servo_status'])}
    assert 3 in states['corner'] and 4 in states['lost_contact']
    assert 7 in states['drop_out'] and 7 in states['pause']
    assert sum(file.stat().st_size for file in FOLDER.rglob('*.*')) < 3e6


def test_a_change_of_one_constant_of_the_servo_is_found(monkeypatch):
    monkeypatch.setattr(motion, 'COAST', 1.01 * motion.COAST)
    result = replay_one(FOLDER / 'noise', SAME, quiet=True)
    assert result.status == 1 and 'joint_trajectory at 1.' in result.table


def test_the_script_makes_them_again(tmp_path):
    """On other processors a closed loop returns to its commands what they differ by."""
    make('saturation', tmp_path / 'bag')
    result = replay_one(tmp_path / 'bag', Options(
        compare=str(FOLDER / 'saturation'), tolerances={'joint_trajectory.points': 1e-6}),
        quiet=True)
    assert result.status == 0, describe(result)


def test_a_change_of_one_parameter_is_found():
    changed = Options(compare='', changes=(
        'edge_servo.approach.speed=0.0101',))
    assert replay_one(FOLDER / 'noise', changed, quiet=True).status == 1
