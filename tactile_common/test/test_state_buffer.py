"""States by their stamps: between two, across gaps, ahead of the newest, after a restart."""
from hypothesis import given
from hypothesis import strategies as st
import pytest

from tactile_common.state_buffer import ONWARD, StateBuffer


def mean(one, other, share):
    return one + share * (other - one)


def buffer(*stamps, **options):
    """Buffer of states that are ten times their stamps."""
    it = StateBuffer(mean, **{'size': 8, **options})
    for stamp in stamps:
        it.add(stamp, 10.0 * stamp)
    return it


def test_states_between_and_at_their_stamps():
    it = buffer(0, 10, 30)
    assert [it.at(stamp) for stamp in (0, 4, 10, 25, 30)] == [0.0, 40.0, 100.0, 250.0, 300.0]
    assert it.at(-1) is None and it.at(31) is None
    assert it.newest_ns == 30 and len(it) == 3


def test_an_empty_buffer_knows_nothing():
    it = buffer()
    assert it.at(0) is None and it.newest_ns is None and not it.went_back(0)
    it = buffer(0, 10)
    it.clear()
    assert it.at(5) is None and it.newest_ns is None and not len(it)
    assert it.add(3, 30.0) and it.at(3) == 30.0


@pytest.mark.parametrize('stamps, options, found', [
    ((0, 10, 21), {'max_gap_ns': 10}, {5: 50.0, 10: 100.0, 15: None, 21: 210.0}),  # across a gap
    ((0, 10), {'max_ahead_ns': 3}, {13: 130.0, 14: None}),  # the motion of the last two goes on
    ((10,), {'max_ahead_ns': 3}, {13: 100.0, 14: None}),  # a single state stands
    ((0, 10, 11), {'max_ahead_ns': 30},  # two at nearly one stamp tell no motion
     {11 + ONWARD: 10.0 * (11 + ONWARD), 12 + ONWARD: None}),
    ((0, 10), {'max_gap_ns': 9, 'max_ahead_ns': 3}, {10: 100.0, 11: None}),
    (range(20), {}, {12: 120.0, 11: None})])  # old states go first
def test_states_across_gaps_and_ahead_of_the_newest(stamps, options, found):
    it = buffer(*stamps, **options)
    assert {stamp: it.at(stamp) for stamp in found} == pytest.approx(found)
    assert len(it) <= 8


@pytest.mark.parametrize('stamp, kept', [(10, 2), (9, 2), (6, 2), (5, 1), (-100, 1)])
def test_late_states_are_left_out_and_a_clock_set_back_forgets(stamp, kept):
    it = buffer(0, 10, restart_ns=5)
    assert it.went_back(stamp) == (kept == 1)
    assert it.add(stamp, -1.0) == (kept == 1)
    assert len(it) == kept and it.newest_ns == (stamp if kept == 1 else 10)
    assert it.at(it.newest_ns) == (-1.0 if kept == 1 else 100.0)


def test_without_a_restart_gap_every_stamp_that_is_not_newer_begins_anew():
    it = buffer(0, 10)
    assert it.add(10, 7.0) and len(it) == 1 and it.at(10) == 7.0 and it.at(5) is None


@given(st.lists(st.integers(-100, 100), max_size=30), st.integers(-120, 120),
       st.integers(0, 40), st.integers(0, 20), st.integers(0, 20))
def test_any_order_of_stamps_gives_what_lies_between_or_nothing(
        stamps, wanted, gap, ahead, restart):
    it = buffer(*stamps, max_gap_ns=gap, max_ahead_ns=ahead, restart_ns=restart)
    found = it.at(wanted)
    if found is not None:
        # The states are a straight line over the stamps; beyond a single one it goes level.
        assert found == pytest.approx(
            10.0 * (wanted if len(it) > 1 else min(wanted, it.newest_ns)))
        assert wanted <= it.newest_ns + ahead
