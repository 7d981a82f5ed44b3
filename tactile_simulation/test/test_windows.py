"""Windows as a controller plays them that samples: smooth, whenever they come."""

from dataclasses import replace

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
from puma_loop import ELBOW, free_controller, LIMITS, PUMA, puma_loop, ROOT, tracked
import pytest

from tactile_servo.config import ServoConfig
from tactile_servo.motion.motion import Motion, SETTLING
from tactile_servo.reasons import ReasonCode
from tactile_servo.types import EdgeGoal
from tactile_simulation.closed_loop import Simulation, TRANSPORT
from tactile_simulation.edge_path import EdgePath
from tactile_simulation.scene import load_scene

CYCLE = 2_500_000  # ns
BEGIN = 10**12  # ns


def play(cycles, *, period_ns, joined, offset=None, expected=lambda _: 0.0):
    """
    Commands (K, 6) of a controller for windows of these cycles.

    Each has the time since the one before and that of the window under way [ns], and a twist;
    `expected` of its number is the lateness that is expected then [s].
    """
    motion = Motion(PUMA, LIMITS, 1e-9 * CYCLE)
    motion.seed(ELBOW)
    start = ELBOW if offset is None else ELBOW + offset
    controller = free_controller(start, rate=1e9 / period_ns, from_desired=joined)
    now_ns, arrivals = BEGIN, []
    for count, (pause, way, twist) in enumerate(cycles):
        now_ns += pause
        arrival = max(now_ns + way, arrivals[-1][0] if arrivals else 0)
        motion.expect_lateness(expected(count))
        window = motion.command(np.array(twist), now_ns).trajectory
        if window is not None:
            arrivals.append((arrival, window))
    commands = [start]
    for step in range(BEGIN, now_ns + 500_000_000, period_ns):
        while arrivals and arrivals[0][0] <= step:
            controller.accept(arrivals.pop(0)[1], 1e-9 * step)
        controller.step(1e-9 * step)
        commands.append(controller.commanded[0])
    return np.array(commands)


def assert_smooth(commands, period_ns, times_limit):
    period = 1e-9 * period_ns
    assert (commands >= LIMITS.lower - 1e-9).all() and (commands <= LIMITS.upper + 1e-9).all()
    assert (np.abs(np.diff(commands, axis=0)) <= (LIMITS.velocity * period + 1e-9)).all()
    assert (np.abs(np.diff(commands, 2, axis=0)) <= (
        times_limit * LIMITS.acceleration * period**2 + 1e-9)).all()
    np.testing.assert_allclose(commands[-1], commands[-2], atol=1e-12)


wishes = st.tuples(*[st.floats(-0.3, 0.3)] * 3, *[st.floats(-2.0, 2.0)] * 3) | st.just(
    (float('nan'),) * 6)
pauses = st.sampled_from([CYCLE] * 6 + [1_300_000, 4_000_000, 12_000_000, 60_000_000, 10**9])


@settings(max_examples=20)
@given(script=st.lists(st.tuples(pauses, wishes, st.integers(1, 30)), max_size=8),
       ways=st.lists(st.integers(0, 2_000_000), min_size=7, max_size=7),
       period_ns=st.sampled_from([1_000_000, 2_000_000]), joined=st.booleans())
def test_within_what_is_committed_the_acceleration_is_the_motions_own(
        script, ways, period_ns, joined):
    """Late and early cycles, windows up to 2 ms under way: no seam shows."""
    settled = round(1e9 * SETTLING / CYCLE)
    cycles = [(CYCLE, 0, np.zeros(6))] * settled + [
        (pause, 0, wish) for pause, wish, repeat in script for _ in range(repeat)]
    cycles = [(pause, ways[k % 7], wish) for k, (pause, _, wish) in enumerate(cycles)]
    assert_smooth(play(cycles, period_ns=period_ns, joined=joined), period_ns, 1.0 + 1e-3)


