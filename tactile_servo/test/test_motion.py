"""From a twist to commands: what is held back is named; how fast joints can follow a way."""
import numpy as np
import pytest

from tactile_servo.motion.limits import JointLimits, WorkspaceBox
from tactile_servo.motion.motion import BLOCKED_AFTER, COAST, COMMITTED, Motion, SETTLING
from tactile_servo.motion.robot import RobotModel

DT = 0.0025
AXES = {'x': '1 0 0', 'y': '0 1 0', 'z': '0 0 1'}
SECOND = round(BLOCKED_AFTER / DT) + 1  # cycles that are a second for certain


def slides():
    """Three slides and three turns that cross in one point; singular at a pitch of 90 deg."""
    joints, parent = '', 'base'
    for kind, axes in (('prismatic', 'xyz'), ('revolute', 'zyx')):
        for axis in axes:
            joints += f"""<link name="{kind}_{axis}_link"/>
                <joint name="{kind}_{axis}" type="{kind}"><parent link="{parent}"/>
                <child link="{kind}_{axis}_link"/><axis xyz="{AXES[axis]}"/>
                <limit lower="-1" upper="2" velocity="0.5" effort="1"/></joint>"""
            parent = f'{kind}_{axis}_link'
    return RobotModel.from_urdf(
        f'<robot name="slides"><link name="base"/>{joints}</robot>', 'revolute_x_link')


ROBOT = slides()
LIMITS = JointLimits(ROBOT.joint_names, ROBOT.lower, ROBOT.upper, ROBOT.velocity_limit,
                     np.full(6, 5.0))


def motion_at(positions, workspace=None):
    motion = Motion(ROBOT, LIMITS, DT, workspace)
    motion.seed(np.array(positions, dtype=float))
    return motion


def driven(motion, twist, cycles):
    """Command a twist; the clock goes on where the last call left it."""
    for _ in range(cycles):
        motion.now_ns = getattr(motion, 'now_ns', 10**9) + round(DT * 1e9)
        step = motion.command(np.array(twist, dtype=float), motion.now_ns)
    return step


def test_a_stop_keeps_the_way():
    motion = motion_at(np.zeros(6))
    driven(motion, [0.3, 0.1, 0.0, 0.0, 0.0, 0.0], 200)
    step = driven(motion, np.full(6, np.nan), 10)
    assert step.limited_by == 'velocity not finite'
    assert 0.1 < motion.velocities[0] < 0.25
    assert motion.velocities[1] == pytest.approx(motion.velocities[0] / 3.0, rel=1e-6)
    driven(motion, np.full(6, np.nan), 40)
    assert not motion.velocities.any()


def test_a_twist_moves_the_pose():
    motion = motion_at(np.zeros(6))
    driven(motion, np.zeros(6), round(SETTLING / DT))
    step = driven(motion, [0.1, 0.0, 0.0, 0.0, 0.0, 0.2], 400)
    assert motion.pose[0, 3] == pytest.approx(np.sin(0.2) * 0.5, rel=0.02)
    assert motion.positions[3] == pytest.approx(0.2, rel=0.03)  # speeds up first
    assert (step.scale, step.limited_by, motion.blocked) == (1.0, '', '')
    assert not motion.standing


def test_a_twist_that_turns_leads_round_and_not_out():
    """The sensor goes on as its twist says in the middle of every cycle: a circle is one."""
    motion, speed, turn = motion_at(np.zeros(6)), 0.1, 0.4
    twist = np.array([speed, 0.0, 0.0, 0.0, 0.0, turn])
    driven(motion, twist, round((SETTLING + 1.0) / DT))
    before = motion.pose
    driven(motion, twist, 1)
    way = before[:3, :3].T @ (motion.pose - before)[:3, 3]
    assert way[0] == pytest.approx(speed * DT, rel=1e-4)
    half = 0.5 * turn * DT  # the chord of an arc leads in by half of its angle
    assert way[1] / way[0] == pytest.approx(half, rel=0.02)


