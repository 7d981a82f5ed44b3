"""Whatever is interrupted, and however it comes back: nothing jumps, nothing presses."""

from dataclasses import replace

import numpy as np
from puma_loop import GOAL, LIMITS, puma_loop, ROOT, steady
import pytest

from tactile_sensing.types.contact import Reason as ContactReason
from tactile_servo.config import ServoConfig
from tactile_servo.reasons import Reason, ReasonCode
from tactile_servo.types import EdgeGoal, State
from tactile_simulation.closed_loop import Simulation
from tactile_simulation.edge_path import lifted, walk
from tactile_simulation.edge_world import EdgeScene
from tactile_simulation.scene import load_scene

NEAR = 2e-3  # m, of where the pad was when it all began
HARDEST = 2.0  # times the limit of acceleration, between samples of the controller
LIFT = 0.01  # m, off what was tracked, in a hold that lasts
SHORT = 0.5  # s, of an interruption that a hold may end by itself


class Interrupted:
    """A loop on its way, whose parts can be interrupted, and what came of it."""

    def __init__(self, tracker, state, seed, goal=GOAL, **options):
        self.loop = steady(goal, tracker, state, seed=seed, **options)
        self.loop.run(None, 0.05 + 0.01 * seed)
        assert self.loop.servo.state == state
        self.began, self.place = self.loop.now, self.loop.pose[:3, 3].copy()
        self.seen = len(self.loop.log)

    def controller(self, seconds):
        """It is deactivated, and activated again."""
        self.loop.robot.activate(False)
        self.began = self.loop.now + 0.03  # it stops at once, however hard that is
        self.loop.run(None, seconds)
        self.loop.robot.activate(True)

    def deaf(self, seconds):
        """It plays the last window out and takes no other; then it takes the last it was sent."""
        robot, accept, last = self.loop.robot, self.loop.robot.accept, []
        robot.accept = lambda window, _: last.append(window)
        self.loop.run(None, seconds)
        robot.accept = accept
        try:
            robot.accept(last[-1], self.loop.now)
        except ValueError:  # it is over by its stamp
            pass

    def servo(self, seconds):
        """It does not come to run, and what it should have heard is lost."""
        loop = self.loop
        cycle, see = loop.servo.cycle, (loop.servo.see_joints, loop.servo.see_image,
                                        loop.servo.see_contact)
        status = loop.log[-1].status
        loop.servo.cycle = lambda *_: (status, None)
        loop.servo.see_joints = loop.servo.see_image = loop.servo.see_contact = lambda *_: None
        loop.run(None, seconds)
        loop.servo.cycle = cycle
        loop.servo.see_joints, loop.servo.see_image, loop.servo.see_contact = see

    def sensing(self, seconds):
        """No picture comes."""
        self.loop.sensor_alive = False
        self.loop.run(None, seconds)
        self.loop.sensor_alive = True

    def joints(self, seconds):
        """No joint state comes."""
        self.loop.robot_alive = False
        self.loop.run(None, seconds)
        self.loop.robot_alive = True

    def reasons(self):
        """Codes of the holds since it was interrupted."""
        return {cycle.status.reason.code for cycle in self.loop.log[self.seen:]
                if cycle.status.state == State.HOLD}

    def check(self):
        """Velocity and acceleration of what the controller commanded; the true force."""
        times, commands = zip(*self.loop.commands, strict=True)
        since = np.searchsorted(times, self.began - 0.02)
        speed = np.diff(np.array(commands[since:]), axis=0) / np.diff(times[since:])[:, None]
        hardness = np.diff(speed, axis=0) / np.diff(times[since + 1:])[:, None]
        assert (np.abs(speed) <= LIMITS.velocity).all()
        assert np.abs(hardness).max() <= HARDEST * LIMITS.acceleration.max()
        assert max(cycle.force for cycle in self.loop.log[self.seen:]) <= 1.5 * GOAL.force


@pytest.fixture
def it():
    """Give a loop that traces the edge."""
    return Interrupted('trace', State.TRACK, 0)


WHY = {'controller': ReasonCode.NOT_FOLLOWING, 'deaf': ReasonCode.NOT_FOLLOWING,
       'servo': ReasonCode.STALLED, 'sensing': ReasonCode.STALE_IMAGE,
       'joints': ReasonCode.STALE_JOINT_STATE}


