"""Force of a pad along an edge: prediction, gains, bounds."""

import math

import pytest

from tactile_servo.control import force_controller
from tactile_servo.control.force_controller import ForceController, stopping_speed
from tactile_servo.laws.edge_motion import missing_depth
from tactile_servo.laws.edge_sight import Load

SKIN = 2e5  # N/m^2
GAIN, HALF, DT = 60.0, 0.0127, 0.0025


@pytest.fixture(autouse=True)
def hard_brakes(monkeypatch):
    """Let the gain alone decide."""
    monkeypatch.setattr(force_controller, 'BRAKING', 100.0)


def speed(load, force=5.0, length=2 * HALF, pressed=0.0, **options):
    """Speed that an edge under a pad asks for."""
    missing = missing_depth(force, load, half=HALF, length=length, pressed=pressed,
                            skin_stiffness=SKIN)
    return ForceController(GAIN, 0.0, 1.0, 1.0).speed(missing, None, DT, **options)


def indentation(force, length):
    return force / length / SKIN


@pytest.mark.parametrize('force', [4.0, 4.9, 5.0, 5.1, 7.0])
def test_a_missing_indentation_is_made_up_at_its_gain(force):
    missing = indentation(5.0 - force, 2 * HALF)
    assert speed(Load(force, 2 * HALF)) == pytest.approx(GAIN * missing, abs=1e-12)


def test_what_was_moved_since_the_image_counts():
    """A pad that has gone just as deep as it lacked wants no more."""
    missing = indentation(1.0, 2 * HALF)
    assert speed(Load(4.0, 2 * HALF), pressed=missing) == pytest.approx(0.0, abs=1e-12)


def test_force_spreads_over_the_length_that_is_under_the_pad_soon():
    """On half of the edge the same line force is half of the force: press deeper."""
    assert speed(Load(5.0, 2 * HALF), length=HALF) == pytest.approx(
        GAIN * indentation(5.0, 2 * HALF))
    # A sliver of an edge is no reason to press without bound.
    assert speed(Load(5.0, 2 * HALF), length=0.0) == speed(Load(5.0, 2 * HALF), length=HALF / 2)


def test_a_leg_that_comes_is_given_way_to_before():
    coming = 0.01
    wanted = 5.0 / (2 * HALF + 0.35 * coming)  # a third of what comes
    error = (wanted - 5.0 / (2 * HALF)) / SKIN
    assert error < 0.0
    assert speed(Load(5.0, 2 * HALF, coming)) == pytest.approx(GAIN * error)


@pytest.mark.parametrize('delay', [0.0, 0.0025, 0.04])
def test_a_stop_takes_the_way_that_is_left(delay):
    for way, deceleration in ((1e-5, 2.0), (4e-4, 2.0), (4e-4, 0.5)):
        left = stopping_speed(way, deceleration, delay)
        assert left * delay + left**2 / (2.0 * deceleration) == pytest.approx(way)


def test_pressing_can_be_braked(monkeypatch):
    monkeypatch.setattr(force_controller, 'BRAKING', 1e-3)
    missing = indentation(5.0, 2 * HALF)
    assert speed(Load(0.0, 2 * HALF)) == pytest.approx(math.sqrt(2.0 * 1e-3 * missing))


def test_what_is_no_edge_is_no_reason_to_press():
    assert speed(Load(1.0, 2 * HALF), may_press=False) == 0.0
    assert speed(Load(9.0, 2 * HALF), may_press=False) < 0.0


def test_the_integral_takes_what_remains_but_nothing_of_a_start():
    controller = ForceController(60.0, 60.0, 0.05, 0.05)
    first = controller.speed(1e-4, None, DT)
    assert controller.speed(1e-4, None, DT) == first  # too far off to be counted
    second = controller.speed(1e-4, 1e-4, DT)
    assert second > first and controller.speed(1e-4, 1e-4, DT) > second
    controller.reset()
    assert controller.speed(1e-4, 1e-4, DT) == second


@pytest.mark.parametrize('missing, bound', [(-1.0, -0.04), (1.0, 0.02)])
def test_the_speed_is_bounded(missing, bound):
    assert ForceController(60.0, 0.0, press=0.02, lift=0.04).speed(missing, None, DT) == bound
