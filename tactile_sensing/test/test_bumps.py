"""Bumps: images compared with closed forms, derivatives with finite differences."""
from averages_over_tactels import line_average
import numpy as np
import point_load as point
import pytest

from tactile_sensing.skin import bumps
from tactile_sensing.skin.bumps import LINE, P, POINT
from tactile_sensing.skin.pad import pad_of
from tactile_sensing.types.array import TactelArray

ARRAY, DEPTH = TactelArray(12, 16, 1.6e-3, 1.4e-3), 2e-3
ONE, TWO, SHEARED = (('zz', DEPTH),), (('zz', DEPTH), ('zz', 2 * DEPTH)), (
    ('zz', DEPTH), ('xz', DEPTH), ('yz', DEPTH))
SHARP = [P.Q0, P.Q1, P.FORCE, P.SHEAR_U]
STEPS = {P.Q0: 1e-7, P.Q1: 1e-7, P.BEGIN: 1e-7, P.END: 1e-7, P.WIDTH: 1e-5,
         P.EXPONENT: 1e-5, P.BLUNT: 1e-5}  # forces: 1e-3


def loaded(kind, layers=1, seed=0, **values):
    """Return the parameters of a random load on the pad."""
    rng = np.random.default_rng(seed)
    theta = np.zeros(P.BASE + layers)
    theta[P.Q0] = rng.uniform(-5e-3, 5e-3)
    theta[P.Q1] = rng.uniform(-5e-3, 5e-3) if kind == POINT else rng.uniform(-1.5, 1.5)
    theta[P.FORCE], theta[P.SHEAR_U] = 3.0, 0.5
    if kind == POINT:
        theta[P.SHEAR_V] = -0.7
    for name, value in values.items():
        theta[getattr(P, name)] = value
    return theta


def rows(kind, power, pad, theta, *, ends=False, wide=True):
    """Return the image (tactels,) and its derivatives (parameters, tactels)."""
    size = pad.depths.size * ARRAY.rows * ARRAY.columns
    by, model = np.zeros((theta.size, size)), np.zeros(size)
    bumps.add_rows(kind, power, ends, wide, pad.nodes, pad, theta, by, model)
    return model, by


@pytest.mark.parametrize('seed', range(3))
@pytest.mark.parametrize('layers', [ONE, TWO, SHEARED])
def test_a_point_is_that_of_the_half_space(layers, seed):
    pad, theta = pad_of(ARRAY, layers, area=False), loaded(POINT, len(layers), seed)
    model, _ = rows(POINT, False, pad, theta)
    for found, (component, depth) in zip(
            model.reshape(-1, *ARRAY.shape), layers, strict=True):
        true = point.stress(component, ARRAY.x, ARRAY.y[:, None], *theta[[P.Q0, P.Q1]],
                            *theta[P.FORCE:P.BASE], depth)
        assert np.abs(found - true).max() < 1e-3 * np.abs(true).max()


@pytest.mark.parametrize('exponent', [1.7, 2.5, 12.0])
@pytest.mark.parametrize('width', [0.3e-3, 1.5e-3, 20e-3])
def test_a_bump_of_free_shape_is_a_power_of_the_distance(width, exponent):
    theta = loaded(POINT, WIDTH=np.log(width), EXPONENT=np.log(exponent), SHEAR_U=0.0, SHEAR_V=0.0)
    model, _ = rows(POINT, True, pad_of(ARRAY, (('zz', 0.0),), area=False), theta)
    squared = (ARRAY.x - theta[P.Q0])**2 + (ARRAY.y[:, None] - theta[P.Q1])**2
    half = 2.0**(1.0 / exponent) - 1.0  # of the peak at the half width
    true = theta[P.FORCE] * (1.0 + half * squared / width**2)**-exponent
    np.testing.assert_allclose(model, true.ravel(), rtol=1e-8 * exponent, atol=1e-200)


def test_an_elongated_bump_is_that_of_stretched_distances():
    turn, ratio, width = 0.4, 1.5, 1.5e-3
    long = (ratio**2 - 1.0) / (ratio**2 + 1.0)
    theta = loaded(POINT, LONG_X=long * np.cos(2.0 * turn), LONG_XY=long * np.sin(2.0 * turn),
                   WIDTH=np.log(width), EXPONENT=np.log(2.5), SHEAR_U=0.0, SHEAR_V=0.0)
    model, _ = rows(POINT, True, pad_of(ARRAY, (('zz', 0.0),), area=False), theta)
    x, y = ARRAY.x - theta[P.Q0], ARRAY.y[:, None] - theta[P.Q1]
    along, aside = x * np.cos(turn) + y * np.sin(turn), y * np.cos(turn) - x * np.sin(turn)
    squared = (along**2 + (ratio * aside)**2) * 2.0 / (1.0 + ratio**2)
    true = theta[P.FORCE] * (1.0 + (2.0**0.4 - 1.0) * squared / width**2)**-2.5
    np.testing.assert_allclose(model, true.ravel(), rtol=1e-8)


