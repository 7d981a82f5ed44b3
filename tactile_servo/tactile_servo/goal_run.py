"""Runs one goal: decides when the pad approaches, tracks, holds and lifts off."""

from collections import defaultdict
from collections.abc import Callable, Set

import numpy as np

from tactile_servo.clocks import CycleClock
from tactile_servo.config import PRESS_DEPTH, ServoConfig
from tactile_servo.control.press_check import most_doubted, most_unfelt, SLOPE_ERROR
from tactile_servo.following import apart, FollowingCheck
from tactile_servo.inputs import Inputs
from tactile_servo.law import Assessment, Goal, Reference, ServoLaw
from tactile_servo.motion.motion import Motion, MotionStep
from tactile_servo.normal_way import NormalWay
from tactile_servo.phases import (
    APPROACHING,
    BINDING,
    HELD,
    Hold,
    LIFTING,
    MOVING,
    Phase,
    STANDING,
    TOUCHING,
    TRACKING,
)
from tactile_servo.reasons import Reason, ReasonCode
from tactile_servo.track_statistics import TrackStatistics
from tactile_servo.types import State

SOUND_FORCE = 0.5  # share of the goal's force above which PRESS_DEPTH counts from the pose then
SETTLE = 0.1  # s from the end of the last command until the robot is at rest
NEAR = 5.0  # times `following_distance`: only a robot this near is sent to its measured position
BESIDE = 0.1  # largest share of images beside the tracked feature for a success
SLIGHT = 0.1  # times `following_distance`: a command by less than this counts as no motion
LONGEST_PAUSE = 3600.0  # s
TEST_AGAIN = 2e-3  # m, least way after which the sensor is tested again
# Time within which a hold ends by itself when its cause goes away [s]; people near the robot still
# remember that it moved. After a longer one the pad lifts off and the robot waits to be asked.
RESUME_WITHIN = 0.5
# Time limit of a state: SLACK, and the time for its distance at the share SLOWNESS of its speed.
SLACK, SLOWNESS = 10.0, 0.05  # s
LONGEST_TRACK = 1800.0  # s, for a goal without a length


