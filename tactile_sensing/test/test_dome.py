"""Forward models of a round probe: half-space on the tangent plane, finite elements."""
import tracemalloc

import numpy as np
import point_load as point
import pytest

from tactile_common.errors import ConfigurationError
from tactile_sensing.dome import finite_elements
from tactile_sensing.dome.finite_elements import (
    FiniteElementDome,
    operator_for,
    SkinConfig,
    solve,
)
from tactile_sensing.dome.geometry import contact_frame, Dome, HalfSpaceDome
from tactile_sensing.types.array import TactelArray

PITCH = 0.0254 / 16
ARRAY, DOME = TactelArray(16, 16, PITCH, PITCH), Dome()
COARSE = SkinConfig(across=13, layers=2)  # solved in a second or two
STATES = [(0.0, 0.0, 5.0, 0.3, -0.2), (3e-3, -2e-3, 5.0, 0.0, 0.0)]


@pytest.fixture(scope='module')
def model():
    """Return a dome with coarse elements."""
    return FiniteElementDome(DOME, ARRAY, solve(DOME, COARSE, ARRAY))


def force_and_centroid(image):
    """Return the force on the array [N] and its centroid [m]."""
    pressure = image[0]
    return (pressure.sum() * PITCH**2, pressure.sum(axis=0) @ ARRAY.x / pressure.sum(),
            pressure.sum(axis=1) @ ARRAY.y / pressure.sum())


def test_places_and_directions_are_inverse():
    places = np.random.default_rng(0).uniform(-0.02, 0.02, (50, 2))
    directions = DOME.direction(places)
    assert np.linalg.norm(directions, axis=1) == pytest.approx(1.0)
    assert DOME.place(3.0 * directions) == pytest.approx(places)
    assert DOME.place(np.array([0.0, 0.0, 1.0])) == pytest.approx([0.0, 0.0])
    # along a great circle: angle times radius
    assert DOME.direction([0.01, 0.0]) == pytest.approx([np.sin(0.4), 0.0, np.cos(0.4)])


@pytest.mark.parametrize('place', [(0.0, 0.0), (1e-7, 2e-7), (4e-3, -7e-3), (12e-3, 12e-3)])
def test_contact_frames(place):
    axes = contact_frame(DOME, *place)
    assert axes @ axes.T == pytest.approx(np.eye(3)) and np.linalg.det(axes) > 0.0
    assert axes[2] == pytest.approx(DOME.direction(place))
    # The smallest rotation is about an axis in the sensor's xy plane, which stays unchanged.
    across = np.array([-place[1], place[0], 0.0])
    assert axes @ across == pytest.approx(across, abs=1e-12)


def test_a_large_sphere_is_a_plane():
    for state in STATES:
        expected = point.stress('zz', ARRAY.x, ARRAY.y[:, None], *state, 0.002)
        errors = [abs(HalfSpaceDome(Dome(r, r - 0.002, r - 0.004), ARRAY).image(
            np.array(state)) - expected).max() / expected.max() for r in (0.1, 1.0)]
        assert errors[1] < 2e-3 and errors[1] < 0.2 * errors[0]


def test_elements_keep_the_balance_of_forces_and_feel_a_contact_where_it_is(model):
    # The force on the skin arrives at the tactels, except a tenth: a part spreads beyond the
    # array, and the bonded skin carries a part sideways as shear.
    for p in (1.0, 5.0):
        force, x, y = force_and_centroid(model.image(np.array([0.0, 0.0, p, 0.0, 0.0])))
        assert force == pytest.approx(p, rel=0.15) and (x, y) == pytest.approx((0, 0), abs=1e-9)
    for place in ((4e-3, 0.0), (0.0, -6e-3), (5e-3, 5e-3)):
        force, *felt = force_and_centroid(model.image(np.array([*place, 5.0, 0.0, 0.0])))
        assert felt == pytest.approx(place, abs=0.5e-3) and force == pytest.approx(5.0, rel=0.15)
    # On a half-space the centroid moves by Q d / P (2.2); on a bonded skin it moves less.
    _, x, _ = force_and_centroid(model.image(np.array([0.0, 0.0, 5.0, 2.0, 0.0])))
    assert 0.05e-3 < x < 0.8e-3


