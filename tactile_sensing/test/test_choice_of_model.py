"""Choice of the simplest model that explains an image, and estimates of points."""

from averages_over_tactels import point_average
import numpy as np
import point_load as point
import pytest

from tactile_sensing.contact.estimator import ContactEstimator, EstimatorConfig
from tactile_sensing.skin.half_spaces import add_segment
from tactile_sensing.thesis import line
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import ContactType, Reason
from tactile_sensing.types.image import Layer, TactileImage

ARRAY, DEPTH, FORCE = TactelArray(26, 26, 1e-3, 1e-3), 0.002, 5.0
X, Y = ARRAY.x, ARRAY.y[:, None]
ESTIMATOR = ContactEstimator(EstimatorConfig(tactel='point'))


def press(a, b, force=FORCE, shear=(0.0, 0.0)):
    return point.stress('zz', X, Y, a, b, force, *(force * np.array(shear)), DEPTH)


def nothing(_):
    return np.zeros(ARRAY.shape)


def a_point(rng):
    return press(*rng.uniform(-8e-3, 8e-3, 2))


def sheared(rng):
    return press(*rng.uniform(-8e-3, 8e-3, 2), shear=rng.uniform(-0.5, 0.5, 2))


def an_edge(rng):
    yaw, a = rng.uniform(-0.7, 0.7), rng.uniform(-8e-3, 8e-3)
    return line.pressure(X, Y, a * np.cos(yaw), yaw, 200.0, DEPTH)


def two_points(rng):
    first = rng.uniform(-8e-3, 8e-3, 2)
    turn, apart = rng.uniform(-np.pi, np.pi), rng.uniform(5e-3, 9e-3)
    second = np.clip(first + apart * np.array([np.cos(turn), np.sin(turn)]), -12e-3, 12e-3)
    if np.hypot(*(second - first)) < 5e-3:
        second = -first
    return press(*first) + press(*second, force=rng.uniform(0.5, 1.0) * FORCE)


def flat_disc(rng):
    radius, centre = rng.uniform(4e-3, 7e-3), rng.uniform(-4e-3, 4e-3, 2)
    grid = rng.uniform(-radius, radius, (400, 2))
    grid = grid[np.hypot(*grid.T) < radius]
    return sum(press(*(centre + offset), force=FORCE / len(grid)) for offset in grid)


def a_corner(rng):
    first, turn = rng.uniform(-np.pi, np.pi), rng.uniform(np.pi / 3, 2.5)
    centre = rng.uniform(-4e-3, 4e-3, 2)
    return sum(press(*(centre + s * np.array([np.cos(angle), np.sin(angle)])), force=0.08)
               for s in np.arange(0.0, 0.02, 4e-4) for angle in (first, first + turn))


def end_of_an_edge(rng):
    turn, centre = rng.uniform(-np.pi, np.pi), rng.uniform(-4e-3, 4e-3, 2)
    return sum(press(*(centre + s * np.array([np.cos(turn), np.sin(turn)])), force=0.08)
               for s in np.arange(0.0, 0.03, 4e-4))


def estimate(picture, noise, estimator=ESTIMATOR):
    layer = Layer('zz', DEPTH, picture.astype(np.float32), noise_std=noise)
    return estimator.estimate(TactileImage(0, 0, (layer,), ARRAY, tared=True))


def noisy_estimates(make, decibels, count, seed):
    rng = np.random.default_rng(seed)
    for _ in range(count):
        picture = make(rng)
        noise = (picture.max() or 20e3) * 10.0 ** (-decibels / 20.0)
        yield estimate(picture + rng.normal(0.0, noise, ARRAY.shape), noise)


@pytest.mark.parametrize('decibels', [20, 30, pytest.param(50, marks=pytest.mark.long)])
@pytest.mark.parametrize('make, kind', [
    (nothing, ContactType.NONE), (a_point, ContactType.POINT), (sheared, ContactType.POINT),
    (an_edge, ContactType.LINE), (two_points, ContactType.OTHER),
    (flat_disc, ContactType.OTHER), (a_corner, ContactType.OTHER),
    (end_of_an_edge, ContactType.LINE)])
