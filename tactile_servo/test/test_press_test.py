"""A press and a release tell whether a sensor answers as its stiffness says."""

import numpy as np
import pytest

from tactile_servo.control.press_test import LASTING, PressTest

FORCE, STIFFNESS, DT = 5.0, 1e4, 0.0025
TOUCHED = 0.5  # N


def pressed(felt, noise=0.0, begin=TOUCHED / STIFFNESS, late=0, every=1, stamped=0, **how):
    """
    Test of a pad whose images tell a force by its depth [m], `late` by some cycles.

    There is an image in one of `every` cycles, whose stamp is off by `stamped` cycles.
    """
    rng = np.random.default_rng(0)
    how = {'load': TOUCHED, 'depth': lambda force: force / STIFFNESS} | how
    test, depths = PressTest(FORCE, **how), [begin]
    while not test.over and len(depths) < 4000:
        seen = depths[max(len(depths) - 1 - late, 0)]
        load = max(felt(seen) + noise * rng.normal(), 0.0)
        if len(depths) % every == 0:
            at = max(len(depths) - 1 - late + stamped, 0)
            test.see(round(1e9 * DT * len(depths)), load, depths[min(at, len(depths) - 1)] - begin)
        most = min(0.01, 0.4 * FORCE / STIFFNESS / (late * DT + 0.01))
        depths.append(depths[-1] + DT * min(test.speed(load, DT), most))
    return test, np.array(depths) - begin


@pytest.mark.parametrize('factor', [0.4, 1.0, 2.5])
@pytest.mark.parametrize('noise', [0.0, 0.1])
def test_a_sensor_that_answers_is_believed(factor, noise):
    test, _ = pressed(lambda depth: factor * STIFFNESS * depth, noise)
    assert test.over and test.problem() == ''


@pytest.mark.parametrize('felt', [
    lambda depth: 0.2 * STIFFNESS * depth, lambda depth: 5.0 * STIFFNESS * depth,
    lambda depth: 3.5, lambda depth: max(7.0 - STIFFNESS * depth, 0.0)])
def test_a_sensor_that_does_not_is_named(felt):
    test, _ = pressed(felt, 0.02)
    assert 'of what the stiffness says' in test.problem()


def test_noise_that_hides_the_answer_proves_nothing():
    assert pressed(lambda depth: 3.5, 2.0)[0].problem() == ''
    assert '1.5 at first' in pressed(lambda depth: 3.5, 2.0, first=1.5)[0].problem()


@pytest.mark.parametrize('factor, noise, passes', [
    (1.5, 0.05, True), (1.4, 0.05, True), (1.2, 0.05, False), (2.0, 0.05, False),
    (1.5, 1.0, False)])
def test_a_later_test_proves_that_the_answer_has_not_changed(factor, noise, passes):
    test, _ = pressed(lambda depth: factor * STIFFNESS * depth, noise,
                      FORCE / STIFFNESS / factor, load=FORCE, first=1.5)
    assert (test.problem() == '') == passes
    assert test.slope == pytest.approx(factor, rel=0.02 if noise < 1.0 else 1.0)


class Play:
    """Skin with hysteresis: what it feels stays, until it is too high by a share."""

    def __init__(self, share):
        self._share, self._felt = share, 0.0

    def __call__(self, depth):
        force = max(STIFFNESS * depth, 0.0)
        self._felt = min(max(self._felt, force), (1.0 + self._share) * force)
        return self._felt


@pytest.mark.parametrize('share', [0.05, 0.1, 0.15])
@pytest.mark.parametrize('unloaded', [0.0, 0.1])
def test_hysteresis_is_no_change_of_the_answer(share, unloaded):
    """The later test begins with a load that was pressed on, or partly taken away before."""
    first, _ = pressed(Play(share), 0.02)
    assert first.problem() == ''
    skin, begin = Play(share), FORCE / STIFFNESS
    skin((1.0 + unloaded) * begin)
    test, _ = pressed(skin, 0.02, begin, load=skin(begin), first=first.slope)
    assert test.problem() == '', (first.slope, test.slope)


def test_a_pad_is_relieved_no_faster_than_it_may_move_off():
    test, depths = pressed(lambda depth: 1.5 * STIFFNESS * depth, 0.02, FORCE / STIFFNESS / 1.5,
                           load=FORCE, first=1.5, lift=0.002)
    relief = depths[:depths[:-round(LASTING / DT)].argmin()]
    assert test.problem() == '' and relief[-1] < -1e-4
    assert np.diff(relief).min() == pytest.approx(-0.002 * DT)


@pytest.mark.parametrize('stamped', [-2, 2])
def test_stamps_that_are_wrong_do_not_hide_that_the_answer_is_the_same(stamped):
    """The force seems to lag, or to lead: a loop over the depth, which is no noise."""
    test, _ = pressed(lambda depth: 1.5 * STIFFNESS * depth, 0.02, FORCE / STIFFNESS / 1.5,
                      late=2, stamped=stamped, load=FORCE, first=1.5)
    assert test.problem() == '' and test.slope == pytest.approx(1.5, rel=0.03)


def test_stamps_of_a_burst_may_be_a_nanosecond_apart_and_come_in_any_order():
    test = PressTest(FORCE, TOUCHED, lambda force: force / STIFFNESS)
    begin = 1_800_000_000_000_000_000
    stamps = begin + np.round(1e9 * DT * np.arange(160)).astype(int)
    stamps[40:48] = stamps[40] + np.arange(8)[::-1]
    for stamp in stamps.tolist():
        depth = (0.7 + 0.2 * np.cos(2.0 * np.pi * (stamp - begin) * 1e-9 / 0.4)) * 5e-4
        test.see(stamp, STIFFNESS * depth, depth)
        test.speed(STIFFNESS * depth, DT)
    assert test.over and test.problem() == '' and test.slope == pytest.approx(1.0, abs=1e-3)


def test_a_slow_sensor_is_pressed_for_longer():
    """Four images within the usual time would prove nothing."""
    test, depths = pressed(lambda depth: 1.5 * STIFFNESS * depth, 0.05, FORCE / STIFFNESS / 1.5,
                           every=40, rate=10.0, load=FORCE, first=1.5)
    assert test.problem() == '' and len(depths) * DT >= 3.0


def test_a_pad_that_was_not_moved_is_named():
    test = PressTest(FORCE, TOUCHED, lambda force: force / STIFFNESS)
    for k in range(400):
        test.see(round(1e9 * DT * k), 4.0, 0.0)
        test.speed(4.0, DT)
    assert test.over and 'not seen to be released' in test.problem()


@pytest.mark.parametrize('late', [0, 16, 32])
def test_the_release_is_short_smooth_and_leads_back(late):
    _, depths = pressed(lambda depth: STIFFNESS * depth, late=late)
    turn = depths.argmax()
    assert STIFFNESS * depths[turn] < 1.1 * FORCE
    way = depths[-round(LASTING / DT):]
    assert way[-1] == pytest.approx(way[0], abs=2e-6)
    assert np.ptp(way) < 0.3 * FORCE / STIFFNESS
    acceleration = np.diff(way, 2) / DT**2
    assert np.abs(acceleration).max() < 0.05
