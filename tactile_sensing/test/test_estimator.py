"""Estimator: valid estimates are at the noise limit, other images are refused."""

import numpy as np
import point_load as point
import pytest

from tactile_common.errors import ConfigurationError
from tactile_sensing.contact.estimator import ContactEstimator, EstimatorConfig
from tactile_sensing.thesis import line
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import ContactType, Reason
from tactile_sensing.types.image import Layer, TactileImage

DEPTH, FORCE = 0.002, 200.0
ARRAY = TactelArray(16, 16, 0.0254 / 16, 0.0254 / 16)
NOISE = 0.01 * line.peak_pressure(FORCE, DEPTH)  # 40 dB


def edge(offset=0.0, yaw=0.0, force=FORCE, array=ARRAY, depth=DEPTH):
    return line.pressure(array.x[None, :], array.y[:, None], offset, yaw, force, depth)


def tactile_image(stress, array=ARRAY, noise=NOISE, saturated=0, tared=True, **layer):
    layer = {'component': 'zz', 'depth': DEPTH, 'noise_std': noise} | layer
    return TactileImage(0, 0, (Layer(stress=np.asarray(stress, np.float32), **layer),), array,
                        tared=tared, saturated=saturated)


def estimate(stress, *, method='fit', **kwargs):
    return ContactEstimator(EstimatorConfig(method=method, tactel='point')).estimate(
        tactile_image(stress, **kwargs))


def noisy(picture, rng, noise=NOISE):
    return picture + rng.normal(0.0, noise, picture.shape)


def sheared(offset, yaw, force, shear, change=(0.0, 0.0, 0.0, 0.0)):
    offset, yaw, force, shear = np.add((offset, yaw, force, shear), change)
    return line.pressure(ARRAY.x, ARRAY.y[:, None], offset, yaw, force, DEPTH, shear)


@pytest.mark.parametrize('decibels', [20, 30, 40, 50])
def test_line_is_at_the_cramer_rao_bound(decibels):
    rng = np.random.default_rng(decibels)
    truth = rng.uniform((-8e-3, np.radians(-40)), (8e-3, np.radians(40)), (4000, 2))
    noise = 10.0 ** (-decibels / 20.0) * line.peak_pressure(FORCE, DEPTH)
    frames = np.array([noisy(edge(*load), rng, noise) for load in truth])
    found = ContactEstimator(EstimatorConfig(tactel='point')).estimate_batch(
        frames, ARRAY, [Layer('zz', DEPTH, None, 0, noise)])
    valid = found['valid'] & (found['type'] == ContactType.LINE)
    assert valid.mean() > 0.995
    found, truth = found[valid], truth[valid]
    offset = found['x'] * np.cos(found['yaw']) + found['y'] * np.sin(found['yaw'])
    error = np.column_stack([offset - truth[:, 0], found['yaw'] - truth[:, 1],
                             found['line_force'] - FORCE])
    bound = []
    steps = np.diag([1e-7, 1e-5, 1.0, 1.0])
    for load in truth[::8]:
        j = np.stack([(sheared(*load, FORCE, 0.0, by) - sheared(*load, FORCE, 0.0, -by)).ravel()
                      / (2.0 * by.sum()) for by in steps], axis=-1)
        prior = np.diag([0.0, 0.0, 0.0, (0.3 * FORCE) ** -2])  # friction
        bound.append(np.diag(np.linalg.inv(j.T @ j / noise**2 + prior))[:3])
    rms = np.sqrt(np.mean(error**2, axis=0))
    assert (rms / np.sqrt(np.mean(bound, axis=0)) < 1.08).all()
    if decibels == 40:
        assert rms[0] < 0.015e-3 and np.degrees(rms[1]) < 0.03 and rms[2] < 0.0025 * FORCE


