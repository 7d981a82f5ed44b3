"""Least-model estimator: exact without noise, the bars with it, and what a path cannot see."""
import re

from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.shape.cases import (
    CYLINDER_CASE,
    PLANE_CASE,
    rectangle,
    SPHERE_CASE,
    TORUS_CASE,
)
from benchmarks.shape.claims import with_noise
from benchmarks.shape.surfaces import (
    add_noise,
    cylinder,
    gradient,
    PLANE,
    sphere,
    Torus,
    value,
    Weave,
)
from tactile_common.errors import ConfigurationError
from tactile_shape.local_surface.curvature_fit import Fitter, Noise
from tactile_shape.local_surface.local_quadric import (
    LocalQuadric,
    LocalQuadricConfig,
    MAX_CELLS,
    YIELD,
)
from tactile_shape.types.patch import Kind
from tactile_shape.types.tangent import tangent_frame

EXACT = [(PLANE, Kind.PLANE), (cylinder(0.0325), Kind.CYLINDER), (cylinder(0.1), Kind.CYLINDER),
         (sphere(0.035), Kind.SPHERE), (sphere(0.063), Kind.SPHERE)]
# Largest error over 20 x 4 mm, median and 95th percentile [m], and the least share of right kinds.
BARS = [(PLANE, Kind.PLANE, 12e-6, 30e-6, 0.95),
        (cylinder(0.0325), Kind.CYLINDER, 40e-6, 1e-4, 0.95),
        (cylinder(0.1), Kind.CYLINDER, 40e-6, 1e-4, 0.95),
        (sphere(0.035), Kind.SPHERE, 35e-6, 1e-4, 0.88),
        (sphere(0.063), Kind.SPHERE, 35e-6, 1e-4, 0.88),
        (Torus(0.06, 0.025), Kind.GENERAL, 45e-6, 1.1e-4, 0.98)]
ESTIMATOR = LocalQuadric()


def last(estimator, points, normals):
    estimator.reset()
    for point, normal in zip(points, normals, strict=True):
        estimator.add(point, normal)
    return estimator.estimate()


def course(path):
    return np.array([np.cos(path.heading), np.sin(path.heading), 0.0])


def error(patch, surface, path):
    return np.abs(surface.distance(patch.sheet(rectangle(patch, course(path))))).max()


def true_curvature(surface):
    return np.sort(np.diag(surface.curvature))[::-1]


def test_synthetic_contacts_lie_on_their_surface():
    rng = np.random.default_rng(1)
    for surface in (*(s for s, _ in EXACT), Torus(0.06, 0.025)):
        along, across = rng.uniform(-0.02, 0.02, (2, 100))
        points, normals = surface.at(along, across)
        np.testing.assert_allclose(surface.distance(points), 0.0, atol=1e-15)
        # The distance falls by as much as one goes along the inward normal.
        np.testing.assert_allclose(surface.distance(points + 1e-3 * normals), -1e-3, atol=1e-12)
        np.testing.assert_allclose(surface.at(*np.zeros((2, 1)))[1], [[0.0, 0.0, 1.0]])


@pytest.mark.parametrize('surface, kind', EXACT)
def test_exact_without_noise_however_large_the_arc(surface, kind):
    path = Weave(heading=0.4, speed=0.3)  # contacts farther apart than a cell: none is averaged
    patch = last(ESTIMATOR, *path.trace(surface, 0.04))
    assert patch.valid and patch.kind == kind and patch.seen.all()
    assert error(patch, surface, path) < 1e-11
    np.testing.assert_allclose(patch.curvature, true_curvature(surface), atol=1e-6)


def test_averaging_in_cells_shifts_by_the_sagitta_of_a_cell_at_most():
    radius = 0.0325
    path = Weave(heading=0.4)
    patch = last(ESTIMATOR, *path.trace(sphere(radius), 0.03))
    np.testing.assert_allclose(patch.curvature, 1.0 / radius, rtol=1e-3)
    assert error(patch, sphere(radius), path) < 2 * 0.001**2 / (8 * radius)


