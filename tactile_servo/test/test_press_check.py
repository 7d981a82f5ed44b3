"""What a pad presses beyond what its images tell."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tactile_servo.control.press_check import most_doubted, most_unfelt, PressCheck

DOWN = np.array([0.0, 0.0, 1.0])


def pressed(depths, told):
    """Check of a pad at depths (N,) [m] whose images tell others."""
    check = PressCheck()
    for depth, indentation in zip(depths, told, strict=True):
        check.see(np.eye(4), depth * DOWN, DOWN, indentation)
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


@pytest.mark.parametrize('tilt', [(0.0, 0.02), (-0.05, 0.0), (0.03, -0.04)])
def test_a_tilt_of_the_sensor_is_learned_along_the_way(tilt):
    """Rotation about x, y of the sensor's true frame in the one that the robot believes in."""
    turn = Rotation.from_euler('xy', tilt).as_matrix()
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler('xyz', (2.5, 0.3, 1.0)).as_matrix()
    surface = pose[:3, :3] @ turn  # x, y lie in a plane that the pad slides on
    way = np.array([-tilt[1], tilt[0], 0.0])  # along the steepest growth
    check = PressCheck()
    for length in np.linspace(0.0, 0.02, 101):
        check.see(pose, length * surface @ way / np.linalg.norm(way), pose[:3, 2], 5e-4)
    assert check.unexplained > 1e-4
    check.learn()
    assert check.tilt == pytest.approx(tilt, rel=0.03, abs=1e-4)
    for length in np.linspace(0.0, 0.1, 101):
        check.see(pose, length * surface @ way / np.linalg.norm(way), pose[:3, 2], 5e-4)
    assert abs(check.drift) < 1e-4


def test_half_of_what_ends_a_goal_is_doubted():
    assert 0.4 * most_unfelt(5.0) < most_doubted(5.0) < 0.6 * most_unfelt(5.0)
