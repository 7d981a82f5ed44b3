"""A stall is noticed however often a hold comes in between."""
import pytest

from tactile_servo.laws.stall import Stall, STALL_TIME

PERIOD, ADVANCE = 0.01, 5e-4


def cycles(count, speed=0.0, held=0, asked=0.03):
    """Cycles until it stalls, with a hold of 1 s every `held` of them; None if it does not."""
    stall, now, progress = Stall(), 0.0, 0.0
    for k in range(count):
        if held and k % held == held - 1:
            now, stall.seen = now + 1.0, None
        if stall.see(now, progress, ADVANCE, asked):
            return k
        now, progress = now + PERIOD, progress + speed * PERIOD


@pytest.mark.parametrize('held', [0, 7, 100])
def test_standing_still_is_a_stall(held):
    due = STALL_TIME / PERIOD
    lost = due / held if held else 0.0  # a cycle after a hold is not counted
    assert due <= cycles(1000, held=held) <= due + 1.3 * lost + 2


@pytest.mark.parametrize('held', [0, 7, 100])
def test_time_in_a_hold_does_not_count(held):
    slow = 2.0 * ADVANCE / STALL_TIME
    assert cycles(5000, slow, held=held) is None


def test_slower_than_that_is_no_progress_unless_it_was_asked_for():
    slow = 0.5 * ADVANCE / STALL_TIME
    assert cycles(2000, slow) is not None
    assert cycles(2000, slow, asked=1.2 * slow) is None