def interrupted(tracker, state, what, seconds, seed=0):
    """Interrupt something; ask to go on if need be; see that all went well to the end."""
    it = Interrupted(tracker, state, seed)
    getattr(it, what)(seconds)
    it.loop.run(None, 0.3)
    assert WHY[what] in it.reasons()
    holds = [cycle.time for cycle in it.loop.log[it.seen:] if cycle.status.state == State.HOLD]
    assert what != 'sensing' or min(holds) - it.began <= 0.15
    it.check()
    asked = what in ('controller', 'deaf') or seconds > SHORT
    if asked:  # by then it stands, and goes on standing
        it.loop.run(None, 1.5, lambda s: s.reason.code == ReasonCode.INPUT_BACK)
        moved = it.loop.pose[:3, 3] - it.place
        lifted = what == 'sensing' and state == State.TRACK
        assert np.linalg.norm(moved[:2]) <= NEAR and abs(moved[2] - LIFT * lifted) <= NEAR
        assert not lifted or it.loop.log[-1].force == 0.0
        assert it.loop.servo.state == State.HOLD
        assert it.loop.servo.reason.code == ReasonCode.INPUT_BACK
        assert it.loop.servo.pause(False, it.loop.now)
    it.loop.run(None, 20.0)
    assert it.loop.servo.success, it.loop.servo.reason
    it.check()
    truth = it.loop.truth()
    assert tracker != 'trace' or np.abs(truth.lateral[truth.tracking][-400:]).max() < 0.05e-3


LONG = [('controller', 0.8), ('deaf', 2.0), ('servo', 1.0), ('sensing', 1.0), ('joints', 1.0)]
BRIEF = [('servo', 0.06), ('sensing', 0.2)]
RARE = [*((State.TRACK, *it) for it in (('controller', 0.2), ('deaf', 0.2), ('servo', 0.3))),
        *((State.APPROACH, *it) for it in LONG[1:])]


@pytest.mark.parametrize('state, what, seconds', [
    *((State.TRACK, *it) for it in LONG + BRIEF), (State.APPROACH, *LONG[0]),
    *(pytest.param(*it, marks=pytest.mark.long) for it in RARE)])
def test_an_interruption_is_told_and_moves_nothing(state, what, seconds):
    interrupted('trace', state, what, seconds)


@pytest.mark.parametrize('speed, pause', [(0.2, 0.045), *(
    pytest.param(*it, marks=pytest.mark.long) for it in ((0.1, 0.045), (0.2, 0.035)))])
def test_a_robot_is_not_blamed_for_a_pause_of_the_servo(speed, pause):
    """Its last window took it on: it was 2.1 to 3.6 mm from the way, and had to be asked."""
    it = Interrupted('trace', State.TRACK, 0, EdgeGoal(speed, 5.0, length=0.1))
    it.servo(pause)
    it.loop.run(None, 20.0)
    assert not it.reasons() and it.loop.servo.success, it.loop.servo.reason
    it.check()


@pytest.mark.parametrize('what, seconds', [
    ('sensing', 1.0), *(pytest.param(*it, marks=pytest.mark.long) for it in (
        ('controller', 0.4), ('servo', 1.0), ('joints', 1.0)))])
def test_the_law_of_the_thesis_is_interrupted_likewise(what, seconds):
    interrupted('resolved_rate', State.TRACK, what, seconds, seed=1)


def blinded(state, goal, seconds):
    """Interrupt the pictures; when they come back the edge is not seen any more."""
    it = Interrupted('trace', state, 0, goal)
    it.loop.sensor_alive = False
    it.loop.run(None, 0.1)
    assert it.loop.servo.reason.code == ReasonCode.STALE_IMAGE
    law = it.loop.servo.law
    lacks, law.lacks = law.lacks, lambda _: Reason(ReasonCode.EDGE_LOST)
    it.loop.run(None, seconds - 0.1)
    it.loop.sensor_alive = True
    it.loop.run(None, 0.5)
    it.unseen, law.lacks = it.loop.servo.reason, lacks
    return it


def test_a_short_hold_amid_a_search_needs_no_sight_of_the_edge_to_end():
    it = blinded(State.SEARCH, EdgeGoal(0.03, 5.0, direction=-1), 0.2)
    assert it.loop.servo.state != State.HOLD
    it.loop.run(None, 20.0)
    assert it.loop.servo.reason.code == ReasonCode.EDGE_ENDED, it.loop.servo.reason
    it.check()


