"""The shape estimator node: what it publishes of a replayed trace, resets and odd input."""
import time

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
import numpy as np
import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, qos_profile_sensor_data, QoSProfile
from scipy.spatial.transform import Rotation
from visualization_msgs.msg import MarkerArray

from benchmarks.shape.surfaces import add_noise, sphere, Weave
from tactile_common.errors import ConfigurationError
from tactile_common.ros.conversions import stamp_from_ns, stamp_to_ns
from tactile_common.ros.runner import make_executor
from tactile_msgs.msg import Contact as ContactMsg
from tactile_msgs.msg import SurfacePatch
from tactile_shape.contour.outline import find_outline
from tactile_shape.nodes.shape_estimator import ShapeEstimatorNode

DEADLINE = 20.0  # s
MS = 1_000_000
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
RADIUS = 0.035


class Replay(Node):
    """Publishes poses and contacts; keeps what comes back."""

    def __init__(self, context):
        super().__init__('replay', context=context, namespace='shape_test')
        self.poses = self.create_publisher(PoseStamped, 'sensor_pose', qos_profile_sensor_data)
        self.contacts = self.create_publisher(ContactMsg, 'contact', qos_profile_sensor_data)
        self.patches, self.contours, self.markers = [], [], []
        self.create_subscription(SurfacePatch, 'surface_patch', self.patches.append, 100)
        self.create_subscription(Path, 'contour', self.contours.append, LATCHED)
        self.create_subscription(MarkerArray, 'markers', self.markers.append, LATCHED)

    def ready(self):
        return self.poses.get_subscription_count() and self.contacts.get_subscription_count() \
            and self.count_publishers('/shape_test/surface_patch') \
            and self.count_publishers('/shape_test/markers')


class Bench:
    def __init__(self, context, **parameters):
        self.node = ShapeEstimatorNode(
            context=context, namespace='shape_test',
            parameter_overrides=[Parameter(k, value=v) for k, v in parameters.items()])
        self.replay = Replay(context)
        self.executor = make_executor(context)
        for node in (self.node, self.replay):
            self.executor.add_node(node)
        self.wait(self.replay.ready, 'the match of the topics')

    def wait(self, condition, what):
        end = time.monotonic() + DEADLINE
        while not condition():
            assert time.monotonic() < end, f'{what} did not come'
            self.executor.spin_once(timeout_sec=0.05)

    def touch(self, contact, pose=None):
        """Publish a contact and, before it, its pose; returns the patch that comes."""
        count = len(self.replay.patches)
        if pose is not None:
            self.replay.poses.publish(pose)
        self.replay.contacts.publish(contact)
        self.wait(lambda: len(self.replay.patches) > count, 'a patch')
        return self.replay.patches[-1]


@pytest.fixture
def bench(context):
    """Give a function that makes a bench with parameters of the node."""
    benches = []
    yield lambda **parameters: benches.append(Bench(context, **parameters)) or benches[-1]
    for it in benches:
        it.executor.shutdown()


def pose_msg(stamp_ns, position, normal, frame='base', offset=(0.0, 0.0)):
    turn, _ = Rotation.align_vectors([normal], [[0.0, 0.0, 1.0]])
    pose = PoseStamped()
    pose.header.stamp, pose.header.frame_id = stamp_from_ns(stamp_ns), frame
    origin = position - turn.apply([*offset, 0.0])
    for axis, value in zip('xyz', origin, strict=True):
        setattr(pose.pose.position, axis, float(value))
    for axis, value in zip('xyzw', turn.as_quat(), strict=True):
        setattr(pose.pose.orientation, axis, float(value))
    return pose


def contact_msg(stamp_ns, x=0.0, y=0.0, kind=ContactMsg.TYPE_POINT, valid=True, yaw=0.0):
    contact = ContactMsg(sensor='pad', type=kind, valid=valid, x=x, y=y, yaw=yaw)
    contact.header.stamp, contact.header.frame_id = stamp_from_ns(stamp_ns), 'tactile_pad'
    return contact


