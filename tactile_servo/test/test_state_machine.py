"""The table of transitions: every pair of state and event, and what must hold of all ways."""

from itertools import product

import pytest

from tactile_servo.reasons import Reason, ReasonCode
from tactile_servo.state_machine import (
    ASSESSED,
    Event,
    IllegalTransition,
    RESUMPTION,
    StateMachine,
    TRANSITIONS,
)
from tactile_servo.types import State, TRACKING

WHY = Reason(ReasonCode.CONTACT)
ACTIVE = [state for state in State if state not in (State.IDLE, State.DONE)]


def at(state):
    machine = StateMachine()
    machine.state = state
    return machine


@pytest.mark.parametrize('state, event', list(product(State, Event)))
def test_an_event_does_what_the_table_says_and_nothing_else(state, event):
    machine = at(state)
    before = machine.reason, machine.since
    following = TRANSITIONS[state].get(event)
    if following is None:
        with pytest.raises(IllegalTransition, match=f'{event.name} while {state.name}'):
            machine.fire(event, WHY, 1.0)
        assert (machine.state, machine.reason, machine.since) == (state, *before)
    else:
        machine.fire(event, WHY, 1.0)
        assert (machine.state, machine.reason, machine.since) == (following, WHY, 1.0)


def test_a_servo_waits_with_a_reason_and_without_a_goal():
    machine = StateMachine()
    assert (machine.state, machine.reason.code) == (State.IDLE, ReasonCode.WAITING)
    assert not machine.active


def ways(start):
    """States that can be reached."""
    found, last = {start}, None
    while found != last:
        last = set(found)
        found |= {after for state in last for after in TRANSITIONS[state].values()}
    return found


@pytest.mark.parametrize('state', list(State))
def test_every_state_is_reached_and_left_to_every_other(state):
    assert ways(state) == set(State)


@pytest.mark.parametrize('state', ACTIVE)
def test_whatever_goes_on_can_be_held_or_stopped(state):
    assert TRANSITIONS[state][Event.STOP] is State.HOLD
    assert state is State.HOLD or TRANSITIONS[state][Event.HOLD] is State.HOLD


def test_only_rest_ends_a_goal_and_only_a_start_begins_one():
    for state, event in product(State, Event):
        following = TRANSITIONS[state].get(event)
        assert (following is State.DONE) == (event is Event.REST and following is not None)
        assert (event is Event.START) == (
            state is State.IDLE and following is State.APPROACH) or following is None


def test_the_law_has_the_word_only_while_tracking():
    for state, event in product(State, ASSESSED.values()):
        assert (event in TRANSITIONS[state]) == (state in TRACKING)
    assert {State(TRANSITIONS[State.TRACK][event]) for event in ASSESSED.values()} == set(TRACKING)


def test_a_hold_goes_back_to_what_it_interrupted():
    assert set(RESUMPTION) == set(ACTIVE) - {State.HOLD}
    for state, event in RESUMPTION.items():
        after = TRANSITIONS[State.HOLD][event]
        assert after is state or (after is State.TRACK and state in TRACKING)