@pytest.mark.parametrize('share', [0.0, 0.3])
def test_covariance_is_the_spread_of_the_estimates(share):
    rng = np.random.default_rng(2)
    clean = sheared(0.003, 0.3, FORCE, share * FORCE)
    contacts = [estimate(noisy(clean, rng)) for _ in range(1500)]
    across = np.array([np.cos(0.3), np.sin(0.3)])
    values = np.array([[np.dot(across, (c.x, c.y)), c.yaw, c.normal_force, c.line_force]
                       for c in contacts])
    rows = [2, 3, 6]
    claimed = np.sqrt(np.median([[np.trace(c.covariance[:2, :2]), *np.diag(c.covariance)[rows]]
                                 for c in contacts], axis=0))
    ratio = values.std(axis=0) / claimed
    yaw, *forces = ratio[1:]
    assert 0.7 < yaw < 1.1  # the scatter of the gains is unknown
    assert 0.25 < min(forces) and max(forces) < 1.1  # a patch is possible, but there is none
    if share:
        assert ratio[0] == pytest.approx(0.9, abs=0.2)
        shear = np.array([[c.shear_force_x, c.shear_force_y] for c in contacts])
        length = 0.0254 / np.cos(0.3)
        np.testing.assert_allclose(
            shear.mean(axis=0), share * FORCE * length * np.array([np.cos(0.3), np.sin(0.3)]),
            rtol=0.01)
        claimed = [np.sqrt(np.mean([c.covariance[i, i] for c in contacts])) for i in (4, 5)]
        np.testing.assert_allclose(shear.std(axis=0), claimed, rtol=0.4)
    else:
        assert ratio[0] < 1.1


def test_noise_free_fit_is_exact():
    for offset, yaw in ((0.0, 0.0), (0.007, 0.6), (-0.005, -0.6)):
        contact = estimate(edge(offset, yaw), noise=0.0)
        assert contact.offset == pytest.approx(offset, abs=1e-7)
        assert contact.yaw == pytest.approx(yaw, abs=1e-5)
        assert contact.line_force == pytest.approx(FORCE, rel=3e-4)
    contact = estimate(edge(0.0, 0.4), noise=0.0)
    assert contact.normal_force == pytest.approx(
        contact.line_force * 0.0254 / np.cos(0.4), rel=1e-4)


@pytest.mark.parametrize('dtype', [float, int])
def test_a_masked_reading_is_missing(dtype):
    frame = noisy(edge(0.002, 0.3), np.random.default_rng(5)).astype(dtype)
    masked = np.ma.masked_greater(frame, 0.9 * frame.max())
    missing, layer = masked.astype(float).filled(np.nan), Layer('zz', DEPTH, None, noise_std=NOISE)
    records = ContactEstimator().estimate_batch(np.array([missing]), ARRAY, [layer])
    assert records['reasons'][0] & int(Reason.DEAD_TACTELS)
    by_mask = ContactEstimator().estimate_batch(masked[None], ARRAY, [layer])
    assert by_mask.tobytes() == records.tobytes()
    layer.stress = masked
    contact = ContactEstimator().estimate(TactileImage(0, 0, (layer,), ARRAY, tared=True))
    assert contact.x == records['x'][0]


def test_a_component_that_is_none_is_named():
    layers = [Layer(component, DEPTH, None) for component in ('zz', 'yy')]
    with pytest.raises(ConfigurationError, match="component is 'yy', must be one of zz, xz, yz"):
        ContactEstimator().estimate_batch(np.zeros((1, 2, *ARRAY.shape)), ARRAY, layers)


@pytest.mark.parametrize('scale', [0.5, 3.0])
def test_estimate_scales_with_pitch_and_force(scale):
    wide = TactelArray(16, 16, scale * ARRAY.pitch_x, scale * ARRAY.pitch_y)
    contact = estimate(
        edge(0.003 * scale, 0.2, FORCE * scale**2, wide, DEPTH * scale), array=wide,
        depth=DEPTH * scale, noise=0.0)
    assert contact.offset == pytest.approx(0.003 * scale, rel=1e-4)
    assert contact.yaw == pytest.approx(0.2, rel=1e-4)
    assert contact.line_force == pytest.approx(FORCE * scale**2, rel=1e-4)


def test_moments_baseline_is_worse_than_the_fit_but_sane():
    rng = np.random.default_rng(4)
    picture = noisy(edge(0.002, 0.2), rng)
    baseline, fit = estimate(picture, method='moments'), estimate(picture)
    assert baseline.valid and baseline.method == 'moments'
    assert baseline.offset == pytest.approx(0.002, abs=5e-4)
    assert baseline.yaw == pytest.approx(0.2, abs=0.05)
    assert abs(fit.yaw - 0.2) < abs(baseline.yaw - 0.2)


