"""Corners, sides and radii of traced contours."""
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tactile_common.errors import ConfigurationError
from tactile_shape.contour.outline import find_outline

TAPE = np.array([[0.0, 0.0], [0.109, 0.0], [0.109, 0.069], [0.0, 0.069]])


def walk(vertices, spacing=2.5e-4):
    """Points along a polyline."""
    travel = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(vertices, axis=0), axis=1)))
    s = np.arange(0.0, travel[-1], spacing)
    return np.column_stack([np.interp(s, travel, v) for v in vertices.T])


def tape(rng, noise=1e-4, rounding=1e-3, overlap=0.0):
    """Traced case of 109 x 69 mm from the middle of a side, its corners rounded by the skin."""
    start = np.array([0.05, 0.0])
    loop = walk(np.array([start, *TAPE[1:], TAPE[0], start + [overlap, 0.0]]))
    corner = np.abs(loop[:, None, :] - TAPE).max(axis=-1)
    for k, vertex in enumerate(TAPE):
        near = corner[:, k] < rounding
        loop[near] += 0.2 * (np.array([0.0545, 0.0345]) - vertex) / 0.05 * (
            rounding - corner[near, k])[:, None]
    return lifted(loop + rng.normal(0.0, noise, loop.shape))


def lifted(flat):
    return np.column_stack([flat, np.zeros(len(flat))])


@pytest.mark.parametrize('overlap', [0.0, 0.008])
def test_tape_case(overlap):
    for seed in range(5):
        outline = find_outline(tape(np.random.default_rng(seed), overlap=overlap))
        assert outline.closed and len(outline.corners) == 4
        lengths = [side.length for side in outline.sides]
        np.testing.assert_allclose(lengths, [0.069, 0.109, 0.069, 0.109], atol=3e-4)
        np.testing.assert_allclose(np.degrees(outline.angles), 90.0, atol=0.5)
        assert {side.kind for side in outline.sides} == {'line'}
        away = np.linalg.norm(outline.corners[:, None, :2] - TAPE, axis=-1).min(axis=1)
        assert away.max() < 3e-4
        np.testing.assert_array_equal(outline.points[0], outline.points[-1])
        np.testing.assert_allclose(outline.points[:-1], outline.corners)
    assert 'side 1: line, 6' in str(outline) and '4 corners' in str(outline)


def test_contacts_that_are_off_do_not_divide_a_side():
    """The first contacts of a goal are of little force: tenths of a millimetre off."""
    for seed in range(8):
        rng = np.random.default_rng(seed)
        contour = tape(rng, noise=1.5e-5)[::4]
        contour[1:12, 1] += rng.normal(0.0, 2e-4, 11)
        sides = find_outline(contour).sides
        np.testing.assert_allclose(
            [side.length for side in sides], [0.069, 0.109, 0.069, 0.109], atol=5e-4)


@pytest.mark.parametrize('radius, angle', [(0.06, 1.5), (0.02, 3.0), (0.06, 5.0)])
def test_curved_edge(radius, angle):
    s = np.arange(0.0, angle, 2.5e-4 / radius)
    arc = radius * np.column_stack([np.cos(s), np.sin(s)])
    rng = np.random.default_rng(3)
    outline = find_outline(lifted(arc + rng.normal(0.0, 2e-5, arc.shape)))
    assert len(outline.corners) == 0 and not outline.closed
    (side,) = outline.sides
    assert side.kind == 'arc' and side.radius == pytest.approx(radius, rel=0.01)
    assert side.length == pytest.approx(radius * s[-1], rel=0.01)
    assert np.abs(np.linalg.norm(outline.points, axis=1) - radius).max() < 0.01 * radius


@pytest.mark.parametrize('noise', [1e-6, 3e-5])
def test_a_line_that_goes_over_into_an_arc_and_back(noise):
    """The scene `curve`: 30 mm, a quarter of a circle of 60 mm radius, 30 mm."""
    radius = 0.06
    angle = np.arange(0.0, np.pi / 2, 1e-3 / radius)
    arc = radius * np.column_stack([np.sin(angle), 1.0 - np.cos(angle)])
    path = np.concatenate([walk(np.array([[-0.03, 0.0], [0.0, 0.0]]), 1e-3), arc,
                           walk(np.array([[radius, radius], [radius, radius + 0.03]]), 1e-3)])
    for seed in range(2):
        rng = np.random.default_rng(seed)
        outline = find_outline(lifted(path + rng.normal(0.0, noise, path.shape)))
        assert [side.kind for side in outline.sides] == ['line', 'arc', 'line']
        assert len(outline.corners) == 0
        lengths = [side.length for side in outline.sides]
        assert outline.sides[1].radius == pytest.approx(radius, rel=0.01)
        np.testing.assert_allclose(lengths, [0.03, np.pi / 2 * radius, 0.029], atol=5e-3)