@pytest.mark.parametrize('blunt', [0.2, 0.75])
def test_a_blunt_bump_is_a_compressed_one_of_the_same_half_width(blunt):
    width, pad = 2.1e-3, pad_of(ARRAY, (('zz', 0.0),), area=False)
    theta = loaded(POINT, WIDTH=np.log(width), BLUNT=blunt, SHEAR_U=0.0, SHEAR_V=0.0,
                   EXPONENT=np.log(3.0), Q0=ARRAY.x[5] + width, Q1=ARRAY.y[4])
    model = rows(POINT, True, pad, theta)[0].reshape(ARRAY.shape) / theta[P.FORCE]
    assert model[4, 5] == pytest.approx(0.5, rel=1e-8)
    theta[P.BLUNT], at_half = 0.0, ((2.0 - blunt) / (1.0 - blunt))**(1.0 / 3.0) - 1.0
    theta[P.WIDTH] += 0.5 * np.log((2.0**(1.0 / 3.0) - 1.0) / at_half)
    sharp = rows(POINT, True, pad, theta)[0].reshape(ARRAY.shape) / theta[P.FORCE]
    np.testing.assert_allclose(model, sharp / (1.0 - blunt + blunt * sharp), rtol=1e-8)


@pytest.mark.parametrize('seed', range(6))
def test_a_line_is_that_of_the_half_space_on_tactels_of_some_area(seed):
    pad, theta = pad_of(ARRAY, ONE), loaded(LINE, seed=seed)
    model, _ = rows(LINE, False, pad, theta)
    true = line_average(ARRAY.x, ARRAY.y[:, None], theta[P.Q0], theta[P.Q1], theta[P.FORCE],
                        theta[P.SHEAR_U], DEPTH, ARRAY.pitch_x, ARRAY.pitch_y)
    assert np.abs(model.reshape(ARRAY.shape) - true).max() < 4e-3 * true.max()


@pytest.mark.parametrize('thickness, patch', [(np.inf, 0.0), (4e-3, 0.0), (4e-3, 0.2)])
def test_a_line_with_far_ends_has_none_and_two_parts_are_one(thickness, patch):
    pad, theta = pad_of(ARRAY, ONE, thickness=thickness), loaded(LINE, seed=3, WIDTH=patch)
    whole, _ = rows(LINE, False, pad, theta)

    def part(begin, end):
        return rows(LINE, False, pad, loaded(
            LINE, seed=3, WIDTH=patch, BEGIN=begin, END=end), ends=True)[0]
    assert np.abs(part(-1.0, 1.0) - whole).max() < 5e-3 * whole.max()  # two polynomials
    np.testing.assert_allclose(part(-1.0, 1e-3) + part(1e-3, 1.0), part(-1.0, 1.0), rtol=1e-9)


@pytest.mark.parametrize('seed', range(3))
def test_a_tapered_line_is_a_row_of_points(seed):
    pad, theta = pad_of(ARRAY, ONE, area=False), loaded(LINE, seed=seed, TAPER=2.0, SHEAR_U=0.0)
    model, _ = rows(LINE, False, pad, theta)
    half = np.hypot(pad.half_x, pad.half_y)
    along = np.linspace(-0.1, 0.1, 2001)
    forces = (theta[P.FORCE] + theta[P.TAPER] * along / half) * (along[1] - along[0])
    cos, sin = np.cos(theta[P.Q1]), np.sin(theta[P.Q1])
    true = sum(point.stress('zz', ARRAY.x, ARRAY.y[:, None], theta[P.Q0] * cos - s * sin,
                            theta[P.Q0] * sin + s * cos, force, 0.0, 0.0, DEPTH)
               for s, force in zip(along, forces, strict=True))
    assert np.abs(model.reshape(ARRAY.shape) - true).max() < 1e-3 * true.max()


@pytest.mark.parametrize('seed', range(4))
@pytest.mark.parametrize('kind, power, layers, ends', [
    (POINT, False, ONE, False), (POINT, False, TWO, False), (POINT, False, SHEARED, False),
    (POINT, True, (('zz', 0.0),), False), (LINE, False, ONE, False), (LINE, False, TWO, False),
    (LINE, False, ONE, True), (LINE, True, (('zz', 0.0),), False),
    (LINE, True, (('zz', 0.0),), True)])
