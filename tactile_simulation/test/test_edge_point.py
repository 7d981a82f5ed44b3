"""Bends, corners and ends are located where pictures have them; round contacts are not."""
from dataclasses import replace

from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
import numpy as np
import pytest

from tactile_sensing.contact.estimator import ContactEstimator, EstimatorConfig
from tactile_sensing.image import image_moments
from tactile_sensing.skin.pressure import SkinPressure
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import Contact, ContactType, Reason
from tactile_sensing.types.image import Layer, TactileImage
from tactile_sensing.types.skin import Skin
from tactile_shape.contour.contact_path import edge_point, locate, needs_picture
from tactile_simulation.render import render
from tactile_simulation.sensor import SceneSkin

PITCH = 0.0254 / 16
PAD = TactelArray(16, 16, PITCH, PITCH)
SKIN = SceneSkin()
PRESS = 8e-4  # m
NOISE = 630.0  # Pa


def image(pressure, **changes):
    layer = Layer('zz', SKIN.depth, np.asarray(pressure, np.float32), noise_std=NOISE)
    return replace(TactileImage(0, 0, (layer,), PAD, tared=True), **changes)


def edge(points, seed=0):
    """Picture of a polyline (N, 2) pressed into the skin."""
    clean = render(np.column_stack([points, np.full(len(points), -PRESS)]), PAD, SKIN)
    return image(clean + NOISE * np.random.default_rng(seed).standard_normal(clean.shape))


def arc(radius, heading):
    """Arc that touches the y axis of the pad at (1 mm, 0), turned about the pad's centre."""
    angle = np.linspace(-1.0, 1.0, 400) * min(0.02 / radius, 1.5)
    points = np.column_stack([1e-3 - radius * (1.0 - np.cos(angle)), radius * np.sin(angle)])
    c, s = np.cos(heading), np.sin(heading)
    return points @ np.array([[c, s], [-s, c]])


@pytest.mark.parametrize('heading', [0.0, 0.4, 2.0])
@pytest.mark.parametrize('radius, bound', [(10.0, 2e-5), (0.06, 8e-5), (0.02, 2e-4)])
def test_a_curved_edge_is_where_it_is_nearest_to_the_centre(radius, bound, heading):
    """The skin blurs a curve inwards by about depth^2 / (2 radius)."""
    place = edge_point(edge(arc(radius, heading)))
    true = 1e-3 * np.array([np.cos(heading), np.sin(heading)])
    assert np.linalg.norm(place - true) < bound + SKIN.depth**2 / radius


@pytest.mark.parametrize('ahead', [2e-3, 4e-3, 8e-3])
def test_before_a_corner_the_place_is_on_the_leg(ahead):
    corner = np.array([[0.0, -0.03], [0.0, ahead], [-0.03, ahead]])
    x, y = edge_point(edge(corner))
    assert abs(x) < (3e-4 if ahead < 3e-3 else 1e-4) and abs(y) < 3e-4


@pytest.mark.parametrize('end', np.arange(-3e-3, 1.1e-3, 5e-4))
def test_an_edge_ends_between_tactels(end):
    """Load along half a line leaves half of the pressure at its end: finer than a pitch."""
    x, y = edge_point(edge(np.array([[0.0, -0.03], [0.0, end]])))
    bound = 3e-4 if end > -1e-3 else 5e-4
    assert abs(x) < 1.5e-4 and abs(y - min(end, 0.0)) < bound


@pytest.mark.parametrize('left', [2e-3, 4e-3, 6e-3])
def test_an_edge_that_leaves_the_pad_is_not_told_beyond_its_end(left):
    """The noise makes faint ridges beside and beyond what is left of it on the pad's border."""
    end = left - 8.0 * PITCH
    for seed in range(20):
        place = edge_point(edge(np.array([[0.0, -0.03], [0.0, end]]), seed))
        assert place is None or (abs(place[0]) < 2e-4 and place[1] < end + 2e-4)


def test_what_is_no_edge_is_not_located():
    x, y = PAD.x, PAD.y[:, None]
    round_contact = SkinPressure(Skin(SKIN.depth)).point(x, y, 1e-3, -1e-3, 5.0)
    assert round_contact.max() > 10.0 * NOISE
    for pressure in (np.zeros(PAD.shape), np.full(PAD.shape, 4e3), round_contact,
                     np.full(PAD.shape, np.nan)):
        assert edge_point(image(pressure)) is None
    sound = edge(arc(0.06, 0.0))
    (layer,) = sound.layers
    for picture in (replace(sound, tared=False), replace(sound, layers=()),
                    replace(sound, layers=(replace(layer, unit='counts'),)),
                    replace(sound, layers=(replace(layer, component='xz'),))):
        assert edge_point(picture) is None


@settings(max_examples=100)
@given(npst.arrays(np.float32, PAD.shape, elements=st.floats(width=32)))
def test_garbage_has_a_place_on_the_pad_or_none(pressure):
    place = edge_point(image(pressure))
    assert place is None or np.abs(place).max() < 0.0254


def line(x, yaw):
    return Contact(ContactType.LINE, True, Reason(0), 'fit', x=x, y=0.0, yaw=yaw)


def test_a_line_through_a_bend_is_located_in_its_picture():
    bend = 0.06 * np.array([[1.0 - np.cos(t), np.sin(t)] for t in np.linspace(0.0, 0.4, 40)])
    picture = edge(np.vstack([[[0.0, -0.03]], bend]) + [0.0, 4e-3])
    contact = ContactEstimator(EstimatorConfig(tactel='point')).estimate(picture)
    assert contact.valid and abs(contact.offset) > 5e-5  # the edge is through the middle
    place, is_edge = locate(contact, picture)
    assert is_edge and np.hypot(*place) < 2e-5


@pytest.mark.parametrize('yaw', [-1.5, -0.5, 0.0, 0.3, 1.5, np.pi / 2])
def test_a_whole_straight_edge_needs_no_picture(yaw):
    for end, needed in ((0.03, False), (0.0, True)):
        along = np.array([-np.sin(yaw), np.cos(yaw)])
        picture = edge(np.array([[1e-3, 0.0]]) + np.array([[-0.03], [end]]) * along)
        moments = image_moments(picture.layers[0].stress, PAD)
        assert needs_picture(replace(line(1e-3, yaw), moments=moments)) == needed


def test_a_line_ends_where_its_picture_says():
    picture = edge(np.array([[1e-3, -0.02], [1e-3, -0.004]]))
    assert locate(line(1e-3, 0.0)) == ((1e-3, 0.0), True)
    place, is_edge = locate(line(1e-3, 0.0), picture)
    assert is_edge and place == pytest.approx((1e-3, -4e-3), abs=1.7e-3)  # a tactel
