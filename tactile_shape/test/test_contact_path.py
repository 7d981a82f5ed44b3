"""Contacts on the pad to contacts in space: geometry, interpolation, order and gaps."""
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from tactile_common.state_buffer import pose_between, StateBuffer
from tactile_sensing.thesis.line import pressure as line_pressure
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import Contact, ContactType, Reason
from tactile_sensing.types.image import Layer, TactileImage
from tactile_sensing.types.moments import Moments
from tactile_shape.contour.contact_path import ContactPath, locate, needs_picture, on_pad

MS = 1_000_000


def point(x=0.0, y=0.0, valid=True):
    return Contact(ContactType.POINT, valid, Reason(0), 'fit', x=x, y=y, yaw=np.nan)


def line(x, yaw, y=0.0, **known):
    """Line through (x, y)."""
    return Contact(ContactType.LINE, True, Reason(0), 'fit', x=x, y=y, yaw=yaw, **known)


NOTHING = Contact(ContactType.NONE, False, Reason.NO_CONTACT, 'fit')


def pose(seed):
    it = np.eye(4)
    it[:3, :3] = Rotation.from_rotvec(np.random.default_rng(seed).normal(0, 0.3, 3)).as_matrix()
    it[:3, 3] = np.random.default_rng(seed).normal(0, 0.1, 3)
    return it


def other(m0, place, along, across, reasons=Reason.BAD_FIT):
    """Contact that no model explains, of given centre and variances along y and x [m^2]."""
    x, y = place
    return Contact(ContactType.OTHER, False, reasons, 'fit', moments=Moments(
        m0, m0 * x, m0 * y, m0 * (across + x * x), m0 * (along + y * y), m0 * x * y))


def test_point_on_a_flat_pad():
    place, edge = locate(point(1e-3, -2e-3))
    assert place == (1e-3, -2e-3) and not edge
    position, normal = on_pad(place)
    np.testing.assert_allclose(position, [1e-3, -2e-3, 0.0])
    np.testing.assert_array_equal(normal, [0.0, 0.0, 1.0])


@pytest.mark.parametrize('yaw', [0.0, 0.4, -1.0, 1.5, np.pi / 2])
def test_edge_is_touched_where_it_is_nearest_to_the_centre(yaw):
    place, edge = locate(line(3e-3, yaw))
    along = np.array([-np.sin(yaw), np.cos(yaw)])
    assert edge and np.dot(place, along) == pytest.approx(0.0, abs=1e-15)
    # and on the line through (3 mm, 0) with direction (-sin, cos)
    away = np.subtract(place, [3e-3, 0.0])
    assert away[0] * along[1] - away[1] * along[0] == pytest.approx(0.0, abs=1e-15)


def test_an_edge_along_x_is_the_same_on_either_side_of_the_wrap():
    """At 90 and just past -90 degrees: one edge, whose ends change places."""
    places = []
    for yaw, ends in ((np.pi / 2, {'start': 1e-3}), (1e-9 - np.pi / 2, {'end': -1e-3})):
        for known in ({}, ends):
            contact = line(0.0, yaw, y=4e-3, **known)
            place, edge = locate(contact)
            assert edge
            places.append(place)
    np.testing.assert_allclose(places, [(0.0, 4e-3), (-1e-3, 4e-3)] * 2, atol=1e-10)


def test_a_large_area_that_stands_out_is_at_its_centre_of_pressure_a_bent_edge_not():
    assert locate(other(5.0, (1e-3, 2e-3), 9e-6, 8e-6)) == (pytest.approx((1e-3, 2e-3)), False)
    # Without its picture a bent edge, or a corner, is not located: it is not at its centre.
    assert locate(other(5.0, (1e-3, 2e-3), 50e-6, 4e-6)) == (None, False)
    both = Reason.BAD_FIT | Reason.TWO_CONTACTS
    assert locate(other(5.0, (0.0, 0.0), 9e-6, 8e-6, both)) == (None, False)
    assert locate(other(0.0, (0.0, 0.0), 9e-6, 8e-6)) == (None, False)
    faint = Reason.BAD_FIT | Reason.LOW_SNR
    assert locate(other(0.2, (1e-3, 2e-3), 9e-6, 8e-6, faint)) == (None, False)
    assert locate(replace(line(1e-3, 0.0), reasons=Reason.LOW_SNR)) == (None, False)


def test_a_bent_edge_is_located_in_its_picture():
    array = TactelArray(16, 16, 0.0016, 0.0016)
    pressure = line_pressure(array.x, array.y[:, None], 1e-3, 0.3, 200.0, 0.002)
    picture = TactileImage(0, 0, (Layer('zz', 0.002, pressure, noise_std=1.0),), array, tared=True)
    bent = other(5.0, (2e-3, 2e-3), 50e-6, 4e-6)
    place, edge = locate(bent, picture)
    assert edge and place == pytest.approx((1e-3 * np.cos(0.3), 1e-3 * np.sin(0.3)), abs=1e-6)
    assert locate(point(1e-3, -2e-3), picture) == ((1e-3, -2e-3), False)  # as fitted
    assert locate(line(1.02e-3, 0.3), picture) == locate(line(1.02e-3, 0.3))


