"""Polylines and angles: values worked by hand, and what must not depend on the frame."""
import math

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from tactile_common.geometry import wrap_angle
from tactile_common.polyline import arc_length, nearest_on_polyline, resample

# An L: 3 m along x, then 4 m along y.
CORNER = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 4.0]])
COORDINATES = st.floats(-1.0, 1.0).map(lambda value: round(value, 6))


def nearest(points, x, y, first=-math.inf, last=math.inf):
    return nearest_on_polyline(points[:, 0], points[:, 1], arc_length(points), x, y, first, last)


def moved(points, angle, shift):
    c, s = math.cos(angle), math.sin(angle)
    return points @ np.array([[c, s], [-s, c]]) + shift


@given(st.floats(-1e3, 1e3), st.integers(-20, 20))
def test_wrap_leaves_the_direction(angle, turns):
    wrapped = wrap_angle(angle + 2.0 * math.pi * turns)
    assert -math.pi <= wrapped <= math.pi
    assert math.cos(wrapped - angle) == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_array_equal(wrap_angle(np.full(2, angle)), wrap_angle(angle))


def test_arc_length_and_resampling():
    np.testing.assert_array_equal(arc_length(CORNER), [0.0, 3.0, 7.0])
    np.testing.assert_array_equal(arc_length(np.array([[0.0, 0, 0], [1.0, 2, 2]])), [0.0, 3.0])
    assert arc_length(CORNER[:1]) == [0.0] and not len(arc_length(CORNER[:0]))
    wide = np.column_stack([CORNER, [5.0, 6.0, 9.0]])
    np.testing.assert_array_equal(arc_length(wide[:, :2]), [0.0, 3.0, 7.0])
    along = arc_length(CORNER)
    np.testing.assert_allclose(resample(CORNER, along, np.array([-1.0, 1.5, 3.0, 5.0, 9.0])),
                               [[0, 0], [1.5, 0], [3, 0], [3, 2], [3, 4]])


@pytest.mark.parametrize('point, station, place, offset, left, along', [
    ((1.0, 0.5), 1.0, (1.0, 0.0), 0.5, 0.5, (1.0, 0.0)),  # beside a chord, to the left
    ((1.0, -0.5), 1.0, (1.0, 0.0), -0.5, -0.5, (1.0, 0.0)),
    ((2.0, 3.0), 6.0, (3.0, 3.0), 1.0, 1.0, (0.0, 1.0)),
    ((-3.0, -4.0), 0.0, (0.0, 0.0), -5.0, -4.0, (1.0, 0.0)),  # before the beginning
    ((3.5, 5.0), 7.0, (3.0, 4.0), -math.sqrt(1.25), -0.5, (0.0, 1.0)),  # beyond the end
    ((4.0, -0.1), 3.0, (3.0, 0.0), -math.sqrt(1.01), -0.1, (1.0, 0.0)),  # outside the corner
    ((1.0, 0.0), 1.0, (1.0, 0.0), 0.0, 0.0, (1.0, 0.0))])
def test_projection(point, station, place, offset, left, along):
    found = nearest(CORNER, *point)
    assert found.station == pytest.approx(station)
    assert (found.x, found.y) == pytest.approx(place)
    assert found.offset == pytest.approx(offset)
    assert found.left == pytest.approx(left)
    assert (found.along_x, found.along_y) == pytest.approx(along)


def test_the_side_outside_a_sharp_corner():
    # Turned by 170 degrees to the left: just outside of the tip, the first chord sees the point
    # on its left by little, the second on its right by more.
    tip = np.array([[-1.0, 0.0], [0.0, 0.0], [-math.cos(0.17), math.sin(0.17)]])
    found = nearest(tip, 1.0, 0.05)
    assert found.left == pytest.approx(0.05)
    assert found.offset == pytest.approx(-math.hypot(1.0, 0.05))


def test_projection_between_stations_and_on_chords_without_length():
    both = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 0.1]])
    assert nearest(both, 0.0, 0.05).station == pytest.approx(0.0)
    assert nearest(both, 0.0, 0.06, 1.5, 9.0).station > 3.0
    assert nearest(both, 0.0, 0.1, 0.0, 0.5).station == pytest.approx(0.0)
    doubled = np.repeat(CORNER, 2, axis=0)
    for point in ((-1.0, 1.0), (1.0, 0.5), (3.0, 1.0), (4.0, -0.1), (3.5, 6.0)):
        assert nearest(doubled, *point) == pytest.approx(nearest(CORNER, *point))
    still = nearest(np.zeros((2, 2)), 3.0, 4.0)  # a vertical edge, seen from above
    assert abs(still.offset) == 5.0 and (still.along_x, still.along_y) == (0.0, 0.0)


@settings(max_examples=200)
@given(st.lists(st.tuples(COORDINATES, COORDINATES), min_size=2, max_size=8, unique=True),
       st.tuples(COORDINATES, COORDINATES), st.floats(-4.0, 4.0),
       st.tuples(COORDINATES, COORDINATES))
def test_nothing_depends_on_the_frame(vertices, point, angle, shift):
    points, point = np.array(vertices), np.array(point)
    there, image = moved(points, angle, shift), moved(point, angle, shift)
    np.testing.assert_allclose(arc_length(there), arc_length(points), atol=1e-9)
    found, again = nearest(points, *point), nearest(there, *image)
    # Two places may be equally near, and then either is right: compare the distances.
    assert abs(again.offset) == pytest.approx(abs(found.offset), abs=1e-9)
    for polyline, at, result in ((points, point, found), (there, image, again)):
        place = resample(polyline, arc_length(polyline), np.array([result.station]))[0]
        np.testing.assert_allclose(place, (result.x, result.y), atol=1e-9)
        assert np.linalg.norm(at - place) == pytest.approx(abs(result.offset), abs=1e-9)
        # No sample of the polyline is nearer.
        length = arc_length(polyline)
        samples = resample(polyline, length, np.linspace(0.0, length[-1], 200))
        assert np.linalg.norm(samples - at, axis=1).min() > abs(result.offset) - 1e-9
