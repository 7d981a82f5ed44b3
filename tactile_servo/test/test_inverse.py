"""Joint velocities within the position limits: the nearest ones, whatever is asked."""

from pathlib import Path

import daqp
from hypothesis import given, settings
from hypothesis import strategies as st
from limited import limit_velocities
import numpy as np
import pytest
from scipy.optimize import lsq_linear

from tactile_servo.motion import inverse
from tactile_servo.motion.limits import JointLimits, Joints, NEGLIGIBLE
from tactile_servo.motion.motion import Motion
from tactile_servo.motion.robot import RobotModel

ROOT = Path(__file__).resolve().parents[2]
PUMA = RobotModel.from_urdf(ROOT / 'launch/urdf/puma260.urdf', 'tactile_pad')
DT = 0.0025
DT_NS = round(DT * 1e9)
WEIGHT = np.repeat([1.0, inverse.ROTATION_LENGTH], 3)


def limits_of(joints, velocity=2.0, acceleration=10.0):
    return JointLimits(tuple(f'joint{k}' for k in range(joints)), np.full(joints, -2.0),
                       np.full(joints, 2.0), np.full(joints, velocity),
                       np.full(joints, acceleration))


def quick(joints):
    """Joints that only position limits hold back."""
    return limits_of(joints, 20.0, 1e6)


def solve(limits, jacobian, twist, positions):
    """Solve from a rest, for joints that only position limits hold back."""
    joints = Joints(positions, np.zeros(len(positions)))
    velocities, scale, limited_by, smallest = inverse.BoundedInverse(limits).solve(
        jacobian, twist, joints, limits.reach(joints, DT))
    assert scale == 1.0 and limited_by[:1] in ('', 'p')
    return velocities, limited_by, smallest


def by_least_squares(jacobian, wanted, bounds):
    """Nearest velocities to the wanted ones: H's root from an SVD, then bounded least squares."""
    last = inverse.YIELDING if jacobian.shape[1] == 6 else 1.0
    weight = WEIGHT * [1.0, 1.0, 1.0, 1.0, 1.0, last]
    _, values, right = np.linalg.svd(weight[:, None] * jacobian)
    scales = np.full(len(right), inverse.TAKE_OVER * inverse.DAMPING)
    scales[:len(values)] = np.maximum(values, inverse.DAMPING)
    root = scales[:, None] * right
    return lsq_linear(root, root @ wanted, bounds, method='bvls', tol=1e-14, max_iter=500).x


@pytest.mark.parametrize('joints', [6, 7])
def test_at_a_limit_the_nearest_velocities_are_found(joints):
    rng, limits, count = np.random.default_rng(3), quick(joints), 0
    for _ in range(50):
        jacobian, twist = rng.normal(size=(6, joints)), rng.normal(size=6)
        wanted, _ = inverse.damped_least_squares(jacobian, twist)
        positions = np.zeros(joints)
        held = rng.integers(joints)
        positions[held] = 2.0 * np.sign(wanted[held])
        velocities, limited_by, smallest = solve(limits, jacobian, twist, positions)
        reach = limits.reach(Joints(positions, np.zeros(joints)), DT)
        bounds = reach.least[0], reach.most[0]
        pushed = _pushed(jacobian, twist, positions, limits)
        expected = by_least_squares(jacobian, pushed, (bounds[0] - 1e-15, bounds[1] + 1e-15))
        np.testing.assert_allclose(velocities, expected, atol=1e-7)
        assert velocities[held] * positions[held] <= 0.0
        bound = pushed[held] * positions[held] > 0.0  # a seventh joint may let it come out
        assert limited_by == (f'position of joint{held}' if bound else '')
        count += bound
        # So that what limits the velocities afterwards does not stop the others for rounding.
        assert (velocities >= bounds[0]).all() and (velocities <= bounds[1]).all()
        assert smallest == pytest.approx(np.linalg.svd(
            WEIGHT[:, None] * jacobian, compute_uv=False)[-1], rel=1e-6)
    assert count > 25


def _pushed(jacobian, twist, positions, limits):
    """Least squares of the twist with a joint at its limit pushed back in the null space."""
    wanted, _ = inverse.damped_least_squares(jacobian, twist)
    if len(positions) <= 6:
        return wanted
    speed = min(inverse.PUSH * np.linalg.norm(WEIGHT * twist),
                inverse.PUSH_SPEED * limits.velocity[0])
    push = np.where(np.abs(positions) == 2.0, -np.sign(positions) * speed, 0.0)
    weighted = WEIGHT[:, None] * jacobian
    return wanted + push - np.linalg.pinv(weighted) @ weighted @ push


def test_away_from_limits_a_redundant_arm_is_not_pushed():
    jacobian, twist = np.random.default_rng(5).normal(size=(6, 7)), np.ones(6) * 0.01
    velocities, limited_by, _ = solve(quick(7), jacobian, twist, np.zeros(7))
    wanted, _ = inverse.damped_least_squares(jacobian, twist)
    np.testing.assert_allclose(velocities, wanted, atol=1e-15)
    assert limited_by == ''