def test_the_type_is_found(make, kind, decibels):
    found = list(noisy_estimates(make, decibels, 100, seed=decibels))
    right = sum(contact.type == kind for contact in found)
    bar = 96 if decibels > 20 else 85 if kind == ContactType.OTHER else 90
    assert right >= bar, [contact.type.name for contact in found if contact.type != kind]
    two = sum(Reason.TWO_CONTACTS in contact.reasons for contact in found)
    assert two >= (0.9 * bar if decibels > 20 else 40) if make is two_points else two <= 20
    explained = {ContactType.POINT, ContactType.LINE}
    if make is end_of_an_edge:  # the pad may show only a corner of it
        found = [contact for contact in found
                 if contact.type == kind and Reason.OFF_PAD not in contact.reasons]
        assert len(found) > 40
        assert all(np.isfinite([contact.start, contact.end]).any() for contact in found)
    assert all(contact.valid == (contact.type in explained) for contact in found)


@pytest.mark.parametrize('depth, least', [(DEPTH, 48), (0.0, 28)])
def test_a_point_on_a_dead_row_is_found_within_its_claim(depth, least):
    array, rng = TactelArray(16, 16, 1.6e-3, 1.6e-3), np.random.default_rng(6)
    errors, over = [], []
    for _ in range(50):
        place = rng.uniform(-8e-3, 8e-3, 2)
        picture = point.stress('zz', array.x, array.y[:, None], *place, FORCE, 0.0, 0.0, DEPTH)
        noise = 0.01 * picture.max()
        picture += rng.normal(0.0, noise, array.shape)
        picture[np.abs(array.y - place[1]).argmin()] = 0.0
        contact = ESTIMATOR.estimate(TactileImage(0, 0, (Layer(
            'zz', depth, picture.astype(np.float32), noise_std=noise),), array, tared=True))
        if contact.type == ContactType.POINT:
            assert Reason.DEAD_TACTELS in contact.reasons
            errors.append(np.array([contact.x, contact.y]) - place)
            over.append(errors[-1] / np.sqrt(np.diag(contact.covariance)[:2]))
    assert len(errors) >= least
    assert np.sqrt(np.mean(np.square(errors))) < 0.1e-3
    assert np.sqrt(np.mean(np.square(over))) < 1.4


def test_the_unit_of_the_readings_changes_no_verdict():
    rng, verdicts = np.random.default_rng(3), set()
    for make in (nothing, a_point, an_edge, two_points) * 25:
        picture = make(rng)
        noise = 10.0 ** (-rng.uniform(14.0, 24.0) / 20.0) * (picture.max() or 1e3)
        picture = picture + rng.normal(0.0, noise, ARRAY.shape)
        pascal, volt = (ESTIMATOR.estimate(TactileImage(0, 0, (Layer(
            'zz', 0.0, (unit * picture).astype(np.float32), noise_std=unit * noise),), ARRAY,
            tared=True)) for unit in (1.0, 2.0**-20))
        assert (pascal.type, pascal.reasons) == (volt.type, volt.reasons)
        verdicts.add(pascal.type)
    assert len(verdicts) == 4


@pytest.mark.parametrize('depth', [DEPTH, 0.0])
@pytest.mark.parametrize('pitch, apart', [(2e-3, 6e-3), (3e-3, 6e-3), (4e-3, 9e-3)])
def test_two_points_on_few_tactels_are_neither_a_point_nor_a_line(pitch, apart, depth):
    array, rng = TactelArray(8, 8, pitch, pitch), np.random.default_rng(5)
    frames = []
    for _ in range(60):
        turn, middle = rng.uniform(-np.pi, np.pi), rng.uniform(-1.5, 1.5, 2) * pitch
        half = 0.5 * apart * np.array([np.cos(turn), np.sin(turn)])
        frames.append(sum(point_average(
            'zz', array.x, array.y[:, None], *place, force, 0.0, 0.0, DEPTH, pitch, pitch)
            for place, force in ((middle + half, FORCE), (middle - half,
                                                          rng.uniform(0.5, 1.0) * FORCE))))
    noise = 0.01 * np.max(frames)
    found = ContactEstimator().estimate_batch(
        frames + noise * rng.standard_normal(np.shape(frames)), array,
        [Layer('zz', depth, None, noise_std=noise)])
    assert found['valid'].mean() < 0.15


