"""A curved edge, traced by the whole graph, gives a contour of its radius."""

from nav_msgs.msg import Path
import numpy as np
import pytest
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from tactile_tests.graph import bench, half_rates

from tactile_msgs.msg import SurfacePatch
from tactile_shape.contour.outline import find_outline
from tactile_shape.nodes.shape_estimator import ShapeEstimatorNode

RADIUS = 0.06  # m, of the scene `curve`
LIFTED = 20  # patches without contact, after which a contour that came with the first is here
CASE = np.array([[0.275, -0.0545], [0.344, -0.0545], [0.344, 0.0545], [0.275, 0.0545]])


class ContourListener(Node):
    """Keeps the newest contour and counts the patches, and those since the pad lifted off."""

    def __init__(self, **kwargs):
        super().__init__('contour_listener', **kwargs)
        self.contour, self.patches, self.lifted = None, 0, 0
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(Path, 'contour', self._on_contour, latched)
        self.create_subscription(SurfacePatch, 'surface_patch', self._on_patch, 100)

    def _on_contour(self, msg):
        self.contour = msg

    def _on_patch(self, msg):
        self.patches += 1
        self.lifted = self.lifted + 1 if msg.reason == 'nothing is touched' else 0

    def wait_for_the_last_contour(self, it):
        """Contours come once a second; the last one when the pad has lifted off."""
        it.wait(lambda: self.lifted > LIFTED, 'the last contour')

    @property
    def points(self):
        """Contour, ndarray (N, 3) [m]."""
        poses = self.contour.poses if self.contour else []
        return np.array([[getattr(pose.pose.position, axis) for axis in 'xyz']
                         for pose in poses]).reshape(-1, 3)


def test_the_curved_edge_has_its_radius(tmp_path):
    with bench('curve', parameters=half_rates(tmp_path)) as it:
        it.add_all()
        it.graph.add(ShapeEstimatorNode)
        listener = it.graph.add(ContourListener)
        client = it.track(speed=0.06, length=0.12)
        assert client.success, client.reason
        listener.wait_for_the_last_contour(it)
        contour, patches = listener.points, listener.patches
    assert patches > 80  # of 200 images; a slow machine skips some
    outline = find_outline(contour)
    curved = max(outline.sides, key=lambda side: side.length)
    assert curved.kind == 'arc' and curved.radius == pytest.approx(RADIUS, rel=0.01)


def test_the_tape_case_has_its_sides(tmp_path):
    with bench('tape_case', parameters=half_rates(tmp_path)) as it:
        it.add_all()
        it.graph.add(ShapeEstimatorNode)
        listener = it.graph.add(ContourListener)
        client = it.track(speed=0.05, closed=True)
        assert client.success and client.reason == 'the contour closed', client.reason
        listener.wait_for_the_last_contour(it)
        outline = find_outline(listener.points)
    assert outline.closed and len(outline.corners) == 4
    # From corner to corner: where a slow machine has held, a side may be divided.
    lengths = np.sort(np.linalg.norm(
        outline.corners - np.roll(outline.corners, 1, axis=0), axis=1))
    np.testing.assert_allclose(lengths, [0.069, 0.069, 0.109, 0.109], atol=3e-4)
    # From above; the skin has yielded by about 1 mm, of which the contour knows nothing.
    away = np.linalg.norm(outline.corners[:, None, :2] - CASE, axis=-1).min(axis=1)
    assert away.max() < 1.5e-4
