"""The tables of phases and rules: every pair, and what must hold of all ways."""

from itertools import product

import pytest

from tactile_servo.goal_run import RULES
from tactile_servo.reasons import Reason, ReasonCode
from tactile_servo.state_machine import (
    Event,
    HELD,
    IllegalTransition,
    LIFTING,
    MOVING,
    Phase,
    RESUMPTION,
    STANDING,
    StateMachine,
    TRACKING,
    TRANSITIONS,
)
from tactile_servo.types import State

WHY = Reason(ReasonCode.CONTACT)
ACTIVE = [phase for phase in Phase if phase not in (Phase.IDLE, Phase.DONE)]
# What an event of the rules may become before it is fired.
BECOMES = {Event.RESUME: tuple(RESUMPTION.values()), Event.END: (Event.LIFT, Event.STOP),
           Event.LIFT: (Event.LIFT, Event.STOP)}


def at(phase):
    machine = StateMachine()
    machine.phase = phase
    return machine


@pytest.mark.parametrize('phase, event', list(product(Phase, Event)))
def test_an_event_does_what_the_table_says_and_nothing_else(phase, event):
    machine = at(phase)
    before = machine.reason, machine.since
    following = TRANSITIONS[phase].get(event)
    if following is None:
        with pytest.raises(IllegalTransition, match=f'{event.name} while {phase.name}'):
            machine.fire(event, WHY, 1.0)
        assert (machine.phase, machine.reason, machine.since) == (phase, *before)
    else:
        machine.fire(event, WHY, 1.0)
        assert (machine.phase, machine.reason) == (following, WHY)
        assert machine.since == (before[1] if following is phase else 1.0)


def test_a_servo_waits_with_a_reason_and_without_a_goal():
    machine = StateMachine()
    assert (machine.phase.state, machine.reason.code) == (State.IDLE, ReasonCode.WAITING)
    assert not machine.active


def ways(start):
    """Phases that can be reached."""
    found, last = {start}, None
    while found != last:
        last = set(found)
        found |= {after for phase in last for after in TRANSITIONS[phase].values()}
    return found


@pytest.mark.parametrize('phase', list(Phase))
def test_every_phase_is_reached_and_left_to_every_other(phase):
    assert ways(phase) == set(Phase)


def test_every_state_of_the_messages_is_that_of_a_phase():
    assert {phase.state for phase in Phase} == set(State)
    assert {phase for phase in Phase if phase.state is State.HOLD} == HELD | {Phase.STOPPING}


@pytest.mark.parametrize('phase', ACTIVE)
def test_whatever_goes_on_can_be_held_or_stopped(phase):
    assert TRANSITIONS[phase][Event.STOP] is Phase.STOPPING
    if phase is not Phase.STOPPING:
        moves = phase in MOVING | LIFTING
        assert TRANSITIONS[phase][Event.HOLD] is (Phase.SETTLING if moves else phase)


def test_only_rest_ends_a_goal_and_only_a_start_begins_one():
    for phase, event in product(Phase, Event):
        following = TRANSITIONS[phase].get(event)
        assert (following is Phase.DONE) == (event is Event.REST and following is not None)
        assert (event is Event.START) == (
            phase is Phase.IDLE and following is Phase.APPROACH) or following is None


def test_the_law_has_the_word_only_while_tracking():
    said = (Event.TRACK, Event.CORNER, Event.SEARCH)
    for phase, event in product(Phase, said):
        assert (event in TRANSITIONS[phase]) == (phase in TRACKING)
    assert {TRANSITIONS[Phase.TRACK][event] for event in said} == TRACKING


def test_a_hold_goes_back_to_what_it_interrupted():
    assert set(RESUMPTION) == MOVING
    for (phase, event), standing in product(RESUMPTION.items(), STANDING):
        after = TRANSITIONS[standing][event]
        assert after is phase or (after is Phase.TRACK and phase in TRACKING) or (
            after is Phase.APPROACH and phase is Phase.TEST)


def test_a_robot_that_must_be_asked_is_not_moved_by_a_rule_without_it():
    for phases, guard, event in RULES:
        if Phase.ASKED in phases and event not in (Event.HOLD, Event.REPORT, Event.END):
            assert (guard.__name__, event) == ('_asked', Event.RESUME)
    assert Event.LIFT not in TRANSITIONS[Phase.ASKED]  # what an END would have to become


def test_every_rule_fires_what_its_phases_know():
    for phases, guard, event in RULES:
        for phase, fired in product(phases, BECOMES.get(event, (event,))):
            assert fired in TRANSITIONS[phase] or (
                event is Event.END and fired is Event.LIFT and phase in HELD), guard.__name__
    assert {phase for phases, _, _ in RULES for phase in phases} == set(ACTIVE)
