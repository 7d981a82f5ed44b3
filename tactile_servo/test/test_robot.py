"""Kinematics against the Denavit-Hartenberg table, finite differences and the closed forms."""

from pathlib import Path

import numpy as np
import pytest

from tactile_common.errors import ConfigurationError, UnreachableError
from tactile_servo.motion.inverse import damped_least_squares, ROTATION_LENGTH
from tactile_servo.motion.robot import RobotModel
from tactile_servo.robot_config import NodeConfig, robot_of

PUMA = Path(__file__).resolve().parents[2] / 'launch/urdf/puma260.urdf'
INCH = 0.0254
FINGER = 0.1  # m along the tool's z
TABLE = [(0.0, 90, 13.0), (8.0, 0, -2.5), (0.0, -90, -2.5),
         (0.0, 90, 8.0), (0.0, -90, 0.0), (0.0, 0, 2.5)]  # a [in], alpha [deg], d [in]
LIMITS = [(-180, 110), (-75, 240), (-235, 60), (-580, 40), (-120, 110), (-215, 295)]
DOWN = np.array([[-1.0, 0, 0], [0, 1, 0], [0, 0, -1]])  # pad y = base y, pad z = -base z
WELL = np.radians([-39.6, 37.0, -170.3, 0.0, -46.8, -39.6])  # far from every singularity


@pytest.fixture(scope='module')
def puma():
    return RobotModel.from_urdf(PUMA, 'tactile_pad')


def forward_by_table(q):
    """Product of the standard Denavit-Hartenberg matrices, and the finger."""
    pose = np.eye(4)
    for (a, alpha, d), theta in zip(TABLE, q, strict=True):
        c, s = np.cos(theta), np.sin(theta)
        ca, sa = np.cos(np.radians(alpha)), np.sin(np.radians(alpha))
        pose = pose @ np.array([
            [c, -s * ca, s * sa, a * INCH * c],
            [s, c * ca, -c * sa, a * INCH * s],
            [0, sa, ca, d * INCH],
            [0, 0, 0, 1]])
    pose[:3, 3] += FINGER * pose[:3, 2]
    return pose


def down_at(x, y, z, yaw=0.0):
    c, s = np.cos(yaw), np.sin(yaw)
    pose = np.eye(4)
    pose[:3, :3] = DOWN @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    pose[:3, 3] = x, y, z
    return pose


def jacobian_by_differences(model, q, step=1e-6):
    columns = []
    rotation = model.pose(q)[:3, :3]
    for i in range(len(q)):
        d = np.zeros(len(q))
        d[i] = step
        change = (model.pose(q + d) - model.pose(q - d)) / (2 * step)
        spin = rotation.T @ change[:3, :3]
        columns.append([*(rotation.T @ change[:3, 3]), spin[2, 1], spin[0, 2], spin[1, 0]])
    return np.array(columns).T


def test_kinematics_and_limits_are_the_table(puma):
    rng = np.random.default_rng(0)
    for q in rng.uniform(puma.lower, puma.upper, (100, 6)):
        np.testing.assert_allclose(puma.pose(q), forward_by_table(q), atol=1e-14)
    np.testing.assert_allclose(np.degrees([puma.lower, puma.upper]).T, LIMITS, atol=1e-9)
    assert puma.joint_names == tuple(f'joint_{i}' for i in range(1, 7))
    assert puma.root_frame == 'base_link' and np.all(puma.velocity_limit > 0)
    np.testing.assert_allclose(puma.middle, 0.5 * (puma.lower + puma.upper))


def test_jacobian_and_bias_are_derivatives_in_the_tip_frame(puma):
    rng = np.random.default_rng(1)
    for q in rng.uniform(puma.lower, puma.upper, (50, 6)):
        np.testing.assert_allclose(
            puma.jacobian(q), jacobian_by_differences(puma, q), atol=1e-9)
    rng, step = np.random.default_rng(1), 1e-6
    for q in rng.uniform(puma.lower, puma.upper, (50, 6)):
        v = rng.normal(size=6)
        change = puma.jacobian(q + step * v) - puma.jacobian(q - step * v)
        np.testing.assert_allclose(puma.bias(q, v), change @ v / (2.0 * step), atol=1e-8)


@pytest.mark.parametrize('positions', [np.zeros(7), np.zeros((6, 1)), 0.0])
def test_positions_of_other_joints_are_refused(puma, positions):
    with pytest.raises(ValueError, match='must be of 6 joints'):
        puma.place(positions)


def test_results_do_not_change_with_the_next_call(puma):
    pose, jacobian = puma.pose(WELL), puma.jacobian(WELL)
    kept = pose.copy(), jacobian.copy()
    puma.pose(np.zeros(6)), puma.jacobian(np.zeros(6))
    np.testing.assert_array_equal(pose, kept[0])
    np.testing.assert_array_equal(jacobian, kept[1])