class GoalRun:
    """
    One goal, from its acceptance to its end.

    In every cycle the first row of `RULES`, below, whose guard gives a reason fires. When a hold
    begins, no more motion is commanded, and the last window ends at rest. Once the robot is at
    rest, it is sent to its measured position, so that no older command can move it any more.
    """

    def __init__(self, goal: Goal, config: ServoConfig, law: ServoLaw, inputs: Inputs,
                 motion: Motion, now: float):
        assert inputs.sensor is not None  # otherwise the goal would have been refused
        array = inputs.sensor.array
        self.phase, self.reason = Phase.APPROACH, Reason(ReasonCode.GOAL_ACCEPTED)
        self._since = now  # steady time of the last change of phase [s]
        self.goal, self.statistics = goal, TrackStatistics(
            goal.force, law.near * max(array.pitch_x, array.pitch_y))
        self.reference: Reference | None = None  # last one of the law, while it moves the pad
        self.observed = -np.inf  # steady time of the law's last observation [s]
        self.success = False  # whether the goal was reached
        self._unfelt = 0.0  # largest unfelt force of the law since the last test [N]
        self.hold = Hold(Phase.APPROACH, Reason(ReasonCode.NONE), -np.inf)
        self._config, self._law, self._inputs, self._motion = config, law, inputs, motion
        self._way = NormalWay(config, goal, law, inputs, motion)
        self._following = FollowingCheck(config.input.following_distance)
        self._longest = time_limits(config, goal)
        self._spent: dict[State, float] = defaultdict(float)
        self._paused, self._outcome = False, self.reason
        self._tested = not config.self_test
        # Of this cycle: steady time, period, time since the previous cycle [s], why the robot must
        # stand still, what must be observed before a hold ends, and the assessment of the law.
        self._now, self._dt, self._gap = now, 0.0, 0.0
        self._why: Reason | None = None
        self._unseen: Reason | None = None
        self._found: Assessment | None = None
        # Steady time until which the robot may move [s]; whether it was sent to its measured
        # position; distance of that command if it is due now [m], else None.
        self._moving, self._stays = -np.inf, True
        self._stay: float | None = None

    def cancel(self, code: ReasonCode) -> None:
        """Stop within the robot's limits and end the goal."""
        self._enter(Phase.STOPPING, Reason(code))

    def pause(self, paused: bool) -> Reason | None:
        """Hold (true) or continue (false); return why that does not happen, or None."""
        self._paused, wrong = paused, self._why
        if self.phase is Phase.STOPPING:
            return self.reason
        if paused or self.phase not in HELD:
            return None
        if wrong is not None and wrong.code is ReasonCode.PAUSED:  # may hide another problem
            wrong = self._standstill()
        self.hold.asked = wrong is None
        return wrong

    def decide(self, now: float, dt: float, clock: CycleClock,
               around: Reason | None = None) -> None:
        """
        Fire the first rule whose guard gives a reason.

        Faults of the clock, and problems `around` the servo, are reasons to hold.
        """
        self._count_way()
        self._spent[_limited(self.phase)] += now - self._now
        self._now, self._dt, self._gap, self._found = now, dt, clock.gap, None
        self._why = clock.fault or (
            around if self.phase not in LIFTING else None) or self._standstill()
        if self.phase in HELD:
            self._unseen = self._lacking()
            self.hold.see(self._why is None and self._unseen is None, now)
        for guard, following in _RULES_OF[self.phase]:
            if (reason := guard(self)) is not None:
                self._enter(following if isinstance(following, Phase)
                            else following(self, reason), reason)
                return

    def _count_way(self) -> None:
        """Add the distance since the last cycle to the statistics."""
        phase, reference = self.phase, self.reference
        braking = (phase is Phase.SETTLING and self.hold.after in TRACKING
                   or phase is Phase.TEST and self._tested)
        if reference is not None and (phase in TRACKING or braking):
            self.statistics.move(self._inputs.pose, reference.heading,
                                 phase in TRACKING and phase is not Phase.SEARCH)
        else:
            self.statistics.interrupt()

    def _standstill(self) -> Reason | None:
        """Return why the robot must stop, independently of the law, or None."""
        if self._paused:
            return Reason(ReasonCode.PAUSED)
        inputs, phase = self._inputs, self.phase
        missing = inputs.joints_missing()
        if missing is None and phase not in LIFTING:  # lifting off needs no image
            missing = inputs.contact_missing(self._law.sees_images)
        if missing is not None or inputs.joints is None or phase not in MOVING | LIFTING:
            return missing  # nothing is commanded that the robot could fail to follow
        return (inputs.astray(self._motion.positions)
                or self._following.problem(inputs.pose, inputs.joints.arrival))

    def _lacking(self) -> Reason | None:
        """Return what must be observed before a hold can end, or None."""
        hold = self.hold
        if hold.after is not Phase.TRACK or self._came_off():
            return None
        lacking = self._law.lacks(self._now)
        return hold.cause if lacking and hold.of_law else lacking

    def _came_off(self) -> bool:
        """Return whether the pad lost contact while stopping and must approach again."""
        hold = self.hold
        return (hold.after is Phase.TRACK and not hold.of_law
                and hold.cause.code is not ReasonCode.NOT_FOLLOWING and self._stays
                and not self._in_contact and self._law.lacks(self._now) is not None
                and self._off() <= self._config.input.following_distance)

    @property
    def _in_contact(self) -> bool:
        return self._inputs.touches(self._config.approach.contact_force, self.goal.force)

    def _off(self) -> float:
        """Return the robot's distance from the end of its last window, as in `apart` [m]."""
        return apart(self._motion.rest_pose, self._inputs.pose)

    # Guards: each returns the reason of a rule that is due, or None.

    def _played_out(self) -> Reason | None:
        """Check whether the last command has ended."""
        return self.reason if self._now >= self._moving + SETTLE else None

    def _stands(self) -> Reason | None:
        """Check whether the last command has ended and the robot's position is known."""
        known = self._inputs.joints_fresh and self._dt > 0.0
        return self.reason if self._stays else self._played_out() if known else None

    def _waited_long(self) -> Reason | None:
        hold = self.hold
        longest = LONGEST_PAUSE if self._paused else self._config.hold.give_up
        if self._now - hold.began <= longest:
            return None
        well = hold.well_since is not None
        return Reason(ReasonCode.GAVE_UP, (hold.cause if well else self.reason).text)

    def _unloads(self) -> Reason | None:
        """Check whether the hold lasts long while the pad is still pressed."""
        hold, wrong = self.hold, self._why
        bound = hold.bound or (wrong is not None and wrong.code in BINDING)
        pressed = hold.after in TRACKING and not bound
        lasts = self._now - hold.began > RESUME_WITHIN
        able = (self._inputs.joints_fresh and self._now >= self._moving
                and self._off() <= self._config.input.following_distance)
        return self.reason if pressed and lasts and able else None

    def _unloaded(self) -> Reason | None:
        """Check whether the pad has lifted off, or cannot move."""
        return self.hold.cause if self._motion.blocked or self._lifted() else None

    def _binds(self) -> Reason | None:
        """Check whether the hold ends only when asked: by its cause, or as the robot was moved."""
        off = self._off()
        if off > self._config.input.following_distance:
            self.hold.stray(off)
        return self.hold.cause if self.hold.bound else None

    def _asked(self) -> Reason | None:
        able = self.hold.asked and self._now >= self._moving
        return Reason(ReasonCode.RESUMED) if able else None

    def _well_soon(self) -> Reason | None:
        since = self.hold.well_since
        able = (since is not None and since - self.hold.began <= RESUME_WITHIN
                and self._now >= self._moving)
        return Reason(ReasonCode.INPUT_BACK) if able else None

    def _well(self) -> Reason | None:
        return Reason(ReasonCode.INPUT_BACK,
                      f'resume with ~/pause false (held: {self.hold.cause.text})')

    def _blocked(self) -> Reason | None:
        blocked = self._motion.blocked
        return Reason(ReasonCode.MOTION_BLOCKED, blocked) if blocked else None

    def _too_long(self) -> Reason | None:
        state = _limited(self.phase)
        longest = self._longest[state]
        over = self._spent[state] > longest
        return Reason(ReasonCode.TIME_LIMIT, f'{longest:.0f} s') if over else None

    def _cannot_lift(self) -> Reason | None:
        """Return what prevents the pad from lifting off, appended to the unchanged outcome."""
        hindered, (code, detail) = self._blocked() or self._too_long(), self.reason
        return hindered and Reason(code, '; '.join(filter(None, (detail, hindered.text))))

    def _overload(self) -> Reason | None:
        load = self._inputs.largest_load
        over = load > self._config.force.max_load
        return Reason(ReasonCode.OVERLOAD, f'{load:.1f} N') if over else None

    def _lies(self) -> Reason | None:
        inputs = self._inputs
        return inputs.watch.problem(self.goal.force) or inputs.wrist.problem(
            inputs.load, self._now)

    def _touches(self) -> Reason | None:
        touches = self._in_contact and self._law.lacks(self._now) is None
        return Reason(ReasonCode.CONTACT) if touches else None

    def _touches_untested(self) -> Reason | None:
        # A pad that already presses with the goal's force is relieved first, without a test.
        return None if self._tested or self._inputs.load >= self.goal.force else self._touches()

    def _fails_test(self) -> Reason | None:
        problem = self._way.test_problem()
        if not problem:
            return None
        return Reason(ReasonCode.TOO_DEEP, f'tested again, {problem}') if (
            self._tested) else Reason(ReasonCode.SELF_TEST, problem)

    def _passes_test(self) -> Reason | None:
        if not self._way.tested:
            return None
        press, detail = self._law.press, ''
        if self._tested and press is not None:
            about_x, about_y = np.degrees(press.tilt)
            detail = ('the sensor is sound; it seems to be mounted with a tilt of '
                      f'{about_x:.1f}, {about_y:.1f} degrees about its x, y')
        return Reason(ReasonCode.CONTACT, detail)

    def _touches_nothing_to_track(self) -> Reason | None:
        lacking, since = self._law.lacks(self._now), self._since
        looked = self.observed > since or self._now - since > self._inputs.patience
        if lacking is None or self._inputs.largest_load < self.goal.force or not looked:
            return None
        return Reason(ReasonCode.NO_EDGE, lacking.text)

    def _meets_nothing(self) -> Reason | None:
        farthest = self._way.farthest
        far = self._way.advance >= farthest
        return Reason(ReasonCode.NO_CONTACT, f'within {farthest:.2g} m') if far else None

    def _too_deep(self) -> Reason | None:
        unfelt = self._law.unfelt
        if not unfelt > most_unfelt(self.goal.force):
            return None
        return Reason(ReasonCode.TOO_DEEP, f'by {unfelt:.1f} N; ' + (self._motion.at_limit or (
            'the object gives way, the sensor measures too little, or the stiffness is too high')))

    def _seems_too_deep(self) -> Reason | None:
        """Check whether the sensor must be tested again: it may be mounted with a tilt instead."""
        law, press, force = self._law, self._law.press, self.goal.force
        # Without a first test there is nothing to compare with.
        if press is None or not self._way.tested or self._inputs.saturated or (
                np.hypot(*press.way) <= TEST_AGAIN):
            return None
        most = most_doubted(force)
        # The other way round, a tilt would hide a gain that fades.
        least = law.depth(force) - law.depth(force + most)
        grown, shrunk = law.unfelt > most, press.drift + SLOPE_ERROR * press.path < least
        differs = law.even and grown or (grown or shrunk) and press.steady
        return Reason(ReasonCode.CONTACT, 'tested again, the depth has grown by '
                      f'{1e3 * press.drift:.2g} mm more than felt') if differs else None

    def _halted(self) -> Reason | None:
        return self.reason if self.reference is not None and self.reference.speed <= 0.0 else None

    def _presses_too_deep(self) -> Reason | None:
        return Reason(ReasonCode.TOO_DEEP, f'{1e3 * PRESS_DEPTH:g} mm, without the force') if (
            self._way.advance > PRESS_DEPTH) else None

    def _law_says(self, state: State) -> Reason | None:
        """Check whether the law changes to a state, or gives another reason for it."""
        found = self._assessed()
        news = self.phase.state is not state or self.reason.code is not found.reason.code
        return found.reason if found.state is state and news else None

    def _law_fails(self) -> Reason | None:
        return self._law_says(State.DONE) if self._assessed().lift else None

    def _assessed(self) -> Assessment:
        """Return the law's assessment of this cycle."""
        if self._found is None:
            inputs, law = self._inputs, self._law
            self._found = law.assess(self._now, self.statistics.tracked_length, inputs.load)
            self._unfelt = max(self._unfelt, law.unfelt)
            seen, contact = law.error, inputs.contact
            if seen is not None and contact is not None and self._found.state is not State.HOLD:
                self.statistics.see(seen, inputs.pose, contact.stamp_ns)
                if seen.force >= SOUND_FORCE * self.goal.force:
                    self._way.begin()
            if self._found.success and (objection := self._objection()):
                self._found = Assessment(State.DONE, Reason(self._found.reason.code, objection))
            elif self._found.state in (State.HOLD, State.DONE) and not self._found.success:
                code, detail = self._found.reason
                self._found = self._found._replace(reason=Reason(
                    code, '; '.join(filter(None, (detail, self._motion.at_limit)))))
        return self._found

    def _objection(self) -> str:
        """Return why the end of a goal is no success, '' if it is one."""
        beside, unfelt = self.statistics.beside, self._unfelt
        if beside > BESIDE:
            return f"but {100.0 * beside:.0f} % of the images saw it beside the pad's centre"
        return f'but by its depth the pad pressed {unfelt:.1f} N harder than the images show' if (
            unfelt > most_doubted(self.goal.force)) else ''

    def _lifted(self) -> Reason | None:
        return self.reason if self._way.lifted and self._motion.standing else None

    # What a rule leads to: each returns the next phase.

    def _begin_hold(self, reason: Reason) -> Phase:
        phase, of_law = self.phase, reason is not self._why
        after = (Phase.APPROACH if phase in APPROACHING else
                 Phase.TRACK if phase in (Phase.CORNER, Phase.HALT) or of_law else phase)
        self.hold = Hold(after, reason, self._now - self._gap, of_law=of_law,
                         bound=self._gap > RESUME_WITHIN)
        self._moving = max(self._moving, self._now)
        return self._go_on_holding(reason)

    def _go_on_holding(self, reason: Reason) -> Phase:
        joints = self._inputs.joints
        self.hold.worsen(reason, joints is None or self._now - joints.arrival > RESUME_WITHIN)
        return self.phase if self.phase in STANDING else Phase.SETTLING

    def _hold_unloaded(self, _: Reason) -> Phase:
        self.hold.after = Phase.APPROACH
        return Phase.SETTLING

    def _stay_held(self, _: Reason) -> Phase:
        return self.phase

    def _resume(self, _: Reason) -> Phase:
        after = Phase.APPROACH if self._came_off() else self.hold.after
        self._start_here()
        self._law.resume()
        return after

    def _end(self, reason: Reason) -> Phase:
        """End the goal, and lift off if it asks for that."""
        return self._lift(reason, self.goal.retreat)

    def _lift(self, reason: Reason, lift: bool = True) -> Phase:
        """End the goal, and lift off if that is possible."""
        self._outcome, self.success = reason, self._found is not None and self._found.success
        if not lift or self._why is not None or self.phase in HELD - {Phase.WAITING}:
            return Phase.STOPPING
        if self.phase is Phase.WAITING:
            self._start_here()
        self._motion.reset_blocked()
        self._way.lift()
        return Phase.RETREAT

    def _enter(self, phase: Phase, reason: Reason) -> None:
        """Change the phase, or only its reason."""
        if phase is Phase.HALT:
            self._law.halt()
        elif phase is Phase.TEST:
            self._way.begin_test()
            if self._tested and self._law.press is not None:
                self._law.press.learn()  # if the test fails, the goal ends
        elif phase is Phase.TRACK and self.phase in APPROACHING:
            self._way.touch()
            if self._tested and self.phase is Phase.TEST:
                self._unfelt = 0.0
                self._law.resume()
            self._tested = True
        elif phase is Phase.SEARCH:
            self._way.begin()
        elif phase is Phase.UNLOADING:
            self._start_here()
            self._motion.reset_blocked()
        elif phase is Phase.RETREAT:
            reason = self._outcome
        elif phase in (Phase.WAITING, Phase.DONE) and not self._stays and self._stands():
            self._stand()
        if phase is not self.phase:
            self._since = self._now
        self.phase, self.reason = phase, reason

    def _stand(self) -> None:
        """Request a command to the measured position, where the robot is at rest."""
        self._stays, off = True, self._off()
        following = self._config.input.following_distance
        if off > following:
            self.hold.stray(off)
        self._start_here()
        # A robot that is farther off was moved by somebody else, who commands it now.
        self._stay = off if off <= NEAR * following else None

    def _start_here(self) -> None:
        """Start from the measured position at rest; forget earlier commands."""
        assert self._inputs.joints is not None  # a goal starts with a joint state
        self._motion.seed(self._inputs.joints.value)
        self._following.reset()
        self.reference = None

    def command(self, now: float, now_ns: int, dt: float, stamped: bool) -> MotionStep | None:
        """Return the next step of motion, of `dt` [s]; None if nothing is to be commanded."""
        motion, phase = self._motion, self.phase
        if phase in MOVING | LIFTING:
            trust = self._inputs.trust(now, touch=phase not in LIFTING)
            step = motion.command(trust * self.twist(dt), now_ns, stamped)
            self._following.sent(now, motion.pose, self._inputs.pose)
            if step.trajectory is not None:
                self._moving, self._stays = now + motion.lasting, False
            return step
        if self._stay is None:
            return None
        step = motion.command(np.zeros(6), now_ns, stamped)
        if self._stay > SLIGHT * self._config.input.following_distance:
            self._moving = now + motion.lasting
        self._stay = None
        return step

    def twist(self, dt: float) -> np.ndarray:
        """Compute the wanted twist (6,) of the sensor in its own frame [m/s, rad/s]."""
        phase = self.phase
        if phase is Phase.APPROACH:
            return self._way.approach()
        if phase is Phase.TEST:
            return self._way.test(dt)
        if phase in LIFTING:
            return self._way.retreat(dt)
        self.reference = self._law.reference(
            self._inputs.pose, self._motion.pose, self._motion, dt)
        twist = self.reference.twist
        if self._inputs.saturated and self._in_contact:
            # The force is larger than measured by an unknown amount: lift. Move sideways no faster
            # than that, because a rising surface may be the cause.
            twist[2] = min(twist[2], -self._config.approach.speed)
            twist[:2] *= min(-twist[2] / max(np.hypot(*twist[:2]), 1e-9), 1.0)
        return twist