@pytest.mark.parametrize('depth', [DEPTH, 0.0])
@pytest.mark.parametrize('pitch', [2e-3, 3e-3, 4e-3])
def test_a_plate_that_covers_a_part_of_few_tactels_is_no_line_inside_it(pitch, depth):
    array, rng, few = TactelArray(8, 8, pitch, pitch), np.random.default_rng(5), 6
    fine = TactelArray(8 * few, 8 * few, pitch / few, pitch / few)
    yaws, borders = rng.uniform(-np.pi, np.pi, 80), rng.uniform(-2.0, 2.0, 80) * pitch
    frames = []
    for yaw, border in zip(yaws, borders, strict=True):
        u = (fine.x * np.cos(yaw) + fine.y[:, None] * np.sin(yaw) - border) / DEPTH
        inside = 0.5 + (u / (1.0 + u * u) + np.arctan(u)) / np.pi  # lines from the border on
        frame = inside + rng.uniform(0.0, 0.5) / (1.0 + u * u) ** 2
        frames.append(frame.reshape(8, few, 8, few).mean(axis=(1, 3)))
    noise = 0.01 * np.max(frames)
    found = ContactEstimator().estimate_batch(
        frames + noise * rng.standard_normal(np.shape(frames)), array,
        [Layer('zz', depth, None, noise_std=noise)])
    off = found['x'] * np.cos(yaws) + found['y'] * np.sin(yaws) - borders
    on_border = (np.abs(off) < 0.5e-3) & (np.abs(np.sin(found['yaw'] - yaws)) < 0.05)
    assert (found['valid'] & ~on_border).mean() < 0.1


def test_a_flat_disc_that_few_tactels_feel_is_found_within_its_claim():
    array, rng, radius, few = TactelArray(8, 8, 4e-3, 4e-3), np.random.default_rng(0), 3e-3, 4
    parts = 4e-3 * ((np.arange(few) + 0.5) / few - 0.5)  # a tactel measures its mean
    x, y = (array.x[:, None] + parts).ravel(), (array.y[:, None] + parts).ravel()[:, None]
    grid = radius * np.mgrid[-1:1:13j, -1:1:13j].reshape(2, -1).T
    disc = grid[np.hypot(*grid.T) <= radius]
    errors, over = [], []
    for _ in range(60):
        centre = rng.uniform(-10e-3, 10e-3, 2)
        picture = sum(point.stress('zz', x, y, *(centre + offset), 2.0 / len(disc), 0.0, 0.0,
                                   DEPTH) for offset in disc)
        picture = picture.reshape(8, few, 8, few).mean(axis=(1, 3))
        noise = 0.01 * picture.max()
        layer = Layer('zz', DEPTH, (picture + rng.normal(0.0, noise, picture.shape)).astype(
            np.float32), noise_std=noise)
        contact = ContactEstimator().estimate(TactileImage(0, 0, (layer,), array, tared=True))
        assert contact.type == ContactType.POINT
        errors.append(np.array([contact.x, contact.y]) - centre)
        over.append(errors[-1] / np.sqrt(np.diagonal(contact.covariance)[:2]))
    assert np.hypot(*np.transpose(errors)).max() < 1e-3
    assert 0.5 < np.sqrt(np.mean(np.square(over))) < 1.2


