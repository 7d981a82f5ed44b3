"""The law that follows a surface: filter, paths, goals, features, teaching, messages."""
from dataclasses import replace

from geometry_msgs.msg import Point, Vector3
import numpy as np
import pytest

from tactile_common.errors import ConfigurationError
from tactile_common.polyline import arc_length
from tactile_common.ros.conversions import pose_from_msg
from tactile_msgs.action import TrackSurface
from tactile_sensing.devices.calibration import Calibration
from tactile_sensing.dome.geometry import Dome, HalfSpaceDome
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.image import Layer, TactileImage
from tactile_servo.cli import build_jacobian_table
from tactile_servo.config import ServoConfig
from tactile_servo.control import surface_filter
from tactile_servo.control.surface_filter import SurfaceFilter
from tactile_servo.control.surface_path import PlanarPath, raster, SectionPath, spiral
from tactile_servo.conversions import surface_goal_from_msg, touch_to_msg
from tactile_servo.law import Observation, Teachable, Touch
from tactile_servo.laws.registry import LAWS, make_law
from tactile_servo.laws.surface_config import ProbeConfig, SurfaceConfig
from tactile_servo.laws.surface_features import between, ContactSense, Felt, PadContact
from tactile_servo.laws.surface_following import Record, SurfaceFollowing
from tactile_servo.laws.surface_goal import (
    Pattern,
    plan_path,
    refuse_surface_goal,
    SurfaceGoal,
)
from tactile_servo.reasons import Reason, ReasonCode
from tactile_servo.tactile_jacobian import (
    build_table,
    FeatureKind,
    grid,
    Increments,
    load_table,
    ModelFeatures,
)

PITCH, FORCE = 0.0254 / 16, 5.0
ARRAY, DOME = TactelArray(16, 16, PITCH, PITCH), Dome()
HALF_SPACE = HalfSpaceDome(DOME, ARRAY)
GOAL = SurfaceGoal(0.05, FORCE, length=0.1)
DOWN = np.array([0.0, 0.0, -1.0])
TABLE = build_table(ModelFeatures(HALF_SPACE, ARRAY), FeatureKind.CENTROID, grid(
    ARRAY.half_width_x, ARRAY.half_width_y, 6, (2.0, 3.5, 5.0, 7.5)),
    Increments(stiffness=ProbeConfig().stiffness(FORCE)), ARRAY.half_width_x)


def image_of(place, force, stress=None):
    """Image of a contact, as a sensor that is calibrated by the force."""
    if stress is None:
        state = np.array([*place, force, 0.0, 0.0])
        stress = HALF_SPACE.image(state)[0] / ModelFeatures(HALF_SPACE, ARRAY).sensitivity
    return TactileImage(0, 0, (Layer('zz', DOME.depth, stress, noise_std=1.0),), ARRAY, True)


def sense():
    return ContactSense(ARRAY, DOME, SurfaceConfig(), FORCE)


def arc(radius, cylinder, count=160, step=3e-4):
    """Centres and inward normals along a way round a sphere, or across a cylinder along y."""
    angles = step / radius * np.arange(count)
    normals = -np.column_stack([np.sin(angles), 0.0 * angles, np.cos(angles)])
    centres = -radius * normals
    if cylinder:
        centres[:, 1] = 2e-4 * np.arange(count)
    return centres, normals


@pytest.mark.parametrize('radius, cylinder', [(0.062, False), (0.06, True), (1e4, False)])
def test_the_filter_is_exact_on_spheres_cylinders_and_planes(radius, cylinder):
    centres, normals = arc(radius, cylinder)
    felt = SurfaceFilter()
    felt.update(0.0, normals[0], centres[0], 1e-3)
    for centre, normal in zip(centres[1:-20], normals[1:-20], strict=True):
        felt.update(0.0, normal, centre, 1e-3)
    way = centres[-20] - centres[-21]
    way /= np.linalg.norm(way)
    bend = -(1.0 - way[1]**2) / radius  # along the way, inward normals on what is convex
    assert way @ felt.bend @ way == pytest.approx(bend, abs=0.2)
    depth, normal = felt.predict(centres[-1])  # 6 mm ahead
    assert abs(depth) < 3e-6 and normal == pytest.approx(normals[-1], abs=2e-3)
    assert felt.bend_std(way) < 2.0


