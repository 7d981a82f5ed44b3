"""The servo in a closed loop, and where input, robot or scene fail it."""

from dataclasses import replace
import re

import numpy as np
from puma_loop import GOAL, LIMITS, PUMA, puma_loop, ROOT, steady, tracked
import pytest

from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import Contact, ContactType, Reason
from tactile_sensing.types.image import Layer, TactileImage
from tactile_sensing.types.moments import Moments
from tactile_servo.motion.limits import WorkspaceBox
from tactile_servo.phases import Phase
from tactile_servo.reasons import Reason as ServoReason
from tactile_servo.reasons import ReasonCode, Refused
from tactile_servo.types import EdgeGoal, State
from tactile_simulation.scene import load_scene


def along(loop):
    """Where the pad stands along the edge [m]."""
    return float(loop.scene.edge.nearest(loop.pose[None, :3, 3])[1][0])


def held(loop, code):
    """Whether the servo holds, and for that reason."""
    return (loop.servo.state, loop.servo.reason.code) == (State.HOLD, code)


def moved(loop, seconds):
    """Way of the sensor over the next seconds [m]."""
    before = loop.pose[:3, 3]
    loop.run(None, seconds)
    return float(np.linalg.norm(loop.pose[:3, 3] - before))


@pytest.fixture
def loop():
    return puma_loop()


def test_straight_edge_is_tracked_within_the_bars(loop):
    status = loop.run(EdgeGoal(0.03, 5.0), 20.0)
    assert status.state == State.DONE and loop.servo.success
    lateral, force = tracked(loop)
    assert np.sqrt(np.mean(lateral**2)) <= 0.05e-3 and np.abs(lateral).max() <= 0.3e-3
    assert np.sqrt(np.mean((force - 5.0)**2)) <= 0.05 * 5.0
    assert status.progress > 0.16
    assert loop.robot.limit_violations == 0


@pytest.mark.parametrize('scene, speed, rms, largest', [
    ('two_segments', 0.026, 0.4e-3, 2.0e-3),
    pytest.param('curve', 0.023, 0.45e-3, 0.6e-3, marks=pytest.mark.long)])
def test_corner_and_curve_are_held_as_well_as_by_the_thesis(scene, speed, rms, largest):
    loop = puma_loop(scene)
    loop.run(EdgeGoal(speed, 5.0, length=0.11), 20.0)
    assert loop.servo.success, loop.servo.reason
    lateral, force = tracked(loop)
    assert np.sqrt(np.mean(lateral**2)) <= rms and np.abs(lateral).max() <= largest
    assert max(force) <= 7.5


def test_states_run_in_order_and_the_contour_lies_on_the_edge(loop):
    status = loop.run(GOAL, 20.0)
    states = [row.status.state for row in loop.log if row.status.state != State.IDLE]
    order = [s for k, s in enumerate(states) if k == 0 or s != states[k - 1]]
    assert order == [State.APPROACH, State.TRACK, State.RETREAT, State.DONE]
    assert status.reason == (ReasonCode.LENGTH_REACHED, '') and loop.servo.success
    contour = np.array([pose[:3, 3] for _, pose in loop.servo.statistics.contour])
    lateral, _ = loop.scene.edge.nearest(contour)
    assert np.abs(lateral[10:]).max() < 0.1e-3 and len(contour) > 45
    loop.run(None, 0.2)
    assert loop.log[-1].force == 0.0 and not loop.servo.active  # lifted off


def test_direction_can_be_reversed(loop):
    loop.run(GOAL, 20.0)
    loop.servo.finish()
    start = along(loop)
    loop.run(EdgeGoal(0.03, 5.0, direction=-1, length=0.03), 20.0)
    assert loop.servo.success
    assert along(loop) == pytest.approx(start - 0.03, abs=0.01)


def test_too_much_load_in_a_hold_lifts_off_once_it_is_known():
    loop = steady()
    loop.sensor_alive = False
    loop.run(None, 0.2)
    assert loop.servo.state == State.HOLD
    stamp = round(loop.now * 1e9)
    loop.servo.see_contact(Contact(
        ContactType.LINE, True, Reason(0), 'fit', force_valid=True, x=0.0, y=0.0, yaw=0.0,
        normal_force=100.0), stamp, loop.now)
    status, _ = loop.servo.cycle(loop.now + 0.0025, stamp + 2_500_000)
    assert status.state == State.RETREAT and status.reason.code == ReasonCode.OVERLOAD


