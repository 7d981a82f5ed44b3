"""
Whatever is fed to the servo, its commands stay within the limits and end at rest.

A few sequences, always the same ones, are part of the tests; HOSTILE_SEQUENCES=10000 in the
environment runs that many, drawn anew each time.
"""

from dataclasses import replace
import os

from hypothesis import example, given, settings
from hypothesis import strategies as st
import numpy as np
from puma_loop import ELBOW, free_controller, LIMITS, PUMA
import pytest

from tactile_sensing.devices.calibration import Calibration
from tactile_sensing.dome.geometry import Dome, HalfSpaceDome
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import Contact, ContactType, Reason
from tactile_sensing.types.image import Layer, TactileImage
from tactile_sensing.types.moments import Moments
from tactile_servo.config import ServoConfig
from tactile_servo.laws.registry import LAWS, make_law
from tactile_servo.laws.surface_goal import Pattern, SurfaceGoal
from tactile_servo.motion.limits import WorkspaceBox
from tactile_servo.reasons import ReasonCode, Refused
from tactile_servo.supervisor import Supervisor
from tactile_servo.types import EdgeGoal, State, TRACKING
from tactile_simulation.render import force_on, render
from tactile_simulation.sensor import SceneSkin

SEQUENCES = int(os.environ.get('HOSTILE_SEQUENCES', '0'))
PERIOD_NS = 2_500_000
ROBOT_PERIOD_NS = 2_000_000
BOX_TOLERANCE = 1e-3  # m; the box is kept by velocities, whose joints brake in a curve
DOME = Dome()
ARRAY = TactelArray(16, 16, 0.0254 / 16, 0.0254 / 16)
FULL_SCALE = 1.6e5  # Pa
KINDS = ('edge', 'corner', 'blob', 'heavy', 'noise', 'blank', 'saturated', 'nan', 'huge', 'shape',
         'counts', 'none')

values = st.floats(-1.0, 1.0) | st.sampled_from(
    [float('nan'), float('inf'), -1e300, 1e300, 0.0, 1e-3, 5.0, 50.0, 100.0])
wild = st.builds(
    Contact, type=st.sampled_from(ContactType), valid=st.booleans(), force_valid=st.booleans(),
    reasons=st.sampled_from([Reason(0), Reason.NOT_TARED, Reason.LOW_SNR, Reason.SATURATED]),
    method=st.just('fit'), x=values, y=values, yaw=values, normal_force=values,
    moments=st.builds(Moments, values, values, values, values, values, values))


def line(force, x, yaw):
    """Contact that looks right: without it a sequence never comes to track."""
    return Contact(ContactType.LINE, True, Reason(0), 'fit', force_valid=True, x=x, y=0.0, yaw=yaw,
                   normal_force=force,
                   moments=Moments(force, force * x, 0.0, 0.0, force * 5.4e-5, 0.0))


contacts = wild | st.builds(line, st.floats(0.0, 12.0) | st.just(100.0),
                            st.floats(-5e-3, 5e-3), st.floats(-0.5, 0.5))


def picture(kind, seed, noise_std, tared, array, frame):
    """Return layers, tared, how many tactels are saturated, array and frame, of a kind."""
    rng = np.random.default_rng(seed)
    stress = 600.0 * rng.standard_normal(ARRAY.shape)
    if kind in ('edge', 'corner', 'saturated', 'counts', 'nan', 'huge'):
        corners = 3 if kind == 'corner' else 2
        depth = 0.01 if kind == 'saturated' else rng.uniform(0, 2e-3)
        points = np.column_stack([rng.uniform(-0.02, 0.02, (corners, 2)),
                                  np.full(corners, -depth)])
        stress += render(points, ARRAY, SceneSkin())
    elif kind in ('blob', 'heavy'):
        stress += 1e5 if kind == 'blob' else 100.0 / 0.0254**2
    elif kind == 'noise':
        stress *= 1e3
    if kind == 'saturated':
        stress[stress > FULL_SCALE] = np.nan
    elif kind in ('nan', 'huge'):
        stress[rng.random(ARRAY.shape) < 0.2] = rng.choice(
            [np.nan] if kind == 'nan' else [np.inf, -1e300, 1e12, 9e8])
    elif kind == 'shape':
        stress = stress[:5]
    layer = Layer('zz', 0.002, stress, FULL_SCALE, noise_std,
                  unit='counts' if kind == 'counts' else 'Pa')
    saturated = int(np.isnan(stress).sum()) if kind == 'saturated' else 0
    return () if kind == 'none' else (layer,), tared, saturated, array, frame


