"""Servos on late images and slow robots: bounded gains, bounded force, honest ends."""

from dataclasses import replace

import numpy as np
from puma_loop import ROOT, summary_of, tracked
import pytest

from tactile_sensing.devices.calibration import Calibration
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import Contact, ContactType, Reason
from tactile_sensing.types.moments import Moments
from tactile_servo.config import MAX_STAMP_AGE, ServoConfig
from tactile_servo.control import stability
from tactile_servo.control.stability import gain_limit
from tactile_servo.law import Observation
from tactile_servo.laws.resolved_rate import ResolvedRate, ResolvedRateConfig
from tactile_servo.motion.motion import COMMITTED
from tactile_servo.reasons import ReasonCode
from tactile_servo.types import EdgeGoal, State
from tactile_simulation import closed_loop
from tactile_simulation.closed_loop import Simulation
from tactile_simulation.edge_path import EdgePath
from tactile_simulation.edge_world import EdgeScene
from tactile_simulation.scene import load_scene

GOAL = EdgeGoal(0.03, 5.0, length=0.05)
PICTURE = 0.005  # s between two
PAD = Calibration(TactelArray(16, 16, 0.0254 / 16, 0.0254 / 16)).sensor_info('pad', '', 0)
HALF = PAD.array.half_width_y


def scanned_limit(delay, lag):
    """Gain at which exp(-s d) / (s (1 + s tau)) closes a loop that swings: by its phase."""
    omega = np.geomspace(1e-2, 1e4, 2_000_001)
    loop = np.exp(-1j * omega * delay) / (1j * omega * (1.0 + 1j * omega * lag))
    below = np.unwrap(np.angle(loop)) <= -np.pi
    return 1.0 / abs(loop[np.argmax(below)])


@pytest.mark.parametrize('delay, lag', [
    (0.01, 0.0), (0.001, 0.01), (0.01, 0.01), (0.02, 0.01), (0.05, 0.01), (0.1, 0.05)])
def test_limit_is_where_the_phase_of_the_loop_reaches_half_a_turn(delay, lag):
    assert gain_limit(delay, lag) == pytest.approx(scanned_limit(delay, lag), rel=1e-4)


def line(lateral=0.001, remaining=0.0, force=4.9):
    moments = Moments(force, 0.0, force * remaining, 0.0, force * HALF**2 / 3.0, 0.0)
    return Contact(ContactType.LINE, True, Reason(0), 'fit', force_valid=True, moments=moments,
                   x=lateral, y=0.0, yaw=0.02, normal_force=force)


def seen_late(age, contact=None, pictures=100, goal=GOAL):
    """Law that has seen pictures of an age [s], and the time of the last."""
    law = ResolvedRate(ServoConfig())
    law.begin(goal, PAD)
    for k in range(pictures):
        law.observe(Observation(0, k * PICTURE, age, None, contact=contact or line()))
    return law, (pictures - 1) * PICTURE


@pytest.mark.parametrize('age', [0.0, 0.01, 0.04, 0.08])
def test_gains_are_the_lesser_of_what_is_asked_for_and_what_the_age_allows(age):
    law, _ = seen_late(age)
    lateral, _, normal, _, _, turn = law.reference(
        np.eye(4), np.eye(4), None, 0.0025).twist
    # A picture is used for a period, a command for one at 400 Hz, and reached after two.
    delay = age + 0.5 * PICTURE + 0.5 / 400 + COMMITTED + 0.0025
    allowed = scanned_limit(delay, 0.010) / 2.5
    c = ResolvedRateConfig()
    assert lateral / 0.001 == pytest.approx(min(1.0 / c.across_time, allowed), rel=1e-3)
    assert turn / 0.02 == pytest.approx(min(1.0 / c.across_time, allowed), rel=1e-3)
    assert normal * law.stiffness / 0.1 == pytest.approx(
        min(1.0 / c.force_time, allowed), rel=1e-3)
    assert (allowed > 1.0 / c.force_time) == (age <= 0.01)


def test_an_age_that_is_not_known_is_taken_for_the_worst():
    worst, _ = seen_late(np.inf)
    oldest, _ = seen_late(MAX_STAMP_AGE)
    assert worst.shortest == oldest.shortest > seen_late(0.08)[0].shortest
    young, _ = seen_late(0.0, pictures=1)
    assert young.shortest > 0.9 * worst.shortest  # one picture proves little


def simulated(scene='straight', goal=GOAL, **options):
    if isinstance(scene, str):
        scene = load_scene(ROOT / f'launch/scenes/{scene}.yaml')
    loop = Simulation(scene, 'resolved_rate', **options)
    loop.run(goal, 20.0)
    return loop, max(cycle.force for cycle in loop.log) / goal.force