def test_only_what_may_be_a_bent_edge_needs_its_picture():
    assert needs_picture(other(5.0, (0.0, 0.0), 9e-6, 8e-6))
    assert not needs_picture(point()) and not needs_picture(NOTHING)


def test_round_finger():
    position, normal = on_pad((3e-3, 4e-3), 0.01)
    assert np.linalg.norm(normal) == pytest.approx(1.0)
    np.testing.assert_allclose(position[:2], [3e-3, 4e-3])
    np.testing.assert_allclose(position - 0.01 * normal, [0.0, 0.0, -0.01], atol=1e-15)
    assert on_pad((0.011, 0.0), 0.01) == (None, None)
    for x in (np.nan, np.inf, -1e200):
        assert on_pad((x, 0.0)) == (None, None)
    assert locate(line(1e-3, np.inf)) == (None, False) == locate(line(1e-3, np.nan))
    assert locate(point(valid=False)) == (None, False) == locate(NOTHING)


def test_interpolation_is_that_of_scipy():
    one, other = pose(1), pose(2)
    buffer = StateBuffer(pose_between, size=2, restart_ns=1000 * MS)
    assert buffer.add(0, one) and buffer.add(100 * MS, other)
    assert not buffer.add(100 * MS, one) and not buffer.add(50 * MS, one)
    slerp = Slerp([0.0, 0.1], Rotation.from_matrix([one[:3, :3], other[:3, :3]]))
    for ms in (0, 25, 60, 100):
        found = buffer.at(ms * MS)
        np.testing.assert_allclose(found[:3, :3], slerp(ms * 1e-3).as_matrix(), atol=1e-12)
        np.testing.assert_allclose(
            found[:3, 3], one[:3, 3] + 0.01 * ms * (other[:3, 3] - one[:3, 3]))
    assert buffer.at(101 * MS) is None and buffer.at(-1) is None


def test_contacts_wait_for_their_pose_and_keep_their_order():
    path = ContactPath()
    path.add_pose(0, pose(1))
    assert path.add_contact(5 * MS, point(), 'first') == []
    assert path.add_contact(9 * MS, point(), 'second') == []
    (extra, first, anew, _), (other, second, later, _) = path.add_pose(10 * MS, pose(2))
    assert (extra, anew) == ('first', True) and (other, later) == ('second', False)
    np.testing.assert_allclose(
        first.position, 0.5 * (pose(1)[:3, 3] + pose(2)[:3, 3]), atol=1e-12)
    # A contact older than the newest pose is placed at once.
    ((_, third, _, _),) = path.add_contact(10 * MS, point())
    np.testing.assert_allclose(third.position, pose(2)[:3, 3])
    assert path.lost == 0


def test_a_pad_that_lifts_off_touches_nowhere():
    """Neither what it still touches nor, while contact flickers, what it touches again."""
    path = ContactPath()
    for ms in range(0, 350, 50):
        path.add_pose(ms * MS, np.eye(4))

    def place(ms, load):
        return path.add_contact(ms * MS, replace(
            point(), moments=Moments(load, 0.0, 0.0, 0.0, 0.0, 0.0)))[0].contact

    assert place(0, 5.0) and place(10, 3.0)
    assert not place(20, 2.0) and 'lifts off' in path.add_contact(
        25 * MS, replace(point(), moments=Moments(2.0, *5 * (0.0,))))[0].reason
    path.add_contact(30 * MS, NOTHING)
    assert not place(40, 0.5)
    assert place(300, 0.5)  # another touch, a light one


def test_one_heavy_image_does_not_end_the_contour():
    path, found = ContactPath(), []
    for ms in range(0, 3000, 10):
        path.add_pose(ms * MS, np.eye(4))
        found += path.add_contact(ms * MS, replace(point(), moments=Moments(
            11.0 if ms == 30 else 5.0, 0.0, 0.0, 0.0, 0.0, 0.0)))
    assert sum(one.contact is None for one in found) < 30


def test_lost_contact_and_gaps_begin_a_new_path():
    path = ContactPath()
    for k in range(100):
        path.add_pose(10 * k * MS, np.eye(4))

    def anew(ms, contact):
        ((_, _, result, _),) = path.add_contact(ms * MS, contact)
        return result

    assert [anew(10, point()), anew(20, point()), anew(30, point(valid=False)),
            anew(40, point())] == [True, False, False, False]
    assert anew(50, NOTHING) and anew(60, point()) and not anew(70, point())
    assert not anew(210, point()) and anew(370, point())  # 140 and 160 ms after the last


def test_a_recording_that_restarts():
    path = ContactPath()
    path.add_pose(10_000 * MS, pose(1))
    path.add_contact(10_000 * MS, point())
    assert path.add_pose(0, pose(2)) == []
    ((_, contact, anew, _),) = path.add_contact(0, point())
    np.testing.assert_allclose(contact.position, pose(2)[:3, 3])
    assert anew


def test_contacts_without_poses_are_counted_and_dropped():
    path = ContactPath()
    path.add_pose(1_000 * MS, pose(1))
    ((_, contact, _, why),) = path.add_contact(500 * MS, point())
    assert contact is None and path.lost == 1 and 'no pose' in why
    for k in range(250):
        path.add_contact((2_000 + k) * MS, point())
    assert path.lost == 51
