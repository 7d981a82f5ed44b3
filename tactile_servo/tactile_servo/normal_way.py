"""Motion of the pad along its normal: approach, press, retreat, and what its force must be."""

import math

import numpy as np

from tactile_servo.config import MAX_STAMP_AGE, PRESS_DEPTH, ServoConfig
from tactile_servo.control.force_controller import REACTION, unseen_way
from tactile_servo.control.press_check import most_doubted, most_unfelt, SLOPE_ERROR
from tactile_servo.control.press_test import PressTest
from tactile_servo.control.scaling import clipped
from tactile_servo.following import Driven
from tactile_servo.inputs import Inputs
from tactile_servo.law import ServoLaw
from tactile_servo.reasons import Reason, ReasonCode
from tactile_servo.types import Goal

SOUND_FORCE = 0.5  # share of the goal's force above which PRESS_DEPTH counts from the pose then
TEST_AGAIN = 2e-3  # m, least way after which the sensor is tested again


class NormalWay:
    """
    Moves the pad along its normal, and compares how far it has moved with the force.

    Once the pad has touched, a later approach searches only near the last touch, so that a sensor
    that has failed in the meantime does not press harder. Methods that return a `Reason | None`
    are guards of `goal_run.RULES`.
    """

    def __init__(self, config: ServoConfig, goal: Goal, law: ServoLaw, inputs: Inputs,
                 robot: Driven):
        self._config, self._goal, self._law = config, goal, law
        self._inputs, self._robot, self._motion = inputs, robot, robot.motion
        self._touched, self._lift = False, config.retreat_distance
        self._tested = not config.self_test  # whether the sensor passed a test, or needs none
        self._testing = False  # whether a test has begun and was not passed
        self._unfelt = 0.0  # largest unfelt force of the law since the last test [N]
        self._test: PressTest | None = None
        self._first = math.nan  # slope measured by the first test
        self.begin()

    def begin(self) -> None:
        """Measure the advance from the pose that is commanded now."""
        self._anchor = self._motion.pose

    def lift(self) -> None:
        """Begin to lift off; without a touch so far, at least to the start of the approach."""
        if not self._touched:
            self._lift = max(self._lift, self.advance)
        self.begin()

    def _touch(self) -> None:
        """Record a touch, and measure the advance from here."""
        self._touched = True
        self.begin()

    def track(self, after_test: bool) -> None:
        """Begin to track, after an approach or after a press test."""
        self._touch()
        if after_test and self._tested:  # not the first test
            self._unfelt = 0.0
            self._law.resume()
        self._tested, self._testing = True, False

    @property
    def advance(self) -> float:
        """Distance of the commanded sensor from its start, along the normal [m]."""
        return self._beyond(self._motion.pose)

    def _beyond(self, pose: np.ndarray) -> float:
        anchor = self._anchor
        return 0.0 if pose is anchor else float((pose[:3, 3] - anchor[:3, 3]) @ anchor[:3, 2])

    @property
    def lifted(self) -> bool:
        """Whether the pad has lifted off."""
        return -self.advance >= self._lift

    def approach(self) -> np.ndarray:
        """Compute the twist of the pad (6,) towards the object [m/s, rad/s]."""
        speed = self._careful_speed() if self._inputs.load < self._goal.force else 0.0
        return np.array([0.0, 0.0, speed, 0.0, 0.0, 0.0])

    def begin_test(self) -> None:
        """Record a touch and begin the first or another press test of the sensor."""
        self._touch()
        self._testing = True
        if self._tested and self._test is not None and math.isnan(self._first):
            self._first = self._test.slope
        sensor = self._inputs.sensor
        rate = sensor.nominal_rate if sensor and sensor.nominal_rate else math.inf
        self._test = PressTest(
            self._goal.force, self._inputs.load, self._law.depth, self._first, rate,
            self._config.approach_speed)
        if self._tested and self._law.press is not None:
            self._law.press.learn()  # the goal goes on only if the test is passed

    def test(self, dt: float) -> np.ndarray:
        """Compute the twist of the pad (6,) in the press test, for a cycle of `dt` [s]."""
        assert self._test is not None and self._inputs.contact is not None
        twist = self._slowed(dt)
        if twist[:2].any():  # a pad that follows stops first
            twist[2] = 0.0
            return twist
        stamp = self._inputs.contact.stamp_ns
        pose = self._inputs.pose_at(stamp)
        advance = math.nan if pose is None else self._beyond(pose)
        self._test.see(stamp, self._inputs.load, advance)
        speed = min(self._test.speed(self._inputs.load, dt), self._careful_speed())
        return np.array([0.0, 0.0, speed, 0.0, 0.0, 0.0])

    def fails_test(self) -> Reason | None:
        """Return why the sensor has failed the test, or None."""
        assert self._test is not None
        saturated, load, advance = self._inputs.saturated, self._inputs.load, self.advance
        if not self._test.pressed and (
                advance > self._test.deepest(saturated) + self._unseen_way()):
            problem = f'{1e3 * advance:.1f} mm deeper, {load:.1f} N are felt'
        else:
            problem = self._test.problem() if self._test.over else ''
        if not problem:
            return None
        problem += ', with saturated tactels' * saturated
        return Reason(ReasonCode.TOO_DEEP, f'tested again, {problem}') if (
            self._tested) else Reason(ReasonCode.SELF_TEST, problem)

    def passes_test(self) -> Reason | None:
        """Return that the test is over, and the tilt that a later test has found, or None."""
        assert self._test is not None
        if not self._test.over:
            return None
        press, detail = self._law.press, ''
        if self._tested and press is not None:
            about_x, about_y = np.degrees(press.tilt)
            detail = ('the sensor is sound; it seems to be mounted with a tilt of '
                      f'{about_x:.1f}, {about_y:.1f} degrees about its x, y')
        return Reason(ReasonCode.CONTACT, detail)

    @property
    def in_contact(self) -> bool:
        """Whether the pad is pressed by a force that is no noise."""
        return self._inputs.touches(self._config.contact_force, self._goal.force)

    def touches(self, now: float) -> Reason | None:
        """Return that the pad touches what the law can track, or None."""
        touches = self.in_contact and self._law.lacks(now) is None
        return Reason(ReasonCode.CONTACT) if touches else None

    def touches_nothing_to_track(self, now: float) -> Reason | None:
        """Return what the law lacks although the pad is pressed by the goal's force, or None."""
        lacking = self._law.lacks(now)
        if lacking is None or self._inputs.largest_load < self._goal.force:
            return None
        return Reason(ReasonCode.NO_EDGE, lacking.text)

    @property
    def needs_test(self) -> bool:
        """
        Whether a pad that touches is to be tested.

        Before the first test a pad that is pressed by its force is relieved instead.
        """
        if self._tested:
            return self._testing
        return self._inputs.load < self._goal.force

    def meets_nothing(self) -> Reason | None:
        """Return that an approach has gone as far as it may, or None."""
        farthest = self._unseen_way() if self._touched else self._config.approach_distance
        far = self.advance >= farthest
        return Reason(ReasonCode.NO_CONTACT, f'within {farthest:.2g} m') if far else None

    def alarm(self, now: float) -> Reason | None:
        """Return why the pad must not press on: its force, or what is wrong with the sensor."""
        inputs, load = self._inputs, self._inputs.largest_load
        if load > self._config.max_load:
            return Reason(ReasonCode.OVERLOAD, f'{load:.1f} N')
        return inputs.watch.problem(self._goal.force) or inputs.wrist.problem(inputs.load, now)

    def see(self, force: float | None) -> None:
        """Process the force on the pad [N] in an assessed image, None without an image."""
        self._unfelt = max(self._unfelt, self._law.unfelt)
        if force is not None and force >= SOUND_FORCE * self._goal.force:
            self.begin()

    def objection(self) -> str:
        """Return why the forces so far are no success, '' if they are one."""
        unfelt = self._unfelt
        return f'but by its depth the pad pressed {unfelt:.1f} N harder than the images show' if (
            unfelt > most_doubted(self._goal.force)) else ''

    def too_deep(self) -> Reason | None:
        """Return that the depth needs more force than the images show, or None."""
        unfelt = self._law.unfelt
        if not unfelt > most_unfelt(self._goal.force):
            return None
        return Reason(ReasonCode.TOO_DEEP, f'by {unfelt:.1f} N; ' + (self._motion.at_limit or (
            'the object gives way, the sensor measures too little, or the stiffness is too high')))

    def seems_too_deep(self) -> Reason | None:
        """Return why the sensor must be tested again, or None: it may be mounted with a tilt."""
        law, press, force = self._law, self._law.press, self._goal.force
        # Without a first test there is nothing to compare with.
        if press is None or self._test is None or self._inputs.saturated or (
                np.hypot(*press.way) <= TEST_AGAIN):
            return None
        most = most_doubted(force)
        # The other way round, a tilt would hide a gain that fades.
        least = law.depth(force) - law.depth(force + most)
        grown, shrunk = law.unfelt > most, press.drift + SLOPE_ERROR * press.path < least
        differs = law.even and grown or (grown or shrunk) and press.steady
        return Reason(ReasonCode.CONTACT, 'tested again, the depth has grown by '
                      f'{1e3 * press.drift:.2g} mm more than felt') if differs else None

    def presses_too_deep(self) -> Reason | None:
        """Return that the pad has gone on without its force, or None."""
        return Reason(ReasonCode.TOO_DEEP, f'{1e3 * PRESS_DEPTH:g} mm, without the force') if (
            self.advance > PRESS_DEPTH) else None

    def relieved(self, twist: np.ndarray) -> np.ndarray:
        """Change a law's twist (6,) while tactels are saturated, so that the pad lifts off."""
        if self._inputs.saturated and self.in_contact:
            # The force is larger than measured by an unknown amount: lift. Move sideways no faster
            # than that, because a rising surface may be the cause.
            twist[2] = min(twist[2], -self._config.approach_speed)
            twist[:2] *= min(-twist[2] / max(np.hypot(*twist[:2]), 1e-9), 1.0)
        return twist

    def retreat(self, dt: float) -> np.ndarray:
        """
        Compute the twist of the pad (6,) off the object [m/s, rad/s], for a cycle of `dt` [s].

        Motion in the other directions slows down gradually. If all motion had to stop at once,
        the joint limits would delay the motion along the normal as well.
        """
        twist = self._slowed(dt)
        twist[2] = 0.0 if self.lifted else -self._config.approach_speed
        return twist

    def _slowed(self, dt: float) -> np.ndarray:
        twist = self._motion.twist
        beside = np.hypot(twist[0], twist[1])
        return twist * max(1.0 - self._motion.across() * dt / max(beside, 1e-9), 0.0)

    def _careful_speed(self) -> float:
        """
        Return the speed at which the pad may approach or press in the test [m/s].

        At this speed the force cannot grow much before an image shows it.
        """
        way, contact = self._unseen_way(), self._inputs.contact
        seen = None if contact is None else self._inputs.pose_at(contact.stamp_ns)
        if seen is None:
            return min(self._config.approach_speed, way / MAX_STAMP_AGE)
        pose = self._robot.pose
        blind = float((pose[:3, 3] - seen[:3, 3]) @ pose[:3, 2])
        return clipped((way - blind) / REACTION, 0.0, self._config.approach_speed)

    def _unseen_way(self) -> float:
        return unseen_way(self._goal.force, self._law.stiffness)