pictures = st.builds(
    picture, st.sampled_from(KINDS), st.integers(0, 1000),
    st.sampled_from([630.0, 630.0, 0.0, -1.0, float('nan'), 1e300]),
    st.sampled_from([True, True, True, False]),
    st.sampled_from([*[ARRAY] * 4, replace(ARRAY, pitch_x=1e-6), TactelArray(8, 8, 3e-3, 3e-3)]),
    st.sampled_from(['', '', '', 'map']))

stamps = st.sampled_from([10**7, -10**7, 10**8, -10**8, 10**10])  # ns, by which one is late
wrong_goals = st.builds(
    EdgeGoal, st.floats(0.001, 0.2) | st.sampled_from([0.0, float('nan')]),
    st.floats(0.6, 10.0) | st.sampled_from([0.1, 1e9]), st.sampled_from([-1, 1, 0]),
    st.sampled_from([0.0, -1.0, float('inf')]), st.booleans(), retreat=st.booleans())
goals = st.builds(EdgeGoal, st.floats(0.001, 0.2), st.floats(0.6, 10.0), st.sampled_from([-1, 1]),
                  st.sampled_from([0.0, 0.0, 0.01]), st.booleans())
ATTACKS = {
    'contact': contacts | st.just('none'),
    'image': pictures | st.just('none'),
    'joints': st.sampled_from(['silent', 'stuck'])
    | st.lists(st.floats(-4.0, 4.0) | st.just(float('nan')), min_size=5, max_size=6),
    'late_contact': stamps, 'late_image': stamps, 'late_joints': stamps,
    'jump': st.sampled_from([10**9, -10**9, 10**7, -10**7]),  # of the clock that stamps [ns]
    'asleep': st.sampled_from([0.03, 5.0]),  # pause of the whole process [s]
    'action': st.sampled_from(['pause', 'resume', 'cancel', 'finish']) | goals | wrong_goals}
cycles = {'cycles': st.sampled_from([1, 2, 5, 12, 30, 80])}  # 20 make a picture stale
# Nothing wrong, one thing, or several at once.
steps = st.one_of(
    st.fixed_dictionaries(cycles),
    *[st.fixed_dictionaries(cycles | {name: attack}) for name, attack in ATTACKS.items()],
    st.fixed_dictionaries(cycles, optional=ATTACKS))
# Anywhere, at the ends of the joints' ranges, and where the wrist or the arm is singular.
share = st.floats(0.0, 1.0) | st.sampled_from([0.0, 1e-6, 1.0])
places = (st.tuples(*[share] * 6).map(
    lambda shares: LIMITS.lower + np.array(shares) * (LIMITS.upper - LIMITS.lower))
    | st.sampled_from([ELBOW, ELBOW * [1, 1, 1, 1, 0, 1], ELBOW * [1, 1, 0, 1, 1, 1],
                       np.zeros(6)]).map(
                           lambda angles: np.clip(angles, LIMITS.lower, LIMITS.upper)))
# Before it is attacked a servo has come this far [cycles].
preludes = st.sampled_from([0, 40, 40, 150])