def test_xml_text_is_as_good_as_a_path(puma, capfd):
    model = RobotModel.from_urdf(PUMA.read_text(encoding='utf-8'), 'tool0')
    lever = model.pose(WELL)
    lever[:3, 3] += FINGER * lever[:3, 2]
    np.testing.assert_allclose(lever, puma.pose(WELL), atol=1e-15)
    assert capfd.readouterr().out == ''


def test_inverse_finds_reachable_poses(puma):
    rng = np.random.default_rng(4)
    for q in rng.uniform(puma.lower, puma.upper, (20, 6)):
        pose = puma.pose(q)
        found = puma.inverse(pose, q + rng.normal(0.0, 0.2, 6))
        np.testing.assert_allclose(puma.pose(found), pose, atol=2e-7)
        assert (puma.lower <= found).all() and (found <= puma.upper).all()


def test_inverse_stays_in_the_branch_of_the_seed(puma):
    q = np.array(WELL)
    for y in np.linspace(-0.1, 0.1, 41):
        following = puma.inverse(down_at(0.32, y, 0.15), q)
        assert y == -0.1 or np.abs(following - q).max() < np.radians(5.0)
        q = following


def test_inverse_without_seed_is_clear_of_singularities_and_limits(puma):
    q = puma.inverse(down_at(0.32, -0.1, 0.15))
    _, smallest = damped_least_squares(puma.jacobian(q), np.zeros(6))
    assert smallest > 0.015
    assert np.minimum(q - puma.lower, puma.upper - q).min() > np.radians(30.0)
    np.testing.assert_allclose(q, WELL, atol=np.radians(0.1))


def test_unreachable_pose_says_how_far_it_got(puma):
    with pytest.raises(UnreachableError, match=r'closest [\d.]+ mm, [\d.]+ deg'):
        puma.inverse(down_at(0.9, 0.0, 0.1), WELL)


@pytest.mark.parametrize('pose, seed, message', [
    (np.eye(3), WELL, 'pose'),
    (np.full((4, 4), np.nan), WELL, 'pose'),
    (np.diag([1.0, 1, -1, 1]), WELL, 'no rotation'),
    (np.eye(4), np.zeros(5), 'seed: 6 finite'),
    (np.eye(4), np.full(6, np.nan), 'seed: 6 finite')])
def test_inverse_refuses_nonsense(puma, pose, seed, message):
    with pytest.raises(ConfigurationError, match=message):
        puma.inverse(pose, seed)


@pytest.mark.parametrize('x, z', [(0.32, 0.15), (0.36, 0.15), (0.34, 0.12)])
@pytest.mark.parametrize('yaw', np.radians([-100.0, 0.0, 100.0]))
def test_pad_looks_down_and_turns_along_an_edge(puma, x, z, yaw):
    q = WELL
    for y in np.linspace(-0.1, 0.1, 9):
        q = puma.inverse(down_at(x, y, z, yaw), q)
        assert damped_least_squares(puma.jacobian(q), np.zeros(6))[1] > 0.012
        assert np.minimum(q - puma.lower, puma.upper - q).min() > np.radians(25.0)


def test_speeds_are_bounded_at_and_near_every_singularity(puma):
    rng = np.random.default_rng(6)
    wrist = np.array([0.2, 0.6, -2.9, 0.3, 0.0, 0.1])
    elbow = np.array([0.2, 0.6, -np.pi / 2, 0.3, 0.5, 0.1])  # arm straight
    for singular in (wrist, elbow, np.zeros(6)):
        for distance in (0.0, 1e-9, 1e-4, 1e-2, 0.1):
            q = singular + distance
            jacobian = puma.jacobian(q)
            for twist in rng.normal(size=(10, 6)):
                dq, smallest = damped_least_squares(jacobian, twist, damping=0.02)
                bound = np.linalg.norm(twist * np.repeat([1.0, 0.04], 3)) / 0.02
                assert np.all(np.isfinite(dq)) and np.linalg.norm(dq) <= bound * (1 + 1e-9)
            if distance == 0.0:
                assert smallest < 1e-6


@pytest.mark.parametrize('joints', [1, 3, 4, 6, 7, 9])
def test_the_law_is_that_of_its_singular_values(joints):
    rng = np.random.default_rng(8)
    for spread in (0.0, 1.0, 3.0):  # decades over which the columns differ
        jacobian = rng.normal(size=(6, joints)) * 10.0**(-spread * rng.random(joints))
        twist = rng.normal(size=6)
        dq, smallest = damped_least_squares(jacobian, twist, damping=0.05)
        weight = np.repeat([1.0, ROTATION_LENGTH], 3)
        left, values, right = np.linalg.svd(weight[:, None] * jacobian, full_matrices=False)
        gains = values / np.maximum(values**2, 0.05**2)
        np.testing.assert_allclose(
            dq, right.T @ (gains * (left.T @ (weight * twist))), rtol=1e-6, atol=1e-9)
        assert smallest == pytest.approx(values[-1], rel=1e-4, abs=1e-8)