def test_depths_tell_more_of_the_normal_than_places_do(monkeypatch):
    rng = np.random.default_rng(0)
    centres, normals = arc(0.062, False)
    errors = {}
    for name, noise in (('depth', 4e-6), ('no depth', 1e-2)):
        monkeypatch.setattr(surface_filter, 'DEPTH_NOISE', noise)
        felt = SurfaceFilter()
        felt.update(0.0, normals[0], centres[0], 4e-3)
        for centre, normal in zip(centres[1:], normals[1:], strict=True):
            felt.update(rng.normal(0.0, 2e-6), normal + rng.normal(0.0, 4e-3, 3), centre, 4e-3)
        errors[name] = abs((felt.normal - normals[-1]) @ [normals[-1][2], 0, -normals[-1][0]])
    assert errors['depth'] < 1e-3 and errors['depth'] < errors['no depth']


def test_an_edge_is_a_surprise():
    centres, normals = arc(1e4, False, 120)
    felt = SurfaceFilter()
    felt.update(0.0, normals[0], centres[0], 1e-3)
    for centre, normal in zip(centres[1:], normals[1:], strict=True):
        felt.update(0.0, normal, centre, 1e-3)
    way = np.array([1.0, 0.0, 0.0])
    known = felt.bend_std(way)
    turned = np.array([-0.05, 0.0, -1.0])
    felt.update(-2e-5, turned / np.linalg.norm(turned), centres[-1] + 3e-4 * way, 1e-3)
    assert felt.bend_std(way) > 5.0 * known


def test_a_line_goes_round_a_cylinder_in_its_plane_and_leads_back_to_it():
    path = SectionPath(np.array([0.0, 0.0, 0.03]), DOWN, np.array([1.0, 0.0, 5.0]))
    for angle in np.linspace(0.0, 2.5, 9):
        normal = -np.array([np.sin(angle), 0.0, np.cos(angle)])
        step = path.step(-0.03 * normal, normal, 10.0, 0.05)
        assert step.way == pytest.approx([np.cos(angle), 0.0, -np.sin(angle)], abs=1e-9)
    assert path.step(np.zeros(3), np.array([0.0, 1.0, 0.0]), 10.0, 0.05) is None
    path = SectionPath(np.zeros(3), DOWN, np.array([1.0, 0.0, 0.0]))
    assert path.step(np.array([0.01, 1e-3, 0.0]), DOWN, 10.0, 0.05).way[1] < -0.1
    assert path.step(np.array([0.01, -1e-3, 0.0]), DOWN, 10.0, 0.05).way[1] > 0.1


@pytest.mark.parametrize('plan', [raster(0.04, 0.02, 0.005), spiral(0.015, 0.004)])
def test_patterns_are_gone_through_to_the_end(plan):
    path = PlanarPath(np.zeros(3), DOWN, np.array([1.0, 0.0, 0.0]), plan, 0.5)
    place, places, dt = np.zeros(3), [], 0.0025
    for _ in range(20000):
        step = path.step(place, DOWN, 30.0, 0.05)
        if step.left == 0.0:
            break
        assert np.linalg.norm(step.way) == pytest.approx(1.0) and abs(step.way[2]) < 1e-9
        place = place + min(step.top, 0.05) * dt * step.way
        places.append(place)
    assert step.left == 0.0
    # On z down, y of the plan points along -y.
    corners = plan * [1.0, -1.0]
    for corner in corners:
        assert np.hypot(*(np.array(places)[:, :2] - corner).T).min() < 1.2e-3


def test_rows_of_a_raster_are_step_over_apart_on_what_is_not_too_steep():
    plan = raster(0.04, 0.02, 0.005)
    rows = np.unique(np.round(plan[abs(plan[:, 0]) == 0.02][:, 1], 6))
    assert rows == pytest.approx([-0.01, -0.005, 0.0, 0.005, 0.01])
    path = PlanarPath(np.zeros(3), DOWN, np.array([1.0, 0.0, 0.0]), raster(0.04, 0.02, 0.005), 0.5)
    assert path.step(np.zeros(3), np.array([0.99, 0.0, -0.14]), 30.0, 0.05) is None


