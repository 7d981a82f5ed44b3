"""Claimed errors hold on arrays that are not ideal; frames by closed forms."""

from averages_over_tactels import point_average
import numpy as np
import point_load as point
import pytest

from tactile_sensing.contact.estimator import ContactEstimator, EstimatorConfig
from tactile_sensing.skin.half_spaces import add_point, add_segment
from tactile_sensing.thesis import line
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import ContactType, Reason, ROW
from tactile_sensing.types.image import Layer

ARRAY, DEPTH, COUNT = TactelArray(16, 16, 0.0254 / 16, 0.0254 / 16), 0.002, 600
X, Y = ARRAY.x, ARRAY.y[:, None]
# N and N/m
FORCES = {ContactType.POINT: ('normal_force', 5.0), ContactType.LINE: ('line_force', 200.0)}
PLACES = {ContactType.POINT: ('x', 'y'), ContactType.LINE: ('offset', 'yaw')}
HONEST = 1.4  # largest RMS of error over claimed standard deviation


def presses(kind, rng, count=COUNT):
    """Return the truth by name, and images (count, rows, columns) without noise [Pa]."""
    name, force = FORCES[kind]
    if kind == ContactType.POINT:
        truth = rng.uniform(-8e-3, 8e-3, (count, 2))
        frames = np.array([point.stress('zz', X, Y, a, b, force, 0.0, 0.0, DEPTH)
                           for a, b in truth])
    else:
        truth = rng.uniform((-6e-3, -0.6), (6e-3, 0.6), (count, 2))
        frames = np.array([line.pressure(X, Y, *load, force, DEPTH) for load in truth])
    return {**dict(zip(PLACES[kind], truth.T, strict=True)), name: force}, frames


def estimates(frames, noise, **layer):
    given = Layer('zz', DEPTH, None, noise_std=noise, **layer)
    return ContactEstimator(EstimatorConfig(tactel='point')).estimate_batch(frames, ARRAY, [given])


def over_claims(found, truth):
    """Return the largest RMS of error over claimed standard deviation, of valid contacts."""
    valid = found['valid']
    claimed = found['covariance']
    ratios = [(found[name] - truth[name]) / np.sqrt(claimed[:, row, row])
              for name, row in ROW._asdict().items() if name in truth]
    if 'offset' in truth:  # across the edge, at the estimated place
        across = found['x'] * np.cos(truth['yaw']) + found['y'] * np.sin(truth['yaw'])
        ratios.append((across - truth['offset'])
                      / np.sqrt(claimed[:, ROW.x, ROW.x] + claimed[:, ROW.y, ROW.y]))
    return max(np.sqrt(np.mean(ratio[valid]**2)) for ratio in ratios)


@pytest.mark.parametrize('yaw', [0.0, 0.4])
def test_a_line_that_begins_beside_the_centre_turns_about_its_own_middle(yaw):
    """A turn about the pad's centre would move it across: place and turn are hardly correlated."""
    along, across = np.array([-np.sin(yaw), np.cos(yaw)]), np.array([np.cos(yaw), np.sin(yaw)])
    ends = [(length * along + 1e-3 * across).tolist() for length in (3e-3, 30e-3)]
    frame = np.zeros(ARRAY.shape)
    add_segment(frame, ARRAY.x, ARRAY.y, DEPTH, *ends[0], *ends[1], 200.0, 200.0)
    noise = 0.01 * frame.max()
    frames = frame + np.random.default_rng(4).normal(0.0, noise, (200, *frame.shape))
    found = estimates(frames, noise)
    found = found[found['valid']]
    assert len(found) > 190
    place = found['x'] * across[0] + found['y'] * across[1]
    covariance = found['covariance'].mean(axis=0)
    claimed = np.sqrt(across @ covariance[:2, :2] @ across)
    assert 1.0 < claimed / place.std() < 2.2  # of a full line: 1.8
    said = across @ covariance[:2, ROW.yaw] / claimed / np.sqrt(covariance[ROW.yaw, ROW.yaw])
    assert abs(said - np.corrcoef(place, found['yaw'])[0, 1]) < 0.4