def test_a_window_is_stamped_unless_told_otherwise():
    motion = motion_at(np.zeros(6))
    assert motion.command(np.zeros(6), 7_000_000_123).trajectory.stamp_ns == 7_000_000_123
    # In the midst of a motion that does not change.
    assert motion.command(np.zeros(6), 8_000_000_124, False).trajectory.stamp_ns == 8_000_000_124
    motion.seed(np.zeros(6))
    assert motion.command(np.zeros(6), 9_000_000_124, False).trajectory.stamp_ns == 0
    assert motion.command(np.zeros(6), 9_900_000_125).trajectory.stamp_ns == 0


def test_a_start_leaves_the_controller_time_to_come_there():
    """One window with its first point ahead, at rest, then none until that is reached."""
    motion, twist, sent = motion_at(np.zeros(6)), [0.1, 0.0, 0.0, 0.0, 0.0, 0.0], []
    for cycle in range(round(SETTLING / DT) + 1):
        window = driven(motion, twist, 1).trajectory
        if window is not None:
            sent.append(cycle)
            assert window.times[0] == pytest.approx(SETTLING - cycle * DT, abs=1e-12)
            np.testing.assert_allclose(window.positions[0], 0.0, atol=1e-15)
            assert window.velocities.any() == (cycle > 0)
    assert sent == [0, 40]
    assert motion.velocities[0] == pytest.approx(5.0 * DT)


def test_a_start_far_from_the_last_command_takes_the_time_to_come_there():
    """The controller's cubic from rest to rest keeps half of the limits of the slides."""
    motion = motion_at(np.zeros(6))
    driven(motion, np.zeros(6), 1)
    for way in (1e-6, 0.01, 0.1, 1.0):
        motion.seed(np.array([0.0, way, 0.0, 0.0, 0.0, 0.0]))
        motion.seed(np.array([0.0, way, 0.0, 0.0, 0.0, 0.0]))
        time = motion.command(np.zeros(6), 0).trajectory.times[0]
        assert time >= SETTLING
        assert 1.5 * way / time <= 0.25 + 1e-9 and 6.0 * way / time**2 <= 2.5 + 1e-9
        motion.seed(np.zeros(6))
        motion.command(np.zeros(6), 0)


def test_standing_is_when_the_last_window_is_over():
    motion = motion_at(np.zeros(6))
    assert motion.standing
    driven(motion, [0.1, 0.0, 0.0, 0.0, 0.0, 0.0], 100)
    driven(motion, np.zeros(6), 1)
    while motion.velocities.any():
        driven(motion, np.zeros(6), 1)
    assert not motion.standing
    driven(motion, np.zeros(6), round(COMMITTED / DT) + 1)
    assert motion.standing


@pytest.mark.parametrize('start, way, text', [
    (2.0, 0.1, 'prismatic_y is at its upper limit, 2'),
    (-1.0, -0.1, 'prismatic_y is at its lower limit, -1')])
def test_a_joint_at_its_limit_is_named_after_a_second(start, way, text):
    motion = motion_at([0.0, start, 0.0, 0.0, 0.0, 0.0])
    driven(motion, [0.0, way, 0.0, 0.0, 0.0, 0.0], SECOND - 3)
    assert motion.blocked == ''
    driven(motion, [0.0, way, 0.0, 0.0, 0.0, 0.0], 3)
    assert motion.blocked == text
    driven(motion, [0.0, -way, 0.0, 0.0, 0.0, 0.0], 1)
    assert motion.blocked == ''


@pytest.mark.parametrize('start, twist, text', [
    (np.zeros(6), [0.0, 0.0, 0.1, 0.0, 0.0, 0.0], 'workspace'),
    ([0.0, 0.0, 0.0, 0.0, np.pi / 2, 0.0], [0.0, 0.0, 0.0, 0.0, 0.0, 0.1], 'singularity')])