@pytest.mark.parametrize('degrees', [-89.9, -75, -45, 0, 30, 60, 80, 85, 89, 90])
def test_all_directions_are_alike(degrees):
    """An edge is found equally well in all directions; a yaw of 90 degrees stays 90."""
    rng, yaw, errors = np.random.default_rng(21), np.radians(degrees), []
    across, along = np.array([np.cos(yaw), np.sin(yaw)]), np.array([-np.sin(yaw), np.cos(yaw)])
    for offset in np.linspace(-6e-3, 6e-3, 40):
        contact = estimate(noisy(edge(offset, yaw), rng))
        assert contact.valid and contact.type == ContactType.LINE and contact.force_valid
        assert -np.pi / 2 < contact.yaw <= np.pi / 2
        turned = contact.yaw - yaw
        assert abs(np.sin(turned)) < 0.01
        place = np.array([contact.x, contact.y])
        claimed = contact.covariance[:2, :2]
        errors.append((across @ place - offset) / np.sqrt(across @ claimed @ across))
        # The place is the middle of the chord; the claim is across the edge only.
        assert (np.abs(place) < ARRAY.half_width_x).all()
        ends = [[(at - offset * n) / t for at in (-ARRAY.half_width_x, ARRAY.half_width_x)]
                for n, t in zip(across, along, strict=True) if abs(t) > 1e-6]
        middle = 0.5 * (max(map(min, ends)) + min(map(max, ends)))
        assert along @ place == pytest.approx(middle, abs=2e-4)
        normal = np.array([np.cos(contact.yaw), np.sin(contact.yaw)])
        np.testing.assert_allclose(
            claimed, np.trace(claimed) * np.outer(normal, normal), atol=1e-6 * np.trace(claimed))
    assert np.sqrt(np.mean(np.square(errors))) < 1.3


def test_saturated_tactels_are_left_out_and_reported():
    picture = edge(0.003, 0.3)
    saturated = picture > 0.7 * picture.max()
    contact = estimate(np.where(saturated, np.nan, picture), saturated=int(saturated.sum()))
    assert contact.valid and Reason.SATURATED in contact.reasons
    assert Reason.DEAD_TACTELS not in contact.reasons
    assert contact.line_force == pytest.approx(FORCE, rel=0.01)


def test_weak_contact_is_seen_but_not_valid_and_an_untared_image_says_so():
    rng = np.random.default_rng(7)
    contact = estimate(noisy(edge(force=0.04 * FORCE), rng))
    assert not contact.valid and Reason.LOW_SNR in contact.reasons
    assert contact.moments.m0 > 0.0 and np.isnan(contact.x)
    assert Reason.NOT_TARED in estimate(edge(), tared=False).reasons


@pytest.mark.parametrize('change, reason', [
    ({'component': 'xz'}, Reason.BAD_IMAGE), ({'depth': -1e-3}, Reason.BAD_IMAGE),
    ({'depth': float('nan')}, Reason.BAD_IMAGE)])
def test_unusable_layers_are_refused(change, reason):
    contact = estimate(edge(), **change)
    assert not contact.valid and reason in contact.reasons


@pytest.mark.parametrize('stress', [
    np.full((16, 16), np.nan), np.full((16, 16), np.inf), np.full((16, 16), 3e38),
    np.full((16, 16), -1e30), np.zeros((16, 16)), np.zeros((4, 4)), np.zeros((0, 0)),
    np.zeros(256)])
@pytest.mark.parametrize('method', ['fit', 'moments'])
def test_garbage_never_makes_a_valid_estimate(stress, method):
    assert not estimate(stress, method=method).valid


@pytest.mark.parametrize('decibels', [20, 30, 40, 50])
@pytest.mark.parametrize('side', [5, 8, 32])
@pytest.mark.parametrize('yaw', [None, 0.0, 0.2, 0.4, 0.6, np.pi / 4])  # None: a point
def test_unknown_noise_of_small_pads_and_slanting_edges(side, yaw, decibels):
    rng, array, depth = np.random.default_rng(11), TactelArray(side, side, 1e-3, 1e-3), 1.3e-3
    x, y, found, noise = array.x, array.y[:, None], [], 10.0 ** (-decibels / 20.0)
    for _ in range(40):
        a, b = rng.uniform(-0.3e-3, 0.3e-3, 2) * side
        picture = (point.stress('zz', x, y, a, b, 1.0, 0.0, 0.0, depth) if yaw is None
                   else line.pressure(x, y, a, yaw, 1.0, depth))
        peak = picture.max() if yaw is None else line.peak_pressure(1.0, depth)
        picture = picture / peak + noise * rng.standard_normal(picture.shape)
        found.append(estimate(picture, array=array, noise=0.0, depth=depth).snr)
    assert 1.0 / 1.5 < 10.0 ** ((decibels - np.nanmedian(found)) / 20.0) < 1.5