def test_elements_are_linear_and_symmetric(model):
    one = model.image(np.array([3e-3, 1e-3, 4.0, 0.6, 0.2]))
    mirrored = model.image(np.array([-3e-3, 1e-3, 4.0, -0.6, 0.2]))
    assert mirrored[0] == pytest.approx(one[0, :, ::-1], rel=1e-6, abs=1e-6 * one.max())
    turned = model.image(np.array([-1e-3, 3e-3, 4.0, -0.2, 0.6]))  # by a quarter
    assert turned[0] == pytest.approx(np.rot90(one[0], -1), rel=1e-6, abs=1e-6 * one.max())
    none = model.image(np.array([3e-3, 1e-3, 4.0, 0.0, 0.0]))
    twice = model.image(np.array([3e-3, 1e-3, 4.0, 1.2, 0.4]))
    assert twice - none == pytest.approx(2.0 * (one - none), abs=1e-9 * one.max())


def test_finer_elements_agree(model):
    skin = SkinConfig(across=15, layers=3)
    fine = FiniteElementDome(DOME, ARRAY, solve(DOME, skin, ARRAY))
    state = np.array([4e-3, 2e-3, 5.0, 0.0, 0.0])
    assert force_and_centroid(model.image(state)) == pytest.approx(
        force_and_centroid(fine.image(state)), rel=0.06)
    assert model.operator.modulus == pytest.approx(fine.operator.modulus, rel=0.02)
    # of the bonded layer: between uniaxial (free) and confined compression of rubber
    free, confined = SkinConfig().young / 4e-3, SkinConfig().young * 3.8 / 4e-3
    assert free < fine.operator.modulus < confined


def test_places_are_not_compared_with_all_cells():
    """Memory for places times cells was 0.44 GB here, and 8 GB for 2500 elements."""
    tracemalloc.start()
    solve(DOME, SkinConfig(across=12), ARRAY)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 2e8


def test_the_surface_is_that_of_the_sphere(model):
    op, half = model.operator, COARSE.half_angle
    assert np.linalg.norm(op.points - DOME.centre, axis=1) == pytest.approx(DOME.skin_radius)
    solid_angle = 4.0 * np.arcsin(np.sin(half)**2)  # of a square on the face of a cube
    assert op.areas.sum() == pytest.approx(solid_angle * DOME.skin_radius**2, rel=1e-3)


def test_an_operator_is_kept(tmp_path, monkeypatch):
    skin = SkinConfig(across=3, layers=1, points=1)
    built = operator_for(DOME, skin, ARRAY, tmp_path)
    monkeypatch.setattr(finite_elements, 'solve', None)
    kept = operator_for(DOME, skin, ARRAY, tmp_path)
    assert all((one == other).all() for one, other in zip(built, kept, strict=True))
    with pytest.raises(TypeError):  # others are built
        operator_for(DOME, SkinConfig(across=3, layers=1, points=1, young=1e5), ARRAY, tmp_path)


def test_what_is_kept_and_damaged_is_built_anew(tmp_path):
    skin = SkinConfig(across=3, layers=1, points=1)
    built = operator_for(DOME, skin, ARRAY, tmp_path)
    path, = tmp_path.glob('*.npz')
    path.write_bytes(path.read_bytes()[:1000])
    assert operator_for(DOME, skin, ARRAY, tmp_path).green == pytest.approx(built.green)


def test_what_cannot_be(model):
    with pytest.raises(ConfigurationError, match='array_radius'):
        Dome(0.027, 0.028, 0.023)
    with pytest.raises(ConfigurationError, match='off the skin'):
        model.image(np.array([0.04, 0.04, 1.0, 0.0, 0.0]))
    with pytest.raises(ConfigurationError, match='or the force of 1e-12 N too small for its el'):
        model.image(np.array([1e-3, 1e-3, 1e-12, 0.0, 0.0]))
    with pytest.raises(ConfigurationError, match='256 tactels'):
        FiniteElementDome(DOME, TactelArray(8, 8, PITCH, PITCH), model.operator)
    with pytest.raises(ConfigurationError, match='rad from the apex, beyond the rim'):
        solve(DOME, SkinConfig(half_angle=0.4, across=3, layers=1, points=1), ARRAY)
    assert not model.image(np.zeros(5)).any()