@pytest.mark.parametrize('surface, kind, median, most, right', BARS)
def test_bars_with_realistic_noise(surface, kind, median, most, right):
    rng = np.random.default_rng(7)
    errors, kinds = [], []
    for _ in range(50):
        path = Weave(heading=rng.uniform(0.0, np.pi))
        patch = last(ESTIMATOR, *add_noise(*path.trace(surface, 0.028), rng))
        errors.append(error(patch, surface, path))
        kinds.append(patch.kind == kind)
    assert np.median(errors) < median
    assert np.percentile(errors, 95) < most
    assert np.mean(kinds) >= right


@pytest.mark.parametrize('inside', [0.0, 1e-3])
@pytest.mark.parametrize('surface', [cylinder(0.0325), sphere(0.035), sphere(0.063)])
def test_covariance_is_that_of_the_curvature(surface, inside):
    """The skin yields by `inside`: all contacts lie as far below the surface."""
    rng = np.random.default_rng(8)
    scores = []
    for _ in range(80):
        path = Weave(heading=rng.uniform(0.0, np.pi))
        positions, normals = add_noise(*path.trace(surface, 0.028), rng)
        patch = last(ESTIMATOR, positions + inside * normals, normals)
        off = patch.curvature[0] - true_curvature(surface)[0]
        unknown = 0.0 if inside else YIELD * patch.curvature[0]**2
        scores.append(off / np.sqrt(patch.covariance[0, 0] - unknown**2))
    rms = np.sqrt(np.mean(np.square(scores)))
    assert 0.5 < rms < 1.4 if inside else 0.75 < rms < 1.25


@pytest.mark.parametrize('alike', [4.0, 20.0])
@pytest.mark.parametrize('case', [CYLINDER_CASE, SPHERE_CASE, TORUS_CASE], ids=lambda c: c.name)
def test_errors_that_are_alike_are_no_surface(case, alike):
    """Errors of a filter or of the array's pitch last over many contacts."""
    scores, found = with_noise(case, alike, 60, np.random.default_rng(9))
    assert np.sqrt(np.mean(scores**2)) < 1.1
    assert np.mean([patch.kind == case.kind for patch in found]) > 0.8


def test_cells_of_unlike_weights_leave_correlations_below_one():
    """A correlation near 1 or above would make any excess of the errors, or none."""
    random, excess = np.random.default_rng(0), []
    for _ in range(1000):
        x = np.linspace(-0.01, 0.01, random.integers(10, 24))
        weights = np.where(random.random(x.size) < 0.15, 16.0, 1.0)
        normals = np.tile([0.0, 0.0, 1.0], (x.size, 1))
        normals[:, :2] = 5e-4 * random.standard_normal((x.size, 2)) / np.sqrt(weights)[:, None]
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        points = np.column_stack([x, 1e-3 * np.sin(600.0 * x), 0.0 * x])
        excess.append(Fitter(points, normals, weights, Noise(2e-5, 1.5e-4, 5e-4, 0.0),
                             3)._excess_of_normals())
    assert np.median(excess) == pytest.approx(1.0, abs=0.1) and max(excess) < 8.0


def test_a_plane_stays_one_with_errors_that_are_alike():
    _, found = with_noise(PLANE_CASE, 4.0, 60, np.random.default_rng(9))
    assert np.mean([patch.kind == Kind.PLANE for patch in found]) > 0.85


def test_without_a_path_the_frame_does_not_turn_by_rounding_errors():
    """Contacts in one place, within a micrometre: their mean is subtracted from itself."""
    normal = np.array([0.1, -0.2, 0.97])
    normal /= np.linalg.norm(normal)
    for count in range(2, 12):
        points = np.array([0.3, 0.1, 0.2]) + 1e-6 * np.random.default_rng(
            count).standard_normal((count, 3))
        frame = last(ESTIMATOR, points, [normal] * count).frame
        np.testing.assert_allclose(frame[:3, :3], tangent_frame(normal), atol=1e-3)