@pytest.mark.parametrize('speed', [pytest.param(0.03, marks=pytest.mark.long), 0.1])
def test_interruptions_beyond_the_end_do_not_count_as_tracked(speed):
    goal, lengths = EdgeGoal(speed, 5.0, direction=-1), []
    for breaks in (0, 3):
        loop = steady(goal, 'trace', State.SEARCH, seed=0)
        for _ in range(breaks):
            loop.run(None, 0.05)
            loop.sensor_alive = False
            loop.run(None, 0.2)
            assert loop.servo.reason.code == ReasonCode.STALE_IMAGE
            loop.sensor_alive = True
            loop.run(None, 0.1)
        loop.run(None, 20.0)
        assert loop.servo.reason.code == ReasonCode.EDGE_ENDED
        lengths.append(loop.servo.statistics.tracked_length)
    assert lengths[1] == pytest.approx(lengths[0], abs=1e-3)


def test_a_probe_beyond_the_end_goes_no_deeper_for_being_interrupted_again_and_again():
    it = Interrupted('trace', State.SEARCH, 0, EdgeGoal(0.03, 5.0, direction=-1))
    loop = it.loop
    loop.run(None, 5.0, lambda s: s.normal_force < 0.5)  # then it goes down for a step
    for _ in range(10):
        loop.run(None, 0.1)
        it.sensing(0.1)
        loop.run(None, 0.3, lambda s: s.state != State.HOLD)
    loop.run(None, 20.0)
    assert loop.servo.reason.code == ReasonCode.EDGE_ENDED, loop.servo.reason


def test_a_hold_after_which_the_edge_is_not_seen_says_so_and_waits_to_be_asked():
    it = blinded(State.TRACK, GOAL, 0.2)
    assert (it.loop.servo.state, it.unseen.code) == (State.HOLD, ReasonCode.EDGE_LOST)
    it.loop.run(None, 1.5)
    assert it.loop.servo.reason.code == ReasonCode.INPUT_BACK
    assert it.loop.servo.pause(False, it.loop.now)
    it.loop.run(None, 20.0)
    assert it.loop.servo.success, it.loop.servo.reason
    it.check()


def test_who_asks_while_the_pad_lifts_off_in_a_hold_need_not_ask_again(it):
    it.sensing(1.0)
    it.loop.run(None, 0.1)
    assert it.loop.log[-1].force == 0.0 and it.loop.servo.state == State.HOLD
    assert it.loop.servo.pause(False, it.loop.now).code == ReasonCode.RESUMED
    reasons = set()
    it.loop.run(None, 20.0, lambda s: reasons.add(s.reason.text))
    assert it.loop.servo.success, it.loop.servo.reason
    assert not [text for text in reasons if text.count('held:') > 1]  # one cause, once
    it.check()


def test_a_pad_that_is_lifting_off_in_a_hold_stands_still_when_asked_to(it):
    it.loop.sensor_alive = False
    it.loop.run(None, 1.0)
    there = it.loop.pose[2, 3]
    assert 0.2 * LIFT < there - it.place[2] < 0.8 * LIFT
    it.loop.servo.pause(True, it.loop.now)
    it.loop.run(None, 2.0)
    assert it.loop.pose[2, 3] - there < 0.1 * LIFT
    it.loop.sensor_alive = True
    it.loop.run(None, 0.1)
    it.loop.servo.pause(False, it.loop.now)
    it.loop.run(None, 20.0)
    assert it.loop.servo.reason.code == ReasonCode.LENGTH_REACHED, it.loop.servo.reason
    it.check()


def test_a_robot_that_falls_silent_as_it_lifts_off_in_a_hold_goes_on_lifting(it):
    it.loop.sensor_alive = False
    it.loop.run(None, 1.0)
    it.joints(0.2)
    it.loop.run(None, 1.5)
    assert it.loop.log[-1].force == 0.0
    assert it.loop.pose[2, 3] - it.place[2] == pytest.approx(LIFT, abs=NEAR)
    it.check()


def test_a_robot_that_was_not_heard_of_for_long_is_not_even_lifted_off_unasked():
    it = Interrupted('trace', State.TRACK, 0, replace(GOAL, retreat=True),
                     config=ServoConfig(give_up=2.0))
    it.joints(1.0)
    there = it.loop.pose.copy()
    it.loop.run(None, 3.0)
    assert it.loop.servo.reason.code == ReasonCode.GAVE_UP, it.loop.servo.reason
    assert np.abs(it.loop.pose - there).max() < 1e-6