@pytest.mark.parametrize('tracker', ['resolved_rate', 'trace'])
@pytest.mark.parametrize('force', [1.0, 8.0])
def test_any_force_is_met_without_overshoot(tracker, force):
    loop = puma_loop(tracker=tracker, latency=0.01)
    loop.run(EdgeGoal(0.05, force, length=0.02), 20.0)
    assert loop.servo.success, loop.servo.reason
    assert max(cycle.force for cycle in loop.log) < 1.5 * force


def test_saturated_tactels_are_given_way_to():
    """At a gap the load crowds on half the pad: what saturates hides how much it is."""
    loop = puma_loop('gap', 'trace', latency=0.01)
    loop.run(EdgeGoal(0.05, 8.0, length=0.12), 20.0)
    assert loop.servo.success, loop.servo.reason
    assert max(cycle.force for cycle in loop.log) < 12.0


def test_reason_of_the_end_outlives_a_hold_on_the_way_up(loop):
    loop.run(GOAL, 20.0, lambda s: s.state == State.RETREAT)
    loop.robot_alive = False
    status = loop.run(None, 0.2)
    assert status.state == State.HOLD
    assert status.reason.code == ReasonCode.STALE_JOINT_STATE
    loop.robot_alive = True
    status = loop.run(None, 5.0)
    assert (status.state, status.reason.code) == (State.DONE, ReasonCode.LENGTH_REACHED)
    assert loop.servo.success


def test_a_pad_that_presses_already_goes_on_from_there(loop):
    loop.run(replace(GOAL, force=6.0, length=0.01, retreat=False), 20.0)
    assert loop.servo.success
    loop.servo.finish()
    status = loop.run(GOAL, 20.0)
    assert loop.servo.success, status.reason


@pytest.mark.parametrize('offset_ns', [-200_000_000, 200_000_000])
def test_stamps_off_by_more_than_their_bound_hold(offset_ns):
    loop = steady()
    see = loop.servo.see_contact
    loop.servo.see_contact = lambda contact, stamp, now: see(contact, stamp + offset_ns, now)
    loop.run(None, 0.1)
    assert loop.servo.state == State.HOLD


def test_a_pause_during_a_search_ends_with_a_reason():
    loop = steady(tracker='trace')
    loop.servo.run.phase = Phase.SEARCH  # what a late picture makes of it
    loop.servo.pause(True, loop.now)
    loop.run(None, 0.3)
    loop.servo.pause(False, loop.now)
    told = [loop.step() for _ in range(5)]
    assert told[-1].state == State.TRACK
    assert all(status.reason.text for status in told)


def test_nothing_to_touch_gives_up_within_the_approach_distance(loop):
    loop.world.counts = lambda pose, rng, now, real=loop.world.counts: real(None, rng)
    loop.run(GOAL, 20.0)
    assert not loop.servo.success and loop.servo.reason.code == ReasonCode.NO_CONTACT
    deepest = min(row.pose[2, 3] for row in loop.log)
    assert loop.log[0].pose[2, 3] - deepest < 0.032


def press(force, kind=ContactType.OTHER, elongated=True):
    spread = 260e-6 / 5.0 * force
    moments = Moments(force, 0.0, 0.0, 25e-6 / 5 * force if elongated else spread, spread, 0.0)
    return Contact(kind, False, Reason.BAD_FIT, 'fit', moments=moments)


def test_a_flat_under_the_pad_is_not_pressed_on(loop):
    loop.estimate = lambda _: press(6.0 if loop.pose[2, 3] < loop.scene.edge.points[0, 2] else 0.0,
                                       elongated=False)
    loop.run(GOAL, 20.0)
    assert not loop.servo.success and loop.servo.reason.code == ReasonCode.NO_EDGE
    assert 'elongation' in loop.servo.reason.text


def test_lost_edge_with_contact_held_never_presses():
    loop = steady()
    depth = loop.pose[2, 3]
    loop.estimate = lambda _: press(1.0, elongated=False)  # light, and no edge
    loop.run(None, 0.5)
    assert held(loop, ReasonCode.EDGE_LOST) and 'elongation' in loop.servo.reason.text
    loop.run(None, 2.0)
    assert depth - min(row.pose[2, 3] for row in loop.log) < 0.2e-3


