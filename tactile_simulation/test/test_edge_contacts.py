"""Contacts of edges in rendered pictures: bends and ends are where the picture has them."""
from dataclasses import replace

import numpy as np
import pytest

from tactile_sensing.contact.estimator import ContactEstimator, EstimatorConfig
from tactile_sensing.image import image_moments
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import Contact, ContactType, Reason
from tactile_sensing.types.image import Layer, TactileImage
from tactile_shape.contour.contact_path import locate, needs_picture
from tactile_simulation.render import render
from tactile_simulation.sensor import Skin


def line(x, yaw):
    return Contact(ContactType.LINE, True, Reason(0), 'fit', x=x, y=0.0, yaw=yaw)


def test_a_line_through_a_bend_is_located_in_its_picture():
    array, skin = TactelArray(16, 16, 0.0016, 0.0016), Skin()
    arc = 0.06 * np.array([[1.0 - np.cos(t), np.sin(t)] for t in np.linspace(0.0, 0.4, 40)])
    edge = np.column_stack([np.concatenate([[[0.0, -0.03]], arc]), np.full(41, -8e-4)])
    edge[:, 1] += 4e-3
    pressure = render(edge, array, skin)
    noise = 0.01 * pressure.max()
    pressure += noise * np.random.default_rng(0).standard_normal(pressure.shape)
    picture = TactileImage(
        0, 0, (Layer('zz', skin.depth, pressure, noise_std=noise),), array, tared=True)
    contact = ContactEstimator(EstimatorConfig(tactel='point')).estimate(picture)
    assert contact.valid and abs(contact.offset) > 5e-5  # the edge is through the middle
    place, is_edge = locate(contact, picture)
    assert is_edge and np.hypot(*place) < 2e-5


@pytest.mark.parametrize('yaw', [-1.5, -0.5, 0.0, 0.3, 1.5, np.pi / 2])
def test_a_whole_straight_edge_needs_no_picture(yaw):
    array = TactelArray(16, 16, 0.0016, 0.0016)
    for end, needed in ((0.03, False), (0.0, True)):
        along = np.array([-np.sin(yaw), np.cos(yaw)])
        points = np.array([[1e-3, 0.0]]) + np.array([[-0.03], [end]]) * along
        pressure = render(np.column_stack([points, [-8e-4, -8e-4]]), array, Skin())
        contact = replace(line(1e-3, yaw), moments=image_moments(pressure, array))
        assert needs_picture(contact) == needed


def test_an_edge_ends_where_its_picture_says():
    array, skin = TactelArray(16, 16, 0.0016, 0.0016), Skin()
    ending = np.array([[1e-3, -0.02, -8e-4], [1e-3, -0.004, -8e-4]])
    pressure = render(ending, array, skin)
    picture = TactileImage(
        0, 0, (Layer('zz', skin.depth, pressure, noise_std=1.0),), array, tared=True)
    assert locate(line(1e-3, 0.0)) == ((1e-3, 0.0), True)
    place, edge = locate(line(1e-3, 0.0), picture)
    assert edge and place == pytest.approx((1e-3, -4e-3), abs=1.7e-3)  # a tactel