@pytest.mark.parametrize('joined', [True, False])
@pytest.mark.parametrize('period_ns', [1_000_000, 4_000_000, 8_000_000])
def test_slow_controllers_and_long_ways_are_rough_by_little(period_ns, joined):
    rng = np.random.default_rng(5)
    cycles = [(CYCLE, int(rng.exponential(5e5)), np.array([0, 0.1 * np.sin(0.02 * k), 0, 0, 0, 0]))
              for k in range(400)]
    assert_smooth(play(cycles, period_ns=period_ns, joined=joined), period_ns, 2.0)


@pytest.mark.parametrize('joined', [True, False])
def test_windows_that_come_as_late_as_expected_show_no_seam(joined):
    """Eight of 200 come 8 ms late; before them more is committed amid the motion, then less."""
    cycles = [(CYCLE, 8_000_000 if 150 <= k < 350 and k % 25 == 0 else 500_000,
               np.array([0, 0.1 * np.sin(0.02 * k), 0, 0, 0, 0])) for k in range(500)]
    commands = play(cycles, period_ns=2_000_000, joined=joined,
                    expected=lambda k: 0.008 if 130 <= k < 370 else 0.0)
    assert_smooth(commands, 2_000_000, 1.0)
    with pytest.raises(AssertionError):  # where that is not expected
        assert_smooth(play(cycles, period_ns=2_000_000, joined=joined), 2_000_000, 1.5)


def test_a_servo_commits_to_as_much_as_its_joint_states_come_late():
    loop = puma_loop('straight', 'trace')
    loop.run(EdgeGoal(0.03, 5.0), 1.0)
    now, kept = loop.now, []
    for count in range(8):
        now += 1e-9 * CYCLE
        late = 0.007 if count == 3 else 0.0
        loop.servo.see_joints(loop.servo.motion.positions, round(1e9 * (now - late)), now)
        _, command = loop.servo.cycle(now, round(1e9 * now))
        kept.append([time for time in (0.004, 0.007)
                     if np.isclose(command.times, time, rtol=0.0, atol=1e-5).any()])
    assert all(0.004 in times and 0.007 not in times for times in kept[:3])
    assert all(0.007 in times for times in kept[3:])


@pytest.mark.parametrize('joined', [True, False])
def test_a_controller_that_commands_something_else_comes_smoothly(joined):
    """It is 5 mrad off, as a command differs from what gravity leaves of it."""
    off = 5e-3 * np.array([1, -1, 1, -1, 1, -1])
    commands = play([(CYCLE, 500_000, np.zeros(6))] * 60, period_ns=2_000_000, joined=joined,
                    offset=off)
    assert_smooth(commands, 2_000_000, 1.0)
    np.testing.assert_allclose(commands[-1], ELBOW, atol=1e-9)


def test_a_corner_at_100_mm_s_is_taken_with_what_the_joints_can_accelerate():
    """The pad cuts no further than where joints could accelerate at will: .14 to .21 mm."""
    loop = puma_loop('course', 'trace')
    loop.run(EdgeGoal(0.1, 5.0, length=0.07), 10.0)
    lateral, force = tracked(loop)
    assert loop.servo.success and np.abs(lateral).max() < 0.2e-3 and force.max() < 6.0
    assert np.abs(loop.accelerations()).max() <= 2.0 * LIMITS.acceleration.max()


@pytest.mark.parametrize('rate, speed, missed, least, most', [
    (100.0, 0.03, 0.0, 2.5, 6.5), (50.0, 0.1, 0.3, 0.0, 8.0),
    pytest.param(200.0, 0.03, 0.3, 2.5, 6.5, marks=pytest.mark.long)])
def test_a_servo_with_few_cycles_keeps_the_force_at_a_corner(
        rate, speed, missed, least, most):
    """It lifted off before the corner (.6, 1.3 N), or a pause pressed on (17 N)."""
    tape = load_scene(ROOT / 'launch/scenes/tape_case.yaml')
    scene = replace(tape, edge=EdgePath(np.array(
        [[0.275, 0.0, 0.15], [0.275, -0.03, 0.15], [0.325, -0.03, 0.15], [0.325, -0.07, 0.15]])))
    loop = Simulation(scene, 'trace', robot=(PUMA, LIMITS), seed_positions=ELBOW,
                      config=ServoConfig(rate=rate))
    cycle, draw = loop.servo.cycle, np.random.default_rng(0)
    loop.servo.cycle = lambda *now: (
        cycle(*now) if draw.random() >= missed else (loop.log[-1].status, None))
    loop.run(EdgeGoal(speed, 5.0), 60.0)
    assert loop.servo.success, loop.servo.reason
    truth = loop.truth()
    np.testing.assert_allclose(np.diff(truth.time), 1.0 / rate)
    assert truth.force[truth.settled].min() >= least
    assert max(at.force for at in loop.log) < most


