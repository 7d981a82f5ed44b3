"""The table of rules: what holds of all ways through the phases of a goal; codes of reasons."""
from pathlib import Path
import re

import pytest

from tactile_msgs.msg import ServoReason
from tactile_servo.config import ServoConfig
from tactile_servo.goal_run import GoalRun, RULES
from tactile_servo.laws.surface_goal import Pattern, SurfaceGoal
from tactile_servo.phases import (
    HELD,
    LIFTING,
    MOVING,
    Phase,
    STANDING,
    TimeLimits,
    TRACKING,
)
from tactile_servo.reasons import ReasonCode
from tactile_servo.types import EdgeGoal, State

# What the functions choose from that some rules name in place of a phase.
CHOICES = {
    GoalRun._test_or_track: {Phase.TEST, Phase.TRACK},
    GoalRun._begin_hold: {Phase.SETTLING}, GoalRun._hold_unloaded: {Phase.SETTLING},
    GoalRun._end: {Phase.RETREAT, Phase.STOPPING}, GoalRun._lift: {Phase.RETREAT, Phase.STOPPING},
    GoalRun._resume: {Phase.APPROACH, Phase.TRACK, Phase.RETREAT}}
ACTIVE = [phase for phase in Phase if phase is not Phase.DONE]


def after(phase, following):
    """Phases to which a rule may lead."""
    if isinstance(following, Phase):
        return {following}
    if following is GoalRun._go_on_holding:
        return {phase if phase in STANDING else Phase.SETTLING}
    return CHOICES.get(following, {phase})


WAYS = [(phase, guard, following, next_phase) for phases, guard, following in RULES
        for phase in phases for next_phase in after(phase, following)]


@pytest.mark.parametrize('phase', ACTIVE)
def test_every_phase_is_reached_and_ends(phase):
    def ways(start):
        found, last = {start}, None
        while found != last:
            last = set(found)
            found |= {there for here, _, _, there in WAYS if here in last}
        return found
    assert phase in ways(Phase.APPROACH) and Phase.DONE in ways(phase)


def test_every_state_of_the_messages_is_that_of_a_phase_or_idle():
    assert {phase.state for phase in Phase} == set(State) - {State.IDLE}
    assert {phase for phase in Phase if phase.state is State.HOLD} == HELD | {Phase.STOPPING}


def test_a_reason_to_stand_still_holds_every_phase_that_could_move():
    held = {(here, there) for here, guard, _, there in WAYS
            if guard.__code__.co_names == ('_why',)}
    assert held == {(phase, phase if phase in STANDING else Phase.SETTLING)
                    for phase in MOVING | HELD}


def test_only_rest_ends_a_goal_and_the_law_has_the_word_only_while_tracking():
    assert {(here, guard) for here, guard, _, there in WAYS if there is Phase.DONE} == {
        (Phase.STOPPING, GoalRun._played_out), (Phase.RETREAT, GoalRun._lifted)}
    assert {here for here, _, _, there in WAYS if there in TRACKING - {Phase.TRACK}} == (
        TRACKING - {Phase.HALT})


def test_a_robot_that_must_be_asked_is_not_moved_by_a_rule_without_it():
    for here, guard, following, there in WAYS:
        if here is Phase.ASKED and there in MOVING | LIFTING and following is not GoalRun._end:
            assert (guard, following) == (GoalRun._asked, GoalRun._resume)


@pytest.mark.parametrize('end', [GoalRun._end, GoalRun._lift])
@pytest.mark.parametrize('phase', [it for it in Phase if it in HELD - {Phase.WAITING}])
def test_an_end_does_not_move_a_robot_that_must_be_asked_or_still_moves(end, phase):
    run = object.__new__(GoalRun)
    run.phase, run._why, run._found = phase, None, None
    run.goal = EdgeGoal(0.03, 5.0, retreat=True)
    assert end(run, None) is Phase.STOPPING


MESSAGE = Path(__file__).resolve().parents[2] / 'tactile_msgs/msg/ServoReason.msg'


def lasts(goal, state, **config):
    """Whether a state may last for some seconds."""
    def check(seconds):
        limits, phase = TimeLimits(ServoConfig(**config), goal), Phase[state]
        limits.spend(phase, seconds)
        return limits.problem(phase) is None
    return check


def test_a_state_may_last_as_long_as_its_goal_says():
    line = SurfaceGoal(0.03, 5.0, duration=3600.0)
    assert lasts(line, 'TRACK')(3600.0) and not lasts(line, 'TRACK')(3700.0)
    rows = SurfaceGoal(0.05, 5.0, pattern=Pattern.RASTER, size=(0.3, 0.3), step_over=0.001,
                       length=0.01)  # a raster has no length
    assert lasts(rows, 'TRACK')(2.0 * 91.0 / 0.05)
    assert lasts(EdgeGoal(0.05, 5.0), 'TRACK')(1790.0)
    assert not lasts(EdgeGoal(0.05, 5.0, length=0.1), 'TRACK')(60.0)
    # A pad that has met nothing goes back all of its approach.
    assert lasts(EdgeGoal(0.05, 5.0), 'RETREAT', approach_distance=0.4, approach_speed=0.01,
                 retreat_distance=0.0)(40.0)


def test_names_and_numbers_of_codes_are_those_of_the_message_with_a_text_each():
    told = re.findall(r'^uint16 (\w+)=(\d+)', MESSAGE.read_text(encoding='utf-8'), re.MULTILINE)
    assert {name: int(number) for name, number in told} == {
        code.name: code.value for code in ReasonCode}
    assert len(told) == len(ReasonCode)
    assert all(getattr(ServoReason, code.name) == code for code in ReasonCode)
    assert len({code.text for code in ReasonCode}) == len(ReasonCode)
    assert [code for code in ReasonCode if not code.text] == [ReasonCode.NONE]
    assert ReasonCode(200) is ReasonCode.PAUSED and ReasonCode.PAUSED == 200
