"""The delay of windows on their way to the robot's controller, from what it says that it plays."""

import numpy as np
import pytest

from tactile_servo.motion.delay import DELAY_MARGIN, LATEST, WindowDelay
from tactile_servo.motion.window import Window

MS = 10**6  # ns


def window(place, stamp):
    """One joint that rests at a place [rad] from 1 ms after a stamp [ms]."""
    return Window(np.array([0.001, 0.002]), np.full((2, 1), place), np.zeros((2, 1))), stamp * MS


@pytest.fixture
def delay():
    """A window at 0 is played, one to 0.1 rad is on its way since 10 ms."""
    delay = WindowDelay()
    delay.send(*window(0.0, 1))
    delay.see(np.array([0.0]), 5 * MS)
    delay.send(*window(0.1, 10))
    return delay


def test_a_delay_counts_once_its_window_is_played(delay):
    for stamp in (14, 20):
        delay.see(np.array([0.0]), stamp * MS)
        assert delay.overdue == pytest.approx(1e-3 * (stamp - 10))
        assert delay.longest == delay.needed == 0.0
    delay.see(np.array([0.1]), 22 * MS)
    assert delay.overdue == 0.0 and delay.longest == pytest.approx(0.01)
    assert delay.needed == pytest.approx(0.01 + DELAY_MARGIN)


def test_windows_are_committed_for_no_more_than_the_latest(delay):
    delay.see(np.array([0.0]), 90 * MS)
    delay.see(np.array([0.1]), 91 * MS)
    assert delay.longest == pytest.approx(0.08) and delay.needed == LATEST


def test_the_younger_of_two_late_windows_waits_on(delay):
    delay.send(*window(0.2, 13))
    delay.see(np.array([0.0]), 20 * MS)
    delay.see(np.array([0.1]), 21 * MS)
    assert delay.overdue == pytest.approx(0.008) and delay.longest == pytest.approx(0.01)


def test_a_controller_that_plays_none_of_them_shows_no_delay(delay):
    delay.see(np.array([0.0]), 20 * MS)
    delay.see(np.array([0.7]), 22 * MS)
    assert delay.overdue == delay.longest == 0.0