@pytest.mark.parametrize('pitch', [3e-3, 4e-3])
def test_sharp_points_on_wide_tactels_leave_noise_alone(pitch):
    """Without a skin, the fit ends on tactels that average over their area."""
    array, rng = TactelArray(8, 8, pitch, pitch), np.random.default_rng(17)
    frames = np.array([point_average('zz', array.x, array.y[:, None], *place, 5.0, 0.0, 0.0, DEPTH,
                                     pitch, pitch)
                       for place in rng.uniform(-3.0, 3.0, (100, 2)) * pitch])
    noise = 0.01 * frames.max()
    found = ContactEstimator().estimate_batch(
        frames + noise * rng.standard_normal(frames.shape), array,
        [Layer('zz', 0.0, None, noise_std=noise)])
    valid = found[found['valid']]
    assert len(valid) > 90
    assert np.percentile(valid['residual'], 80) < 1.5


@pytest.mark.parametrize('spread, known', [(0.1, 0.1), (0.1, 0.0), (0.05, 0.0), (0.02, 0.0)])
@pytest.mark.parametrize('kind', FORCES)
def test_gains_that_differ(kind, spread, known):
    rng = np.random.default_rng(31)
    truth, frames = presses(kind, rng, 1000)
    noise = 0.01 * frames.max()
    frames *= 1.0 + spread * rng.standard_normal(frames.shape)
    found = estimates(
        frames + noise * rng.standard_normal(frames.shape), noise, gain_spread=known)
    assert found['valid'].mean() > 0.95
    found['valid'] &= found['type'] == kind
    assert over_claims(found, truth) < HONEST


@pytest.mark.parametrize('kind', FORCES)
def test_a_gain_that_all_tactels_have_in_common(kind):
    rng = np.random.default_rng(37)
    truth, frames = presses(kind, rng)
    noise = 0.01 * frames.max()
    frames *= 1.0 + 0.05 * rng.standard_normal((COUNT, 1, 1))
    found = estimates(
        frames + noise * rng.standard_normal(frames.shape), noise, force_std=0.05)
    assert found['valid'].mean() > 0.95
    name, force = FORCES[kind]
    assert 1.0 / HONEST < over_claims(found, {name: force}) < HONEST
    assert over_claims(found, truth) < HONEST


def test_claims_without_a_fault_are_not_wide():
    rng = np.random.default_rng(36)
    truth, frames = presses(ContactType.POINT, rng, 2000)
    noise = 0.01 * frames.max()
    found = estimates(frames + noise * rng.standard_normal(frames.shape), noise)
    # Larger than by noise only, because scatter of the gains or a patch cannot be excluded.
    assert 0.5 < over_claims(found, truth) < 1.1


def test_the_remainder_of_an_edge_that_pressed_before():
    """A residual that the fit can absorb leaves the force in doubt, on a known skin too."""
    rng = np.random.default_rng(39)
    truth, frames = presses(ContactType.LINE, rng, 300)
    earlier = truth['offset'] + rng.uniform(1.5e-3, 2.2e-3, 300)
    beside = np.array([line.pressure(X, Y, offset, yaw, 200.0, DEPTH)
                       for offset, yaw in zip(earlier, truth['yaw'], strict=True)])
    noise = 0.01 * frames.max()
    frames = frames + 0.05 * beside
    found = estimates(frames + noise * rng.standard_normal(frames.shape), noise)
    assert found['valid'].mean() > 0.95
    off = np.abs(found['line_force'] / 200.0 - 1.0)
    claimed = np.sqrt(found['covariance'][:, ROW.line_force, ROW.line_force]) / 200.0
    assert np.mean((off > 0.02) & (off > 5.0 * claimed)) < 0.01


def test_an_edge_blunter_than_any_bump():
    """The exponent of the bump is at its bound; this must not keep the yaw from converging."""
    rng = np.random.default_rng(38)
    truth = rng.uniform((-8e-3, -1.5), (8e-3, 1.5), (200, 2))
    across = np.abs(X * np.cos(truth[:, 1, None, None]) + Y * np.sin(truth[:, 1, None, None])
                    - truth[:, 0, None, None])
    # Gaussian under the tool, and negative beside it, as a skin on bone bulges there.
    frames = np.exp(-(across / 3.5e-3)**2) - 0.02 * np.exp(-((across - 7e-3) / 2.5e-3)**2)
    found = ContactEstimator().estimate_batch(
        frames + 0.01 * rng.standard_normal(frames.shape), ARRAY,
        [Layer('zz', 0.0, None, noise_std=0.01)])
    assert found['valid'].mean() > 0.95
    assert over_claims(found, dict(zip(('offset', 'yaw'), truth.T, strict=True))) < HONEST


