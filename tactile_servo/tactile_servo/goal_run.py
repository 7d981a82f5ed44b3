"""Runs one goal: decides when the pad approaches, tracks, holds and lifts off."""

from collections.abc import Callable, Set

import numpy as np

from tactile_servo.clocks import CycleClock
from tactile_servo.config import ServoConfig
from tactile_servo.following import Driven
from tactile_servo.inputs import Inputs
from tactile_servo.law import Assessment, Reference, ServoLaw
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
    RESUME_WITHIN,
    STANDING,
    TimeLimits,
    TOUCHING,
    TRACKING,
)
from tactile_servo.reasons import Reason, ReasonCode
from tactile_servo.track_statistics import TrackStatistics
from tactile_servo.types import Goal, State

SETTLE = 0.1  # s from the end of the last command until the robot is at rest
LONGEST_PAUSE = 3600.0  # s


class GoalRun:
    """
    One goal, from its acceptance to its end.

    In every cycle the first row of `RULES`, below, whose guard gives a reason fires. When a hold
    begins, no more motion is commanded, and the last window ends at rest.
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
        self.hold = Hold(Phase.APPROACH, Reason(ReasonCode.NONE), -np.inf)
        self._config, self._law, self._inputs, self._motion = config, law, inputs, motion
        self._robot = Driven(inputs, motion, config.following_distance)
        self._way = NormalWay(config, goal, law, inputs, self._robot)
        self._limits = TimeLimits(config, goal)
        self._paused, self._outcome = False, self.reason
        # Of this cycle: steady time, period, time since the previous cycle [s], why the robot must
        # not move, what must be observed before a hold ends, and the assessment of the law.
        self._now, self._dt, self._gap = now, 0.0, 0.0
        self._why: Reason | None = None
        self._unseen: Reason | None = None
        self._found: Assessment | None = None

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

    def decide(self, clock: CycleClock, around: Reason | None = None) -> None:
        """Fire the first rule whose guard gives a reason; a problem `around` the servo holds."""
        if self.reference is None:
            self.statistics.interrupt()
        else:
            self.statistics.move(self._inputs.pose, self.reference.heading,
                                 self.phase in TRACKING - {Phase.SEARCH})
        self._limits.spend(self.phase, clock.now - self._now)
        self._now, self._dt, self._gap, self._found = clock.now, clock.dt, clock.gap, None
        self._why = clock.fault or (
            around if self.phase not in LIFTING else None) or self._standstill()
        if self.phase in HELD:
            self._unseen = self._lacking()
            if self._why or self._unseen:
                self.hold.well_since = None
            elif self.hold.well_since is None:
                self.hold.well_since = self._now
        for guard, following in _RULES_OF[self.phase]:
            if (reason := guard(self)) is not None:
                self._enter(following(self, reason) if callable(following)
                            else following or self.phase, reason)
                return

    def _standstill(self) -> Reason | None:
        """Return why the robot must stop, independently of the law, or None."""
        if self._paused:
            return Reason(ReasonCode.PAUSED)
        inputs, phase = self._inputs, self.phase
        missing = inputs.joints_missing() or (  # lifting off needs no image
            None if phase in LIFTING else inputs.contact_missing(self._law.sees_images))
        if missing is not None or phase not in MOVING | LIFTING:
            return missing  # nothing is commanded that the robot could fail to follow
        return self._robot.problem()

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
                and hold.cause.code is not ReasonCode.NOT_FOLLOWING and self._robot.sent_here
                and not self._way.in_contact and self._law.lacks(self._now) is not None
                and not self._robot.astray)

    # Guards: each returns the reason of a rule that is due, or None.

    def _played_out(self) -> Reason | None:
        return self.reason if self._now >= self._robot.until + SETTLE else None

    def _stands(self) -> Reason | None:
        """Check whether the last command has ended and the robot's position is known."""
        known = self._inputs.joints_fresh and self._dt > 0.0
        return self.reason if self._robot.sent_here else self._played_out() if known else None

    def _waited_long(self) -> Reason | None:
        hold = self.hold
        longest = LONGEST_PAUSE if self._paused or hold.asked else self._config.give_up
        cause = self.reason if hold.well_since is None else hold.cause
        return Reason(ReasonCode.GAVE_UP, cause.text) if (
            self._now - hold.began > longest) else None

    def _unloads(self) -> Reason | None:
        hold, why = self.hold, self._why
        able = self._inputs.joints_fresh and self._ended and not self._robot.astray
        bound = hold.bound or why is not None and why.code in BINDING
        pressed = hold.after in TRACKING and self._now - hold.began > RESUME_WITHIN
        return self.reason if able and pressed and not bound else None

    @property
    def _ended(self) -> bool:
        return self._now >= self._robot.until

    def _unloaded(self) -> Reason | None:
        return self.hold.cause if self._motion.blocked or self._lifted() else None

    def _asked(self) -> Reason | None:
        return Reason(ReasonCode.RESUMED) if self.hold.asked and self._ended else None

    def _well_soon(self) -> Reason | None:
        since = self.hold.well_since
        soon = since is not None and since - self.hold.began <= RESUME_WITHIN
        return Reason(ReasonCode.INPUT_BACK) if soon and self._ended else None

    def _binds(self) -> Reason | None:
        """Return the cause of a hold that ends only when asked, also as the robot was moved."""
        self._check_place()
        return self.hold.cause if self.hold.bound else None

    def _check_place(self) -> None:
        """Bind the hold if the robot, which is at rest, is not where it was sent."""
        if self._robot.astray:
            self.hold.bound, self.hold.cause = True, Reason(
                ReasonCode.NOT_FOLLOWING,
                f'it is {1e3 * self._robot.off:.1f} mm from where it was sent')

    def _news(self) -> Reason | None:
        """Return what is missing, or that a robot at rest waits to be asked."""
        return self._unseen or (Reason(
            ReasonCode.INPUT_BACK, f'resume with ~/pause false (held: {self.hold.cause.text})')
            if self.phase in STANDING else None)

    def _cannot_lift(self) -> Reason | None:
        """Return what prevents the pad from lifting off, appended to the unchanged outcome."""
        hindered, (code, detail) = self._robot.blocked() or self._limits.problem(
            self.phase), self.reason
        return hindered and Reason(code, '; '.join(filter(None, (detail, hindered.text))))

    def _touches_nothing_to_track(self) -> Reason | None:
        since = self._since
        looked = self.observed > since or self._now - since > self._inputs.patience
        return self._way.touches_nothing_to_track(self._now) if looked else None

    def _halted(self) -> Reason | None:
        return self.reason if self.reference is not None and self.reference.speed <= 0.0 else None

    def _law_says(self, state: State) -> Reason | None:
        """Check whether the law changes to a state, or gives another reason for it."""
        found = self._assessed()
        news = self.phase.state is not state or self.reason.code is not found.reason.code
        return found.reason if found.state is state and news else None

    def _assessed(self) -> Assessment:
        if self._found is None:
            self._found = self._assess()
        return self._found

    def _assess(self) -> Assessment:
        inputs, law = self._inputs, self._law
        found = law.assess(self._now, self.statistics.tracked_length, inputs.load)
        seen, contact = law.error, inputs.contact
        if seen is not None and contact is not None and found.state is not State.HOLD:
            at = inputs.pose_at(contact.stamp_ns)
            self.statistics.see(seen, inputs.pose if at is None else at, contact.stamp_ns)
            self._way.see(seen.force)
        else:
            self._way.see(None)
        if found.success and (objection := self.statistics.objection() or self._way.objection()):
            return Assessment(State.DONE, Reason(found.reason.code, objection))
        if found.state in (State.HOLD, State.DONE) and not found.success:
            code, detail = found.reason
            return found._replace(reason=Reason(
                code, '; '.join(filter(None, (detail, self._motion.at_limit)))))
        return found

    def _lifted(self) -> Reason | None:
        return self.reason if self._way.lifted and self._motion.standing else None

    # What a rule leads to: each returns the next phase.

    def _begin_hold(self, reason: Reason) -> Phase:
        phase, of_law = self.phase, reason is not self._why
        after = (Phase.APPROACH if phase in APPROACHING else
                 Phase.TRACK if phase in (Phase.CORNER, Phase.HALT) or of_law else phase)
        self.hold = Hold(after, reason, self._now - self._gap, of_law=of_law,
                         bound=self._gap > RESUME_WITHIN)
        self._robot.until = max(self._robot.until, self._now)
        return self._go_on_holding(reason)

    def _go_on_holding(self, reason: Reason) -> Phase:
        hold, joints = self.hold, self._inputs.joints
        hold.asked = False
        if not hold.bound:  # without joint states the robot may have been moved
            hold.cause, hold.bound = reason, reason.code in BINDING or (
                joints is None or self._now - joints.arrival > RESUME_WITHIN)
        return self.phase if self.phase in STANDING else Phase.SETTLING

    def _test_or_track(self, _: Reason) -> Phase:
        return Phase.TEST if self._way.needs_test else Phase.TRACK

    def _hold_unloaded(self, _: Reason) -> Phase:
        self.hold.after = Phase.APPROACH
        return Phase.SETTLING

    def _resume(self, _: Reason) -> Phase:
        after = Phase.APPROACH if self._came_off() else self.hold.after
        self._start_here()
        self._law.resume()
        return after

    def _end(self, reason: Reason) -> Phase:
        found = self._found
        return self._lift(reason, self.goal.retreat or found is not None and found.lift)

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
        elif phase is Phase.TRACK and self.phase in APPROACHING:
            self._way.track(after_test=self.phase is Phase.TEST)
        elif phase is Phase.SEARCH:
            self._way.begin()
        elif phase is Phase.UNLOADING:
            self._start_here()
            self._motion.reset_blocked()
        elif phase is Phase.RETREAT:
            reason, self.reference = self._outcome, None
        elif phase is Phase.STOPPING:
            self.reference = None
        elif phase in (Phase.WAITING, Phase.DONE) and not self._robot.sent_here and self._stands():
            self._check_place()
            self._robot.send_here()
            self.reference = None
        if phase is not self.phase:
            self._since = self._now
        self.phase, self.reason = phase, reason

    def _start_here(self) -> None:
        """Start from the measured position at rest; forget earlier commands."""
        self._robot.start_here()
        self.reference = None

    def command(self, now_ns: int, stamped: bool) -> MotionStep | None:
        """Return the motion of this cycle, at a time [ns]; None if nothing is to be commanded."""
        if self.phase not in MOVING | LIFTING:
            return self._robot.stay(self._now, now_ns, stamped)
        trust = self._inputs.trust(self._now, touch=self.phase not in LIFTING)
        return self._robot.move(trust * self.twist(), self._now, now_ns, stamped)

    def twist(self) -> np.ndarray:
        """Compute the wanted twist (6,) of the sensor in its own frame [m/s, rad/s]."""
        phase, dt = self.phase, self._dt
        if phase is Phase.APPROACH:
            return self._way.approach()
        if phase is Phase.TEST:
            return self._way.test(dt)
        if phase in LIFTING:
            return self._way.retreat(dt)
        self.reference = self._law.reference(
            self._inputs.pose, self._robot.pose, self._motion, dt)
        return self._way.relieved(self.reference.twist)