def test_walls_and_singular_directions_are_named_until_a_new_start(start, twist, text):
    motion = motion_at(start, WorkspaceBox([-1.0, -1.0, -1.0], [1.0, 1.0, 0.0]))
    driven(motion, twist, SECOND)
    assert motion.blocked == text
    motion.seed(motion.positions)
    assert motion.blocked == ''


def test_a_window_that_is_not_renewed_keeps_the_twist_of_the_sensor():
    motion = motion_at([0.0, 0.0, 0.0, 0.3, 0.5, 0.2])
    driven(motion, np.zeros(6), round(SETTLING / DT))
    twist = np.array([0.1, 0.05, 0.0, 0.5, 0.3, -0.4])
    window = driven(motion, twist, 400).trajectory
    (turned, begin), (left, end) = [
        (ROBOT.jacobian(window.positions[k]) @ window.velocities[k], window.velocities[k])
        for k in (-3, -2)]  # before and after coasting
    np.testing.assert_allclose(turned, twist, atol=2e-3)
    np.testing.assert_allclose(left, turned, atol=1e-4)
    straight = ROBOT.jacobian(window.positions[-2]) @ begin
    assert np.abs(straight - turned).max() > 1e-3  # as one that coasts in joint space would not


def test_what_comes_to_rest_does_not_coast_back():
    motion = motion_at([0.0, 0.0, 0.0, 0.3, 0.5, 0.2])
    driven(motion, np.zeros(6), round(SETTLING / DT))
    driven(motion, [0.1, 0.05, 0.0, 0.5, 0.3, -0.4], 400)
    for _ in range(200):
        window = driven(motion, np.zeros(6), 1).trajectory
        speeds = np.abs(window.velocities)
        assert (speeds[-2] <= speeds[-3] + 1e-3).all()
    assert motion.standing


def test_a_command_that_is_not_sent_in_time_is_forgotten():
    way = np.array([0.1, 0.05, 0.0, 0.0, 0.0, 0.2])
    motion, other = motion_at(np.zeros(6)), motion_at(np.zeros(6))
    for one in (motion, other):
        assert one.in_time(driven(one, way, 1).trajectory, 0.9 * SETTLING)
        assert one.in_time(driven(one, way, 100).trajectory, COMMITTED)
    assert not motion.in_time(driven(motion, -way, 1).trajectory, 1.01 * COMMITTED)
    np.testing.assert_array_equal(motion.pose, other.pose)
    other.now_ns += round(DT * 1e9)
    one, same = (driven(each, way, 1).trajectory for each in (motion, other))
    for name in ('times', 'positions', 'velocities'):
        np.testing.assert_array_equal(getattr(one, name), getattr(same, name))


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
    assert pace.speed == pytest.approx(left / (LIMITS.stopping_time + COAST + 2.0 * DT))
    assert pace.bound == 'position of prismatic_x'
    back = motion_at([2.0 - left, 0.0, 0.0, 0.0, 0.0, 0.0]).along(-STRAIGHT)
    assert back.speed == pytest.approx(0.8 * FASTEST)


def test_there_is_no_way_on_at_a_singularity():
    # At a pitch of 90 degrees yaw and roll are one: what lies across them cannot be turned to.
    way = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    paces = [motion_at([0.0, 0.0, 0.0, 0.0, 0.5 * np.pi - off, 0.0]).along(way).speed
             for off in (0.5, 0.05, 0.005)]
    assert paces[0] > 5.0 * paces[1] > 25.0 * paces[2]


def test_a_singularity_is_passed_slowly():
    way = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    speeds = [motion_at([0.0, 0.0, 0.0, 0.0, 0.5 * np.pi - off, 0.0]).passing(way)
              for off in (0.5, 0.05, 0.005)]
    assert speeds[0] > 1.5 * speeds[1] and speeds[1] == pytest.approx(speeds[2])