def ending_edges(rng, count=COUNT):
    """Return the truth (count, 3), offset, yaw and end, and images without noise [Pa]."""
    force = FORCES[ContactType.LINE][1]
    truth = rng.uniform((-5e-3, -0.5, -3e-3), (5e-3, 0.5, 7e-3), (count, 3))
    frames = np.zeros((count, *ARRAY.shape))
    for frame, (offset, yaw, end) in zip(frames, truth, strict=True):
        across, along = (np.array([np.cos(yaw), np.sin(yaw)]),
                         np.array([-np.sin(yaw), np.cos(yaw)]))
        foot = offset * across
        add_segment(frame, ARRAY.x, ARRAY.y, DEPTH, *(foot - 0.1 * along), *(foot + end * along),
                    force, force)
    return truth, frames


def turn_alike(found, truth):
    """Add multiples of pi to the estimated directions, to bring them next to the true ones."""
    found['yaw'] -= np.pi * np.round((found['yaw'] - truth['yaw']) / np.pi)


def uneven(rng, count, force, array=ARRAY, depth=DEPTH):
    """
    Return truth and images of edges whose force per length varies along them: rows of points.

    `force` takes places along the edge, in half sides of the pad, and returns shares.
    """
    half, spacing = array.half_width_x, 1e-4
    along = np.arange(-0.025, 0.025, spacing)
    load = 200.0 * np.maximum(force(along / half), 0.0)
    offset, yaw = rng.uniform(-0.4, 0.4, count) * half, rng.uniform(-0.5, 0.5, count) * np.pi
    frames, force = np.zeros((count, *array.shape)), np.empty(count)
    for k, frame in enumerate(frames):
        x = offset[k] * np.cos(yaw[k]) - along * np.sin(yaw[k])
        y = offset[k] * np.sin(yaw[k]) + along * np.cos(yaw[k])
        for place in zip(x, y, spacing * load, strict=True):
            add_point(frame, array.x, array.y, depth, *place)
        force[k] = spacing * load[np.maximum(np.abs(x), np.abs(y)) < half].sum()
    return {'offset': offset, 'yaw': yaw, 'normal_force': force}, frames


@pytest.mark.parametrize('taper', [-0.8, -0.3, 0.1, 0.5])
@pytest.mark.parametrize('depth', [DEPTH, 0.0])
def test_an_edge_that_presses_harder_on_one_side(depth, taper):
    rng = np.random.default_rng(34)
    truth, frames = uneven(rng, 100, lambda along: 1.0 + taper * along)
    noise = 0.01 * frames.max()
    found = ContactEstimator(EstimatorConfig(tactel='point')).estimate_batch(
        frames + noise * rng.standard_normal(frames.shape), ARRAY,
        [Layer('zz', depth, None, noise_std=noise)])
    assert (found['valid'] & (found['type'] == ContactType.LINE)).mean() > 0.97
    assert np.sqrt(np.nanmean((found['x'] * np.cos(truth['yaw']) + found['y'] * np.sin(
        truth['yaw']) - truth['offset'])**2)) < 5e-5
    turn_alike(found, truth)
    if depth == 0.0:
        del truth['normal_force']
    assert over_claims(found, truth) < HONEST
    if depth > 0.0:
        ok = found['force_valid']
        assert ok.mean() > 0.9
        off = found['normal_force'][ok] / truth['normal_force'][ok] - 1.0
        assert np.sqrt(np.mean(off**2)) < 0.02


@pytest.mark.parametrize('noise', [0.005, 0.03])
def test_an_edge_that_presses_harder_on_one_side_of_a_small_pad(noise):
    rng, array = np.random.default_rng(35), TactelArray(5, 5, 3.55e-3, 3.55e-3)
    truth, frames = uneven(rng, 100, lambda along: 1.0 + 0.4 * along, array, 3e-3)
    noise *= frames.max()
    found = ContactEstimator().estimate_batch(
        frames + noise * rng.standard_normal(frames.shape), array,
        [Layer('zz', 0.0, None, noise_std=noise)])
    assert (found['valid'] & (found['type'] == ContactType.LINE)).mean() > 0.9
    turn_alike(found, truth)
    del truth['normal_force']
    assert over_claims(found, truth) < HONEST


@pytest.mark.parametrize('noise', [0.005, 0.03])
@pytest.mark.parametrize('force', [lambda along: 1.0 + 0.25 * np.sin(5.0 * along),
                                   lambda along: np.abs(along - 0.2) > 0.13])