def _limited(phase: Phase) -> State:
    """Return the state whose time limit holds in a phase."""
    return State.TRACK if phase in TRACKING else phase.state


def time_limits(config: ServoConfig, goal: Goal) -> dict[State, float]:
    """Return the longest total times of approach, tracking and retreat [s]."""
    def longest(distance: float, speed: float) -> float:
        return SLACK + distance / (SLOWNESS * speed)

    length = getattr(goal, 'length', 0.0)
    return {
        State.APPROACH: longest(config.approach.distance, config.approach.speed),
        State.TRACK: longest(length, goal.speed) if length else LONGEST_TRACK,
        State.RETREAT: longest(config.retreat.distance, config.approach.speed)}


Guard = Callable[[GoalRun], Reason | None]
Next = Phase | Callable[[GoalRun, Reason], Phase]
# Phases, guard, and the next phase or what chooses it: in each cycle the first row of the phase
# whose guard gives a reason fires. Besides, `cancel` leads from every phase to STOPPING.
RULES: tuple[tuple[Set[Phase], Guard, Next], ...] = (
    ({Phase.STOPPING}, GoalRun._played_out, Phase.DONE),
    (HELD, GoalRun._waited_long, GoalRun._end),
    ({Phase.SETTLING}, GoalRun._stands, Phase.WAITING),
    ({Phase.WAITING}, GoalRun._unloads, Phase.UNLOADING),
    (HELD, lambda run: run._why, GoalRun._go_on_holding),
    ({Phase.UNLOADING}, GoalRun._unloaded, GoalRun._hold_unloaded),
    ({Phase.WAITING}, GoalRun._binds, Phase.ASKED),
    ({Phase.WAITING}, GoalRun._overload, GoalRun._lift),
    ({Phase.WAITING}, GoalRun._lies, GoalRun._lift),
    (STANDING, GoalRun._asked, GoalRun._resume),
    ({Phase.WAITING}, GoalRun._well_soon, GoalRun._resume),
    (HELD - {Phase.UNLOADING}, lambda run: run._unseen, GoalRun._stay_held),
    (STANDING, GoalRun._well, GoalRun._stay_held),
    (MOVING, lambda run: run._why, GoalRun._begin_hold),
    ({Phase.RETREAT}, GoalRun._cannot_lift, Phase.STOPPING),
    ({Phase.RETREAT}, GoalRun._lifted, Phase.DONE),
    (TOUCHING, GoalRun._blocked, GoalRun._end),
    (TOUCHING, GoalRun._overload, GoalRun._lift),
    (TOUCHING, GoalRun._lies, GoalRun._lift),
    (TOUCHING, GoalRun._too_long, GoalRun._lift),
    ({Phase.APPROACH}, GoalRun._touches_untested, Phase.TEST),
    ({Phase.APPROACH}, GoalRun._touches, Phase.TRACK),
    ({Phase.TEST}, GoalRun._fails_test, GoalRun._lift),
    ({Phase.TEST}, GoalRun._passes_test, Phase.TRACK),
    (APPROACHING, GoalRun._touches_nothing_to_track, GoalRun._lift),
    ({Phase.APPROACH}, GoalRun._meets_nothing, GoalRun._lift),
    (TRACKING, lambda run: run._law_says(State.HOLD), GoalRun._begin_hold),
    (TRACKING, GoalRun._law_fails, GoalRun._lift),
    (TRACKING, lambda run: run._law_says(State.DONE), GoalRun._end),
    (TRACKING - {Phase.SEARCH}, GoalRun._too_deep, GoalRun._lift),
    ({Phase.TRACK}, GoalRun._seems_too_deep, Phase.HALT),
    ({Phase.HALT}, GoalRun._halted, Phase.TEST),
    (TRACKING, GoalRun._presses_too_deep, GoalRun._lift),
    (TRACKING - {Phase.HALT}, lambda run: run._law_says(State.TRACK), Phase.TRACK),
    (TRACKING - {Phase.HALT}, lambda run: run._law_says(State.CORNER), Phase.CORNER),
    (TRACKING - {Phase.HALT}, lambda run: run._law_says(State.SEARCH), Phase.SEARCH),
)
_RULES_OF = {phase: [(guard, following) for phases, guard, following in RULES if phase in phases]
             for phase in Phase}