def test_a_wrist_that_comes_to_its_limit_lets_the_pad_go_round_without_it():
    """The tape case takes a whole turn, joint 6 has less from there: it stays at its limit."""
    loop = puma_loop('tape_case', 'trace')
    loop.run(EdgeGoal(0.1, 5.0, closed=True), 30.0)
    lateral, force = tracked(loop)
    ends = np.array([command for _, command in loop.commands])[:, 5]
    assert np.isclose(ends.min(), LIMITS.lower[5], atol=1e-3) or np.isclose(
        ends.max(), LIMITS.upper[5], atol=1e-3)
    assert loop.servo.success and np.abs(lateral).max() < 0.3e-3 and force.max() < 7.5
    assert np.abs(loop.accelerations()).max() <= 2.0 * LIMITS.acceleration.max()


def late_loop(delay, begin=0.0, every=1):
    """Loop on a course whose windows, from a time on and one of so many, come late [s]."""
    loop = puma_loop('course', 'trace', config=ServoConfig(give_up=0.5))

    def see(_):
        late = loop.now >= begin and loop.tick % every == 0
        loop.transport = delay if late else TRANSPORT
        return False

    see(None)
    loop.run(EdgeGoal(0.05, 5.0, length=0.05), 20.0, see)
    return loop


@pytest.mark.parametrize('begin, every', [(0.0, 1), (2.6, 1), (0.0, 100)])
@pytest.mark.parametrize('delay', [pytest.param(0.01, marks=pytest.mark.long), 0.02])
def test_windows_that_come_late_are_no_jolt(delay, begin, every):
    """One seam shows where they begin to, amid the motion: who has not been late is believed."""
    loop = late_loop(delay, begin, every)
    assert loop.servo.success, loop.servo.reason
    times = np.array([time for time, _ in loop.commands])[:len(loop.accelerations())]
    share = np.abs(loop.accelerations()).max(axis=1) / LIMITS.acceleration.max()
    seams = times[share > 1.01]
    assert not len(seams) or (np.ptp(seams) < 0.1 and share.max() < 6.0)
    assert not len(seams) or begin or every > 1
    assert max(cycle.force for cycle in loop.log) < 1.5 * 5.0


def test_a_robot_whose_windows_come_far_too_late_is_not_moved():
    loop = late_loop(0.06)
    assert loop.servo.reason.code == ReasonCode.GAVE_UP
    assert 'late' in loop.servo.reason.text
    assert np.abs(loop.accelerations()).max() <= LIMITS.acceleration.max()
    assert np.ptp([command for _, command in loop.commands], axis=0).max() < 1e-4


@pytest.mark.parametrize('begin', [2.3, *(pytest.param(it, marks=pytest.mark.long)
                                         for it in (2.0, 2.6))])
def test_windows_that_are_suddenly_far_too_late_are_no_longer_sent(begin):
    loop = late_loop(0.06, begin)
    assert 'late' in loop.servo.reason.text
    assert np.abs(loop.accelerations()).max() <= 1.01 * LIMITS.acceleration.max()
    assert max(cycle.force for cycle in loop.log) < 1.5 * 5.0


def test_a_controller_that_plays_something_else_is_led_all_the_same():
    """What it says of itself is of no use, as that of a robot whose speed is scaled."""
    loop = puma_loop('straight', 'trace')
    see = loop.servo.see_reference
    loop.servo.see_reference = lambda reference, stamp_ns: see(reference + 1e-3, stamp_ns)
    loop.run(EdgeGoal(0.03, 5.0, length=0.02), 20.0)
    assert loop.servo.success, loop.servo.reason
    assert loop.servo.motion.delay.longest == 0.0