def test_the_frame_does_not_matter():
    rng = np.random.default_rng(9)
    points, normals = add_noise(*Weave().trace(sphere(0.05), 0.03), rng)
    turn, shift = Rotation.random(random_state=3).as_matrix(), np.array([0.3, -0.2, 0.5])
    one = last(ESTIMATOR, points, normals)
    other = last(ESTIMATOR, points @ turn.T + shift, normals @ turn.T)
    assert one.kind == other.kind
    np.testing.assert_allclose(other.curvature, one.curvature, rtol=1e-6)
    np.testing.assert_allclose(other.frame[:3, 3], turn @ one.frame[:3, 3] + shift, atol=1e-9)
    np.testing.assert_allclose(other.frame[:3, 2], turn @ one.frame[:3, 2], atol=1e-9)


def test_the_surface_matrix_is_that_of_the_object():
    points, normals = Weave(speed=0.3).trace(sphere(0.05), 0.03)
    matrix = last(ESTIMATOR, points, normals).surface_matrix
    np.testing.assert_allclose(value(matrix, points), 0.0, atol=1e-9)
    np.testing.assert_allclose(gradient(matrix, points), normals, atol=1e-7)  # of length 1


@pytest.mark.parametrize('surface, kind', EXACT)
def test_a_round_finger(surface, kind):
    """Its normals come from the location: fitted raw, they would invent -1 / radius."""
    radius = 0.01
    estimator = LocalQuadric(LocalQuadricConfig(finger_radius=radius))
    rng = np.random.default_rng(10)
    curvatures, kinds = [], []
    for _ in range(60):
        path = Weave(heading=rng.uniform(0.0, np.pi))
        patch = last(estimator, *add_noise(*path.trace(surface, 0.028), rng,
                                           finger_radius=radius))
        curvatures.append(patch.curvature)
        kinds.append(patch.kind == kind)
    np.testing.assert_allclose(np.median(curvatures, axis=0), true_curvature(surface), atol=0.4)
    assert np.mean(kinds) > 0.9
    exact = last(estimator, *Weave(speed=0.3).trace(surface, 0.04))
    np.testing.assert_allclose(exact.curvature, true_curvature(surface), atol=1e-6)


def test_a_round_finger_over_an_edge():
    """The finger turns about the edge, its centre on a cylinder of its own radius."""
    radius = 0.01
    estimator = LocalQuadric(LocalQuadricConfig(finger_radius=radius))
    lean = np.linspace(-0.3, 0.3, 100)
    normals = np.column_stack([-np.sin(lean), 0 * lean, np.cos(lean)])
    swing = 2e-3 * np.sin(np.linspace(0.0, 9.0, 100))
    patch = last(estimator, np.column_stack([0 * lean, swing, 0 * lean]), normals)
    assert not patch.valid and 'edge' in patch.reason and np.isnan(patch.curvature).all()


def noisy_everywhere(std, trials, case, rng):
    """Patches from positions whose noise, in every direction, the estimator is not told."""
    surface = case[0]
    for _ in range(trials):
        path = Weave(heading=rng.uniform(0.0, np.pi))
        yield last(ESTIMATOR, *add_noise(*path.trace(surface, 0.028), rng, position=std)), path


# On a plane that much noise of height is itself as large as the bar.
@pytest.mark.parametrize('case', BARS[1:])
def test_bars_hold_with_noise_of_height_that_was_not_told(case):
    surface, kind, median, most, right = case
    patches = list(noisy_everywhere(1.5e-4, 50, case, np.random.default_rng(14)))
    errors = [error(patch, surface, path) for patch, path in patches]
    assert np.median(errors) < median and np.percentile(errors, 95) < most
    assert np.mean([patch.kind == kind for patch, _ in patches]) >= right