def test_near_a_limit_a_redundant_arm_moves_out_without_moving_the_tip():
    jacobian, twist = np.random.default_rng(6).normal(size=(6, 7)), np.ones(6) * 0.01
    positions = np.array([0.0, 0.0, 0.0, 1.9, 0.0, 0.0, 0.0])
    velocities, _, _ = solve(quick(7), jacobian, twist, positions)
    np.testing.assert_allclose(jacobian @ velocities, twist, atol=1e-12)
    assert velocities[3] < inverse.damped_least_squares(jacobian, twist)[0][3]
    still, _, _ = solve(quick(7), jacobian, np.zeros(6), positions)
    assert not still.any()


def test_position_is_kept_where_orientation_gives_way():
    """One joint of six at its limit: most of what is missing is rotation."""
    rng, limits, positions = np.random.default_rng(7), quick(6), np.zeros(6)
    kept = []
    for _ in range(30):
        jacobian, twist = rng.normal(size=(6, 6)), np.array([*rng.normal(size=3), 0, 0, 0]) * 0.02
        wanted, _ = inverse.damped_least_squares(jacobian, twist)
        positions[:] = 0.0
        positions[0] = 2.0 * np.sign(wanted[0])
        velocities, _, _ = solve(limits, jacobian, twist, positions)
        error = jacobian @ velocities - twist
        kept.append(np.linalg.norm(error[:3]) / max(np.linalg.norm(error[3:]), 1e-12))
    assert np.median(kept) < inverse.ROTATION_LENGTH


def random_states(joints, count):
    """Yield Jacobian, twist, positions and velocities of an arm anywhere, in any motion."""
    rng, limits = np.random.default_rng(joints), limits_of(joints)
    for _ in range(count):
        jacobian = PUMA.jacobian(rng.uniform(PUMA.lower, PUMA.upper))
        jacobian = np.hstack([jacobian, 0.1 * rng.normal(size=(6, joints - 6))])
        jacobian = np.ascontiguousarray(jacobian)
        positions = rng.choice([-2.0, 2.0, 1.99, *rng.uniform(-2.0, 2.0, 7)], joints)
        previous = rng.choice([0.0, 0.1, 1.0]) * rng.uniform(-1.0, 1.0, joints) * limits.velocity
        twist = rng.choice([0.0, 0.01, 0.1, 10.0]) * rng.normal(size=6) * np.repeat([1, 4], 3)
        yield jacobian, twist, positions, previous


@pytest.mark.parametrize('joints', [6, 7])
def test_what_the_program_answers_needs_no_more_limiting(joints):
    limits, named = limits_of(joints), set()
    solver = inverse.BoundedInverse(limits)
    for jacobian, twist, positions, previous in random_states(joints, 3000):
        joints = Joints(positions, previous)
        answer, _, name, _ = solver.solve(jacobian, twist, joints, limits.reach(joints, DT))
        velocities, held = limit_velocities(limits, *joints, answer, DT)
        np.testing.assert_allclose(velocities, answer, rtol=0, atol=NEGLIGIBLE * 2.0)
        assert held == ''
        named.add(name.partition(' of ')[0])
    assert named == {'', 'position', 'velocity', 'acceleration'}


@pytest.mark.parametrize('joints', [6, 7])
def test_what_is_delayed_keeps_to_its_way_as_scaled_changes_do(joints):
    """To begin, to turn and to brake, as far as only accelerations bind."""
    limits, count = limits_of(joints), 0
    solver = inverse.BoundedInverse(limits)
    for jacobian, twist, _, previous in random_states(joints, 2000):
        start = Joints(np.zeros(joints), previous)
        wanted, _ = inverse.damped_least_squares(jacobian, twist)
        answer, scale, name, _ = solver.solve(jacobian, twist, start, limits.reach(start, DT))
        if scale < 1.0 or not name:
            continue
        count += 1
        assert name.startswith('acceleration')
        matrix = inverse.hessian(jacobian)
        way, along = wanted - previous, matrix @ (wanted - previous)
        evenly = previous + min(1.0, (limits.acceleration * DT / np.abs(way)).min()) * way
        off = answer - wanted - along @ (answer - wanted) / (along @ way) * way
        left, right = (np.sqrt(error @ matrix @ error) for error in (answer - wanted,
                                                                     evenly - wanted))
        assert np.sqrt(off @ matrix @ off) <= 1.001 * np.sqrt(inverse.EASED) * right + 1e-9
        assert left <= (1.0 + inverse.EASED) * right + 1e-9
    assert count > 500


def test_velocity_limit_scales_all_joints_alike():
    limits, wanted = limits_of(6, 2.0, 1e6), np.array([4.0, 0.5, 1.0, 0.0, -2.0, 0.0])
    rest = Joints(np.zeros(6), np.zeros(6))
    jacobian = np.diag(1.0 / WEIGHT)
    velocities, scale, limited_by, _ = inverse.BoundedInverse(limits).solve(
        jacobian, jacobian @ wanted, rest, limits.reach(rest, DT))
    assert limited_by == 'velocity of joint0' and scale == pytest.approx(0.5, rel=1e-3)
    np.testing.assert_allclose(velocities, 0.5 * wanted, atol=1e-3)


