"""The thesis' estimator on a stream: exact without noise, refusals that name what is unseen."""
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
import numpy as np
import pytest

from benchmarks.shape.surfaces import add_noise, cylinder, PLANE, sphere, value, Weave
from tactile_shape.local_surface.local_quadric import LocalQuadricConfig
from tactile_shape.thesis.matrix_estimator import MatrixEstimator
from tactile_shape.types.patch import Kind
from tactile_shape.types.surface_matrix import SurfaceMatrix

EXACT = LocalQuadricConfig(position_noise=1e-9)


def last(config, points, normals, **options):
    estimator = MatrixEstimator(config, **options)
    for point, normal in zip(points, normals, strict=True):
        estimator.add(point, normal)
    return estimator.estimate()


@pytest.mark.parametrize('surface', [cylinder(0.0325), sphere(0.063)])
def test_exact_without_noise(surface):
    points, normals = Weave(heading=0.4).trace(surface, 0.04)
    patch = last(EXACT, points, normals)
    assert patch.valid and patch.kind == Kind.GENERAL and patch.seen.all()
    np.testing.assert_allclose(value(patch.surface_matrix, points), 0.0, atol=1e-9)
    expected = np.sort(np.diag(surface.curvature))[::-1]
    np.testing.assert_allclose(patch.curvature, expected, atol=1e-6)
    there = SurfaceMatrix(patch.surface_matrix).in_frame(patch.frame)
    np.testing.assert_allclose(there.curvatures()[0], expected, atol=1e-6)


def test_what_is_unseen_is_named_and_has_the_prior():
    patch = last(EXACT, *Weave().trace(PLANE, 0.03))
    assert not patch.valid and patch.seen.all() and patch.reason.endswith('c33')
    np.testing.assert_allclose(patch.curvature, 0.0, atol=1e-9)
    patch = last(EXACT, *Weave(amplitude=0.0, heading=np.pi / 2).trace(cylinder(0.05), 0.03))
    assert not patch.valid and 'c11' in patch.reason
    assert list(patch.seen) == [True, False]
    assert patch.covariance[1, 1] == pytest.approx(100.0**2, rel=1e-6)


def test_contacts_close_together_are_refused():
    """Five contacts a quarter of a millimetre apart, as (4.37) would take them: no curvature."""
    rng = np.random.default_rng(1)
    config = LocalQuadricConfig(window=1e-3)
    for _ in range(50):
        patch = last(config, *add_noise(*Weave(heading=0.4).trace(sphere(0.035), 0.03), rng),
                     contacts=5)
        assert not patch.valid and 'of 9 parameters' in patch.reason


def test_before_the_first_contact_and_after_a_bad_one():
    estimator = MatrixEstimator()
    assert estimator.estimate().reason == 'no contact yet'
    patch = estimator.update(np.full(3, np.nan), np.array([0.0, 0.0, 1.0]))
    assert not patch.valid and 'not finite' in patch.reason


@settings(max_examples=100)
@given(npst.arrays(float, st.tuples(st.integers(1, 12), st.just(3)), elements=st.floats()),
       npst.arrays(float, (12, 3), elements=st.floats(-1, 1)))
def test_garbage_is_refused(points, normals):
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.divide(normals, lengths, out=normals, where=lengths > 0.0)
    estimator = MatrixEstimator()
    for point, normal in zip(points, normals, strict=False):
        patch = estimator.update(point, normal)
        assert patch.valid == (not patch.reason)
        assert not patch.valid or np.isfinite(patch.surface_matrix).all()