def test_far_more_noise_than_was_told_is_refused():
    for case in BARS:
        for patch, _ in noisy_everywhere(6e-4, 10, case, np.random.default_rng(15)):
            assert not patch.valid and 'they scatter by' in patch.reason


def over_a_ridge(degrees, beyond, rng):
    """Patch at a distance beyond where two planes meet at an angle."""
    half = np.radians(degrees) / 2.0
    s = np.arange(-0.02, beyond, 2.5e-4)
    side = np.sign(s + 1e-9)
    points = np.column_stack([s * np.cos(half), 2e-3 * np.sin(2 * np.pi * s / 0.016),
                              np.abs(s) * np.sin(half)])
    normals = np.column_stack([-side * np.sin(half), 0 * s, np.full(len(s), np.cos(half))])
    return last(ESTIMATOR, *add_noise(points, normals, rng))


@pytest.mark.parametrize('degrees', [20.0, 30.0, 38.0])
def test_a_ridge_is_refused(degrees):
    rng = np.random.default_rng(16)
    for _ in range(20):
        patch = over_a_ridge(degrees, 0.006, rng)
        assert not patch.valid and re.search('second order|too noisy', patch.reason)


@pytest.mark.parametrize('degrees', [5.0, 20.0, 30.0])
def test_the_window_is_halved_where_it_reaches_back_over_another_surface(degrees):
    rng = np.random.default_rng(17)
    kinds = [over_a_ridge(degrees, 0.0135, rng).kind for _ in range(50)]
    assert np.mean([kind == Kind.PLANE for kind in kinds]) > 0.9


def test_a_straight_path_sees_one_curvature():
    rng = np.random.default_rng(11)
    for surface, heading, expected in (
            (PLANE, 0.3, 0.0), (cylinder(0.0325), 0.0, 0.0), (sphere(0.035), 0.7, 1 / 0.035),
            (cylinder(0.0325), np.pi / 2, 1 / 0.0325)):
        path = Weave(amplitude=0.0, heading=heading)
        patch = last(ESTIMATOR, *add_noise(*path.trace(surface, 0.03), rng))
        assert patch.valid and patch.kind in (Kind.PLANE, Kind.CYLINDER)
        assert list(patch.seen) == [True, False]
        assert patch.curvature[0] == pytest.approx(expected, abs=1.0)
        assert patch.curvature[1] == 0.0
        assert patch.covariance[1, 1] > 50.0**2  # the prior, nothing better
        assert abs(patch.frame[:3, 0] @ course(path)) > 0.9


def test_a_straight_path_that_runs_oblique_says_so():
    path = Weave(amplitude=0.0, heading=0.6)
    patch = last(ESTIMATOR, *path.trace(cylinder(0.0325), 0.03))
    assert not patch.valid and not patch.seen.any() and 'across is unseen' in patch.reason
    assert np.isfinite(patch.curvature).all() and (np.diag(patch.covariance) > 20.0**2).all()


@pytest.mark.parametrize('points, normals', [
    (np.zeros((1, 3)), [[0.0, 0.0, 1.0]]),
    ([[0.0, 0.0, 0.0], [5e-4, 0.0, 0.0]], np.tile([0.0, 0.0, 1.0], (2, 1))),
    (np.zeros((50, 3)), np.tile([0.0, 0.0, 1.0], (50, 1))),
    (np.zeros((50, 3)), np.column_stack([np.sin(np.linspace(0, 0.5, 50)), np.zeros(50),
                                         np.cos(np.linspace(0, 0.5, 50))]))],
    ids=['one', 'two', 'at rest', 'pivot'])
def test_too_little_is_refused_with_a_reason(points, normals):
    patch = last(ESTIMATOR, np.array(points), np.array(normals))
    assert not patch.valid and patch.kind == Kind.NONE and 'too short' in patch.reason
    assert not patch.seen.any() and np.isfinite(patch.covariance).all()


