"""The time between cycles, and its faults."""

from tactile_servo.cycle_clock import CycleClock
from tactile_servo.reasons import ReasonCode

PERIOD = 0.0025  # s
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