def test_a_wavy_edge_and_one_with_a_notch(force, noise):
    rng = np.random.default_rng(36)
    truth, frames = uneven(rng, 100, force)
    noise *= frames.max()
    found = ContactEstimator(EstimatorConfig(tactel='point')).estimate_batch(
        frames + noise * rng.standard_normal(frames.shape), ARRAY,
        [Layer('zz', 0.0, None, noise_std=noise)])
    assert (found['valid'] & (found['type'] == ContactType.LINE)).mean() > 0.95
    turn_alike(found, truth)
    del truth['normal_force']
    assert over_claims(found, truth) < HONEST


@pytest.mark.parametrize('size', [0.1, 0.2])
def test_gains_that_vary_smoothly_over_the_pad(size):
    rng = np.random.default_rng(37)
    truth, frames = uneven(rng, 200, np.ones_like)
    waves_x, waves_y, phase_x, phase_y = rng.uniform(1.0, 3.0, (4, 200, 1, 1))
    frames *= 1.0 + size * np.sin(waves_x * ARRAY.x / ARRAY.half_width_x + phase_x) * np.sin(
        waves_y * ARRAY.y[:, None] / ARRAY.half_width_y + phase_y)
    noise = 0.003 * frames.max()
    found = ContactEstimator(EstimatorConfig(tactel='point')).estimate_batch(
        frames + noise * rng.standard_normal(frames.shape), ARRAY,
        [Layer('zz', 0.0, None, noise_std=noise)])
    assert found['valid'].mean() > 0.9
    turn_alike(found, truth)
    del truth['normal_force']
    assert over_claims(found, truth) < HONEST


@pytest.mark.parametrize('unknown', [0, 0.0])
def test_an_integer_noise_of_0_is_unknown(unknown):
    rng = np.random.default_rng(38)
    _, frames = uneven(rng, 20, np.ones_like)
    frames /= frames.max()
    frames += 0.01 * rng.standard_normal(frames.shape)
    found = ContactEstimator().estimate_batch(
        frames, ARRAY, [Layer('zz', 0.0, None, noise_std=unknown)])
    assert found['valid'].all()


def test_an_edge_that_ends_on_the_pad():
    rng = np.random.default_rng(32)
    truth, frames = ending_edges(rng)
    force = FORCES[ContactType.LINE][1]
    noise = 0.01 * frames.max(axis=(1, 2)).mean()
    found = estimates(frames + noise * rng.standard_normal(frames.shape), noise)
    valid = found['valid']
    assert valid.mean() > 0.9 and (found['type'][valid] == ContactType.LINE).all()
    assert np.isfinite(found['end'][valid]).mean() > 0.99
    offset, yaw, end = truth.T
    assert over_claims(found, {'offset': offset, 'yaw': yaw, 'line_force': force}) < HONEST
    off = (found['end'] - end)[valid]
    assert np.sqrt(np.nanmean(off**2)) < 0.05e-3  # a thirtieth of the pitch


def test_a_dead_tactel_on_an_edge_that_ends_is_no_other_end():
    rng = np.random.default_rng(35)
    truth, frames = ending_edges(rng, 200)
    noise = 0.01 * frames.max(axis=(1, 2)).mean()
    for frame in frames:  # the load that loads the border most
        frame[0, frame[0].argmax()] = 0.0
    found = estimates(frames + noise * rng.standard_normal(frames.shape), noise)
    offset, yaw, end = truth.T
    assert found['valid'].mean() > 0.9
    assert (found['reasons'][found['valid']] & int(Reason.DEAD_TACTELS) > 0).all()
    length = end + (ARRAY.half_width_y + offset * np.sin(yaw)) / np.cos(yaw)
    off = found['normal_force'] / (FORCES[ContactType.LINE][1] * length) - 1.0
    claimed = np.sqrt(found['covariance'][:, 3, 3]) / (FORCES[ContactType.LINE][1] * length)
    assert not ((np.abs(off) > 0.02) & (np.abs(off) > 4.0 * claimed)).any()