@pytest.mark.parametrize('side', [5, 8, 16])
def test_what_is_taken_for_noise_hides_no_wrong_load(side):
    """A ring, which is neither point nor edge, is refused with known and unknown noise."""
    rng, array = np.random.default_rng(13), TactelArray(side, side, 1e-3, 1e-3)
    distance = np.hypot(array.x, array.y[:, None]) - 0.3e-3 * side
    ring = np.exp(-0.5 * (distance / 0.6e-3) ** 2)
    for noise in (0.03, 0.01, 0.003):
        for _ in range(20):
            picture = ring + noise * rng.standard_normal(ring.shape)
            assert not estimate(picture, array=array, noise=0.0, depth=1.3e-3).valid


@pytest.mark.parametrize('method', ['fit', 'compensated'])
def test_without_a_gain_there_is_a_place_and_no_force(method):
    """The image is in an unknown unit of 37 Pa: the place is the same within rounding."""
    picture, unit = noisy(edge(0.002, 0.2), np.random.default_rng(14)), 37.0
    one, other = (estimate(picture / scale, noise=NOISE / scale, unit=name, method=method)
                  for scale, name in ((1.0, 'Pa'), (unit, 'counts')))
    assert other.valid and other.type == ContactType.LINE
    assert other.reasons == one.reasons | Reason.UNCALIBRATED
    assert one.force_valid and not other.force_valid
    assert (other.x, other.y, other.yaw) == pytest.approx((one.x, one.y, one.yaw), rel=1e-4)
    assert other.covariance[0, 0] == pytest.approx(one.covariance[0, 0], rel=1e-3, nan_ok=True)
    forces = [other.normal_force, other.line_force, other.shear_force_x, other.patch]
    assert np.isnan(forces).all() and np.isnan(other.covariance[[3, 4, 5, 6]]).all()


@pytest.mark.parametrize('method', ['moments', 'compensated'])
@pytest.mark.parametrize('second', [('zz', 1.0), ('zz', 0.5), ('xz', 1.5)])
def test_layers_without_a_closed_form_leave_the_pressure_alone(method, second):
    component, ratio = second
    estimator = ContactEstimator(EstimatorConfig(method=method, model='point', tactel='point'))
    picture = noisy(point.stress('zz', ARRAY.x, ARRAY.y[:, None], 3e-4, -2e-4, 20.0, 0.0, 0.0,
                                 DEPTH), np.random.default_rng(3))
    layers = [Layer('zz', DEPTH, picture), Layer(component, ratio * DEPTH, picture)]
    both = estimator.estimate_batch(np.stack([picture, picture])[None], ARRAY, layers)
    alone = estimator.estimate_batch(picture[None], ARRAY, layers[:1])
    assert both['valid'].all() and both['x'] == alone['x']
    assert both['normal_force'] == alone['normal_force']


def test_a_flat_and_a_corner_are_no_line():
    rng = np.random.default_rng(8)
    flat = np.full(ARRAY.shape, 20e3)
    corner = edge(0.0, 0.0) * (ARRAY.y[:, None] < 0) + edge(0.0, np.pi / 2 - 1e-9) * (
        ARRAY.x[None, :] > 0)
    for picture in (flat, corner):
        contact = estimate(noisy(picture, rng))
        assert contact.type == ContactType.OTHER and not contact.valid
        assert Reason.BAD_FIT in contact.reasons and np.isnan(contact.normal_force)
        assert contact.moments.m0 == pytest.approx(
            picture.sum() * ARRAY.pitch_x * ARRAY.pitch_y, rel=0.05)


@pytest.mark.parametrize('change', [
    {'method': 'magic'}, {'model': 'blob'}, {'noise_std': float('nan')},
    {'noise_std': -1.0}])
def test_bad_configuration_is_refused_by_name(change):
    with pytest.raises(ConfigurationError, match=next(iter(change))):
        EstimatorConfig(**change)