class Watched:
    """A servo, and what its next command is compared with."""

    def __init__(self, tracker, start, margin):
        self.start = pose = PUMA.pose(start)
        here = pose[:3, 3]
        self.box = WorkspaceBox(here - margin, here + margin)
        config = ServoConfig()
        self.servo = Supervisor(PUMA, LIMITS, make_law(tracker, config), config, self.box)
        self.servo.see_sensor(Calibration(ARRAY, depth=0.002).sensor_info('pad', '', 0))
        self.now, self.now_ns, self.count = 100.0, 10**12, 0
        self.measured = start
        # What controllers would do that sample the windows.
        self.robots = [Sampled(start, joined) for joined in (True, False)]
        # An edge with a corner that the pad presses where it starts.
        self.edge = np.array([[1e-3, -0.05, -3e-4], [1e-3, 0.02, -3e-4], [0.04, 0.04, -3e-4]]
                             ) @ pose[:3, :3].T + here
        self.tell_joints('follow', 0)

    def look(self):
        """What the pad sees of the edge, or a round one of a plane: stress and force."""
        pose = PUMA.pose(self.measured)
        if self.servo.law.goal_type is SurfaceGoal:
            turned = pose[:3, :3].T @ self.start[:3, 2]
            depth = (pose[:3, 3] - self.start[:3, 3]) @ self.start[:3, 2] + 3e-4 - (
                DOME.skin_radius * (1.0 - turned[2]))
            force = max(1.5e4 * depth, 0.0)
            state = np.array([*DOME.place(turned), force, 0.0, 0.0])
            return HalfSpaceDome(DOME, ARRAY).image(state)[0] / 0.85, force
        points = (self.edge - pose[:3, 3]) @ pose[:3, :3]
        return render(points, ARRAY, SceneSkin()), force_on(points, ARRAY, SceneSkin())

    def feed(self, contact='true', image='true', joints='follow', late_contact=0, late_image=0,
             late_joints=0):
        """Send what the driver, the estimator and the robot have to say, true or not."""
        self.count += 1
        self.tell_joints(joints, late_joints)
        if self.count % 2:
            return
        if 'true' in (contact, image):
            stress, force = self.look()
        if image == 'true':
            noise = 600.0 * np.random.default_rng(self.count).standard_normal(ARRAY.shape)
            image = (Layer('zz', 0.002, stress + noise, FULL_SCALE, 600.0),), True, 0, ARRAY, ''
        if image != 'none':
            layers, tared, saturated, array, frame = image
            try:
                self.servo.see_image(TactileImage(
                    self.now_ns - late_image, 0, layers, array, tared, saturated, frame),
                    self.now)
            except Refused as refusal:
                assert str(refusal) and (array, frame) != (ARRAY, '')
        if contact == 'true':
            contact = line(force, 0.0, 0.0) if force > 0.1 else Contact(
                ContactType.NONE, False, Reason.NO_CONTACT, 'fit')
        if contact != 'none':
            self.servo.see_contact(contact, self.now_ns - late_contact, self.now)

    def act(self, action):
        """Do what a client may do at any time."""
        servo = self.servo
        if isinstance(action, EdgeGoal):
            try:
                servo.start(self.goal_for(action), self.now)
            except Refused as refusal:
                assert str(refusal) and refusal.reason.code >= 200
        elif action == 'cancel':
            servo.cancel()
        elif action == 'finish' and servo.state == State.DONE:
            servo.finish()
        elif action in ('pause', 'resume'):
            servo.pause(action == 'pause', self.now)

    def goal_for(self, goal):
        """The same goal, or one as good or bad for a law that follows surfaces."""
        if self.servo.law.goal_type is EdgeGoal:
            return goal
        patterns = {1: Pattern.LINE, -1: Pattern.RASTER, 0: Pattern.SPIRAL}
        return SurfaceGoal(
            goal.speed, goal.force, patterns[goal.direction], (float(goal.direction), 0.3, 0.0),
            goal.length or 0.05, size=(0.02, 0.02), step_over=0.005, retreat=goal.retreat)

    def tell_joints(self, state, late_ns):
        """Send a joint state, as commanded, stuck, wrong, or none."""
        if isinstance(state, str):
            if state == 'silent':
                return
            self.measured = (
                self.robots[0].robot.commanded[0] if state == 'follow' else self.measured)
            state = self.measured
        try:
            self.servo.see_joints(state, self.now_ns - late_ns, self.now)
        except ValueError as refusal:  # the last good one ages
            assert str(refusal)

    def step(self):
        """One cycle, and everything that must hold of its command."""
        self.now, self.now_ns = self.now + 1e-9 * PERIOD_NS, self.now_ns + PERIOD_NS
        for robot in self.robots:
            robot.advance(self.now_ns)
        status, window = self.servo.cycle(self.now, self.now_ns)
        # A hold says what is wrong, or which end it comes to rest for.
        assert status.state != State.HOLD or status.reason.code >= ReasonCode.INPUT_BACK
        if window is None:
            return
        if not status.contact_fresh or not status.joints_fresh or status.normal_force > (
                self.servo.config.max_load):
            assert status.state not in TRACKING
        # In a hold there is one to stay where the robot is, and those that lift the pad off.
        assert status.state != State.HOLD or not window.velocities.any() or (
            status.twist[2] <= 0.0 and not status.twist[3:].any())
        self.check(window)
        for robot in self.robots:
            robot.take(window, self.now_ns)

    def check(self, window):
        """Position, velocity, acceleration, box; and rest at the end of the window."""
        assert np.isfinite(window.positions).all() and np.isfinite(window.velocities).all()
        assert not window.velocities[-1].any() and (np.diff(window.times) > 0.0).all()
        speeds = np.abs(window.velocities)
        assert (speeds <= LIMITS.velocity + 1e-9).all()
        changes, spans = np.diff(window.velocities, axis=0), np.diff(window.times)[:, None]
        assert (np.abs(changes) <= LIMITS.acceleration * spans + 1e-9).all()
        was = beyond(window.positions[0], LIMITS)
        assert (beyond(window.positions, LIMITS) <= was + 1e-9).all()
        ends = [PUMA.pose(positions)[:3, 3] for positions in window.positions[[0, -1]]]
        was, will = beyond(ends[0], self.box), beyond(ends[1], self.box)
        assert (will <= was + BOX_TOLERANCE).all()


