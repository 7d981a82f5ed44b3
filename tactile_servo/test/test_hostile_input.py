"""
Whatever is fed to the servo, its commands stay within the limits and end at rest.

HOSTILE_SEQUENCES=10000 in the environment runs that many sequences.
"""

import os

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
from puma_loop import LIMITS, PUMA

from tactile_sensing.array import TactelArray
from tactile_sensing.contact import Contact, ContactType, Reason
from tactile_sensing.image import Layer, TactileImage
from tactile_sensing.moments import Moments
from tactile_sensing.scene import Skin
from tactile_sensing.synthetic import render
from tactile_servo.edge_servo import EdgeServo
from tactile_servo.limits import WorkspaceBox
from tactile_servo.servo_types import EdgeGoal, EdgeServoConfig, State
from tactile_servo.trackers import make_tracker, TRACKERS

PERIOD_NS = 2_500_000
BOX_TOLERANCE = 1e-3  # m; the box is kept by velocities, whose joints brake in a curve

values = st.floats(-1.0, 1.0) | st.sampled_from(
    [float('nan'), float('inf'), -1e300, 1e300, 0.0, 1e-3, 5.0, 50.0])
contacts = st.builds(
    Contact, type=st.sampled_from(ContactType), valid=st.booleans(),
    reasons=st.sampled_from([Reason(0), Reason.NOT_TARED, Reason.LOW_SNR]), method=st.just('fit'),
    a=values, yaw=values, normal_force=values,
    moments=st.builds(Moments, values, values, values, values, values, values))
ARRAY = TactelArray(16, 16, 0.0254 / 16, 0.0254 / 16)
KINDS = ('edge', 'corner', 'blob', 'noise', 'blank', 'nan', 'huge', 'shape', 'counts', 'none')


def picture(kind, seed, noise_std, tared, late_ns):
    """Return what makes a TactileImage of a kind: layers, and how late its stamp is."""
    rng = np.random.default_rng(seed)
    stress = 600.0 * rng.standard_normal(ARRAY.shape)
    if kind in ('edge', 'corner', 'counts', 'nan', 'huge'):
        points = np.column_stack([rng.uniform(-0.02, 0.02, (3 if kind == 'corner' else 2, 2)),
                                  np.full(3 if kind == 'corner' else 2, -rng.uniform(0, 2e-3))])
        stress += render(points, ARRAY, Skin())[0]
    elif kind == 'blob':
        stress += 1e5
    elif kind == 'noise':
        stress *= 1e3
    if kind in ('nan', 'huge'):
        stress[rng.random(ARRAY.shape) < 0.2] = rng.choice(
            [np.nan] if kind == 'nan' else [np.inf, -1e300, 1e12, 9e8])
    if kind == 'shape':
        stress = stress[:5]
    layer = Layer('zz', 0.002, stress, noise_std=noise_std,
                  unit='counts' if kind == 'counts' else 'Pa')
    return () if kind == 'none' else (layer,), tared, late_ns


pictures = st.builds(
    picture, st.sampled_from(KINDS), st.integers(0, 1000),
    st.sampled_from([630.0, 0.0, -1.0, float('nan'), 1e300]),
    st.sampled_from([True, True, True, False]),
    st.sampled_from([0, 0, 10_000_000, -10_000_000, 10**10]))
joints = st.lists(st.floats(-4.0, 4.0) | st.just(float('nan')), min_size=6, max_size=6)
steps = st.tuples(
    st.none() | contacts, st.none() | pictures, st.none() | joints, st.integers(1, 40),
    st.sampled_from([0, 0, 0, 10**9, -10**9]),  # jump of the clock that stamps [ns]
    st.sampled_from(['', '', '', 'pause', 'resume', 'cancel']))


@settings(max_examples=int(os.environ.get('HOSTILE_SEQUENCES', '150')), deadline=None)
@given(tracker=st.sampled_from(list(TRACKERS)),
       start=st.tuples(*[st.floats(0.05, 0.95)] * 6), script=st.lists(steps, max_size=25),
       goal=st.builds(EdgeGoal, st.floats(0.001, 0.2), st.floats(0.6, 10.0),
                      st.sampled_from([-1, 1])))
def test_commands_stay_within_every_limit(tracker, start, script, goal):
    box = WorkspaceBox([-0.4, -0.4, 0.0], [0.4, 0.4, 0.6])
    config = EdgeServoConfig()
    servo = EdgeServo(PUMA, LIMITS, config, make_tracker(tracker, config), box)
    now, now_ns = 100.0, 10**12
    measured = LIMITS.lower + np.array(start) * (LIMITS.upper - LIMITS.lower)
    servo.see_joints(measured, now_ns, now)
    servo.start(goal, now)
    positions, velocities = measured, np.zeros(6)
    for contact, image, joint_state, cycles, jump, action in script:
        now_ns += jump
        if action == 'cancel':
            servo.cancel()
        elif action:
            servo.pause(action == 'pause', now)
        for _ in range(cycles):
            now, now_ns = now + 1e-9 * PERIOD_NS, now_ns + PERIOD_NS
            if contact is not None:
                servo.see_contact(contact, now_ns, now)
            if image is not None:
                layers, tared, late_ns = image
                servo.see_image(TactileImage(now_ns - late_ns, 0, layers, ARRAY, tared), now)
            try:
                servo.see_joints(positions if joint_state is None else joint_state, now_ns, now)
            except ValueError:  # refused; the last good one ages
                pass
            before = servo.state
            status, window = servo.cycle(now, now_ns)
            if window is None:
                continue
            reached, velocity = window.positions[0], window.velocities[0]
            resumed = before == State.HOLD and status.state != State.HOLD
            if not resumed:  # from a hold it starts anew, at the measured state and at rest
                assert (np.abs(reached - positions) <= LIMITS.velocity * 0.0051).all()
                assert (np.abs(velocity - velocities)
                        <= LIMITS.acceleration * 0.0051 + 1e-9).all()
            assert (np.abs(velocity) <= LIMITS.velocity + 1e-9).all()
            outside = np.maximum(window.positions - LIMITS.upper, LIMITS.lower - window.positions)
            was = np.maximum(np.maximum(positions - LIMITS.upper, LIMITS.lower - positions), 0.0)
            if not resumed:
                assert (outside <= was + 1e-9).all()
            assert not window.velocities[-1].any() and (np.diff(window.times) > 0.0).all()
            assert np.isfinite(window.positions).all()
            if status.state == before == State.HOLD:  # it only brakes
                assert (np.abs(velocity) <= np.abs(velocities) + 1e-9).all()
            here, was = PUMA.pose(reached)[:3, 3], PUMA.pose(positions)[:3, 3]
            outside = np.maximum(here - box.upper, box.lower - here)
            was = np.maximum(np.maximum(was - box.upper, box.lower - was), 0.0)
            if not resumed:
                assert (outside <= was + BOX_TOLERANCE).all()
            positions, velocities = reached, velocity
        if status.state == State.HOLD:
            assert status.reason