def test_a_short_line_before_an_arc_is_none_of_the_arc():
    rng, radius = np.random.default_rng(4), 0.06
    angle = np.arange(0.0, 0.5 * np.pi, 1e-3 / radius)
    arc = radius * np.column_stack([np.sin(angle), 1.0 - np.cos(angle)])
    path = np.concatenate([walk(np.array([[-0.01, 0.0], [0.0, 0.0]]), 1e-3), arc])
    outline = find_outline(lifted(path + rng.normal(0.0, 1e-5, path.shape)))
    assert [side.kind for side in outline.sides] == ['line', 'arc']
    assert np.linalg.norm(outline.points[0] - lifted(path)[0]) < 5e-5


@pytest.mark.parametrize('radius, degrees', [(0.012, 60), (0.016, 45), (0.025, 35)])
def test_a_short_arc_between_lines_is_not_two_corners(radius, degrees):
    turn = np.radians(degrees)
    along = np.arange(0.0, 0.08 + radius * turn, 1e-3)
    heading = np.clip((along - 0.04) / radius, 0.0, turn)
    contour = 1e-3 * np.cumsum(np.column_stack([np.cos(heading), np.sin(heading)]), axis=0)
    for seed in range(10):
        noise = np.random.default_rng(seed).normal(0.0, 1e-5, contour.shape)
        outline = find_outline(lifted(contour + noise))
        assert [side.kind for side in outline.sides] == ['line', 'arc', 'line']
        assert len(outline.corners) == 0
        assert outline.sides[1].radius == pytest.approx(radius, rel=0.05)


def test_a_whole_circle_and_a_line():
    s = np.linspace(0.0, 2.0 * np.pi, 800)
    ring = find_outline(lifted(0.03 * np.column_stack([np.cos(s), np.sin(s)])))
    assert ring.closed and len(ring.corners) == 0
    assert ring.sides[0].radius == pytest.approx(0.03, rel=1e-3)
    assert ring.sides[0].length == pytest.approx(2 * np.pi * 0.03, rel=0.01)
    line = walk(np.array([[0.0, 0.0], [0.1, 0.05]]))
    noisy = line + np.random.default_rng(4).normal(0.0, 5e-5, line.shape)
    outline = find_outline(lifted(noisy))
    assert [side.kind for side in outline.sides] == ['line'] and not outline.closed
    assert outline.sides[0].length == pytest.approx(np.hypot(0.1, 0.05), abs=5e-4)


@pytest.mark.parametrize('start', [0, 30, 80, 140])
def test_a_closed_contour_of_lines_and_arcs_wherever_it_begins(start):
    """Two lines of 60 mm and two half circles of 20 mm radius; no corner."""
    angle = np.arange(-0.5 * np.pi, 0.5 * np.pi, 1e-3 / 0.02)
    half = 0.02 * np.column_stack([np.cos(angle), np.sin(angle)]) + [0.03, 0.0]
    line = np.column_stack([np.arange(-0.03, 0.03, 1e-3), np.full(60, -0.02)])
    oval = np.concatenate([line, half, -line, -half])
    rng = np.random.default_rng(start)
    outline = find_outline(lifted(np.roll(oval, -start, axis=0)
                                  + rng.normal(0.0, 1e-5, oval.shape)))
    assert outline.closed and len(outline.corners) == 0
    assert sorted(side.kind for side in outline.sides) == ['arc', 'arc', 'line', 'line']
    for side in outline.sides:
        length, radius = (0.06, np.inf) if side.kind == 'line' else (0.02 * np.pi, 0.02)
        assert side.radius == pytest.approx(radius, rel=0.01)
        assert side.length == pytest.approx(length, abs=4e-3)


@pytest.mark.parametrize('degrees', [12, 28, 40, 60, 90, 120])
def test_open_corner(degrees):
    turn = np.radians(degrees)
    path = walk(np.array([[0, 0], [0.05, 0], [0.05 + 0.05 * np.cos(turn), 0.05 * np.sin(turn)]]))
    rng = np.random.default_rng(5)
    outline = find_outline(lifted(path + rng.normal(0.0, 5e-5, path.shape)))
    assert len(outline.corners) == 1
    np.testing.assert_allclose(outline.corners[0], [0.05, 0.0, 0.0], atol=1e-4)
    assert abs(np.degrees(outline.angles[0])) == pytest.approx(degrees, abs=0.5)


@pytest.mark.parametrize('reach', [2e-3, 4e-3, 6e-3])
def test_a_blunt_corner_that_the_skin_has_rounded_is_one_corner(reach):
    turn = np.radians(30.0)
    end = [0.08 + 0.1 * np.cos(turn), 0.1 * np.sin(turn)]
    path = walk(np.array([[0.0, 0.0], [0.08, 0.0], end]), 1e-3)
    away = np.linalg.norm(path - [0.08, 0.0], axis=1)
    inward = np.array([-np.sin(0.5 * turn), np.cos(0.5 * turn)])
    path = path + 3e-4 * np.exp(-(away / (0.5 * reach))**2)[:, None] * inward
    rng = np.random.default_rng(5)
    outline = find_outline(lifted(path + rng.normal(0.0, 1e-5, path.shape)))
    assert [side.kind for side in outline.sides] == ['line', 'line']
    np.testing.assert_allclose(outline.corners[0], [0.08, 0.0, 0.0], atol=1e-4)


