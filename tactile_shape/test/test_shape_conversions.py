"""Patches, contours and models to messages, and back where there is a way."""
import numpy as np
import pytest
from std_msgs.msg import Header
from visualization_msgs.msg import Marker

from benchmarks.shape.surfaces import cylinder, sphere, Weave
from tactile_common.errors import TactileError
from tactile_msgs.msg import SurfacePatch
from tactile_shape.contour.object_model import ObjectModel
from tactile_shape.conversions import (
    MAX_PATCHES,
    model_to_markers,
    patch_from_msg,
    patch_to_msg,
)
from tactile_shape.local_surface.local_quadric import LocalQuadric
from tactile_shape.thesis.matrix_estimator import MatrixEstimator
from tactile_shape.types.patch import Kind

HEADER = Header(frame_id='base')


def touched(estimator, surface, length):
    model = ObjectModel()
    for point, normal in zip(*Weave(heading=0.5).trace(surface, length), strict=True):
        patch = estimator.update(point, normal)
        model.add_contact(point)
        model.add_patch(patch)
    return model, patch


@pytest.mark.parametrize('estimator', [LocalQuadric, MatrixEstimator])
@pytest.mark.parametrize('length', [0.0006, 0.03])
def test_patch_and_back(estimator, length):
    _, patch = touched(estimator(), cylinder(0.05), length)
    assert patch.valid == (length > 0.01)
    message = patch_to_msg(patch, HEADER, 'pad')
    assert message.sensor == 'pad' and message.header.frame_id == 'base'
    again = patch_from_msg(message)
    for name in ('kind', 'valid', 'reason', 'method', 'extent', 'samples'):
        assert getattr(again, name) == getattr(patch, name)
    for name in ('frame', 'curvature', 'seen', 'covariance', 'residual', 'surface_matrix'):
        np.testing.assert_allclose(getattr(again, name), getattr(patch, name), atol=1e-12)


def test_nothing_is_nan_not_identity():
    message = patch_to_msg(LocalQuadric().estimate(), HEADER)
    assert not message.valid and message.kind == SurfacePatch.KIND_NONE and message.reason
    assert np.isnan([message.frame.position.x, message.frame.orientation.w]).all()
    assert np.isnan(message.curvature).all() and np.isnan(message.surface_matrix).all()
    assert np.isnan(patch_from_msg(message).frame).all()


def test_numbers_of_kinds_are_those_of_the_message():
    assert {kind.name: kind.value for kind in Kind} == {
        name.removeprefix('KIND_'): getattr(SurfacePatch, name)
        for name in dir(SurfacePatch) if name.startswith('KIND_')}
    with pytest.raises(TactileError, match='kind of patch is 9'):
        patch_from_msg(SurfacePatch(kind=9))


def test_markers():
    model, patch = touched(LocalQuadric(), sphere(0.05), 0.05)
    markers = {marker.ns: marker for marker in model_to_markers(model, patch, HEADER).markers}
    assert set(markers) == {'surface', 'contour', 'patch', 'principal directions'}
    assert len(markers['surface'].points) == 96 * len(model.patches) <= 96 * MAX_PATCHES
    for marker in markers.values():
        assert marker.header.frame_id == 'base' and marker.pose.orientation.w == 1.0
        assert len(marker.colors) in (0, len(marker.points))
        points = np.array([[p.x, p.y, p.z] for p in marker.points])
        assert np.abs(sphere(0.05).distance(points)).max() < 1.5e-4
    assert markers['patch'].type == Marker.TRIANGLE_LIST
    assert len(markers['principal directions'].points) == 4
    gone = model_to_markers(ObjectModel(), None, HEADER).markers  # what was shown is deleted
    assert {marker.ns for marker in gone} == set(markers)
    assert {marker.action for marker in gone} == {Marker.DELETE}
    assert {marker.action for marker in markers.values()} == {Marker.ADD}