@pytest.mark.parametrize('answer', [
    (np.zeros(6), 0.0, -1, {'lam': np.zeros(6)}),
    (np.full(6, np.nan), 0.0, 1, {'lam': np.zeros(6)}),
    (np.full(6, 1e9), 0.0, 1, {'lam': np.zeros(6)})])
def test_whatever_the_solver_answers_no_limit_is_passed(monkeypatch, answer):
    monkeypatch.setattr(daqp, 'solve', lambda *_: answer)
    motion = _motion_at(np.array([2.0, 0.0, 0.0, 0.0, 0.0, -2.0]))
    for cycle in range(400):
        _step_within(motion, np.array([1.0, 1.0, 1.0, 0.0, 0.0, -1.0]), cycle * DT_NS)


class _Slides:
    """Joints, each along or about one axis of the tip, and any change of their rates."""

    def __init__(self, jacobian, bias=0.0):
        self._jacobian, self._bias = np.ascontiguousarray(jacobian), bias

    def place(self, positions):
        return np.eye(4), self._jacobian

    def bias(self, positions, velocities):
        return np.full(6, self._bias)


def _motion_at(positions, jacobian=None, limits=None, bias=0.0):
    joints = len(positions)
    motion = Motion(_Slides(np.eye(6) if jacobian is None else jacobian, bias),
                    limits or limits_of(joints), DT)
    motion.seed(positions)
    return motion


def _step_within(motion, twist, now_ns):
    before, limits = motion.velocities, limits_of(len(motion.positions))
    step = motion.command(twist, now_ns)
    assert (np.abs(motion.velocities) <= limits.velocity + 1e-12).all()
    assert (np.abs(motion.velocities - before) <= limits.acceleration * DT + 1e-12).all()
    if step.trajectory is not None:
        speeds = step.trajectory.velocities
        assert (np.abs(step.trajectory.positions) <= 2.0 + 1e-9).all()
        assert (np.abs(speeds) <= limits.velocity + 1e-12).all()
        changes = np.diff(speeds, axis=0) / np.diff(step.trajectory.times)[:, None]
        assert (np.abs(changes) <= limits.acceleration * (1.0 + 1e-6)).all()
        assert not speeds[-1].any()
    assert 0.0 <= step.scale <= 1.0


numbers = st.floats(-20.0, 20.0) | st.sampled_from([0.0, float('nan'), float('inf'), 1e300, 5e-17])


@settings(max_examples=150)
@given(joints=st.sampled_from([5, 6, 7]), seed=st.integers(0, 2**31),
       starts=st.lists(st.sampled_from([-2.0, 2.0, 0.0, 1.999]), min_size=7, max_size=7),
       twists=st.lists(st.lists(numbers, min_size=6, max_size=6), min_size=1, max_size=6),
       rank=st.integers(0, 6), bias=numbers)
def test_any_twist_from_any_start_keeps_every_limit(joints, seed, starts, twists, rank, bias):
    rng = np.random.default_rng(seed)
    jacobian = rng.normal(size=(6, rank)) @ rng.normal(size=(rank, joints))
    motion = _motion_at(np.array(starts[:joints]), jacobian, bias=bias)
    for cycle, twist in enumerate(twist for twist in twists for _ in range(30)):
        _step_within(motion, np.array(twist), cycle * DT_NS)


def test_a_jacobian_that_is_no_number_stops():
    motion = _motion_at(np.zeros(6), np.full((6, 6), np.nan))
    step = motion.command(np.ones(6), 0)
    assert motion.standing and step.limited_by == 'velocity not finite'


@pytest.mark.parametrize('joints', [6, 7])
def test_agility_is_the_acceleration_across_that_every_joint_bears(joints):
    rng, hard = np.random.default_rng(5), np.linspace(5.0, 15.0, joints)
    for _ in range(20):
        left, values, right = np.linalg.svd(rng.normal(size=(6, joints)), full_matrices=False)
        values = np.maximum(values, 10.0 * inverse.DAMPING)  # away from singularities
        jacobian = np.ascontiguousarray(left * values @ right / WEIGHT[:, None])
        angles = np.linspace(0.0, np.pi, 2001)
        # Of all motions with a twist the smallest, rotations weighted or not.
        ways = np.linalg.pinv(jacobian)[:, :2] @ [np.cos(angles), np.sin(angles)]
        exact = (hard[:, None] / np.abs(ways)).min()
        assert inverse.allowed_acceleration(jacobian, hard, 0, 2) == pytest.approx(exact, rel=1e-5)
    assert inverse.allowed_acceleration(np.full((6, joints), np.nan), hard, 0, 2) == np.inf
    # Nothing would move.
    assert inverse.allowed_acceleration(np.zeros((6, joints)), hard, 0, 2) > 1e6
