"""What a pad presses beyond what its images tell."""

import numpy as np
import pytest

from tactile_servo.control.press_check import doubted, most_unfelt, PressCheck

DOWN = np.array([0.0, 0.0, 1.0])


def pressed(depths, told):
    """Check of a pad at depths (N,) [m] whose images tell others."""
    check = PressCheck()
    for depth, indentation in zip(depths, told, strict=True):
        check.see(depth * DOWN, DOWN, indentation)
    return check.unexplained


def test_what_images_tell_less_of_is_the_sum():
    depths = np.linspace(0.0, 1e-3, 201)
    assert pressed(depths, depths) == 0.0
    assert pressed(depths, 0.6 * depths) == pytest.approx(0.4e-3, rel=0.03)
    assert pressed(np.full(20, 1e-3), np.r_[np.full(10, 1e-3), np.full(10, 4e-4)]) == (
        pytest.approx(6e-4))


@pytest.mark.parametrize('wrong', [1e-2, 0.0, -1e-2])
@pytest.mark.parametrize('images', [1, 2])
def test_one_or_two_wrong_images_count_nothing(wrong, images):
    """In one the indentation is wrong, in the other the stamp, and with it the depth."""
    true, told = np.full(30, 9e-4), np.full(30, 9e-4)
    told[15:15 + images] = wrong
    assert pressed(true, told) == pytest.approx(0.0, abs=1e-12)
    assert pressed(told, true) == pytest.approx(0.0, abs=1e-12)


def test_half_of_what_ends_a_goal_is_doubted():
    assert not doubted(0.4 * most_unfelt(5.0), 5.0) and doubted(0.6 * most_unfelt(5.0), 5.0)