def test_shear_is_reported_within_its_claim():
    for shear in ((0.3, -0.2), (0.06, 0.04), (0.0, 0.0)):
        found = list(noisy_estimates(
            lambda rng, shear=shear: press(1e-3, 2e-3, shear=shear), 40, 100, 1))
        off = np.array([[c.shear_force_x, c.shear_force_y] for c in found]) - np.multiply(
            shear, FORCE)
        claimed = np.sqrt([[c.covariance[4, 4], c.covariance[5, 5]] for c in found])
        assert (np.sqrt(np.mean((off / claimed) ** 2, axis=0)) < 1.25).all()
        assert (np.abs(off.mean(axis=0)) < 0.1).all()


@pytest.mark.parametrize('decibels', [20, 30, 40])
def test_shear_that_does_not_show_is_in_the_covariance(decibels):
    rng = np.random.default_rng(8)
    noise = press(0.0, 0.0).max() * 10.0 ** (-decibels / 20.0)
    errors = []
    for _ in range(500):
        a, turn = rng.uniform(-8e-3, 8e-3), rng.uniform(-np.pi, np.pi)
        shear = rng.uniform(0.0, 0.5) * np.array([np.cos(turn), np.sin(turn)])
        contact = estimate(press(a, 1e-3, shear=shear) + rng.normal(0.0, noise, ARRAY.shape),
                           noise)
        if contact.valid:
            errors.append((contact.x - a) / np.sqrt(contact.covariance[0, 0]))
    assert len(errors) > 480
    assert np.sqrt(np.mean(np.square(errors))) < 1.25


@pytest.mark.parametrize('depth', [1e-4, DEPTH])
def test_one_spot_that_no_load_explains_is_not_two(depth):
    """One finger on a foil: flat in the middle, with a tail. Two fingers, one tactel apart."""
    spot = np.zeros(ARRAY.shape)
    spot[8:13, 8:13], spot[9, 13:17], spot[10, 13:16] = 0.7, 0.2, 0.15
    spot[9:12, 9:12] = 1.0
    two = spot.copy()
    two[9:12, 3:7] = 0.4
    rng = np.random.default_rng(12)
    for picture, expected in ((spot, False), (two, True)):
        stress = (picture + 0.01 * rng.standard_normal(ARRAY.shape)).astype(np.float32)
        contact = ESTIMATOR.estimate(TactileImage(
            0, 0, (Layer('zz', depth, stress, noise_std=0.01),), ARRAY, tared=True))
        assert contact.type == ContactType.OTHER and Reason.BAD_FIT in contact.reasons
        assert (Reason.TWO_CONTACTS in contact.reasons) == expected


def test_two_layers_and_a_shear_layer_are_used():
    rng = np.random.default_rng(4)
    loads = (2e-3, -1e-3, FORCE, 1.0, -0.5)
    spread = {}
    for name, plan in {'one': [('zz', DEPTH)], 'two': [('zz', DEPTH), ('zz', 2 * DEPTH)],
                       'shear': [('zz', DEPTH), ('xz', DEPTH)]}.items():
        found = []
        for _ in range(60):
            layers = []
            for component, depth in plan:
                clean = point.stress(component, X, Y, *loads, depth)
                picture = clean + rng.normal(0.0, 100.0, ARRAY.shape)
                layers.append(Layer(component, depth, picture.astype(np.float32),
                                    noise_std=100.0))
            contact = ESTIMATOR.estimate(TactileImage(0, 0, tuple(layers), ARRAY, tared=True))
            assert contact.valid and contact.model.endswith('+'.join(c for c, _ in plan))
            found.append([contact.x, contact.shear_force_x])
        spread[name] = np.std(found, axis=0)
    assert (spread['shear'] < 0.7 * spread['one']).all()
    assert (spread['two'] < spread['one']).all()


@pytest.mark.parametrize('model, kind', [('point', 'LINE'), ('line', 'POINT')])
def test_a_demanded_model_is_the_only_one(model, kind):
    estimator = ContactEstimator(EstimatorConfig(model=model, tactel='point'))
    rng = np.random.default_rng(5)
    for make in (a_point, an_edge):
        contact = estimate(make(rng), 20.0, estimator)
        assert contact.type.name != kind