@pytest.mark.parametrize('degrees', [45, 90, -90])
def test_a_corner_that_the_skin_has_made_an_arc_is_one_corner(degrees):
    turn, radius = np.radians(abs(degrees)), 3e-3
    angle = np.arange(0.0, turn, 0.3)
    arc = radius * np.column_stack([np.sin(angle), 1.0 - np.cos(angle)])
    arc[:, 0] -= radius * np.tan(0.5 * turn)
    legs = 1e-3 * np.arange(4, 50)[:, None]
    path = np.concatenate([-legs[::-1] * [1.0, 0.0], arc, legs * [np.cos(turn), np.sin(turn)]])
    path[:, 1] *= np.sign(degrees)
    rng = np.random.default_rng(10)
    outline = find_outline(lifted(path + rng.normal(0.0, 1e-5, path.shape)))
    assert [side.kind for side in outline.sides] == ['line', 'line']
    np.testing.assert_allclose(outline.corners[0], 0.0, atol=1e-4)


def test_a_straight_edge_that_rises_is_seen_from_above():
    y = np.arange(0.0, 0.18, 1e-3)
    rise = np.interp(y, [0.0, 0.06, 0.12, 0.18], [0.0, 0.0, 0.006, 0.006])
    rng = np.random.default_rng(8)
    contour = np.column_stack([0.3 + rng.normal(0.0, 2e-5, len(y)), y, rise])
    outline = find_outline(contour)
    assert [side.kind for side in outline.sides] == ['line'] and len(outline.corners) == 0
    assert np.abs(outline.points[:, 0] - 0.3).max() < 1e-4


def test_the_ends_of_an_open_contour_are_on_its_sides():
    """One contact that is off, the last one, does not tilt a side."""
    contour = walk(np.array([[0.0, 0.0], [0.03, 0.0]]))
    true = lifted(contour[[0, -1]])
    contour[:, 1] += np.random.default_rng(0).normal(0.0, 1e-5, len(contour))
    contour[0, 1], contour[-1, 1] = 2e-4, -2e-4
    assert np.abs(find_outline(lifted(contour)).points[[0, -1]] - true).max() < 1e-4


def test_a_contour_that_first_goes_back_and_forth_is_not_closed():
    """As the contacts of a pad that met a wave nearly across it."""
    rng = np.random.default_rng(4)
    way = 1e-3 * np.concatenate([np.arange(0, -14, -1.0), np.arange(-14, 130, 1.0)])
    points = np.column_stack([5e-5 * rng.standard_normal(way.size), way, np.zeros(way.size)])
    outline = find_outline(points)
    assert not outline.closed and len(outline.corners) == 0
    assert outline.sides[0].length > 0.128


def test_a_gap_makes_no_corner():
    y = np.concatenate([np.arange(0.0, 0.07, 1e-3), np.arange(0.084, 0.18, 1e-3)])
    rng = np.random.default_rng(9)
    line = np.column_stack([rng.normal(0.0, 2e-5, len(y)), y, np.zeros(len(y))])
    assert len(find_outline(line).corners) == 0


@pytest.mark.parametrize('across', [6e-3, 12e-3])
def test_a_step_makes_no_corner_far_away(across):
    """An object that slipped: the sides before and after the step are parallel."""
    x = np.arange(0.0, 0.18, 1e-3)
    for seed in range(20):
        y = np.where(x < 0.08, 0.0, across)
        y += np.random.default_rng(seed).normal(0.0, np.where(abs(x - 0.08) < 8e-3, 2e-4, 2e-5))
        outline = find_outline(lifted(np.column_stack([x, y])))
        apart = np.linalg.norm(outline.points[:, None, :2] - np.column_stack([x, y]), axis=2)
        assert apart.min(axis=1).max() < 1e-2


def test_the_plane_does_not_matter():
    contour = tape(np.random.default_rng(6))
    turn = Rotation.from_rotvec([0.3, -0.2, 0.5]).as_matrix()
    one, other = find_outline(contour), find_outline(contour @ turn.T + [0.1, 0.2, 0.3])
    np.testing.assert_allclose(other.corners, one.corners @ turn.T + [0.1, 0.2, 0.3], atol=1e-9)


@pytest.mark.parametrize('points, message', [
    (np.zeros((3, 3)), 'shape'), (np.zeros((5, 2)), 'shape'), (np.full((9, 3), np.nan), 'finite'),
    (np.zeros((9, 3)), 'long'),
    ([[0.0, 0.0, 0.0], [0.096, 0.0, 0.0], [0.1, 0.0, 0.0], [0.105, 0.0, 0.0]], '96 of its 105')])
def test_refused_contours(points, message):
    with pytest.raises(ConfigurationError, match=message):
        find_outline(points)


@settings(max_examples=100)
@given(npst.arrays(float, st.tuples(st.integers(4, 30), st.just(3)),
                   elements=st.floats(-1.0, 1.0)))
def test_garbage_gives_an_outline_or_a_refusal(points):
    try:
        outline = find_outline(points)
    except ConfigurationError:
        return
    assert np.isfinite(outline.corners).all()
    assert all(np.isfinite(side.length) for side in outline.sides)
