"""Features, the Jacobian by least squares, and the table of it."""
import numpy as np
import pytest

from tactile_common.errors import ConfigurationError
from tactile_sensing.dome.geometry import Dome, HalfSpaceDome
from tactile_sensing.image import image_moments
from tactile_sensing.types.array import TactelArray
from tactile_servo.cli.build_jacobian_table import main
from tactile_servo.tactile_jacobian import (
    build_table,
    condition_of,
    FeatureKind,
    features_of,
    filled,
    FORMAT,
    grid,
    Increments,
    JacobianTable,
    least_squares,
    load_table,
    loading_cases,
    ModelFeatures,
    scale_for,
)

PITCH, FORCE = 0.0254 / 16, 5.0
ARRAY, DOME = TactelArray(16, 16, PITCH, PITCH), Dome()
HALF = ARRAY.half_width_x
HALF_SPACE = HalfSpaceDome(DOME, ARRAY)
KINDS = list(FeatureKind)
PAD = grid(HALF, HALF, 6, (1.0, 5.0, 10.0))
FINE = Increments(place=5e-5, force=0.02)


def scaled(matrix, scale):
    """Jacobian without dimension."""
    return matrix * scale.motions / scale.features[:, None]


def by_metres(features, contact, increments):
    """Central differences of the features over 1 um and .1 mN, by (x, y, p / K_z)."""
    slopes = np.array([(features(contact + step) - features(contact - step)) / (2.0 * step.sum())
                       for step in np.diag([1e-6, 1e-6, 1e-4])]).T
    return slopes * [1.0, 1.0, increments.stiffness]


def test_features_are_moments_and_centroid():
    pressure = np.random.default_rng(0).uniform(0.0, 1e5, ARRAY.shape)
    m = image_moments(pressure, ARRAY)
    assert features_of(pressure, ARRAY, FeatureKind.MOMENTS) == pytest.approx([m.m0, m.mx, m.my])
    assert features_of(pressure, ARRAY, FeatureKind.CENTROID) == pytest.approx(
        [m.m0, *m.centre_of_pressure])
    assert np.isnan(features_of(np.zeros(ARRAY.shape), ARRAY, FeatureKind.CENTROID)[1:]).all()


def test_missing_tactels_do_not_pull_the_centroid():
    pressure = HALF_SPACE.image(np.array([2e-3, 1e-3, FORCE, 0.0, 0.0]))[0]
    whole = features_of(pressure, ARRAY, FeatureKind.CENTROID)
    holed = pressure.copy()
    holed[8, 10] = holed[3, 3] = np.nan  # one of them under the contact
    mended = features_of(filled(holed, 0.5), ARRAY, FeatureKind.CENTROID)
    zeroed = features_of(np.nan_to_num(holed), ARRAY, FeatureKind.CENTROID)
    assert abs(mended - whole)[1:].max() < 0.5 * abs(zeroed - whole)[1:].max()
    assert filled(np.full(ARRAY.shape, np.nan), 0.5) is None
    assert filled(pressure, 0.5) is pressure


@pytest.mark.parametrize('kind', KINDS)
def test_least_squares_equals_the_derivatives_everywhere_on_the_pad(kind):
    features, scale = ModelFeatures(HALF_SPACE, ARRAY, kind), scale_for(
        kind, FORCE, HALF, FINE.stiffness)
    for contact in PAD:
        found = least_squares(loading_cases(features, contact, FINE), scale)
        slopes = scaled(by_metres(features, contact, FINE), scale)
        error = np.linalg.norm(scaled(found.forward, scale) - slopes)
        assert error < 0.01 * np.linalg.norm(slopes)
        assert np.linalg.norm(found.inverse @ found.forward - np.eye(3)) < 0.01


def test_centroids_hardly_change_their_jacobian_and_moments_do():
    def spread(kind):
        scale, features = scale_for(kind, FORCE, HALF, 1.5e4), ModelFeatures(
            HALF_SPACE, ARRAY, kind)
        found = [scaled(least_squares(loading_cases(features, contact, Increments()),
                                      scale).forward, scale)
                 for contact in grid(6e-3, 6e-3, 3, (1.0, FORCE))]
        return max(np.linalg.norm(one - found[-1]) for one in found)
    assert spread(FeatureKind.CENTROID) < 0.3 < 0.7 < spread(FeatureKind.MOMENTS)


def test_condition():
    scale = scale_for(FeatureKind.MOMENTS, FORCE, HALF, 1.5e4)
    features = ModelFeatures(HALF_SPACE, ARRAY, FeatureKind.MOMENTS)

    def condition(*contact):
        return least_squares(loading_cases(features, np.array(contact), FINE), scale).condition
    assert condition(0.0, 0.0, FORCE) == pytest.approx(1.0, abs=0.1)
    assert condition(0.0, 0.0, 0.1) == pytest.approx(FORCE / 0.1, rel=0.1)
    assert condition(12e-3, 12e-3, FORCE) > 10.0
    assert np.isinf(condition_of(np.full((3, 3), np.nan), scale))