@pytest.mark.parametrize('beyond', [0.5e-3, 1e-3, 2e-3])
@pytest.mark.parametrize('kind', ['point', 'line'])
def test_load_just_beyond_the_border_is_not_put_inside(kind, beyond):
    rng = np.random.default_rng(7)
    at = ARRAY.half_width_x + beyond
    right = wrong = 0
    for _ in range(200):
        b, yaw = rng.uniform(-8e-3, 8e-3), rng.uniform(-0.02, 0.02)
        picture = press(at, b) if kind == 'point' else line.pressure(
            X, Y, at * np.cos(yaw), yaw, 200.0, DEPTH)
        noise = 0.01 * (press(0.0, 0.0).max() if kind == 'point' else line.peak_pressure(
            200.0, DEPTH))
        contact = estimate(picture + rng.normal(0.0, noise, ARRAY.shape), noise)
        wrong += contact.valid and abs(contact.x - at) > 1e-3
        right += not contact.valid
    assert wrong <= 2 and right >= 195


@pytest.mark.parametrize('depth', [DEPTH, 0.0])
def test_six_readings_claim_no_more_than_they_show(depth):
    # One loaded tactel, the nearest live one beside it unloaded, the others 3 mm and more away.
    array, frame = TactelArray(8, 8, 1e-3, 1e-3), np.full((8, 8), np.nan)
    frame[[1, 1, 5, 6, 6, 6], [3, 4, 4, 2, 5, 7]] = 6e4, 1.0, 0.0, 0.0, 0.0, 0.0
    record = ESTIMATOR.estimate_batch(frame[None], array, [Layer('zz', depth, None)])[0]
    off = np.array([record['x'] - array.x[3], record['y'] - array.y[1]])
    claims = np.sqrt(np.diag(record['covariance'])[:2])
    assert not record['valid'] or (np.abs(off) < claims).all() and claims.min() > 1.5e-3


def estimate_without_skin(frames, array, noise):
    return ContactEstimator().estimate_batch(
        np.asarray(frames)[:, None], array, [Layer('zz', 0.0, np.empty(0), noise_std=noise)])


@pytest.mark.parametrize('axis', [0, 1])
@pytest.mark.parametrize('count', [6, 7, 12])
def test_a_row_of_strips_shows_a_place_across_them(count, axis):
    """Strips have no direction along them: the foils of 7 strips are such arrays."""
    rng, pitch, noise = np.random.default_rng(count), 5e-3, 0.01
    shape = (count, 1) if axis else (1, count)
    array = TactelArray(*shape, pitch, pitch)
    strips = pitch * (np.arange(count) - 0.5 * (count - 1))
    places = rng.uniform(strips[1], strips[-2], 200)

    def pressed(at):
        frames = (1.0 + ((strips - at[:, None]) / (0.8 * pitch))**2)**-1.5
        return frames * rng.normal(1.0, 0.05, frames.shape)

    def felt(frames):
        frames = frames + noise * rng.standard_normal(frames.shape)
        return estimate_without_skin(frames.reshape(-1, *shape), array, noise)

    found = felt(pressed(places))
    assert found['valid'].mean() > 0.98
    ok, variance = found['valid'], found['covariance'][:, axis, axis]
    off = (found['xy'[axis]] - places)[ok] / np.sqrt(variance[ok])
    assert np.sqrt(np.mean(off**2)) < 1.4
    assert np.sqrt(variance[ok]).max() < 0.3 * pitch
    # The place along the strips is not known better than their length is long.
    assert np.sqrt(found['covariance'][ok, 1 - axis, 1 - axis]).min() > 0.5 * pitch
    two = felt(pressed(places) + pressed(places + np.where(places > 0.0, -3.0, 3.0) * pitch))
    assert two['valid'].mean() < 0.02