def test_two_contacts_see_the_curvature_between_them():
    points, normals = sphere(0.05).at(np.array([-0.01, 0.0]), np.zeros(2))
    patch = last(ESTIMATOR, points, normals)
    assert patch.valid and list(patch.seen) == [True, False]
    np.testing.assert_allclose(patch.curvature, [20.0, 0.0], atol=1e-6)


def test_bad_contacts_are_not_added():
    good = Weave().trace(sphere(0.05), 0.03)
    ESTIMATOR.reset()
    for point, normal in zip(*good, strict=True):
        expected = ESTIMATOR.update(point, normal)
    ESTIMATOR.reset()
    for k, (point, normal) in enumerate(zip(*good, strict=True)):
        if k % 10 == 5:
            for bad in ((point * np.nan, normal), (point, normal * np.inf), (point, 0 * normal),
                        (point, 2.0 * normal)):
                patch = ESTIMATOR.update(*bad)
                assert not patch.valid and 'not finite' in patch.reason
        patch = ESTIMATOR.update(point, normal)
    np.testing.assert_array_equal(patch.surface_matrix, expected.surface_matrix)


def test_the_window_forgets_what_is_behind():
    """From a plane onto a sphere; after a window on it, nothing of the plane is left."""
    ahead, inward = Weave(speed=0.3).trace(sphere(0.05), 0.06)
    before = ahead[0] + np.outer(np.linspace(-0.05, -0.002, 50), [1.0, 0.0, 0.0])
    ESTIMATOR.reset()
    for point in before:
        ESTIMATOR.update(point, inward[0])
    for point, normal in zip(ahead, inward, strict=True):
        patch = ESTIMATOR.update(point, normal)
    np.testing.assert_allclose(patch.curvature, 20.0, atol=1e-6)
    assert 0.02 < patch.extent <= 0.024


def test_a_finger_that_crawls_needs_no_more_memory_or_time():
    path = Weave(speed=0.001)
    points, normals = add_noise(*path.trace(sphere(0.05), 0.03), np.random.default_rng(12))
    patch = last(ESTIMATOR, points, normals)
    assert len(points) > 5000 and patch.samples > 4000
    assert patch.kind == Kind.SPHERE
    np.testing.assert_allclose(patch.curvature, 20.0, rtol=0.02)


@pytest.mark.parametrize('noise', [0.0, 3e-4])
def test_what_a_fit_works_on_does_not_grow(noise):
    """Cells of a window are bounded however long the path and however noisy."""
    points, normals = Weave(speed=0.02).trace(cylinder(0.5), 0.3)
    points = points + np.random.default_rng(18).normal(0.0, noise, points.shape)
    ESTIMATOR.reset()
    cells = []
    for point, normal in zip(points, normals, strict=True):
        ESTIMATOR.add(point, normal)
        cells.append(len(ESTIMATOR._cells))
    assert max(cells) <= MAX_CELLS and max(cells[-1000:]) <= max(cells[:1500]) + 5


ANY = st.floats(allow_nan=True, allow_infinity=True)


@settings(max_examples=200)
@given(npst.arrays(float, st.tuples(st.integers(1, 20), st.just(3)), elements=ANY),
       npst.arrays(float, (20, 3), elements=st.floats(-1, 1)))
def test_garbage_never_raises(points, normals):
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.divide(normals, lengths, out=normals, where=lengths > 0.0)
    ESTIMATOR.reset()
    for point, normal in zip(points, normals, strict=False):
        patch = ESTIMATOR.update(point, normal)
        assert patch.valid == (patch.kind != Kind.NONE) == (not patch.reason)
        if patch.valid:
            assert np.isfinite(patch.curvature).all() and np.isfinite(patch.covariance).all()
            assert np.isfinite(patch.surface_matrix).all() and patch.seen.any()


@pytest.mark.parametrize('field, value', [
    ('window', 0.0), ('finger_radius', -1.0), ('position_noise', 0.0), ('location_noise', np.nan)])
def test_refused_configurations(field, value):
    with pytest.raises(ConfigurationError, match=field):
        LocalQuadricConfig(**{field: value})
