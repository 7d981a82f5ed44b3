"""Object model: what is kept, and PLY files that say the same."""
import numpy as np
import pytest

from benchmarks.shape.surfaces import sphere, Weave
from tactile_shape.contour import object_model
from tactile_shape.contour.object_model import ObjectModel
from tactile_shape.local_surface.local_quadric import LocalQuadric
from tactile_shape.mesh import COLOURS, save_mesh
from tactile_shape.types.patch import Kind, Patch


def read_ply(path):
    """Elements of a PLY file as lists of rows of numbers."""
    lines = path.read_text('ascii').splitlines()
    end = lines.index('end_header')
    assert lines[:2] == ['ply', 'format ascii 1.0']
    rows, elements = iter(lines[end + 1:]), {}
    for line in lines[:end]:
        if line.startswith('element'):
            _, name, count = line.split()
            elements[name] = [list(map(float, next(rows).split())) for _ in range(int(count))]
    assert next(rows, None) is None
    return elements


def touched(length=0.05):
    model, estimator = ObjectModel(), LocalQuadric()
    for point, normal in zip(*Weave().trace(sphere(0.05), length), strict=True):
        model.add_contact(point)
        model.add_patch(estimator.update(point, normal))
    return model


def test_contour_is_thinned_and_broken_where_contact_was_lost():
    model = ObjectModel()
    there = 1.05e-4 * np.arange(101)
    for x in there:
        model.add_contact(np.array([x, 0.0, 0.0]))
    for x in there[:40:-1]:  # the way back adds nothing
        assert not model.add_contact(np.array([x, 1e-4, 0.0]))
    model.begin_stroke()
    model.add_contact(np.array([0.0123, 0.0, 0.0]))
    assert [len(stroke) for stroke in model.strokes] == [11, 1]
    np.testing.assert_allclose(model.contour[:11, 0], 1.05e-3 * np.arange(11), atol=2e-4)


def test_a_contour_reaches_to_its_end_and_not_to_single_contacts_beyond():
    model = ObjectModel()
    for x in [*np.arange(0.0, 9.61e-3, 1e-4), 9.7e-3, 9.9e-3, 9.95e-3, 9.6e-3, 9.3e-3]:
        model.add_contact(np.array([x, 0.0, 0.0]))
    kept = model.total
    model.begin_stroke()
    assert model.total == kept + 1
    np.testing.assert_allclose(model.contour[-1], [9.6e-3, 0.0, 0.0])


def test_single_contacts_that_are_off_are_no_ends():
    rng = np.random.default_rng(0)
    there, end = np.array([0.0, 5e-4, 0.0]), np.array([9.85e-3, 0.0, 0.0])
    model = ObjectModel()
    for point in (there, *rng.normal(0.0, 3e-5, (50, 3)),  # a light touch, then the pad stands
                  *np.linspace([0.0, 0.0, 0.0], end, 198),
                  *(end + rng.normal(0.0, 3e-5, (150, 3))), end + [2e-4, 0.0, 0.0]):
        model.add_contact(point)
    np.testing.assert_allclose(model.contour[-1], end + [2e-4, 0.0, 0.0])  # as yet
    model.begin_stroke()
    np.testing.assert_allclose(model.contour[[0, -1]], [np.zeros(3), end], atol=5e-5)


def test_memory_is_bounded(monkeypatch):
    monkeypatch.setattr(object_model, 'MAX_POINTS', 20)
    model = ObjectModel()
    flat = Patch(Kind.PLANE, True, '', 'local_quadric', np.eye(4), np.zeros(2))
    for k in range(100):
        if k % 10 == 0:
            model.begin_stroke()
        model.add_contact(np.array([0.01 * k, 0.0, 0.0]))
        frame = np.eye(4)
        frame[0, 3] = 0.01 * k
        model.add_patch(Patch(flat.kind, True, '', flat.method, frame, flat.curvature))
    assert len(model.contour) == len(model.patches) == 20
    assert model.contour[0, 0] == pytest.approx(0.8)


def test_invalid_patches_are_not_kept():
    model = ObjectModel()
    model.add_patch(Patch(Kind.NONE, False, 'why', 'local_quadric'))
    assert not model.patches


def test_surface_mesh(tmp_path):
    model = touched()
    assert 5 < len(model.patches) < 14
    save_mesh(tmp_path / 'surface.ply', model.patches)
    ply = read_ply(tmp_path / 'surface.ply')
    vertices = np.array(ply['vertex'])
    assert len(vertices) == 25 * len(model.patches)
    assert np.abs(sphere(0.05).distance(vertices[-25:, :3])).max() < 1e-5
    np.testing.assert_allclose(vertices[-1, 3:] / 255.0, COLOURS[Kind.SPHERE], atol=3e-3)
    faces = np.array(ply['face'], dtype=int)
    assert len(faces) == 32 * len(model.patches) and (faces[:, 0] == 3).all()
    # All triangles of a patch turn the same way round, and together they fill its square.
    corners = vertices[faces[-32:, 1:], :3]
    area = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (area @ model.patches[-1].frame[:3, 2] > 0.0).all() or (
        area @ model.patches[-1].frame[:3, 2] < 0.0).all()
    assert np.linalg.norm(area, axis=1).sum() == pytest.approx(0.006**2, rel=0.01)


def test_a_mesh_of_nothing(tmp_path):
    save_mesh(tmp_path / 'empty.ply', [])
    assert read_ply(tmp_path / 'empty.ply') == {'vertex': [], 'face': []}