Guard = Callable[[GoalRun], Reason | None]
Next = Phase | Callable[[GoalRun, Reason], Phase] | None
# Phases, guard, and the next phase or what chooses it (None: the same). In each cycle the first
# row of the phase whose guard gives a reason fires. Besides, `cancel` leads from every phase to
# STOPPING.
RULES: tuple[tuple[Set[Phase], Guard, Next], ...] = (
    ({Phase.STOPPING}, GoalRun._played_out, Phase.DONE),
    (HELD, GoalRun._waited_long, GoalRun._end),
    ({Phase.SETTLING}, GoalRun._stands, Phase.WAITING),
    ({Phase.WAITING}, GoalRun._unloads, Phase.UNLOADING),
    (HELD, lambda run: run._why, GoalRun._go_on_holding),
    ({Phase.UNLOADING}, GoalRun._unloaded, GoalRun._hold_unloaded),
    ({Phase.WAITING}, GoalRun._binds, Phase.ASKED),
    ({Phase.WAITING}, lambda run: run._way.alarm(run._now), GoalRun._lift),
    (STANDING, GoalRun._asked, GoalRun._resume),
    ({Phase.WAITING}, GoalRun._well_soon, GoalRun._resume),
    (HELD - {Phase.UNLOADING}, GoalRun._news, None),
    (MOVING, lambda run: run._why, GoalRun._begin_hold),
    ({Phase.RETREAT}, GoalRun._cannot_lift, Phase.STOPPING),
    ({Phase.RETREAT}, GoalRun._lifted, Phase.DONE),
    (TOUCHING, lambda run: run._robot.blocked(), GoalRun._end),
    (TOUCHING, lambda run: run._way.alarm(run._now), GoalRun._lift),
    (TOUCHING, lambda run: run._limits.problem(run.phase), GoalRun._lift),
    ({Phase.APPROACH}, lambda run: run._way.touches(run._now), GoalRun._test_or_track),
    ({Phase.TEST}, lambda run: run._way.fails_test(), GoalRun._lift),
    ({Phase.TEST}, lambda run: run._way.passes_test(), Phase.TRACK),
    (APPROACHING, GoalRun._touches_nothing_to_track, GoalRun._lift),
    ({Phase.APPROACH}, lambda run: run._way.meets_nothing(), GoalRun._lift),
    (TRACKING, lambda run: run._law_says(State.HOLD), GoalRun._begin_hold),
    (TRACKING, lambda run: run._law_says(State.DONE), GoalRun._end),
    (TRACKING - {Phase.SEARCH}, lambda run: run._way.too_deep(), GoalRun._lift),
    ({Phase.TRACK}, lambda run: run._way.seems_too_deep(), Phase.HALT),
    ({Phase.HALT}, GoalRun._halted, Phase.TEST),
    (TRACKING, lambda run: run._way.presses_too_deep(), GoalRun._lift),
    (TRACKING - {Phase.HALT}, lambda run: run._law_says(State.TRACK), Phase.TRACK),
    (TRACKING - {Phase.HALT}, lambda run: run._law_says(State.CORNER), Phase.CORNER),
    (TRACKING - {Phase.HALT}, lambda run: run._law_says(State.SEARCH), Phase.SEARCH),
)
_RULES_OF = {phase: [(guard, following) for phases, guard, following in RULES if phase in phases]
             for phase in Phase}