def test_small_errors_of_most_tactels_are_no_second_load():
    """Crosstalk of 1.5 % of the peak everywhere: far above the noise, far below a load."""
    rng, array = np.random.default_rng(5), TactelArray(5, 5, 3.55e-3, 3.55e-3)
    places = rng.uniform(-5e-3, 5e-3, (100, 2))
    frames = np.array([point.stress('zz', array.x, array.y[:, None], *place, FORCE, 0.0, 0.0, 3e-3)
                       for place in places])
    peak = frames.max(axis=(1, 2), keepdims=True)
    noise = 1e-3 * frames.max()
    frames += 0.015 * peak * rng.uniform(-1.0, 1.0, frames.shape)
    found = estimate_without_skin(frames + noise * rng.standard_normal(frames.shape), array, noise)
    assert found['valid'].mean() > 0.9
    off = np.hypot(found['x'] - places[:, 0], found['y'] - places[:, 1])
    assert np.nanmax(off) < 1e-3


def test_one_tactel_beside_an_uneven_edge_is_no_second_load():
    """Gains differ by 30 %: the errors of loaded tactels and of one beside them are no load."""
    rng, array = np.random.default_rng(7), TactelArray(13, 6, 3.4e-3, 3.4e-3)
    frames = np.array([line.pressure(array.x, array.y[:, None], place, np.pi / 2, 200.0, 2.5e-3)
                       for place in rng.uniform(-8e-3, 8e-3, 200)])
    peak = frames.max(axis=(1, 2)).min()
    frames *= np.exp(0.3 * rng.standard_normal(frames.shape))
    noise = 2e-3 * peak
    found = estimate_without_skin(frames + noise * rng.standard_normal(frames.shape), array, noise)
    assert (found['valid'] & (found['type'] == 2)).mean() > 0.98


def pressed_points(array, depth, count, rng):
    """Return images of points on the inner tactels of a half-space's pad, with a peak of 1."""
    inner = np.array([array.half_width_x - array.pitch_x, array.half_width_y - array.pitch_y])
    places = rng.uniform(-inner, inner, (count, 2))
    fine = TactelArray(10 * array.rows, 10 * array.columns, 0.1 * array.pitch_x,
                       0.1 * array.pitch_y)
    frames = np.array([point.stress(
        'zz', fine.x, fine.y[:, None], *place, 1.0, 0.0, 0.0, depth).reshape(
            array.rows, 10, array.columns, 10).mean(axis=(1, 3)) for place in places])
    return frames / frames.max(axis=(1, 2), keepdims=True), places


def with_a_hot_tactel(frames, height, rng):
    """Return frames in which a random tactel reads more."""
    hot = frames.reshape(len(frames), -1).copy()
    hot[np.arange(len(hot)), rng.integers(hot.shape[1], size=len(hot))] += height
    return hot.reshape(frames.shape)


COARSE = [TactelArray(5, 5, 4e-3, 4e-3), TactelArray(8, 8, 4e-3, 4e-3),
          TactelArray(16, 16, 2e-3, 2e-3)]


@pytest.mark.parametrize('array', COARSE, ids=lambda it: f'{it.rows}x{it.columns}')
@pytest.mark.parametrize('share, noise', [  # depth over pitch, noise; 0: unknown
    (0.0, 0.0), (0.25, 1.0), (1.0, 1.0), *(pytest.param(*it, marks=pytest.mark.long) for it in (
        (0.0, 1.0), (0.25, 0.0), (0.5, 0.0), (0.5, 1.0), (1.0, 0.0)))])
def test_a_hot_tactel_is_no_load(array, share, noise):
    """On a skin of a quarter of the pitch, a load is nearly all on a single tactel."""
    rng, depth = np.random.default_rng(41), share * array.pitch_x
    most = 0.02 if noise and share != 0.25 else 0.05
    for height, full in ((5.0, 0.0), (10.0, 0.0), (20.0, 0.0), (60.0, 0.0), (200.0, 0.0),
                         (1000.0, 500.0)):
        frames = with_a_hot_tactel(rng.standard_normal((200, *array.shape)), height, rng)
        found = ContactEstimator().estimate_batch(
            np.minimum(frames, full or np.inf), array, [Layer('zz', depth, None, full, noise)])
        assert found['valid'].mean() <= most, height
        if noise and height > 10.0:
            nothing = found['reasons'] & int(Reason.NO_CONTACT) > 0
            assert nothing.mean() > 0.5
            assert (found['reasons'][nothing] & int(Reason.DEAD_TACTELS)).all()