def test_derivatives_are_differences(kind, power, layers, ends, seed):
    pad, extra = pad_of(ARRAY, layers, thickness=4e-3 if layers == ONE else np.inf), {}
    if power:
        extra |= {'WIDTH': np.log(2.3e-3), 'EXPONENT': np.log(3.1), 'BLUNT': 0.3}
        if kind == POINT:
            extra |= {'LONG_X': 0.2, 'LONG_XY': -0.3}
    else:
        extra |= {'WIDTH': 0.15}
    if ends:
        extra |= {'BEGIN': -4e-3, 'END': 5e-3}
    if kind == LINE:
        extra |= {'TAPER': 1.7}
    theta = loaded(kind, len(layers), seed, **extra)
    model, by = rows(kind, power, pad, theta, ends=ends)
    active = [*SHARP, P.SHEAR_V, P.WIDTH, *[P.EXPONENT, P.BLUNT] * power,
              *[P.BEGIN, P.END] * (ends or power and kind == POINT)]
    for parameter in active:
        step = np.zeros(theta.size)
        step[parameter] = STEPS.get(parameter, 1e-3)
        above, below = (rows(kind, power, pad, theta + s * step, ends=ends)[0] for s in (1, -1))
        slope = (above - below) / (2.0 * step[parameter])
        assert np.abs(slope).max() > 0.0
        # The derivative ignores that the mean over a tactel depends on a line's direction.
        bound = 3e-4 if kind == LINE and not power and parameter == P.Q1 else 1e-5
        assert np.abs(by[parameter] - slope).max() < bound * np.abs(slope).max(), parameter
    for layer in range(len(layers)):  # a baseline has derivative 1 in its own layer
        np.testing.assert_array_equal(
            by[P.BASE + layer].reshape(len(layers), -1).max(axis=1), np.eye(len(layers))[layer])
    assert np.isfinite(model).all()


@pytest.mark.parametrize('power', [True, False])
def test_two_points_are_the_sum_of_both_and_their_derivatives_those_by_differences(power):
    pad = pad_of(ARRAY, (('zz', 0.0),) if power else ONE)
    shape = {'WIDTH': np.log(2e-3), 'EXPONENT': np.log(2.2)} if power else {'WIDTH': 0.15}
    theta = loaded(POINT, Q2=-3e-3, Q3=2e-3, SHARE=0.3, **shape)

    def image(theta):
        by, model = np.zeros((theta.size, ARRAY.rows * ARRAY.columns)), np.zeros(
            ARRAY.rows * ARRAY.columns)
        bumps.add_rows_of_two(power, True, pad.nodes, pad, theta, by, model)
        return model, by

    first = theta.copy()
    first[[P.Q2, P.Q3, P.SHARE]] = 0.0
    second = first.copy()
    second[[P.Q0, P.Q1]] = theta[[P.Q2, P.Q3]]
    model, by = image(theta)
    one, other = (rows(POINT, power, pad, load)[0] for load in (first, second))
    np.testing.assert_allclose(model, 0.7 * one + 0.3 * other, rtol=1e-12)
    for parameter in (*SHARP, P.SHEAR_V, P.WIDTH, P.Q2, P.Q3, P.SHARE):
        step = STEPS.get(parameter, 1e-3) * np.eye(theta.size)[parameter]
        slope = (image(theta + step)[0] - image(theta - step)[0]) / (2.0 * step.sum())
        assert np.abs(by[parameter] - slope).max() < 1e-5 * np.abs(slope).max(), parameter


def plate(pad, theta):
    """Return the image (tactels,) of a plate and its derivatives (parameters, tactels)."""
    by, model = np.zeros((theta.size, ARRAY.rows * ARRAY.columns)), np.zeros(
        ARRAY.rows * ARRAY.columns)
    bumps.add_rows_of_plate(pad.nodes, pad, theta, by, model)
    return model, by


def test_a_plate_is_the_integral_of_lines_from_its_border_on():
    pad, half = pad_of(ARRAY, (('zz', 0.0),)), 2e-3
    width = half * np.sqrt((2.0 ** 0.4 - 1.0) / (2.0 ** (1.0 / 3.0) - 1.0))  # n is 2.5 and 3
    theta = loaded(LINE, Q0=1e-3, BEGIN=-1.0, SHARE=0.0, WIDTH=np.log(width))
    line, step, total = theta.copy(), 5e-5, 0.0
    line[[P.WIDTH, P.EXPONENT, P.SHEAR_U]] = np.log(half), np.log(3.0), 0.0
    for line[P.Q0] in 1e-3 + step * (np.arange(1200) + 0.5):
        total = total + step * rows(LINE, True, pad, line)[0]
    model = plate(pad, theta)[0]
    np.testing.assert_allclose(model, total * (model.max() / total.max()), atol=1e-3 * model.max())


def test_derivatives_of_a_plate_are_differences():
    pad, theta = pad_of(ARRAY, (('zz', 0.0),)), loaded(
        LINE, BEGIN=-2e-3, SHARE=0.3, WIDTH=np.log(2e-3))
    by = plate(pad, theta)[1]
    for parameter in (P.Q0, P.Q1, P.BEGIN, P.SHARE, P.WIDTH, P.FORCE):
        step = STEPS.get(parameter, 1e-3) * np.eye(theta.size)[parameter]
        slope = (plate(pad, theta + step)[0] - plate(pad, theta - step)[0]) / (2.0 * step.sum())
        assert np.abs(by[parameter] - slope).max() < 1e-5 * np.abs(slope).max(), parameter