class Sampled:
    """A joint_trajectory_controller at 500 Hz, and how far its commands may go."""

    def __init__(self, start, joined):
        self.robot = free_controller(start, from_desired=joined)
        self.then_ns, self.commands, self.jumped = 10**12, [start] * 3, False

    def take(self, window, now_ns):
        """Take a window; one without a stamp, or of another clock, is played as it can be."""
        if window.stamp_ns == 0 or self.jumped:
            self.commands.clear()
            self.jumped = False
        self.robot.accept(window, 1e-9 * now_ns)

    def jump(self, now_ns):
        """With a clock that jumps the controller starts anew, and so does the check."""
        self.then_ns, self.jumped = now_ns, True
        self.commands.clear()

    def advance(self, now_ns):
        """Play until now."""
        while self.then_ns <= now_ns:
            self.robot.step(1e-9 * self.then_ns)
            self.then_ns += ROBOT_PERIOD_NS
            self.commands = [*self.commands[-2:], self.robot.commanded[0]]
            if len(self.commands) == 3:
                self.check(1e-9 * ROBOT_PERIOD_NS)

    def check(self, period):
        """Velocity and acceleration of the last three commands."""
        first, second, third = self.commands
        assert (np.abs(third - second) <= LIMITS.velocity * period + 1e-9).all()
        assert (np.abs(third - 2.0 * second + first) <= (
            2.0 * LIMITS.acceleration * period**2 + 1e-9)).all()


def beyond(place, bounds):
    """How far each coordinate lies outside of its bounds, 0 within."""
    return np.maximum(np.maximum(place - bounds.upper, bounds.lower - place), 0.0)


HERE = np.clip(ELBOW, LIMITS.lower, LIMITS.upper)
STRETCHED = LIMITS.lower + np.array((0.0, 0.0, 0.0, 0.875, 0.75, 1.0)) * (
    LIMITS.upper - LIMITS.lower)