def urdf(kind='revolute', limit='<limit lower="-1" upper="1" velocity="2" effort="1"/>', more=''):
    return f"""<robot name="r"><link name="base"/><link name="tip"/>
        <joint name="j" type="{kind}"><parent link="base"/><child link="tip"/>
        <axis xyz="0 0 1"/>{limit}{more}</joint></robot>"""


@pytest.mark.parametrize('text, message', [
    ('<robot', 'malformed XML, .*line 1'),
    ('<sdf></sdf>', 'must be <robot>, not <sdf>'),
    ('/nowhere/arm.urdf', 'No such file'),
    (urdf('floating'), "'j': type 'floating'"),
    (urdf(more='<mimic joint="k"/>'), 'mimic'),
    (urdf(limit=''), "'j': limit lower must be a number, is missing"),
    (urdf(limit='<limit lower="-1" upper="1" effort="1"/>'), 'limit velocity .* is missing'),
    (urdf(limit='<limit lower="a" upper="1" velocity="1" effort="1"/>'), "lower .* 'a'"),
    (urdf(limit='<limit lower="1" upper="1" velocity="1" effort="1"/>'), 'below upper 1.0'),
    (urdf(limit='<limit lower="0" upper="1" velocity="0" effort="1"/>'), 'above 0'),
    (urdf('fixed', ''), 'no moving joint'),
    ('/dev/zero', 'has more than'),
    (urdf().replace('name="j"', 'name=""'), 'needs a name'),
    (urdf().replace('0 0 1', '0 0.0 0'), 'axis is 0 0 0'),
    (urdf(limit='<limit lower="-180" upper="180" velocity="2" effort="1"/>'), 'must be in rad'),
    (urdf(more='<safety_controller soft_lower_limit="x"/>'), 'soft_lower_limit must be a number'),
    (urdf(more='<safety_controller soft_lower_limit="2"/>'), 'below upper 1.0'),
    ('<robot name="r"><link name="tip"/><joint name="j" type="fixed"/></robot>', 'parent'),
])
def test_bad_urdf_gets_one_line(text, message, capfd):
    with pytest.raises(ConfigurationError, match=message) as caught:
        RobotModel.from_urdf(text, 'tip')
    assert '\n' not in str(caught.value)
    assert capfd.readouterr().out == ''


def test_soft_limits_go_before_those_of_the_joint():
    soft = '<safety_controller soft_lower_limit="-0.5" soft_upper_limit="3" k_velocity="1"/>'
    model = RobotModel.from_urdf(urdf(more=soft), 'tip')
    assert (model.lower[0], model.upper[0]) == (-0.5, 1.0)


def test_unknown_tip_frame_lists_the_frames():
    with pytest.raises(ConfigurationError, match="'pad': .* it has base, tip"):
        RobotModel.from_urdf(urdf(), 'pad')


def test_continuous_and_prismatic_joints_have_one_coordinate_each():
    text = """<robot name="r"><link name="a"/><link name="b"/><link name="c"/><link name="d"/>
        <link name="side"/>
        <joint name="turn" type="continuous"><parent link="a"/><child link="b"/>
          <axis xyz="0 0 1"/><limit velocity="3" effort="1"/></joint>
        <joint name="slide" type="prismatic"><parent link="b"/><child link="c"/>
          <axis xyz="1 0 0"/><limit lower="0" upper="2" velocity="1" effort="1"/></joint>
        <joint name="fix" type="fixed"><parent link="c"/><child link="d"/></joint>
        <joint name="other" type="floating"><parent link="b"/><child link="side"/></joint>
        </robot>"""
    model = RobotModel.from_urdf(text, 'd')
    assert model.joint_names == ('turn', 'slide')
    np.testing.assert_array_equal(model.lower, [-np.inf, 0.0])
    np.testing.assert_array_equal(model.middle, [0.0, 1.0])
    q = np.array([7.0, 1.5])  # more than a full turn
    np.testing.assert_allclose(
        model.pose(q)[:3, 3], [1.5 * np.cos(7.0), 1.5 * np.sin(7.0), 0.0], atol=1e-14)
    np.testing.assert_allclose(
        model.jacobian(q), jacobian_by_differences(model, q), atol=1e-9)
    np.testing.assert_allclose(model.pose(model.inverse(model.pose(q))), model.pose(q), atol=1e-7)
    np.testing.assert_allclose(model.inverse(model.pose(q), [6.8, 1.0]), q, atol=1e-6)


def test_a_short_slide_keeps_most_of_its_range():
    text = urdf('prismatic', '<limit lower="0" upper="0.08" velocity="1" effort="1"/>')
    _, limits, _ = robot_of(NodeConfig(robot_description=text, tip_frame='tip'))
    assert limits.lower == pytest.approx([0.005]) and limits.upper == pytest.approx([0.075])
    _, limits, _ = robot_of(NodeConfig(robot_description=urdf(), tip_frame='tip'))
    assert limits.lower == pytest.approx([-0.95])


def test_a_jacobian_that_is_no_number_gives_speeds_that_are_none():
    dq, smallest = damped_least_squares(np.full((6, 6), np.nan), np.ones(6))
    assert np.isnan(dq).all() and np.isnan(smallest)