def paused():
    """Loop that was paused while it tracked, and stands."""
    it = Interrupted('trace', State.TRACK, 0)
    it.loop.servo.pause(True, it.loop.now)
    it.loop.run(None, 0.5)
    return it


def test_nothing_is_sent_while_the_robot_stands():
    it = paused()
    known = len(it.loop.commands)
    accepted, accept = [], it.loop.robot.accept
    it.loop.robot.accept = lambda window, now: (accepted.append(now), accept(window, now))
    it.loop.run(None, 2.0)
    assert not accepted
    assert np.ptp([command for _, command in it.loop.commands[known:]], axis=0).max() == 0.0


@pytest.mark.parametrize('way', [0.002, 0.05])
def test_an_arm_that_was_moved_meanwhile_goes_on_from_there(way):
    """By hand or by another controller, which has commanded it there."""
    it = paused()
    loop, robot = it.loop, it.loop.robot
    pose = loop.pose.copy()
    pose[2, 3] += way  # off the edge
    there = loop.model.inverse(pose, robot.measured(loop.now)[0])
    robot._restart(there)
    loop.run(None, 0.3)
    assert loop.servo.state == State.HOLD
    it.began, it.place = loop.now, loop.pose[:3, 3].copy()
    loop.servo.pause(False, loop.now)
    loop.run(None, 0.1)
    assert np.linalg.norm(loop.pose[:3, 3] - it.place) < 1e-4
    loop.run(None, 1.0)
    it.check()


def test_a_robot_that_answers_too_late_is_refused():
    scene = load_scene(ROOT / 'launch/scenes/straight.yaml')
    scene = replace(scene, plant=replace(scene.plant, dead_time=0.08))
    loop = Simulation(scene, 'trace', config=ServoConfig(give_up=1.0))
    loop.run(GOAL, 20.0)
    assert not loop.servo.success
    assert loop.servo.reason.code == ReasonCode.GAVE_UP
    assert 'does not follow' in loop.servo.reason.text
    assert max(cycle.force for cycle in loop.log) == 0.0


def test_joint_states_that_cannot_be_believed_are_named():
    loop = Interrupted('trace', State.TRACK, 0).loop
    see = loop.servo.see_joints
    loop.servo.see_joints = lambda positions, *when: see(np.nan * positions, *when)
    loop.run(None, 0.2)
    assert loop.servo.state is State.HOLD
    assert loop.servo.reason.code is ReasonCode.STALE_JOINT_STATE
    assert 'is not 6 angles' in loop.servo.reason.text


def test_time_that_stands_holds_and_is_not_taken_up_unasked(it):
    loop, cycle = it.loop, it.loop.servo.cycle
    stood = round(loop.now * 1e9)
    loop.servo.cycle = lambda now, _: cycle(now, stood)
    loop.run(None, 0.2)
    assert ReasonCode.CLOCK_STOPPED in it.reasons()
    loop.servo.cycle = cycle
    loop.run(None, 1.0)
    assert (loop.servo.state, loop.servo.reason.code) == (State.HOLD, ReasonCode.INPUT_BACK)
    assert 'time stopped' in loop.servo.reason.detail
    loop.servo.pause(False, loop.now)
    loop.run(None, 20.0)
    assert loop.servo.success
    it.check()


def test_a_stamp_clock_that_stood_before_the_goal_is_no_clock_that_differs():
    loop = puma_loop()
    for _ in range(40):
        loop.step()
    cycle, stands = loop.servo.cycle, round(loop.now * 1e9)
    loop.servo.cycle = lambda now, now_ns: cycle(now, stands)
    for _ in range(8):
        loop.step()
    loop.servo.cycle = cycle
    sent, accept = [], loop.robot.accept
    loop.robot.accept = lambda window, now: (sent.append(window.stamp_ns), accept(window, now))
    loop.run(GOAL, 20.0)
    assert loop.servo.success and len(sent) > 10 and all(sent)


def test_what_is_wrong_around_the_servo_holds_and_refuses(it):
    loop, why = it.loop, (ReasonCode.SEVERAL_PUBLISHERS, '/tactile/image has 2')
    loop.servo.around = why = type(loop.servo.reason)(*why)
    loop.run(None, 0.3)
    assert loop.servo.reason == why
    loop.servo.around = None
    loop.run(None, 1.0)
    assert loop.servo.state == State.HOLD
    loop.servo.cancel()
    loop.run(None, 1.0)
    loop.servo.finish()
    loop.servo.around = why
    assert loop.servo.check(GOAL) == why


