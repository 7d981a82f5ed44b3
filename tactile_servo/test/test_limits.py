"""No command passes a limit, whatever is asked for."""

from hypothesis import given, settings
from hypothesis import strategies as st
from limited import limit_velocities
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tactile_common.errors import ConfigurationError
from tactile_servo.motion.limits import JointLimits, NEGLIGIBLE, WorkspaceBox

DT = 0.0025
LIMITS = JointLimits(
    ('one', 'two', 'three'), np.array([-1.0, -2.0, -np.inf]), np.array([1.0, 0.5, np.inf]),
    np.array([2.0, 1.0, 4.0]), np.array([10.0, 8.0, 10.0]))

speeds = st.floats(-50.0, 50.0) | st.sampled_from([0.0, float('nan'), float('inf'), 1e300])


@settings(max_examples=500)
@given(positions=st.tuples(st.floats(-1.1, 1.1), st.floats(-2.1, 0.6), st.floats(-9, 9)),
       previous=st.tuples(st.floats(-2, 2), st.floats(-1, 1), st.floats(-4, 4)),
       wanted=st.tuples(speeds, speeds, speeds), dt=st.sampled_from([DT, 1e-4, 0.1]))
def test_what_is_held_is_named_and_what_is_not_stays(positions, previous, wanted, dt):
    positions, previous, wanted = np.array(positions), np.array(previous), np.array(wanted)
    velocities, named = limit_velocities(LIMITS, positions, previous, wanted, dt)
    assert np.abs(velocities - previous).max() <= (LIMITS.acceleration * dt).max() + 1e-12
    if not np.isfinite(wanted).all():
        assert named == 'velocity not finite'
        return
    held = np.abs(velocities - wanted) > NEGLIGIBLE * LIMITS.velocity
    assert bool(named) == held.any()
    if not named:
        return
    kind, _, joint = named.partition(' of ')
    k = LIMITS.names.index(joint)
    assert held[k]
    stop = (LIMITS.velocity / LIMITS.acceleration).max() + dt
    if kind == 'position':
        assert positions[k] + wanted[k] * stop > LIMITS.upper[k] or (
            positions[k] + wanted[k] * stop < LIMITS.lower[k])
    elif kind == 'velocity':
        assert abs(wanted[k]) > LIMITS.velocity[k]
    else:
        assert abs(wanted[k] - previous[k]) > LIMITS.acceleration[k] * dt


@settings(max_examples=200)
@given(share=st.floats(0.0, 1.0) | st.sampled_from([2.5e-17, 1e-300]), side=st.booleans(),
       off=st.sampled_from([0.0, 2.3e-16, -2.3e-16, 1e-12]))
def test_rounding_at_a_limit_does_not_hold_the_other_joints(share, side, off):
    at_limit = np.array([1.0 + off, 0.0, 0.0]) * (1 if side else -1)
    little = share * NEGLIGIBLE * LIMITS.velocity[0] * (1 if side else -1)
    velocities, limited_by = limit_velocities(
        LIMITS, at_limit, np.zeros(3), np.array([little, 0.01, -0.01]), DT)
    np.testing.assert_allclose(velocities, [0.0, 0.01, -0.01], atol=1e-14)
    assert limited_by == ''


def test_outside_its_limit_a_joint_may_only_come_back():
    outside = np.array([1.2, 0.0, 0.0])
    out, _ = limit_velocities(LIMITS, outside, np.zeros(3), np.array([1.0, 0, 0]), DT)
    back, _ = limit_velocities(LIMITS, outside, np.zeros(3), np.array([-1.0, 0, 0]), DT)
    assert out[0] == 0.0 and back[0] < 0.0


TURNED = Rotation.from_rotvec([0.3, -1.0, 0.7]).as_matrix()


def test_workspace_box_stops_at_its_walls_only():
    box = WorkspaceBox([-1.0, -1.0, 0.0], [1.0, 1.0, 0.5])

    def limited(place, velocity):
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = TURNED, place
        turning = np.array([0.3, -0.2, 0.1])
        twist, clipped = box.limit(
            pose, np.append(pose[:3, :3].T @ np.array(velocity), turning), 0.1)
        np.testing.assert_array_equal(twist[3:], turning)
        return pose[:3, :3] @ twist[:3], clipped

    velocity, clipped = limited([0.0, 0.0, 0.01], [0.1, 0.2, -0.5])
    assert clipped
    np.testing.assert_allclose(velocity, [0.1, 0.2, -0.1])
    free, clipped = limited([0.2, 0.2, 0.2], [0.1, 0.2, -0.5])
    assert not clipped
    np.testing.assert_allclose(free, [0.1, 0.2, -0.5])
    outside, clipped = limited([1.5, 0.0, 0.2], [0.1, -90.0, 0.0])
    assert clipped
    np.testing.assert_allclose(outside, [0.0, -10.0, 0.0], atol=1e-12)
    assert np.isnan(limited(np.zeros(3), [np.nan] * 3)[0]).all()  # stopped later


@pytest.mark.parametrize('change, text', [
    ({'lower': [2.0, -2.0, -1.0]}, 'one'), ({'velocity': [1.0, 0.0, 1.0]}, 'two'),
    ({'acceleration': [1.0, 1.0, float('inf')]}, 'three'), ({'upper': [1.0]}, 'upper')])
def test_bad_limits_are_refused_by_name(change, text):
    values = {name: getattr(LIMITS, name)
              for name in ('lower', 'upper', 'velocity', 'acceleration')}
    with pytest.raises(ConfigurationError, match=text):
        JointLimits(LIMITS.names, **(values | change))


@pytest.mark.parametrize('lower, upper', [
    ([0, 0], [1, 1]), ([0, 0, 2], [1, 1, 1]), ([0, 0, float('nan')], [1, 1, 1])])
def test_bad_box_is_refused(lower, upper):
    with pytest.raises(ConfigurationError, match='workspace'):
        WorkspaceBox(lower, upper)
