"""The law (5.3): signs, bounds, and what counts as an edge."""

import math

import numpy as np
from puma_loop import ROOT
import pytest

from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import Contact, ContactType, Reason
from tactile_sensing.types.moments import Moments
from tactile_servo.laws import resolved_rate
from tactile_servo.laws.resolved_rate import (
    ACROSS,
    edge_features,
    edge_tilt,
    edge_twist,
    EdgeFeatures,
    PRESS,
    ResolvedRateConfig,
    speed_factor,
    TILT,
    TURN,
)
from tactile_servo.types import EdgeGoal
from tactile_simulation.closed_loop import Simulation
from tactile_simulation.edge_path import EdgePath
from tactile_simulation.edge_world import EdgeScene
from tactile_simulation.metrics import rms
from tactile_simulation.scene import load_scene

CONFIG = ResolvedRateConfig()
ARRAY = TactelArray(16, 16, 0.0254 / 16, 0.0254 / 16)
HALF = ARRAY.half_width_y
STIFFNESS = 5e3  # N/m
EDGE_MOMENTS = Moments(5.0, 0.005, 0.0, 25e-6, 260e-6, 0.0)


def contact(kind=ContactType.LINE, valid=True, moments=EDGE_MOMENTS, reasons=0, **known):
    return Contact(kind, valid, Reason(reasons), 'fit', moments=moments,
                   **{'force_valid': valid} | known)


def test_twist_moves_the_pad_onto_the_edge():
    features = EdgeFeatures(lateral=0.001, yaw=0.1, force=4.0, remaining=0.0)
    twist = edge_twist(features, 0.03, 5.0, STIFFNESS, CONFIG)
    # After dt of this motion the edge, fixed in space, has moved towards the pad's centre.
    dt = 1e-3
    assert abs(features.lateral - twist[0] * dt) < abs(features.lateral)
    assert abs(features.yaw - twist[5] * dt) < abs(features.yaw)
    assert twist[1] == 0.03 and twist[2] > 0.0 and not twist[3:5].any()


def test_every_rate_is_bounded():
    wild = EdgeFeatures(lateral=1.0, yaw=-3.0, force=1e6, remaining=0.0)
    twist = edge_twist(wild, 0.0, 5.0, STIFFNESS, CONFIG)
    assert twist[0] == ACROSS
    assert twist[2] == -PRESS
    assert twist[5] == -TURN


def test_features_are_those_of_a_valid_line_or_of_the_moments():
    features, why = edge_features(
        contact(x=0.002, y=0.001, yaw=0.1, normal_force=4.0), ARRAY, STIFFNESS)
    offset = 0.002 * np.cos(0.1) + 0.001 * np.sin(0.1)  # of the centre from the line
    assert features.lateral == pytest.approx(offset)
    assert (features.yaw, features.force, why) == (0.1, 4.0, '')
    features, _ = edge_features(contact(x=0.0, y=0.0, yaw=0.1, normal_force=np.nan,
                                        force_valid=False), ARRAY, STIFFNESS)
    assert features.force == EDGE_MOMENTS.m0
    features, _ = edge_features(contact(ContactType.OTHER, False), ARRAY, STIFFNESS)
    assert features.lateral == pytest.approx(0.001)
    assert features.force == 5.0 and features.yaw == pytest.approx(0.0)


@pytest.mark.parametrize('seen, text', [
    (contact(ContactType.NONE, False, reasons=Reason.NO_CONTACT), 'no_contact'),
    (contact(ContactType.LINE, False, reasons=Reason.BAD_FIT), 'bad_fit'),
    (contact(ContactType.OTHER, False, Moments(5.0, 0, 0, 2e-4, 2e-4, 0)), 'elongation'),
    (contact(ContactType.OTHER, False, Moments(-5.0, 0, 0, 2e-4, 2e-4, 0),
             reasons=Reason.LOW_SNR), 'low_snr'),
    (contact(x=0.0, y=0.0, yaw=1.3, normal_force=5.0), 'across the pad'),
    (contact(x=0.0, y=0.0, yaw=np.pi / 2, normal_force=5.0), 'across the pad'),
    (contact(x=0.02, y=0.0, yaw=0.0, normal_force=5.0), 'impossible'),
    (contact(x=0.0, y=0.0, yaw=0.0, normal_force=-1.0), 'impossible'),
    (contact(x=0.0, y=0.0, yaw=float('inf'), normal_force=5.0), 'not finite'),
    (contact(x=float('nan'), y=0.0, yaw=0.0, normal_force=5.0), 'not finite')])
