"""Surface matrices: closed forms, invariances, finite differences and what is refused."""
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.shape.surfaces import gradient, value
from tactile_common.errors import SurfaceError
from tactile_shape.types.patch import Kind, Patch
from tactile_shape.types.surface_matrix import SurfaceMatrix
from tactile_shape.types.tangent import principal_curvatures, tangent_frame, turn_about_z


def plane(normal=(0.0, 0.0, 1.0), offset=0.0):
    """Plane normal . x = offset [m], the normal inward and of any length."""
    matrix = np.zeros((4, 4))
    matrix[3, :3] = matrix[:3, 3] = 0.5 * np.array(normal) / np.linalg.norm(normal)
    matrix[3, 3] = -offset
    return SurfaceMatrix(matrix)


def sphere(radius):
    """Sphere; a negative radius is a hollow [m]."""
    return SurfaceMatrix.from_curvature(np.eye(2) / radius)


def cylinder(radius, yaw=0.0):
    """Cylinder [m]; yaw [rad] turns its axis from y towards -x."""
    across = np.array([np.cos(yaw), np.sin(yaw)])
    return SurfaceMatrix.from_curvature(np.outer(across, across) / radius)


R = 0.03
SPHERE, CYLINDER, PLANE = sphere(R), cylinder(R), plane()
SADDLE = SurfaceMatrix.from_curvature([[20.0, 8.0], [8.0, -15.0]])
ALL = {'plane': PLANE, 'cylinder': CYLINDER, 'sphere': SPHERE, 'saddle': SADDLE}


def some_pose(seed):
    rng = np.random.default_rng(seed)
    pose = np.eye(4)
    pose[:3, :3] = Rotation.random(random_state=seed).as_matrix()
    pose[:3, 3] = rng.normal(0.0, 0.1, 3)
    return pose


def moved(pose, points):
    return points @ pose[:3, :3].T + pose[:3, 3]


def normal(surface, points):
    """Inward unit normals at points (..., 3)."""
    slope = gradient(surface.matrix, points)
    return slope / np.linalg.norm(slope, axis=-1, keepdims=True)


def curvatures_at(surface, point):
    there = np.eye(4)
    there[:3, 3] = point
    return surface.in_frame(there).curvatures()


def some_points(seed=1, count=50, size=0.02):
    return np.random.default_rng(seed).normal(0.0, size, (count, 3))


@pytest.mark.parametrize('name', ALL)
def test_convention_of_the_contact_frame(name):
    surface = ALL[name]
    assert value(surface.matrix, np.zeros(3)) == 0.0
    assert surface.matrix[2, 3] == 0.5
    np.testing.assert_array_equal(gradient(surface.matrix, np.zeros(3)), [0.0, 0.0, 1.0])
    assert value(surface.matrix, np.array([0.0, 0.0, 1e-3])) > 0.0  # inward is inside


def test_thesis_matrices_are_multiples_and_their_sum_curves_as_both():
    printed = np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, -R], [0, 0, -R, 0]])
    np.testing.assert_allclose(SPHERE.matrix * -2.0 * R, printed, atol=1e-15)
    printed[1, 1] = 0.0  # its cylinder has its axis along y
    np.testing.assert_allclose(CYLINDER.matrix * -2.0 * R, printed, atol=1e-15)
    crossed = SurfaceMatrix(cylinder(R / 2).matrix + cylinder(R / 2, np.pi / 2).matrix)
    np.testing.assert_allclose(crossed.normalised().curvatures()[0], [1 / R, 1 / R])
    assert crossed.normalised().matrix[2, 3] == 0.5


@pytest.mark.parametrize('name', ALL)
def test_operations_do_not_depend_on_the_frame(name):
    surface, pose, points = ALL[name], some_pose(3), some_points()
    other = surface.in_frame(np.linalg.inv(pose))  # the same surface, moved by the pose
    there = moved(pose, points)
    np.testing.assert_allclose(
        value(other.matrix, there), value(surface.matrix, points), atol=1e-12)
    np.testing.assert_allclose(normal(other, there), normal(surface, points) @ pose[:3, :3].T,
                               atol=1e-10)
    here = curvatures_at(other, pose[:3, 3])
    np.testing.assert_allclose(here[0], surface.curvatures()[0], atol=1e-9)
    back = other.in_frame(pose)
    np.testing.assert_allclose(back.matrix, surface.matrix, atol=1e-12)