@pytest.mark.parametrize('change, word', [
    ({'length': -1.0}, 'length'), ({'length': np.nan}, 'length'),
    ({'length': 0.0}, 'length or a duration'), ({'pattern': 9}, 'pattern 9'),
    ({'direction': (0.0, 0.0, 0.0)}, 'direction'),
    ({'direction': (np.nan, 0.0, 0.0)}, 'direction'),
    ({'pattern': Pattern.RASTER}, 'size'),
    ({'pattern': Pattern.RASTER, 'size': (1.0, 1.0), 'step_over': 1e-4}, 'longer than'),
    ({'pattern': Pattern.SPIRAL, 'size': (0.1, 0.0)}, 'step_over'),
    ({'pattern': Pattern.SPIRAL, 'size': (0.3, 0.0), 'step_over': 1e-3}, 'longer than'),
    ({'pattern': Pattern.POINTS, 'points': np.array([[1e9, 0.0, 0.0]])}, 'longer than'),
    ({'pattern': Pattern.POINTS}, 'points'),
    ({'pattern': Pattern.POINTS, 'points': np.full((2, 3), np.inf)}, 'points')])
def test_goals_that_make_no_sense_are_refused(change, word):
    refused = refuse_surface_goal(replace(GOAL, **change))
    assert refused is not None and refused.code == ReasonCode.INVALID_GOAL
    assert word in refused.text
    assert refuse_surface_goal(GOAL) is None


@pytest.mark.parametrize('change, plan', [
    ({'pattern': Pattern.RASTER, 'size': (0.04, 0.02), 'step_over': 0.005},
     raster(0.04, 0.02, 0.005)),
    ({'pattern': Pattern.SPIRAL, 'size': (0.03, 0.0), 'step_over': 0.002}, spiral(0.03, 0.002))])
def test_the_length_of_a_pattern_is_known_before_the_contact(change, plan):
    assert replace(GOAL, **change).way == pytest.approx(arc_length(plan)[-1], rel=0.15)


def test_points_need_no_direction():
    goal = replace(GOAL, pattern=Pattern.POINTS, direction=(0.0, 0.0, 0.0),
                   points=np.array([[0.02, 0.01, 0.0]]))
    assert refuse_surface_goal(goal) is None
    step = plan_path(goal, np.zeros(3), DOWN, 0.2).step(np.zeros(3), DOWN, 30.0, 0.05)
    assert step.way == pytest.approx(np.array([2.0, 1.0, 0.0]) / np.sqrt(5.0), abs=1e-3)


def test_speeds_allow_to_brake_for_every_bend_and_no_less():
    plan = np.array([[0.0, 0.0], [0.05, 0.0], [0.05, 0.02]])
    path = PlanarPath(np.zeros(3), DOWN, np.array([1.0, 0.0, 0.0]), plan, 0.2)
    tops, stations = path._tops, path._stations
    slope = np.diff(tops ** 2) / np.diff(stations)
    assert slope.min() > -2.0 * 0.2 * (1.0 + 1e-9) and tops[-1] == 0.0
    # Before the corner and the end it brakes as hard as that.
    assert slope[(stations[:-1] > 0.02) & (stations[:-1] < 0.045)] == pytest.approx(-0.4)


def test_goal_messages():
    message = TrackSurface.Goal(
        speed=0.05, force=4.0, pattern=1, direction=Vector3(x=1.0), size=[0.06, 0.05],
        step_over=0.004, points=[Point(x=1.0, y=2.0, z=3.0)], features='soft', retreat=True)
    goal = surface_goal_from_msg(message)
    assert goal.pattern == Pattern.RASTER and goal.size == (0.06, 0.05)
    assert goal.direction == (1.0, 0.0, 0.0) and goal.points.tolist() == [[1.0, 2.0, 3.0]]
    assert goal.features == 'soft' and goal.retreat
    assert surface_goal_from_msg(TrackSurface.Goal(pattern=77)).pattern == 77


@pytest.mark.parametrize('place', [(0.0, 0.0), (3e-3, -2e-3), (-6e-3, 6e-3)])
@pytest.mark.parametrize('table', [None, TABLE])
def test_contacts_are_felt_where_they_are(place, table):
    pose = np.eye(4)
    pose[:3, 3] = 0.1, 0.2, 0.3
    felt = ContactSense(ARRAY, DOME, SurfaceConfig(), FORCE, table).look(
        image_of(place, FORCE), pose)
    assert isinstance(felt, Felt)
    assert felt.place == pytest.approx(place, abs=0.05 * np.hypot(*place) + 5e-5)
    assert felt.force == pytest.approx(FORCE, rel=0.1)
    assert felt.centre == pytest.approx([0.1, 0.2, 0.3 - DOME.skin_radius])
    assert felt.normal == pytest.approx(DOME.direction(felt.place))