@pytest.mark.parametrize('array', COARSE, ids=lambda it: f'{it.rows}x{it.columns}')
@pytest.mark.parametrize('depth', [2e-3, 3e-3])
@pytest.mark.parametrize('height', [0.0, 40.0])
def test_a_point_beside_a_hot_tactel_is_found(array, depth, height):
    rng = np.random.default_rng(42)
    frames, places = pressed_points(array, depth, 100, rng)
    frames = 60.0 * frames + rng.standard_normal(frames.shape)
    found = ContactEstimator().estimate_batch(
        with_a_hot_tactel(frames, height, rng), array, [Layer('zz', depth, None, 0.0, 1.0)])
    right = found['valid'] & (found['type'] == ContactType.POINT)
    off = np.hypot(found['x'] - places[:, 0], found['y'] - places[:, 1])
    claimed = np.sqrt(found['covariance'][:, 0, 0] + found['covariance'][:, 1, 1])
    assert right.mean() > 0.95
    assert (off > 4.0 * claimed)[right].mean() <= (0.08 if height else 0.02)


@pytest.mark.parametrize('depth', [0.0, 2e-3])
def test_the_unit_of_lengths_changes_no_verdict(depth):
    """The same images, of a pad and skin that are ten times as large."""
    rng, array = np.random.default_rng(43), COARSE[1]
    points, _ = pressed_points(array, 2e-3, 200, rng)
    frames = np.concatenate([8.0 * points, np.zeros((200, *array.shape))])
    frames = with_a_hot_tactel(frames, 8.0, rng) + rng.standard_normal(frames.shape)
    found = [ContactEstimator().estimate_batch(
        frames, TactelArray(8, 8, scale * 4e-3, scale * 4e-3),
        [Layer('zz', scale * depth, None, 0.0, 1.0)]) for scale in (1.0, 10.0)]
    for name in ('valid', 'type', 'reasons'):
        assert (found[0][name] == found[1][name]).mean() > 0.99, name


def test_things_as_broad_as_the_pad_are_no_point():
    """Sixty loads anywhere on 18 x 18 mm, such as things that lie on a pad of this size."""
    rng, array = np.random.default_rng(3), TactelArray(5, 5, 3.55e-3, 3.55e-3)

    def things():
        places = rng.uniform(-5e-3, 5e-3, 2) + rng.uniform(-9e-3, 9e-3, (60, 2))
        return sum(point.stress('zz', array.x, array.y[:, None], *place, force, 0.0, 0.0, 3e-3)
                   for place, force in zip(places, rng.uniform(0.0, 1.0, 60), strict=True))

    frames = np.array([things() for _ in range(150)])
    noise = 5e-3 * frames.max()
    found = estimate_without_skin(frames + noise * rng.standard_normal(frames.shape), array, noise)
    assert found['valid'].mean() < 0.1


def test_a_bar_that_is_too_short_for_a_line_is_a_point():
    rng, array = np.random.default_rng(5), TactelArray(16, 16, 1.6e-3, 1.6e-3)
    places, frames = rng.uniform(-6e-3, 6e-3, (40, 2)), np.zeros((40, *array.shape))
    for place, frame, angle in zip(places, frames, rng.uniform(0.0, np.pi, 40), strict=True):
        end = 1.5e-3 * np.array([np.cos(angle), np.sin(angle)])
        add_segment(frame, array.x, array.y, 2.5e-3, *(place - end), *(place + end), 100.0, 100.0)
    noise = 0.01 * frames.max()
    found = estimate_without_skin(frames + noise * rng.standard_normal(frames.shape), array, noise)
    assert (found['type'] == ContactType.POINT)[found['valid']].all()
    assert found['valid'].mean() > 0.9
    assert np.hypot(found['x'] - places[:, 0], found['y'] - places[:, 1]).max() < 0.4e-3