def test_force_that_does_not_rise_is_not_chased_beyond_the_press_depth():
    loop = steady()
    depth = loop.pose[2, 3]
    loop.estimate = lambda _: press(1.0)  # an edge, whose force stays low
    loop.servo.see_image = lambda *_: None
    loop.run(None, 3.0)
    assert not loop.servo.success and loop.servo.reason.code == ReasonCode.TOO_DEEP
    assert depth - min(row.pose[2, 3] for row in loop.log) < 3.5e-3


def test_untared_sensor_holds():
    loop = steady()
    real = loop.estimate
    loop.estimate = lambda image: replace(real(image), reasons=Reason.NOT_TARED)
    loop.run(None, 0.2)
    assert held(loop, ReasonCode.NOT_TARED)
    assert moved(loop, 0.3) < 1e-4


def test_overload_lifts_off():
    loop = steady()
    loop.estimate = lambda _: press(20.0)
    status = loop.run(None, 3.0)
    assert status.state == State.DONE and status.reason.code == ReasonCode.OVERLOAD
    assert loop.log[-1].force == 0.0 and not loop.servo.success


def test_workspace_box_is_not_left():
    start = load_scene(ROOT / 'launch/scenes/straight.yaml').start_pose()[:3, 3]
    wall = start[1] + 0.03
    loop = puma_loop(workspace=WorkspaceBox(start - [0.1, 0.1, 0.1], [1.0, wall, 1.0]))
    loop.run(EdgeGoal(0.05, 5.0), 5.0)
    assert any(row.status.limited_by == 'workspace' for row in loop.log)
    assert loop.servo.reason == (ReasonCode.MOTION_BLOCKED, 'workspace')
    reach = max(row.pose[1, 3] for row in loop.log)
    assert wall - 0.005 < reach <= wall + 1e-5


def test_joint_states_far_beyond_the_limits_or_no_numbers_are_refused(loop):
    positions = loop.limits.upper.copy()
    loop.servo.see_joints(positions + 0.1, 0, 0.0)
    positions[2] = 1e300
    with pytest.raises(ValueError, match='joint_3 at 1e.300.*beyond its limits'):
        loop.servo.see_joints(positions, 0, 0.0)
    for wrong in (np.full(6, np.nan), np.zeros(5)):
        with pytest.raises(ValueError, match='joint state'):
            loop.servo.see_joints(wrong, 0, 0.0)


@pytest.mark.parametrize('goal, text', [
    (EdgeGoal(0.0, 5.0), 'speed'), (EdgeGoal(5.0, 5.0), 'speed'),
    (EdgeGoal(float('nan'), 5.0), 'speed'), (EdgeGoal(0.03, -1.0), 'force'),
    (EdgeGoal(0.03, 50.0), 'force'), (EdgeGoal(0.03, 0.1), '0.1, must be'),
    (EdgeGoal(0.03, 5.0, length=-1.0), 'length'), (EdgeGoal(0.03, 5.0, direction=2), 'direction')])
def test_bad_goals_are_refused_by_name_and_bound(goal, text, loop):
    with pytest.raises(Refused, match='no joint state') as refused:
        loop.servo.start(GOAL, 0.0)
    assert refused.value.reason.code == ReasonCode.NO_JOINT_STATE
    loop.run(None, 0.01)
    with pytest.raises(Refused, match=text) as refused:
        loop.servo.start(goal, loop.now)
    assert refused.value.reason.code == ReasonCode.INVALID_GOAL


def test_second_goal_is_refused_while_one_is_active():
    assert steady().servo.check(GOAL).code == ReasonCode.BUSY


def test_an_arm_that_starts_at_a_joint_limit_says_so():
    """Three joints of a PUMA 260 lift the pad; all at their limits, nothing can take over."""
    start = puma_loop().robot.step(0.0)[0]
    held = np.isin(np.arange(6), [1, 2, 4])
    limits = replace(LIMITS, lower=np.where(held, start - 1e-9, LIMITS.lower),
                     upper=np.where(held, start + 1e-9, LIMITS.upper))
    for retreat in (False, True):
        loop = puma_loop(robot=(PUMA, limits))
        status = loop.run(replace(GOAL, retreat=retreat), 10.0)
        assert status.state == State.DONE and not loop.servo.success
        assert status.reason.code == ReasonCode.MOTION_BLOCKED
        assert re.match(r'joint_[235] is at its (lower|upper) limit, -?\d', status.reason.detail)
        assert 1.0 <= loop.now - 1.0 <= 1.4 + retreat  # the retreat is blocked as well