# With latencies of 2.5 to 10 ms: test_edge_servo.py, test_resolved_rate.py.
@pytest.mark.parametrize('scene, length, largest', [
    ('two_segments', 0.12, 2.0e-3), ('curve', 0.06, 0.6e-3),
    pytest.param('straight_3d', 0.12, 0.5e-3, marks=pytest.mark.long)])
def test_late_pictures_do_not_make_it_swing(scene, length, largest):
    loop, most = simulated(scene, replace(GOAL, length=length), latency=0.08)
    assert loop.servo.success, loop.servo.reason
    assert most <= 1.5
    lateral, force = tracked(loop)
    assert np.abs(lateral).max() <= largest
    # Past the corner and the foot of the ramp it has come to rest.
    assert np.abs(force - 5.0)[-len(force) // 8:].max() <= 0.25


def test_pictures_that_are_too_late_are_refused():
    late = ServoConfig(give_up=0.2)
    loop, most = simulated(latency=0.12, config=late)
    assert not loop.servo.success
    assert loop.servo.reason == (ReasonCode.GAVE_UP, 'tactile image is stale')
    assert most == 0.0


def test_a_loop_that_swings_ends_in_a_refusal(monkeypatch):
    monkeypatch.setattr(stability, 'LIMIT_SHARE', 10.0)
    # It grows from little: the pad rests as it begins.
    loop, _ = simulated(latency=0.08, goal=replace(GOAL, length=0.3))
    assert not loop.servo.success
    assert loop.servo.reason.code == ReasonCode.OVERFORCE
    assert 'beyond 1.5 times the 5 N asked for' in loop.servo.reason.text
    assert loop.log[-1].force == 0.0  # lifted off


@pytest.mark.parametrize('rate, dead_time', [
    (50.0, 2.5e-3), (500.0, 0.04), pytest.param(80.0, 2.5e-3, marks=pytest.mark.long)])
def test_a_robot_that_is_late_does_not_make_it_swing(rate, dead_time, monkeypatch):
    """With the full lateral gain the errors were .75, .066 and 2.3 mm RMS."""
    monkeypatch.setattr(closed_loop, 'ROBOT_STEP', 1.0 / rate)
    scene = load_scene('straight')
    summary = summary_of(Simulation(replace(scene, plant=replace(
        scene.plant, dead_time=dead_time))), EdgeGoal(0.1, 5.0))
    assert summary['ok'], summary['reason']
    assert summary['lateral_rms'] < 0.06e-3


def test_a_light_touch_stays_light():
    loop, most = simulated(goal=replace(GOAL, force=1.0, length=0.01), latency=0.08)
    assert loop.servo.success and most <= 1.5


def test_a_corner_that_was_missed_is_no_end_of_the_edge():
    corner = EdgeScene('corner', 'corner', EdgePath(np.array([
        [0.0, 0.0, 0.0], [0.07, 0.0, 0.0], [0.07, 0.07, 0.0]])))
    loop, _ = simulated(corner, EdgeGoal(0.1, 5.0), latency=0.04)
    assert not loop.servo.success and loop.servo.reason.code == ReasonCode.ENDED_BESIDE


@pytest.mark.parametrize('lateral, success', [(0.0, True), (0.5e-3, True), (2e-3, False)])
def test_an_edge_ends_under_the_pad(lateral, success):
    law, now = seen_late(0.01, line(lateral=lateral, remaining=-0.4 * HALF),
                         goal=EdgeGoal(0.03, 5.0))
    found = law.assess(now, 0.1, 5.0)
    assert found.state == State.DONE and found.success == success
    assert found.reason.code == (
        ReasonCode.EDGE_ENDED if success else ReasonCode.ENDED_BESIDE)


def test_a_contact_that_is_lost_is_no_end_of_the_edge():
    law, now = seen_late(0.01, goal=EdgeGoal(0.03, 5.0))
    assert law.assess(now, 0.1, 4.9).state == State.TRACK
    lost = law.assess(now + 0.1, 0.1, 0.0)
    assert (lost.state, lost.reason.code) == (State.HOLD, ReasonCode.CONTACT_LOST)


@pytest.mark.parametrize('law', ['trace', 'resolved_rate'])
def test_a_slow_sensor_is_given_the_time_of_its_images(law, monkeypatch):
    monkeypatch.setattr(closed_loop, 'PICTURE_RATE', 15.0)
    loop = Simulation(load_scene(ROOT / 'launch/scenes/straight.yaml'), law)
    loop.servo.see_sensor(replace(loop.servo.inputs.sensor, nominal_rate=15.0))
    loop.run(EdgeGoal(0.01, 5.0, length=0.02), 30.0)
    assert loop.servo.success, loop.servo.reason