def test_what_is_no_edge_is_refused_with_its_reason(seen, text):
    features, why = edge_features(seen, ARRAY, STIFFNESS)
    assert features is None and text in why


def test_speed_falls_towards_the_border_and_without_force():
    def at(lateral, force):
        return EdgeFeatures(lateral, 0.0, force, 0.0)
    for lateral, force, factor in (
            (0.0, 5.0, 1.0), (0.75 * HALF, 5.0, 0.5), (1.1 * HALF, 5.0, 0.0), (0.0, 1.25, 0.5),
            (0.0, -1.0, 0.0), (0.0, 0.0, 0.0)):
        assert speed_factor(at(lateral, force), HALF, 5.0) == pytest.approx(factor)


def even_load(tilt=0.0, first=-HALF, last=HALF):
    """Moments of an edge along y between two places, on a pad that it rises towards by `tilt`."""
    y = np.linspace(first, last, 20001)
    stiffness = STIFFNESS / (2.0 * HALF)  # per length
    load = stiffness * (1e-3 + tilt * y) * (y[1] - y[0])
    return Moments(load.sum(), 0.0, load @ y, 0.0, load @ y**2, 0.0)


@pytest.mark.parametrize('tilt', [-0.05, 0.0, 0.02])
def test_tilt_is_told_by_the_first_moment(tilt):
    told = edge_tilt(even_load(tilt), HALF, STIFFNESS)
    assert told == pytest.approx(tilt, rel=1e-2, abs=1e-9)


def test_tilt_is_turned_away_within_its_bound():
    """After dt of this motion the sensor's y has come nearer to the edge's rise."""
    twist = edge_twist(EdgeFeatures(0.0, 0.0, 5.0, 0.0, tilt=0.01), 0.0, 5.0, STIFFNESS, CONFIG)
    rise_of_pad = -twist[3] * 1e-3  # z points at the object: a fall along +z is a rise
    assert 0.0 < rise_of_pad < 0.01
    wild = edge_twist(EdgeFeatures(0.0, 0.0, 5.0, 0.0, tilt=-9.0), 0.0, 5.0, STIFFNESS, CONFIG)
    assert wild[3] == TILT


def test_an_edge_that_ends_is_no_tilt():
    for last in (0.8 * HALF, 0.3 * HALF, -0.5 * HALF):
        assert edge_tilt(even_load(last=last), HALF, STIFFNESS) == 0.0
    for broken in (Moments(5.0, 0, float('nan'), 0, 3e-4, 0), Moments(5.0, 0, 1, 0, np.inf, 0),
                   Moments(0.0, 0, 0, 0, 0, 0), Moments(-1.0, 0, 1, 0, 1, 0)):
        assert edge_tilt(broken, HALF, STIFFNESS) == 0.0


def tracked_with(scene, length=0.0):
    """RMS error of the force [N] while tracking at 30 mm/s, and the rise of the pad [rad]."""
    loop = Simulation(scene, 'resolved_rate')
    loop.run(EdgeGoal(0.03, 5.0, length=length), 30.0)
    assert loop.servo.success, loop.servo.reason
    truth = loop.truth()
    rise = [math.asin(cycle.pose[2, 1]) for cycle in loop.log]
    return rms(truth.force[truth.settled] - 5.0), np.array(rise)


def test_the_pad_levels_itself_on_an_edge_in_space(monkeypatch):
    scene = load_scene(ROOT / 'launch/scenes/straight_3d.yaml')  # rises by 10 %
    error, rise = tracked_with(scene, 0.09)
    assert rise[-1] == pytest.approx(math.atan(0.1), abs=0.01)
    monkeypatch.setattr(resolved_rate, 'TILT', 0.0)
    without, flat = tracked_with(scene, 0.09)
    assert np.abs(flat).max() < 1e-3
    assert error < 0.25 < without  # 5 % of 5 N


@pytest.mark.parametrize('turn', [pytest.param(60, marks=pytest.mark.long), 90])
def test_a_corner_under_the_pad_hardly_tilts_it(turn):
    angle = math.radians(turn)
    scene = EdgeScene('corner', 'corner', EdgePath(np.array([
        [0.0, 0.0, 0.0], [0.07, 0.0, 0.0],
        [0.07 + 0.07 * math.cos(angle), 0.07 * math.sin(angle), 0.0]])))
    _, rise = tracked_with(scene)
    assert np.abs(rise).max() < 0.02