def test_curvatures_by_finite_differences():
    """The turn of the normal along a direction is the curvature there."""
    surface, step = SADDLE.in_frame(some_pose(5)), 1e-6
    point = np.linalg.inv(some_pose(5))[:3, 3]
    curvature, axes = curvatures_at(surface, point)
    np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    np.testing.assert_allclose(axes[:, 2], normal(surface, point), atol=1e-12)
    for k, direction in zip(curvature, axes.T[:2], strict=True):
        behind, ahead = (normal(surface, point + way * direction) for way in (-step, step))
        np.testing.assert_allclose((ahead - behind) / (2 * step), -k * direction, atol=1e-6)


def test_curvatures_elsewhere_on_a_sphere_and_a_cylinder():
    point = R * np.array([np.sin(1.0), 0.0, 1.0 - np.cos(1.0)])
    np.testing.assert_allclose(curvatures_at(SPHERE, point)[0], [1 / R, 1 / R], rtol=1e-9)
    curvature, axes = curvatures_at(CYLINDER, point)
    np.testing.assert_allclose(curvature, [1 / R, 0.0], atol=1e-9)
    np.testing.assert_allclose(np.abs(axes[:, 1]), [0.0, 1.0, 0.0], atol=1e-9)


def test_value_is_that_of_the_closed_forms():
    """X' S X over -2 / r, with the distance from centre or axis; of a plane, the depth below."""
    points = some_points(count=500)
    x, y, z = points.T
    for surface, expected in (
            (SPHERE, R**2 - x**2 - y**2 - (z - R)**2), (CYLINDER, R**2 - x**2 - (z - R)**2),
            (cylinder(R, np.pi / 2), R**2 - y**2 - (z - R)**2),
            (sphere(-R), x**2 + y**2 + (z + R)**2 - R**2),
            (plane([0.0, 3.0, 4.0], 0.01), 2.0 * R * (0.6 * y + 0.8 * z - 0.01))):
        np.testing.assert_allclose(2.0 * R * value(surface.matrix, points), expected, atol=1e-15)


def test_a_sheet_is_exact_for_plane_sphere_and_cylinder():
    def sheet(curvature, places):
        return Patch(Kind.GENERAL, True, '', '', frame=np.eye(4),
                     curvature=np.array(curvature)).sheet(places)

    u = np.random.default_rng(2).uniform(-0.6 * R, 0.6 * R, (200, 2))
    for surface, curvature in ((SPHERE, [1 / R, 1 / R]), (CYLINDER, [1 / R, 0.0]),
                               (PLANE, [0.0, 0.0])):
        points = sheet(curvature, u)
        np.testing.assert_array_equal(points[:, :2], u)
        np.testing.assert_allclose(value(surface.matrix, points), 0.0, atol=1e-16)
    assert np.isnan(sheet([1 / R, 1 / R], np.array([[1.1 * R, 0.0]]))[:, 2]).all()


def test_tangent_frame_and_principal_axes():
    for normal in (*np.eye(3), *-np.eye(3), np.array([0.6, 0.0, -0.8])):
        frame = tangent_frame(normal)
        np.testing.assert_allclose(frame.T @ frame, np.eye(3), atol=1e-12)
        np.testing.assert_allclose(frame[:, 2], normal)
        assert np.linalg.det(frame) == pytest.approx(1.0)
    curvature = np.array([[-30.0, 5.0], [5.0, 10.0]])
    first, second, heading = principal_curvatures(-30.0, 5.0, 10.0)
    assert abs(first) > abs(second)
    turn = turn_about_z(heading)[:2, :2]
    np.testing.assert_allclose(turn @ np.diag([first, second]) @ turn.T, curvature)


@pytest.mark.parametrize('matrix, message', [
    (np.eye(3), 'shape'), (np.full((4, 4), np.nan), 'finite'), (np.zeros((4, 4)), 'degenerate'),
    (np.diag([0.0, 0.0, 0.0, 1.0]), 'degenerate'),
    # The thesis' plane, as printed:
    (np.array([[0, 0, 0, 1], [0, 0, 0, 2], [0, 0, 0, 3], [0, 0, 0, 4]]), 'not symmetric')])
def test_refused_matrices(matrix, message):
    with pytest.raises(SurfaceError, match=message):
        SurfaceMatrix(matrix)


def test_refused_values():
    for make in (lambda: SurfaceMatrix.from_curvature([[np.nan, 0.0], [0.0, 0.0]]),
                 lambda: SurfaceMatrix.from_curvature([[0.0, 1.0], [2.0, 0.0]]),
                 lambda: SPHERE.in_frame(np.full((4, 4), np.nan)),
                 lambda: curvatures_at(SPHERE, [0.0, 0.0, R]),
                 lambda: SurfaceMatrix(np.diag([1.0, 1.0, -1.0, 0.0])).normalised()):  # a cone
        with pytest.raises(SurfaceError):
            make()