def test_dead_sensor_holds_within_150_ms_and_resumes_on_command():
    loop = steady()
    loop.sensor_alive = False
    died = loop.now
    loop.run(None, 0.15)
    assert held(loop, ReasonCode.STALE_IMAGE)
    assert loop.now - died == pytest.approx(0.15, abs=0.01)
    assert moved(loop, 0.3) < 1e-4
    loop.run(None, 2.0)
    assert loop.log[-1].force == 0.0  # it has lifted off
    loop.sensor_alive = True
    assert moved(loop, 0.3) < 1e-4  # after a long hold nothing moves unasked
    assert held(loop, ReasonCode.INPUT_BACK) and 'resume' in loop.servo.reason.detail
    assert loop.servo.pause(False, loop.now)
    loop.run(None, 5.0)
    assert loop.servo.success


@pytest.mark.parametrize('change, word', [
    ({'unit': 'counts'}, 'no pressure in Pa'), ({'component': 'xz'}, 'no pressure in Pa'),
    ({'depth': 0.0}, '`depth`')])
def test_a_sensor_that_cannot_say_its_force_is_refused_before_anything_moves(change, word):
    """By its counts the pad would be pressed until the approach has gone as far as it may."""
    loop = puma_loop(tracker='trace')
    loop.run(None, 0.1)
    inputs = loop.servo.inputs
    inputs.sensor = replace(inputs.sensor, layers=tuple(
        replace(layer, **change) for layer in inputs.sensor.layers))
    with pytest.raises(Refused, match=re.escape(word)) as refused:
        loop.servo.start(GOAL, loop.now)
    assert refused.value.reason.code is ReasonCode.UNSUPPORTED_GOAL


def test_of_two_depths_the_first_says_the_load(loop):
    loop.run(None, 0.1)
    stress = np.full(loop.array.shape, 7750.0)
    loads = []
    for depths in ((0.002,), (0.002, 0.004)):
        layers = tuple(Layer('zz', depth, stress) for depth in depths)
        loop.servo.see_image(TactileImage(0, 0, layers, loop.array, True), loop.now)
        loads.append(loop.servo.inputs.load)
    assert loads[0] == loads[1] > 1.0


def test_an_image_of_another_array_is_named_although_contacts_come(loop):
    loop.run(None, 0.1)
    servo, other = loop.servo, TactelArray(8, 8, 0.003, 0.003)
    image = TactileImage(round(1e9 * loop.now), 0, (Layer('zz', 0.002, np.zeros((8, 8))),), other,
                         True)
    with pytest.raises(Refused):
        servo.see_image(image, loop.now)
    servo.see_contact(loop.estimate(image), image.stamp_ns, loop.now)
    servo.inputs.refresh(loop.now + 1.0, round(1e9 * (loop.now + 1.0)))
    assert '8 x 8 tactels' in servo.inputs.contact_missing(images=True).text


@pytest.mark.parametrize('rate', [400.0, 100.0])  # of the simulated time
def test_a_silent_client_is_missed_in_real_time(rate):
    loop = puma_loop()
    loop._faults.client_lives = lambda _: False
    cycle = loop.servo.cycle
    loop.servo.cycle = lambda now, _: cycle(now, round(1e9 * int(now * rate + 1e-6) / rate))
    loop.run(EdgeGoal(0.005, 5.0, client_timeout=1.0), 8.0)
    assert loop.servo.reason.code is ReasonCode.CLIENT_LOST
    assert loop.now - loop._began < 1.5


@pytest.mark.parametrize('tracker', ['resolved_rate', 'trace'])
def test_the_contour_is_where_the_pad_was_at_its_images(tracker):
    loop = puma_loop(tracker=tracker, latency=0.02)
    loop.run(EdgeGoal(0.1, 5.0, length=0.08), 8.0)
    assert loop.servo.success
    poses = {round(1e9 * cycle.time): cycle.pose for cycle in loop.log}
    stamps = np.array(list(poses))
    for stamp, pose in loop.servo.statistics.contour:
        there = poses[int(stamps[np.abs(stamps - stamp).argmin()])]
        assert abs(there[:3, 1] @ (there[:3, 3] - pose[:3, 3])) < 0.4e-3  # 100 mm/s in 2.5 ms


def test_a_pad_that_is_halted_does_not_search():
    loop = steady(tracker='trace')
    law = loop.servo.law
    law.halt()
    law.lacks = lambda now: ServoReason(ReasonCode.EDGE_LOST)
    loop.run(None, 0.2)
    assert loop.servo.state is State.SEARCH and moved(loop, 0.3) < 1e-4
