"""Times between cycles and their faults; what joint states tell of the robot's clock."""

from tactile_servo.clocks import ClockCheck, CycleClock
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


def test_a_clock_agrees_by_its_youngest_joint_state():
    assert seen([0.02, 0.001, 0.02]).agrees
    assert not seen([0.02, 0.003, 0.02]).agrees  # more than 2.5 ms
    assert not seen([0.001] + [0.02] * 300).agrees  # no longer


def test_lateness_is_what_the_oldest_has_of_the_youngest_for_a_while():
    assert ClockCheck().lateness == 0.0
    assert abs(seen([0.001, 0.009, 0.001]).lateness - 0.008) < 1e-12
    assert abs(seen([0.001, 0.009] + [0.001] * 100).lateness - 0.008) < 1e-12  # of .4 s ago
    assert seen([0.001, 0.009] + [0.001] * 300).lateness == 0.0  # of 1.2 s
    assert abs(seen([-0.5, -0.49]).lateness - 0.01) < 1e-12  # whatever the clock
