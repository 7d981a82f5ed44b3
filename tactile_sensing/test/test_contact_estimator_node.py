"""The contact estimator node: what it publishes for an image."""
from averages_over_tactels import line_average
import numpy as np
import pytest
import rclpy
from rclpy.serialization import serialize_message

from tactile_sensing.conversions import image_to_msg
from tactile_sensing.nodes.contact_estimator import ContactEstimatorNode
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.image import Layer, TactileImage

ARRAY = TactelArray(16, 16, 1.6e-3, 1.6e-3)


@pytest.fixture(scope='module')
def node():
    rclpy.init()
    node = ContactEstimatorNode()
    yield node
    node.destroy_node()
    rclpy.shutdown()


@pytest.mark.parametrize('unit', ['Pa', 'counts'])
def test_a_wrench_is_published_where_the_force_is_valid(node, monkeypatch, unit):
    """An edge along x in Pa has a force; in counts with unknown gain only a place."""
    contacts, wrenches = [], []
    monkeypatch.setattr(node._contact, 'publish', contacts.append)
    monkeypatch.setattr(node._wrench, 'publish', wrenches.append)
    picture = line_average(ARRAY.x, ARRAY.y[:, None], 2e-3, np.pi / 2, 200.0, 0.0, 2e-3,
                           ARRAY.pitch_x, ARRAY.pitch_y)
    layer = Layer('zz', 2e-3, picture.astype(np.float32), noise_std=500.0, unit=unit)
    image = image_to_msg(TactileImage(0, 1, (layer,), ARRAY, tared=True, frame_id='pad'))
    node._on_image(bytes(serialize_message(image)))
    (contact,) = contacts
    assert contact.valid and contact.force_valid == (unit == 'Pa') == bool(wrenches)
    assert (contact.x, contact.y) == pytest.approx((0.0, 2e-3), abs=1e-4)
    assert abs(np.cos(contact.yaw)) < 0.01
    assert np.isfinite(contact.normal_force) == np.isfinite(contact.patch) == (unit == 'Pa')
    for wrench in wrenches:
        assert wrench.wrench.force.z == -contact.normal_force
