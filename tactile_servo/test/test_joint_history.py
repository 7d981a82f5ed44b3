"""Joint states that are believed, and those that are not."""
import numpy as np
import pytest

from tactile_servo.motion.joint_history import JointHistory, LEAP, SILENCE
from tactile_servo.motion.limits import JointLimits

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