def test_invalid_tactels_cost_accuracy_only():
    rng = np.random.default_rng(5)
    picture = noisy(edge(0.003, 0.3), rng)
    picture[rng.random(picture.shape) < 0.15] = np.nan
    contact = estimate(picture)
    assert contact.valid and Reason.DEAD_TACTELS in contact.reasons
    assert contact.offset == pytest.approx(0.003, abs=5e-5)


def test_edge_beside_the_pad_is_refused():
    contact = estimate(edge(0.0133, force=4 * FORCE), noise=NOISE)
    assert not contact.valid


def test_a_valid_estimate_has_no_nan():
    rng = np.random.default_rng(9)
    for _ in range(300):
        picture = noisy(edge(rng.uniform(-0.012, 0.012), rng.uniform(-1.5, 1.5),
                             10 ** rng.uniform(0, 4)), rng)
        picture[rng.random(picture.shape) < rng.uniform(0, 0.9)] = np.nan
        contact = estimate(picture)
        if contact.valid:
            assert np.isfinite([contact.x, contact.y, contact.snr, contact.residual]).all()
            assert np.isfinite(contact.normal_force) == contact.force_valid
            if contact.type == ContactType.LINE:
                assert np.isfinite(contact.yaw)
                assert np.isfinite(contact.line_force) == contact.force_valid


def test_unknown_noise_is_read_from_the_picture():
    rng = np.random.default_rng(10)
    contact = estimate(noisy(edge(0.002, 0.1), rng), noise=0.0)
    noise = line.peak_pressure(FORCE, DEPTH) / 10.0 ** (contact.snr / 20.0)
    assert contact.valid and noise == pytest.approx(NOISE, rel=0.3)


def three_layers(rng, loud=1.0):
    """Layers by component of a point load, and noise: that of shear is `loud` times as large."""
    x, y = ARRAY.x, ARRAY.y[:, None]
    layers = {name: point.stress(name, x, y, 2e-3, -1e-3, 2.0, 0.3, -0.2, DEPTH)
              for name in ('zz', 'xz', 'yz')}
    noise = 0.01 * layers['zz'].max()
    return noise, {name: stress + rng.normal(0.0, noise * (1.0 if name == 'zz' else loud),
                                             stress.shape) for name, stress in layers.items()}


@pytest.mark.parametrize('noise', [True, False])
def test_the_order_of_the_layers_does_not_matter(noise):
    std, layers = three_layers(np.random.default_rng(3))
    config = EstimatorConfig(tactel='point')
    found = []
    for order in (('zz', 'xz', 'yz'), ('xz', 'zz', 'yz'), ('xz', 'yz', 'zz')):
        there = tuple(Layer(name, DEPTH, layers[name], noise_std=std * noise) for name in order)
        found.append(ContactEstimator(config).estimate(TactileImage(0, 0, there, ARRAY, True)))
    for one in found:
        assert one.valid and one.type == ContactType.POINT
        assert (one.x, one.normal_force) == pytest.approx((found[0].x, found[0].normal_force),
                                                          rel=1e-6)


def test_every_layer_has_its_own_unknown_noise():
    right = 0
    for seed in range(12):
        _, layers = three_layers(np.random.default_rng(seed), loud=5.0)
        there = tuple(Layer(name, DEPTH, stress) for name, stress in layers.items())
        found = ContactEstimator(EstimatorConfig(tactel='point')).estimate(
            TactileImage(0, 0, there, ARRAY, True))
        assert found.residual < 1.5
        right += found.valid and abs(found.normal_force - 2.0) < 0.04
    assert right > 9


@pytest.mark.parametrize('live', [2, 10, 64, 65])
def test_a_few_tactels_that_read_nothing_are_no_contact(live):
    stress = np.full(ARRAY.shape, np.nan)
    stress.flat[:live] = 0.0
    found = estimate(stress)
    assert not found.valid and found.reasons & (Reason.NO_CONTACT | Reason.FEW_TACTELS)


def test_two_columns_show_no_direction_of_a_line():
    array = TactelArray(16, 2, 1.6e-3, 1.6e-3)
    for model, valid in (('auto', True), ('line', False)):
        stress = edge(0.0, 1.4, array=array)
        image = tactile_image(stress, array, noise=0.01 * stress.max())
        found = ContactEstimator(EstimatorConfig(model=model, tactel='point')).estimate(image)
        assert found.valid <= valid
    assert found.reasons & Reason.FEW_TACTELS
