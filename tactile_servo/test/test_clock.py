"""What the ages of joint states tell of the robot's clock, and of what is held up."""

from tactile_servo.motion.clock import ClockCheck

PERIOD = 0.004  # s


def seen(ages):
    """Give a check that has seen joint states of these ages [s], one every PERIOD."""
    check = ClockCheck()
    for count, age in enumerate(ages):
        check.see(count, age, count * PERIOD)
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
