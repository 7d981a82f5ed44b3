"""The tape case, traced by the whole graph, gives a closed contour of its sides."""
from nav_msgs.msg import Path
import numpy as np
from rclpy.qos import DurabilityPolicy, QoSProfile
from tactile_tests.graph import bench, half_rates

from tactile_msgs.msg import SurfacePatch
from tactile_shape.contour.outline import find_outline
from tactile_shape.nodes.shape_estimator import ShapeEstimatorNode

LIFTED = 20  # patches without contact, after which a contour that came with the first is here
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
CASE = np.array([[0.275, -0.0545], [0.344, -0.0545], [0.344, 0.0545], [0.275, 0.0545]])


def test_the_tape_case_has_its_sides(tmp_path):
    with bench('tape_case', parameters=half_rates(tmp_path)) as it:
        it.add_all()
        it.graph.add(ShapeEstimatorNode)
        contours = it.listener.keep(Path, 'contour', LATCHED)
        patches = it.listener.keep(SurfacePatch, 'surface_patch', 100)
        client = it.track(speed=0.05, closed=True)
        assert client.success and client.reason == 'the contour closed', client.reason
        # Contours come once a second; the last one when the pad has lifted off.
        it.wait(lambda: {patch.reason for patch in patches[-LIFTED:]} == {'nothing is touched'},
                'the last contour')
        outline = find_outline(np.array([[getattr(pose.pose.position, axis) for axis in 'xyz']
                                         for pose in contours[-1].poses]))
    assert outline.closed and len(outline.corners) == 4
    # From corner to corner: where a slow machine has held, a side may be divided.
    lengths = np.sort(np.linalg.norm(
        outline.corners - np.roll(outline.corners, 1, axis=0), axis=1))
    np.testing.assert_allclose(lengths, [0.069, 0.069, 0.109, 0.109], atol=3e-4)
    # From above; the skin has yielded by about 1 mm, of which the contour knows nothing.
    away = np.linalg.norm(outline.corners[:, None, :2] - CASE, axis=-1).min(axis=1)
    assert away.max() < 1.5e-4