def test_a_depth_is_that_of_an_elastic_foundation():
    law = SurfaceFollowing(ServoConfig())
    law.begin(GOAL, SENSOR)
    stiffness = ProbeConfig().stiffness(FORCE)
    felt = sense().look(image_of((0.0, 0.0), FORCE), np.eye(4))
    assert law.depth(felt.force) == pytest.approx(0.0, abs=1e-6)
    slope = law.depth(5.05) - law.depth(4.95)
    assert 0.1 / slope == pytest.approx(stiffness, rel=0.01)
    assert law.depth(0.0) == pytest.approx(-2.0 * FORCE / stiffness)
    law.press.unexplained = law.depth(6.0)
    assert law.unfelt == pytest.approx(6.0 - FORCE)


def test_what_is_no_contact():
    looking, pose = sense(), np.eye(4)
    for image, code in (
            (image_of(None, 0, np.zeros(ARRAY.shape)), ReasonCode.CONTACT_LOST),
            (image_of(None, 0, np.full(ARRAY.shape, np.nan)), ReasonCode.BAD_IMAGE),
            (image_of(None, 0, np.zeros((4, 4))), ReasonCode.BAD_IMAGE),
            (replace(image_of((0, 0), FORCE), layers=()), ReasonCode.BAD_IMAGE)):
        found = looking.look(image, pose)
        assert isinstance(found, Reason) and found.code == code


def test_a_table_on_disk_is_used_and_a_wrong_one_refused(tmp_path):
    path = tmp_path / 'table.npz'
    features = ModelFeatures(HALF_SPACE, ARRAY, FeatureKind.MOMENTS)
    build_table(features, FeatureKind.MOMENTS, grid(0.01, 0.01, 5, (4.0, 5.0, 6.0)), Increments(),
                0.0127).save(path)
    config = SurfaceConfig(table=str(path))
    law = SurfaceFollowing(ServoConfig(), config)
    law.begin(GOAL, Calibration(ARRAY, depth=DOME.depth).sensor_info('pad', '', 0))
    law.observe(Observation(0, 0.0, 0.0, np.eye(4), image_of((2e-3, 1e-3), FORCE)))
    assert (law.error.lateral, law.error.longitudinal) == pytest.approx((2e-3, 1e-3), abs=3e-4)
    path.write_text('nonsense')
    with pytest.raises(ValueError, match='table.npz'):
        SurfaceFollowing(ServoConfig(), config)


@pytest.mark.parametrize('force', [1.0, 10.0])
def test_a_table_serves_goals_of_other_forces_than_it_was_built_for(tmp_path, force):
    path = str(tmp_path / 'table.npz')
    assert build_jacobian_table.main([
        path, '--model', 'half_space', '--forces', '0.5', '1', '2', '5', '10', '20']) == 0
    sense = ContactSense(ARRAY, DOME, SurfaceConfig(), force, load_table(path))
    features = ModelFeatures(HALF_SPACE, ARRAY)
    for share in (0.7, 1.3):
        found = sense.contact_of(features(np.array([0.0, 0.0, share * force]))).force
        assert found == pytest.approx(share * force, rel=0.05)


def test_a_goal_without_an_accurate_contact_still_says_how_long_it_touched():
    record = Record(ProbeConfig(), cycles=400, touching=300, kept=200, square=200 * 1e-6)
    assert record.result().contact_kept == 0.75
    assert record.result().centre_rms == pytest.approx(1e-3)
    assert record.result().contour is None
    assert np.isnan(Record(ProbeConfig()).result().contact_kept)


def test_the_depth_of_the_tactels_is_that_of_the_calibration():
    law = SurfaceFollowing(ServoConfig())
    law.begin(GOAL, Calibration(ARRAY, depth=0.003).sensor_info('pad', '', 0))
    assert law._dome.depth == pytest.approx(0.003)
    with pytest.raises(ConfigurationError, match='`depth`'):  # unknown
        law.begin(GOAL, Calibration(ARRAY).sensor_info('pad', '', 0))


@pytest.mark.parametrize('inward', [(0.0, 0.0, -1.0), (0.36, 0.48, -0.8), (-0.6, 0.0, 0.8),
                                    (0.0, 0.0, 1.0)])
def test_a_contact_in_a_message_looks_outwards(inward):
    message = touch_to_msg(Touch(3, np.array([0.1, 0.2, 0.3]), np.array(inward)), 'base')
    pose = pose_from_msg(message.pose)
    assert pose[:3, 2] == pytest.approx(-np.array(inward))
    assert pose[:3, 3] == pytest.approx([0.1, 0.2, 0.3])
    assert message.header.frame_id == 'base' and message.header.stamp.nanosec == 3