def hertz(array, depth, halves, angle, place):
    """Return the image of an elliptical Hertz contact with half axes (2,) [m] and a force of 1."""
    few = 5
    parts = (np.arange(few) + 0.5) / few - 0.5  # a tactel measures its mean
    x = (array.x[:, None] + array.pitch_x * parts).ravel()
    y = (array.y[:, None] + array.pitch_y * parts).ravel()[:, None]
    grid = np.mgrid[-1:1:15j, -1:1:15j].reshape(2, -1).T
    grid = grid[np.hypot(*grid.T) < 1.0]
    pressure = np.sqrt(1.0 - np.sum(grid**2, axis=1))
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    fine = sum(point.stress('zz', x, y, *(place + offset), force, 0.0, 0.0, depth)
               for offset, force in zip(grid * halves @ turn.T, pressure / pressure.sum(),
                                        strict=True))
    return fine.reshape(array.rows, few, array.columns, few).mean(axis=(1, 3))


@pytest.mark.parametrize('pitch, depth, halves', [
    (4e-3, 2e-3, (7e-3, 4.5e-3)), (3e-3, 1.5e-3, (6e-3, 4e-3)), (2e-3, 1.5e-3, (4e-3, 2.5e-3)),
    (1.6e-3, 2e-3, (4e-3, 3e-3))])  # the flat top of the last one shows
def test_an_elongated_contact_as_of_a_finger_is_a_point_within_its_claim(pitch, depth, halves):
    rng, array = np.random.default_rng(1), TactelArray(12, 12, pitch, pitch)
    places = rng.uniform(-3.0 * pitch, 3.0 * pitch, (40, 2))
    frames = np.array([hertz(array, depth, halves, angle, place)
                       for angle, place in zip(rng.uniform(0.0, np.pi, 40), places, strict=True)])
    noise = 0.01 * frames.max()
    found = estimate_without_skin(frames + noise * rng.standard_normal(frames.shape), array, noise)
    ok = found['valid'] & (found['type'] == ContactType.POINT)
    assert ok.mean() > 0.85 and (found['valid'] == ok).all()
    off = np.column_stack([found['x'], found['y']])[ok] - places[ok]
    sd = np.sqrt(np.diagonal(found['covariance'], axis1=1, axis2=2)[ok, :2])
    assert np.hypot(*off.T).max() < 0.1 * pitch
    assert np.sqrt(np.mean((off / sd)**2)) < 1.4


def test_a_pad_that_is_smaller_than_what_it_feels_still_finds_places():
    """The skin blurs a point to more than the pad can recognise; that alone refuses no image."""
    rng, array, depth = np.random.default_rng(4), TactelArray(3, 6, 2e-3, 2e-3), 3e-3
    places = rng.uniform(-1.0, 1.0, (100, 2)) * [5e-3, 2e-3]
    frames = np.array([
        point.stress('zz', array.x, array.y[:, None], *place, FORCE, 0.0, 0.0, depth)
        for place in places])
    noise = 0.01 * frames.max()
    found = estimate_without_skin(frames + noise * rng.standard_normal(frames.shape), array, noise)
    ok = found['valid']
    assert ok.mean() > 0.6
    sd = np.sqrt(np.diagonal(found['covariance'], axis1=1, axis2=2)[ok, :2])
    off = np.column_stack([found['x'], found['y']])[ok] - places[ok]
    assert np.sqrt(np.mean((off / sd)**2)) < 1.4


def test_equal_readings_that_no_number_can_divide_are_no_error():
    frame = np.zeros((8, 8))
    frame[3:5, 3:5] = 5e-324  # the smallest float: a millionth of it is 0
    record = ESTIMATOR.estimate_batch(
        frame[None], TactelArray(8, 8, 1e-3, 1e-3), [Layer('zz', DEPTH, None)])[0]
    assert not record['valid']