TURNED = np.array([-0.38397244, 0.61086524, -3.00196631, 0.0, -0.83775804, -0.38397244])
LIGHT, FIRM, HARD = (EdgeGoal(0.125, force, -1, 0.0, retreat=False) for force in (1.0, 4.0, 5.0))
LIES = {'joints': [0.0] * 6}


@pytest.mark.parametrize('tracker', list(LAWS))
@settings(max_examples=(SEQUENCES + 1) // 2 or 12, derandomize=not SEQUENCES,
          print_blob=True)
@given(start=places, margin=st.sampled_from([1e-9, 1e-3, 0.4, 0.4]), goal=goals,
       prelude=preludes, script=st.lists(steps, max_size=12))
@example(HERE, 0.4, LIGHT, 40, [
    {'cycles': 1}, {'cycles': 5}, {'cycles': 1, 'asleep': 5.0}, {'cycles': 5}])
# The robot moves on as it comes to rest, while its joint states say that it stands.
@example(STRETCHED, 0.4, FIRM, 150, [
    {'cycles': 30, 'image': 'none'}, {'cycles': 80, 'joints': 'stuck'}])
@example(STRETCHED, 0.4, FIRM, 150, [
    {'cycles': 30, 'image': 'none'}, {'cycles': 78, 'joints': 'stuck'},
    *[{'cycles': 1, 'action': 'resume'}] * 10])
# One joint state lies, in the very cycle in which a motion begins.
@example(TURNED, 0.4, LIGHT, 0, [{'cycles': 1}, {'cycles': 1, **LIES}, {'cycles': 1}])
# Before anything was sent joint states lie, one after the other, or one does after a silence.
@example(HERE, 0.4, LIGHT, 0, [{'cycles': 5, **LIES}])
@example(HERE, 0.4, LIGHT, 0, [{'cycles': 1, 'asleep': 0.03, 'jump': 10**9, **LIES},
                               {'cycles': 5}])
# It sleeps while the controller settles, and awakes in the motion that was sent then.
@example(LIMITS.lower, 0.4, HARD, 0, [
    {'cycles': 30, 'late_contact': 10**7}, {'cycles': 2, 'asleep': 0.03}])
# The robot's clock seems to be another one for a while.
@example(HERE, 0.4, EdgeGoal(0.0625, 2.0, -1, 0.0, retreat=False), 40, [
    {'cycles': 80, 'contact': 'none'}, {'cycles': 80, 'late_joints': -10**7},
    *[{'cycles': 80}] * 3])
# A round probe rolls, and brakes in a curve, in a box without room.
@example(HERE, 1e-9, LIGHT, 0, [
    {'cycles': 30}, {'cycles': 80, 'image': picture('edge', 0, 630.0, True, ARRAY, '')}])
def test_commands_stay_within_every_limit(tracker, start, margin, goal, prelude, script):
    watched = Watched(tracker, start, margin)
    watched.act(goal)
    for _ in range(prelude):
        watched.feed()
        watched.step()
    for attack in script:
        attack = dict(attack)
        if 'jump' in attack:
            watched.now_ns += attack.pop('jump')
            for robot in watched.robots:
                robot.jump(watched.now_ns)
        asleep = attack.pop('asleep', 0.0)
        watched.now, watched.now_ns = watched.now + asleep, watched.now_ns + round(1e9 * asleep)
        for robot in watched.robots:  # the robot does not sleep: it is measured where it is by now
            robot.advance(watched.now_ns)
        watched.act(attack.pop('action', ''))
        for _ in range(attack.pop('cycles')):
            watched.feed(**attack)
            watched.step()


@pytest.mark.parametrize('tracker', list(LAWS))
def test_what_is_attacked_does_track(tracker):
    watched = Watched(tracker, HERE, 0.4)
    watched.act(EdgeGoal(0.03, 5.0))
    for _ in range(400):
        watched.feed()
        watched.step()
    assert watched.servo.state in TRACKING and watched.servo.statistics.length > 0.01