SENSOR = Calibration(ARRAY, depth=0.002).sensor_info('pad', '', 0)


@pytest.fixture
def law():
    """Law that was shown a contact of 4 N beside the centre, and one of 6 N in it."""
    law = SurfaceFollowing(ServoConfig())
    law.teach('aside', image_of((3e-3, -1e-3), 4.0), ARRAY)
    law.teach('firm', image_of((0.0, 0.0), 6.0), ARRAY)
    return law


def see(law, image):
    law.observe(Observation(0, 0.0, 0.0, np.eye(4), image))
    return law.error


def test_what_was_taught_is_what_is_wanted(law):
    law.begin(replace(GOAL, features='aside'), SENSOR)
    error = see(law, image_of((3e-3, -1e-3), 4.0))
    assert (error.lateral, error.longitudinal) == pytest.approx((0.0, 0.0), abs=2e-5)
    moved = see(law, image_of((3.2e-3, -1e-3), 4.0))
    assert moved.lateral == pytest.approx(2e-4, rel=0.3)


def test_features_are_gone_through_along_the_way(law):
    law.begin(replace(GOAL, features='aside, firm'), SENSOR)
    for progress, share in ((0.0, 0.0), (0.05, 0.5), (0.1, 1.0)):
        law.assess(1.0, progress, 5.0)
        error = see(law, image_of((0.0, 0.0), 5.0))
        assert error.lateral == pytest.approx(-3e-3 * (1.0 - share), abs=2e-4)


def test_several_aims_are_interpolated():
    aims = [PadContact(force, np.full(2, force)) for force in (1.0, 3.0, 4.0)]
    for share, force in ((-1, 1.0), (0, 1.0), (0.25, 2.0), (0.5, 3.0), (0.75, 3.5), (2, 4.0)):
        aim = between(aims, share)
        assert aim.force == pytest.approx(force) and aim.place == pytest.approx([force] * 2)
    assert between(aims[:1], 0.7) is aims[0]


@pytest.mark.parametrize('goal, word', [
    ({'features': 'gently'}, "no features were taught by the name 'gently'; known: aside, firm"),
    ({'features': 'aside,,firm'}, "the name ''"),
    ({'features': 'aside', 'force': 8.0}, "'aside' are of 4.0"),
    ({'features': 'aside, firm', 'pattern': Pattern.SPIRAL, 'size': (0.02, 0.0),
      'step_over': 0.004}, 'a line, or a duration')])
def test_goals_for_features_that_cannot_be_met_are_refused(law, goal, word):
    refused = law.validate(replace(GOAL, **goal))
    assert refused is not None and word in refused.text
    assert refused.code in (ReasonCode.UNSUPPORTED_GOAL, ReasonCode.INVALID_GOAL)
    assert law.validate(replace(GOAL, features='aside')) is None
    assert law.validate(replace(GOAL, features='firm, aside, firm')) is None


def holed(image):
    """An image half of whose tactels are missing."""
    image.layers[0].stress[::2] = np.nan
    return image


@pytest.mark.parametrize('name, image, word', [
    ('', image_of((0.0, 0.0), 5.0), 'name is'), ('a, b', image_of((0.0, 0.0), 5.0), 'name is'),
    ('x' * 41, image_of((0.0, 0.0), 5.0), 'name is'),
    ('faint', image_of((0.0, 0.0), 0.2), 'feels 0.20 N, must be 0.5 N'),
    ('holed', holed(image_of((0.0, 0.0), 5.0)), 'too many tactels'),
    ('none', TactileImage(0, 0, (), ARRAY, True), 'no calibrated pressure')])
def test_what_cannot_be_taught_is_refused(law, name, image, word):
    with pytest.raises(ConfigurationError, match=word):
        law.teach(name, image, ARRAY)


def test_a_name_is_taught_again(law):
    told = law.teach('aside', image_of((2e-3, 0.0), 5.0), ARRAY)
    assert told.startswith('aside: M0 ') and 'centroid at ' in told
    law.begin(replace(GOAL, features='aside'), SENSOR)
    assert see(law, image_of((2e-3, 0.0), 5.0)).lateral == pytest.approx(0.0, abs=2e-5)


def test_laws_that_can_be_taught():
    # The node offers ~/teach for these alone.
    assert [name for name in LAWS if isinstance(make_law(name, ServoConfig()), Teachable)] == [
        'tactile_jacobian', 'jacobian_rate']