def test_a_second_contact_that_one_tactel_shows_is_no_dead_tactel():
    rng = np.random.default_rng(33)
    truth, frames = presses(ContactType.POINT, rng)
    noise = 0.01 * frames.max()
    for frame, a, b in zip(frames, truth['x'], truth['y'], strict=True):
        second = rng.uniform(-9e-3, 9e-3, 2)
        while np.hypot(second[0] - a, second[1] - b) < 4.0 * DEPTH:
            second = rng.uniform(-9e-3, 9e-3, 2)
        add_point(frame, ARRAY.x, ARRAY.y, DEPTH, *second, 0.3 * FORCES[ContactType.POINT][1])
    found = estimates(frames + noise * rng.standard_normal(frames.shape), noise)
    assert found['valid'].mean() < 0.01
    assert (found['reasons'] & int(Reason.TWO_CONTACTS) > 0).mean() > 0.95


# A saturating load near the rim shows only one flank; the claimed error must include that.
NOISE = 0.01
HALF = 2.5e-3  # m, of the patch of a cylinder (Hertz)


def cylinders(offset, along_x):
    """Return images of a cylinder on a half-space, full scale 1, peak 2; and their yaws."""
    across = HALF * np.linspace(-0.95, 0.95, 39)
    shares = np.sqrt(1.0 - (across / HALF)**2)
    yaws = np.radians(np.linspace(-2.0, 2.0, 9)) + 0.5 * np.pi * along_x
    images = np.array([sum(
        share * line.pressure(ARRAY.x[None, :], ARRAY.y[:, None], offset + aside, yaw, 1.0, DEPTH)
        for aside, share in zip(across, shares, strict=True)) for yaw in yaws])
    images *= 2.0 / images.max(axis=(1, 2), keepdims=True)
    noise = np.random.default_rng(0).normal(0.0, NOISE, images.shape)
    return np.minimum(images + noise, 1.0), yaws


def found_cylinders(offset, along_x, depth):
    """Return errors and claims (N,) across the line [m], of valid estimates."""
    images, yaws = cylinders(offset, along_x)
    records = ContactEstimator().estimate_batch(images, ARRAY, [Layer(
        'zz', depth, np.empty(0), full_scale=1.0, noise_std=NOISE)])
    normal = np.stack([np.cos(yaws), np.sin(yaws)], axis=-1)
    error = records['x'] * normal[:, 0] + records['y'] * normal[:, 1] - offset
    variance = np.einsum('ni,nij,nj->n', normal, records['covariance'][:, :2, :2], normal)
    return error[records['valid']], np.sqrt(variance[records['valid']])


@pytest.mark.parametrize('depth', [0.0, DEPTH])
@pytest.mark.parametrize('along_x', [False, True])
@pytest.mark.parametrize('offset', [-11.6e-3, -10.9e-3, 10.9e-3, 11.6e-3])
def test_the_claim_for_a_load_beside_the_rim_holds(offset, along_x, depth):
    error, claimed = found_cylinders(offset, along_x, depth)
    assert len(error) >= 5 and np.abs(error / claimed).max() < 3.0


@pytest.mark.parametrize('depth', [0.0, DEPTH])
@pytest.mark.parametrize('along_x', [False, True])
def test_two_flanks_are_accurate(along_x, depth):
    error, claimed = found_cylinders(1e-3, along_x, depth)
    assert len(error) == 9 and np.abs(error).max() < 1e-4 and claimed.max() < 3e-4


@pytest.mark.parametrize('std', [0.3, 1.0])  # noise [LSB]
@pytest.mark.parametrize('kind', FORCES)
def test_six_bits_clipped_at_zero(kind, std):
    rng = np.random.default_rng(34)
    truth, frames = presses(kind, rng)
    lsb = frames.max() / 60.0
    measured = frames + std * lsb * rng.standard_normal(frames.shape)
    noise = lsb * np.hypot(std, 12**-0.5)
    counts = np.clip(np.rint(measured / lsb), 0, 63)
    found = estimates(counts * lsb, noise, floor=0.5 * lsb)
    ideal = estimates(frames + noise * rng.standard_normal(frames.shape), noise)
    assert found['valid'].mean() > ideal['valid'].mean() - 0.02
    assert over_claims(found, truth) < HONEST
    for name, values in truth.items():
        rms = [np.sqrt(np.nanmean((each - values)**2)) for each in (
            records['x'] * np.cos(records['yaw']) + records['y'] * np.sin(records['yaw'])
            if name == 'offset' else records[name] for records in (found, ideal))]
        assert rms[0] < 1.3 * rms[1] * (1.0 + 2.0 / np.sqrt(COUNT)), name
