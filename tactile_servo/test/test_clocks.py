"""Times between cycles and their faults; joint states that are believed; the journal of calls."""
import numpy as np
import pytest

from tactile_servo.clocks import ClockCheck, CycleClock
from tactile_servo.journal import Call, Journal, MOST_CALLS
from tactile_servo.motion.joint_history import JointHistory, LEAP, SILENCE
from tactile_servo.motion.limits import JointLimits
from tactile_servo.reasons import ReasonCode

PERIOD, STATE_PERIOD = 0.0025, 0.004  # s
MS = 1_000_000  # ns


def code(clock):
    return None if clock.fault is None else clock.fault.code


def test_cycles_in_time_have_no_fault_and_late_ones_count_two_periods():
    clock = CycleClock(PERIOD)
    assert clock.tick(10.0, 5 * MS) == PERIOD and code(clock) is None
    assert clock.tick(10.002, 7 * MS) == 0.002 and code(clock) is None
    assert clock.tick(10.04, 45 * MS) == 2 * PERIOD and code(clock) is None


def test_a_pause_of_the_servo_is_told_once():
    clock = CycleClock(PERIOD)
    clock.tick(10.0, 0)
    clock.tick(10.3, 300 * MS)
    assert code(clock) is ReasonCode.STALLED and '0.30 s' in clock.fault.text
    assert clock.gap == 10.3 - 10.0
    clock.tick(10.3025, 302 * MS)
    assert code(clock) is None


def test_a_clock_of_coarse_steps_is_none_that_stands():
    """Simulated time comes every 20 ms."""
    clock = CycleClock(PERIOD)
    for k in range(100):
        dt = clock.tick(10.0 + k * PERIOD, k // 8 * 20 * MS)
        assert code(clock) is None and (dt > 0.0) == (k % 8 == 0)


def test_a_clock_that_stands_or_goes_back_is_told():
    clock = CycleClock(PERIOD)
    found = []
    for k in range(40):
        clock.tick(10.0 + k * PERIOD, 100 * MS)
        found.append(code(clock))
    assert found.index(ReasonCode.CLOCK_STOPPED) in (20, 21)  # 50 ms, as far as they are rounded
    assert clock.tick(10.1, 90 * MS) == 0.0
    assert 'went back by 0.01 s' in clock.fault.text
    clock.tick(10.1025, 92 * MS)
    assert code(clock) is None


def seen(ages):
    """Give a check that has seen joint states of these ages [s], one every STATE_PERIOD."""
    check = ClockCheck()
    for count, age in enumerate(ages):
        check.see(count, age, count * STATE_PERIOD)
    return check


def test_a_clock_agrees_by_its_youngest_joint_state_and_the_oldest_is_late_by_it():
    assert seen([0.02, 0.001, 0.02]).agrees
    assert not seen([0.02, 0.003, 0.02]).agrees  # more than 2.5 ms
    assert not seen([0.001] + [0.02] * 300).agrees  # no longer
    assert ClockCheck().lateness == 0.0
    assert abs(seen([0.001, 0.009, 0.001]).lateness - 0.008) < 1e-12
    assert abs(seen([0.001, 0.009] + [0.001] * 100).lateness - 0.008) < 1e-12  # of .4 s ago
    assert seen([0.001, 0.009] + [0.001] * 300).lateness == 0.0  # of 1.2 s
    assert abs(seen([-0.5, -0.49]).lateness - 0.01) < 1e-12  # whatever the clock


LIMITS = JointLimits(('shoulder', 'elbow'), -np.full(2, 3.0), np.full(2, 3.0), np.ones(2),
                     np.full(2, 10.0))
PERIOD_NS = 2_000_000


def test_a_leap_is_believed_from_the_second_state_that_tells_of_it():
    history = JointHistory(LIMITS)
    history.add([0.1, 0.2], 0)
    with pytest.raises(ValueError, match='elbow leap'):
        history.add([0.1, 0.5], PERIOD_NS)
    np.testing.assert_array_equal(history.add([0.1, 0.2], 2 * PERIOD_NS), [0.1, 0.2])
    for wrong in ([0.1, 0.5], [0.1, -0.5], [2.0, 0.5]):  # no two of them tell the same
        with pytest.raises(ValueError, match='leap'):
            history.add(wrong, 3 * PERIOD_NS)
    np.testing.assert_array_equal(history.add([2.0, 0.501], 4 * PERIOD_NS), [2.0, 0.501])


def test_what_a_joint_can_do_is_no_leap():
    history = JointHistory(LIMITS)
    for k in range(50):
        history.add([0.001 * k, 0.9 * LEAP * (k % 2)], k * PERIOD_NS)
    history.add([2.9, 0.0], 50 * PERIOD_NS + round(1.1e9 * SILENCE))  # unseen it may go anywhere


def test_a_state_that_is_repeated_or_overtaken_does_not_erase_those_before_it():
    history = JointHistory(LIMITS)
    for k in range(5):
        history.add([0.001 * k, 0.0], k * PERIOD_NS)
    for late in (0, 1, PERIOD_NS):
        history.add([0.004, 0.0], 4 * PERIOD_NS - late)
        assert history.at(5 * PERIOD_NS // 2) == pytest.approx([0.0025, 0.0])
    history.add([0.0, 0.0], 4 * PERIOD_NS - 1_000_000_000)  # the clock was set back
    assert history.at(5 * PERIOD_NS // 2) is None


def test_a_journal_that_nobody_takes_stays_small_and_says_what_is_lost():
    journal = Journal()
    for k in range(MOST_CALLS + 5):
        journal.add(Call.CYCLE, value=k)
    taken = journal.take()
    assert taken.first == MOST_CALLS
    assert list(taken.value) == list(range(MOST_CALLS, MOST_CALLS + 5))
    assert journal.first == MOST_CALLS + 5 and not journal.call
