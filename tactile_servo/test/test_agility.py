"""How fast joints can follow a way: on slides and turns, where that is a formula."""
import numpy as np
import pytest
from test_motion import DT, LIMITS, motion_at

from tactile_servo.motion.motion import COAST

FASTEST, HARDEST = 0.5, 5.0  # of every joint [m/s or rad/s, and per second]
RADIUS = 2.0  # m
STRAIGHT = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
CIRCLE = STRAIGHT + [0.0, 0.0, 0.0, 0.0, 0.0, 1.0 / RADIUS]


def test_a_straight_way_is_bounded_by_velocity():
    pace = motion_at(np.zeros(6)).along(STRAIGHT, 0.3)
    assert pace[:2] == pytest.approx((0.8 * FASTEST, HARDEST))
    assert pace.bound == 'velocity of prismatic_x'


@pytest.mark.parametrize('angle', [0.0, 0.4, 0.7])
def test_on_a_circle_the_slides_take_the_centripetal_acceleration(angle):
    motion = motion_at([0.0, 0.0, 0.0, angle, 0.0, 0.0])
    speed, rate, bend = 0.2, np.cos(angle), np.cos(angle) / RADIUS
    pace = motion.along(CIRCLE, speed, 0.01)
    # The slide y turns the most: at a speed v by v^2 / r cos(angle), which may be 1 % of it.
    assert pace.speed == pytest.approx(np.sqrt(0.01 * HARDEST / bend), rel=5e-3)
    assert pace.bound == 'acceleration of prismatic_y'
    left = min((HARDEST - np.sin(angle) / RADIUS * speed**2) / rate,
               (HARDEST - bend * speed**2) / max(np.sin(angle), 1e-12))
    assert pace.acceleration == pytest.approx(left, rel=5e-3)


def test_a_joint_near_its_limit_can_still_stop():
    left = 0.02
    pace = motion_at([2.0 - left, 0.0, 0.0, 0.0, 0.0, 0.0]).along(STRAIGHT)
    assert pace.speed == pytest.approx(left / (LIMITS.stopping_time + (COAST + 2.0) * DT))
    assert pace.bound == 'position of prismatic_x'
    back = motion_at([2.0 - left, 0.0, 0.0, 0.0, 0.0, 0.0]).along(-STRAIGHT)
    assert back.speed == pytest.approx(0.8 * FASTEST)


def test_there_is_no_way_on_at_a_singularity():
    # At a pitch of 90 degrees yaw and roll are one: what lies across them cannot be turned to.
    way = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    paces = [motion_at([0.0, 0.0, 0.0, 0.0, 0.5 * np.pi - off, 0.0]).along(way).speed
             for off in (0.5, 0.05, 0.005)]
    assert paces[0] > 5.0 * paces[1] > 25.0 * paces[2]