def test_a_trace_over_a_sphere_of_70_mm(bench):
    points, normals = Weave().trace(sphere(RADIUS), 0.045)
    # The pad touches up to 2 mm off its centre; what it reports has the noise of real contacts.
    rng = np.random.default_rng(5)
    noisy, turned = add_noise(points, normals, rng)
    offsets = 2e-3 * np.sin(np.arange(len(points)) / 15.0)
    radii = []
    it = bench()
    for k, (point, normal, x) in enumerate(zip(noisy, turned, offsets, strict=True)):
        stamp = (1000 + 5 * k) * MS
        patch = it.touch(
            contact_msg(stamp, x=x), pose_msg(stamp, point, normal, 'base', (x, 0)))
        assert stamp_to_ns(patch.header.stamp) == stamp and patch.header.frame_id == 'base'
        assert patch.sensor == 'pad'
        if patch.valid and all(patch.curvature_seen) and patch.extent > 0.02:
            assert patch.kind == SurfacePatch.KIND_SPHERE
            radii.append(1.0 / patch.curvature[0])
    it.touch(contact_msg(stamp + MS, kind=ContactMsg.TYPE_NONE, valid=False),
             pose_msg(stamp + MS, point, normal))
    it.wait(lambda: len(it.replay.contours[-1].poses) > 20
            and len(it.replay.markers[-1].markers) == 4, 'contour and markers')
    contour = it.replay.contours[-1]
    markers = it.replay.markers[-1].markers
    assert len(radii) > 50
    np.testing.assert_allclose(radii, RADIUS, rtol=0.02)
    assert contour.header.frame_id == 'base'
    xyz = np.array([[getattr(p.pose.position, axis) for axis in 'xyz'] for p in contour.poses])
    assert np.abs(sphere(RADIUS).distance(xyz)).max() < 3e-4
    assert {marker.ns for marker in markers} == {
        'surface', 'patch', 'contour', 'principal directions'}


def test_an_edge_makes_a_contour_of_its_radius(bench):
    """A pad that follows a curved edge of 60 mm radius at 23 mm/s, its own centre .3 mm off."""
    up, speed, radius = np.array([0.0, 0.0, 1.0]), 0.023, 0.06
    rng = np.random.default_rng(2)
    it = bench()
    for k in range(400):
        angle = speed * 0.01 * k / radius
        out = np.array([np.cos(angle), np.sin(angle), 0.0])
        lean = 0.1 * np.sin(k / 20.0)
        pose = pose_msg((1000 + 10 * k) * MS, (radius - 3e-4) * out, up)
        turn = Rotation.from_rotvec([0.0, 0.0, angle + lean])
        for axis, value in zip('xyzw', turn.as_quat(), strict=True):
            setattr(pose.pose.orientation, axis, float(value))
        # In the frame of the pad the edge is at 3e-4 along the radius, turned back by lean.
        away = 3e-4 + rng.normal(0.0, 2e-5)
        patch = it.touch(contact_msg(
            (1000 + 10 * k) * MS, x=away * np.cos(lean), y=-away * np.sin(lean),
            kind=ContactMsg.TYPE_LINE, yaw=-lean), pose)
    assert not patch.valid and 'an edge' in patch.reason
    it.touch(contact_msg((1000 + 10 * k) * MS, kind=ContactMsg.TYPE_NONE, valid=False), pose)
    it.wait(lambda: len(it.replay.contours[-1].poses) > 75, 'the contour')
    xyz = np.array([[getattr(p.pose.position, axis) for axis in 'xyz']
                    for p in it.replay.contours[-1].poses])
    (side,) = find_outline(xyz).sides
    assert side.kind == 'arc' and side.radius == pytest.approx(radius, rel=0.01)


def test_another_frame_begins_another_model(bench):
    up = np.array([0.0, 0.0, 1.0])
    it = bench()
    it.touch(contact_msg(100 * MS), pose_msg(100 * MS, np.zeros(3), up))
    patch = it.touch(contact_msg(105 * MS), pose_msg(105 * MS, np.ones(3), up, 'world'))
    assert patch.header.frame_id == 'world' and patch.samples == 1
    it.wait(lambda: it.replay.contours[-1].header.frame_id == 'world', 'the contour')
    assert len(it.replay.contours[-1].poses) == 1