def test_a_contour_that_does_not_close_ends(monkeypatch):
    monkeypatch.setattr('tactile_servo.edge_map.traced_path.CLOSING', -1.0)
    plan = walk((0.0, 0.0), 0.0, [(0.025, 0.0), *[(0.0, 0.5 * np.pi), (0.05, 0.0)] * 3,
                                  (0.0, 0.5 * np.pi), (0.025, 0.0)])
    loop = Simulation(EdgeScene('square', '', lifted(plan, 0.0)), 'trace')
    status = loop.run(EdgeGoal(0.1, 5.0, closed=True), 60.0)
    assert not loop.servo.success and loop.servo.reason.code == ReasonCode.LAP_LIMIT
    assert status.progress < 0.2 + 0.02  # one lap, and little more


@pytest.mark.parametrize('state', [State.APPROACH, State.TRACK, State.RETREAT])
def test_no_state_lasts_for_ever(state, monkeypatch):
    """A robot whose every wanted motion is held back, by so little that it counts as moving."""
    monkeypatch.setattr('tactile_servo.phases.SLACK', 0.1)
    monkeypatch.setattr('tactile_servo.phases.SLOWNESS', 0.2)
    monkeypatch.setattr('tactile_servo.phases.LONGEST_TRACK', 1.0)
    loop = puma_loop(tracker='resolved_rate', config=ServoConfig(
        approach_distance=0.005, retreat_distance=0.003))
    loop.run(EdgeGoal(0.03, 5.0, length=0.01 if state == State.RETREAT else 0.0), 9.0,
             lambda s: s.state == state)
    command = loop.servo.motion.command
    loop.servo.motion.command = lambda twist, *rest: command(0.01 * twist, *rest)
    status = loop.run(None, 120.0)
    assert status.state == State.DONE
    assert (ReasonCode.TIME_LIMIT.text in loop.servo.reason.text) or (
        loop.servo.reason.code == ReasonCode.TIME_LIMIT)
    assert loop.servo.success == (state == State.RETREAT)  # its outcome stands


def test_a_light_contact_does_not_hide_a_heavy_image():
    it = Interrupted('resolved_rate', State.TRACK, 0)
    loop, see = it.loop, it.loop.servo.see_image

    def heavy(image, now):
        layer = image.layers[0]
        see(replace(image, layers=(replace(layer, stress=np.full_like(layer.stress, 4e4)),)), now)

    loop.servo.see_image = heavy  # 26 N, while the contact says 5
    loop.run(None, 0.02)
    assert (loop.servo.state, loop.servo.reason.code) == (State.RETREAT, ReasonCode.OVERLOAD)


def test_cancelling_ends_every_state():
    for state in (State.APPROACH, State.TRACK, State.RETREAT, State.HOLD):
        loop = puma_loop(tracker='trace')
        loop.run(replace(GOAL, length=0.01), 20.0,
                 lambda s, wanted=state: s.state == (
                     State.TRACK if wanted == State.HOLD else wanted))
        if state == State.HOLD:
            loop.robot_alive = loop.sensor_alive = False
            loop.run(None, 1.0)
        loop.servo.cancel()
        status = loop.run(None, 1.0)
        assert (status.state, status.reason.code) == (State.DONE, ReasonCode.CANCELLED)
        loop.servo.finish()
        assert loop.servo.state == State.IDLE


def test_the_approach_does_not_go_further_than_pictures_have_shown():
    """Pictures of 80 ms: at 10 mm/s the pad would go on by .9 mm, that is 4.5 N."""
    loop = puma_loop(tracker='trace', latency=0.08)
    blind = []

    def measure(status):
        if status.state == State.APPROACH and loop.servo.inputs.contact is not None:
            then = loop.servo.inputs.pose_at(loop.servo.inputs.contact.stamp_ns)
            blind.append((loop.servo.motion.pose - then)[2, 3])
        return status.state == State.TRACK

    loop.run(GOAL, 20.0, measure)
    assert max(np.abs(blind)) < 0.55e-3  # half of 5 N at 5000 N/m
    loop.run(None, 20.0)
    assert loop.servo.success and max(cycle.force for cycle in loop.log) < 1.5 * GOAL.force