def test_the_example_of_section_6_5():
    # |F - F1|^2 is 10.61e6 (printed 16.81e6): M_0 aside, -2100 is 3100 from 1000 and 2000 is 1000
    # from it. The state that is chosen is the third (printed: the second), at 0.16e6.
    states = np.array([[-1000, 1000, 1000], [-1000, 2000, 2000], [-1000, -2500, 2000]], float)
    inverse = np.arange(3)[:, None, None] * np.ones((3, 3, 3))
    parts = states, states, inverse, inverse, np.ones(3), np.ones(3), 0.5e6
    table = JacobianTable(FeatureKind.MOMENTS, *parts)
    shown = np.array([-1000.0, -2100.0, 2000.0])
    assert ((shown - states[0])**2).sum() == pytest.approx(10.61e6)
    assert ((shown - states[2])**2).sum() == pytest.approx(0.16e6)
    assert (table.nearest(shown) == inverse[2]).all()
    # Beyond the stop radius the last one is used, whatever is nearest.
    assert (table.nearest(np.array([-1000.0, 0.0, 1000.0])) == inverse[2]).all()
    table = JacobianTable(FeatureKind.MOMENTS, *parts)  # before there was one
    assert (table.nearest(np.array([-1000.0, 0.0, 1000.0])) == inverse[0]).all()


def test_a_table_is_written_and_read(tmp_path):
    table = build_table(ModelFeatures(HALF_SPACE, ARRAY), FeatureKind.CENTROID,
                        grid(HALF, HALF, 3, (FORCE,)), Increments(), HALF)
    table.save(tmp_path / 'table.npz')
    read = load_table(tmp_path / 'table.npz')
    assert read.kind is table.kind and read.stop == table.stop
    for name in ('contacts', 'features', 'forward', 'inverse', 'condition', 'scale'):
        assert (getattr(read, name) == getattr(table, name)).all()


def test_holes_in_a_table_are_passed_over(tmp_path):
    table = build_table(ModelFeatures(HALF_SPACE, ARRAY), FeatureKind.CENTROID,
                        grid(HALF, HALF, 3, (FORCE,)), Increments(), HALF)
    table.inverse[4] = np.nan  # at the centre
    table.save(tmp_path / 'holes.npz')
    holed = load_table(tmp_path / 'holes.npz')
    assert not holed.usable[4]
    assert np.isfinite(holed.nearest(table.features[4])).all()
    assert np.isfinite(holed.nearest(np.full(3, np.nan))).all()
    table.inverse[:] = np.nan
    table.save(tmp_path / 'none.npz')
    with pytest.raises(ConfigurationError, match='none of its 9 entries'):
        load_table(tmp_path / 'none.npz')


def test_what_is_no_table(tmp_path):
    with pytest.raises(ConfigurationError, match='cannot be read'):
        load_table(tmp_path / 'missing.npz')
    (tmp_path / 'text.npz').write_text('no archive')
    with pytest.raises(ConfigurationError, match='text.npz'):
        load_table(tmp_path / 'text.npz')
    np.savez(tmp_path / 'other.npz', a=np.zeros(3))
    with pytest.raises(ConfigurationError, match="array 'format' is missing"):
        load_table(tmp_path / 'other.npz')
    small = {name: np.zeros(1) for name in ('features', 'forward', 'inverse', 'condition', 'scale',
                                            'kind', 'stop', 'stiffness')}
    np.savez_compressed(tmp_path / 'bomb.npz', contacts=np.zeros((3_000_000, 3)),
                        format=FORMAT, **small)
    assert (tmp_path / 'bomb.npz').stat().st_size < 1e6
    with pytest.raises(ConfigurationError, match='would take 72 MB'):
        load_table(tmp_path / 'bomb.npz')
    with pytest.raises(ConfigurationError, match='inverse has the shape'):
        JacobianTable(FeatureKind.MOMENTS, *np.zeros((2, 4, 3)), np.zeros((4, 3, 3)),
                      np.zeros((4, 3)), np.zeros(4), np.ones(3))


def test_the_command(tmp_path, capsys):
    out = tmp_path / 'table.npz'
    assert main([str(out), '--model', 'half_space', '--across', '4', '--forces', '2', '5',
                 '--features', 'moments']) == 0
    table = load_table(out)
    assert len(table.contacts) == 32 and table.kind is FeatureKind.MOMENTS
    assert '32 entries' in capsys.readouterr().out
    assert main([str(out), '--array-radius', '1.5']) == 2
    assert 'array_radius' in capsys.readouterr().err


@pytest.mark.parametrize('count, pitch', [(5, 5e-3), (7, 4e-3), (8, 4e-3), (16, PITCH)])
def test_a_table_of_a_coarse_array_finds_a_contact_a_pitch_away(tmp_path, count, pitch):
    """With increments of 1 mm it was up to 9.7 times as far away."""
    path = tmp_path / 'table.npz'
    assert main([str(path), '--model', 'half_space', '--features', 'centroid', '--across', '1',
                 '--rows', str(count), '--columns', str(count), '--pitch', str(pitch)]) == 0
    array = TactelArray(count, count, pitch, pitch)
    features = ModelFeatures(HalfSpaceDome(DOME, array), array, FeatureKind.CENTROID)
    centre, beside = (features(np.array([x, 0.0, FORCE])) for x in (0.0, pitch))
    place, *_ = load_table(path).nearest(centre) @ (beside - centre)
    assert place == pytest.approx(pitch, rel=0.05)