def test_a_recording_that_restarts_begins_another_model(bench):
    up = np.array([0.0, 0.0, 1.0])
    it = bench()
    for number, second in enumerate((5, 6, 7)):
        place = np.array([0.01 * number, 0.0, 0.0])
        it.touch(contact_msg(1000 * second * MS), pose_msg(1000 * second * MS, place, up))
    it.wait(lambda: len(it.replay.contours[-1].poses) == 3, 'the contour')
    it.touch(contact_msg(5000 * MS), pose_msg(5000 * MS, np.zeros(3), up))
    it.wait(lambda: len(it.replay.contours[-1].poses) == 1, 'a contour of the second turn')


def test_odd_input_is_passed_over(bench):
    up = np.array([0.0, 0.0, 1.0])
    it = bench()
    bad = pose_msg(100 * MS, np.zeros(3), up)
    bad.pose.orientation.w = 7.0
    nan = pose_msg(101 * MS, np.full(3, np.nan), up)
    for message in (bad, nan):
        it.replay.poses.publish(message)
    it.replay.contacts.publish(contact_msg(99 * MS, kind=77))
    patch = it.touch(
        contact_msg(102 * MS, x=float('nan')), pose_msg(102 * MS, np.zeros(3), up))
    assert not patch.valid and 'not located' in patch.reason
    same = [it.touch(contact_msg(103 * MS), pose_msg(103 * MS, np.zeros(3), up))
            for _ in range(3)]
    assert [patch.samples for patch in same] == [1, 2, 3] and not same[-1].valid
    patch = it.touch(contact_msg(50 * MS))  # older than every pose
    assert not patch.valid and 'no pose' in patch.reason


def test_contacts_without_a_pose_are_logged_once_while_they_come(bench, monkeypatch):
    it, warned, levels = bench(), [], []
    monkeypatch.setattr(it.node, '_warn', warned.append)
    monkeypatch.setattr(it.node, 'diagnose', lambda level, text: levels.append(level))
    monkeypatch.setattr(it.node, '_on_diagnose', lambda: None)  # of the timer
    it.touch(contact_msg(102 * MS), pose_msg(102 * MS, np.zeros(3), np.array([0.0, 0.0, 1.0])))

    def diagnose(lost):
        if lost:
            it.touch(contact_msg(50 * MS))  # older than every pose
        ShapeEstimatorNode._on_diagnose(it.node)
    diagnose(True)
    assert not warned  # a servo may still be starting
    it.node._begun -= 60.0
    for lost in (True, True, True, False, True):
        diagnose(lost)
    assert warned == [f'{k} contacts had no sensor_pose near their stamp' for k in (2, 5)]
    ok, warn = DiagnosticStatus.OK, DiagnosticStatus.WARN
    assert levels == [ok, warn, warn, warn, ok, warn]


def test_a_picture_that_is_no_message_is_passed_over(bench):
    it = bench()
    it.node._shape.take_image(b'garbage')
    patch = it.touch(contact_msg(100 * MS, kind=ContactMsg.TYPE_LINE),
                     pose_msg(100 * MS, np.zeros(3), np.array([0.0, 0.0, 1.0])))
    assert 'an edge' in patch.reason


def test_the_other_method(bench):
    points, normals = Weave().trace(sphere(RADIUS), 0.03)
    it = bench(method='surface_matrix')
    for k, (point, normal) in enumerate(zip(points, normals, strict=True)):
        patch = it.touch(contact_msg(5 * k * MS), pose_msg(5 * k * MS, point, normal))
    assert patch.valid and patch.method == 'surface_matrix'
    np.testing.assert_allclose(1.0 / np.array(patch.curvature), RADIUS, rtol=1e-6)


@pytest.mark.parametrize('name, value', [('window', 0.0), ('window', 'wide'), ('method', 'magic')])
def test_refused_parameters(context, name, value):
    with pytest.raises(ConfigurationError, match=name):
        ShapeEstimatorNode(context=context, parameter_overrides=[Parameter(name, value=value)])