SILENT_AFTER = 0.4  # s
ATTENDED = replace(GOAL, client_timeout=SILENT_AFTER)


def attended(loop, until, goal=None):
    """Run a goal whose client is heard, until something is true of the status."""
    def heard(status):
        loop.servo.hear_client()
        return until(status)
    return loop.run(goal, 20.0, heard)


@pytest.mark.parametrize('state', [State.APPROACH, State.TRACK, State.HOLD])
def test_a_goal_ends_with_its_client(state):
    loop = puma_loop(tracker='trace')
    attended(loop, lambda s: s.state == (
        State.TRACK if state == State.HOLD else state), ATTENDED)
    if state == State.HOLD:
        loop.servo.pause(True, loop.now)
    died = loop.now
    loop.run(None, SILENT_AFTER - 0.01)
    assert loop.servo.reason.code != ReasonCode.CLIENT_LOST
    status = loop.run(None, 2.0)
    assert (status.state, status.reason.code) == (State.DONE, ReasonCode.CLIENT_LOST)
    assert not loop.servo.success
    assert loop.now - died < SILENT_AFTER + 0.5  # and the robot stands


def test_a_client_that_is_heard_keeps_its_goal_and_need_not_see_it_lift_off():
    loop = puma_loop(tracker='trace')
    attended(loop, lambda s: s.state == State.RETREAT, ATTENDED)
    loop.run(None, 20.0)
    assert loop.servo.success, loop.servo.reason


def test_a_servo_that_was_late_itself_does_not_blame_the_client():
    it = Interrupted('trace', State.TRACK, 0, replace(GOAL, client_timeout=20.0))
    it.loop.servo.run.goal = ATTENDED
    it.loop.servo.hear_client()
    it.servo(2.0)
    it.loop.run(None, 0.1)
    assert it.loop.servo.reason.code != ReasonCode.CLIENT_LOST


@pytest.mark.parametrize('timeout', [-1.0, float('nan'), float('inf')])
def test_a_timeout_that_is_none_is_refused(timeout):
    loop = puma_loop(tracker='trace')
    loop.run(None, 0.1)
    refusal = loop.servo.check(replace(GOAL, client_timeout=timeout))
    assert refusal.code == ReasonCode.INVALID_GOAL and 'client_timeout' in refusal.text


def test_who_asks_to_go_on_hears_what_happens(it):
    loop, servo = it.loop, it.loop.servo
    assert servo.pause(True, loop.now).code == ReasonCode.PAUSED
    loop.sensor_alive = False
    loop.run(None, 1.0)
    assert servo.reason.code == ReasonCode.PAUSED
    assert servo.pause(False, loop.now).code == ReasonCode.STALE_IMAGE  # what the pause hid
    loop.run(None, 0.1)
    assert servo.reason.code == ReasonCode.STALE_IMAGE
    loop.sensor_alive = True
    loop.run(None, 0.5)  # not forgotten, not taken up late either: it waits to be asked
    assert (servo.state, servo.reason.code) == (State.HOLD, ReasonCode.INPUT_BACK)
    assert servo.pause(False, loop.now).code == ReasonCode.RESUMED
    loop.run(None, 20.0)
    assert servo.success
    assert servo.pause(False, loop.now).code == ReasonCode.WAITING


def test_a_goal_that_ends_is_not_paused_any_more(it):
    it.loop.servo.cancel()
    assert it.loop.servo.pause(True, it.loop.now).code == ReasonCode.CANCELLED


def test_a_pause_may_last_longer_than_another_hold():
    it = Interrupted('trace', State.TRACK, 0, config=ServoConfig(give_up=0.5))
    it.loop.servo.pause(True, it.loop.now)
    it.loop.run(None, 1.0)
    it.loop.servo.pause(False, it.loop.now)
    it.loop.run(None, 20.0)
    assert it.loop.servo.success, it.loop.servo.reason


def test_a_goal_for_a_sensor_that_is_not_tared_is_refused_at_once():
    loop = puma_loop(tracker='trace')
    see = loop.servo.see_contact
    loop.servo.see_contact = lambda contact, *rest: see(
        replace(contact, reasons=contact.reasons | ContactReason.NOT_TARED), *rest)
    for _ in range(20):
        loop.step()
    assert loop.servo.check(GOAL).code == ReasonCode.NOT_TARED
    loop.servo.see_contact = see
    for _ in range(20):
        loop.step()
    assert loop.servo.check(GOAL) is None
