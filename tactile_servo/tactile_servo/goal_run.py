"""What happens from a goal to its end: when the pad approaches, tracks, holds, lifts off."""

from dataclasses import dataclass

import numpy as np

from tactile_servo.config import ServoConfig
from tactile_servo.control.lap_guard import LapGuard
from tactile_servo.cycle_clock import CycleClock
from tactile_servo.following import apart, Following
from tactile_servo.hold import ASKED, Hold
from tactile_servo.inputs import Inputs
from tactile_servo.law import Goal, Reference, ServoLaw
from tactile_servo.motion.motion import Motion, MotionStep
from tactile_servo.normal_way import NormalWay
from tactile_servo.reasons import Reason, ReasonCode
from tactile_servo.state_machine import ASSESSED, Event, RESUMPTION, StateMachine
from tactile_servo.state_times import StateTimes
from tactile_servo.track_statistics import TrackStatistics
from tactile_servo.types import ON_TRACK, State, TRACKING

SOUND_FORCE = 0.5  # of the force, from which the depth of the pad is known to be sound
OFFER = 'resume with ~/pause false'
SETTLE = 0.1  # s after the end of the last command, until what is measured is where it stands
NEAR = 5.0  # times `following_distance`, within which a robot at rest is told to stay there
SLIGHT = 0.1  # of it, which a robot at rest may be told to move at once


@dataclass
class Ending:
    """Why a goal ends, None until then; whether it was met; whether the pad stays where it is."""

    reason: Reason | None = None
    success: bool = False
    stopping: bool = False


class GoalRun:
    """
    One goal, from its acceptance to its end.

    Every change of state goes through the table of `state_machine`. In a hold nothing is
    commanded: the last window ends at rest. Once the robot stands it is told to stay where it
    is measured, so that no older command can move it any more; from there it goes on. It has
    many parts, for all that a goal needs meets here.
    """

    def __init__(self, goal: Goal, config: ServoConfig, law: ServoLaw, inputs: Inputs,
                 motion: Motion, machine: StateMachine):
        self.goal, self.statistics = goal, TrackStatistics(goal.force)
        self.hold, self.ending = Hold(), Ending()
        self.reference: Reference | None = None  # last one, None unless the law moves the pad
        self.observed = -np.inf  # steady time at which the law was last told something [s]
        self._config, self._law, self._inputs = config, law, inputs
        law.agility = motion
        self._motion, self._machine = motion, machine
        self._way = NormalWay(config, goal, law, inputs, motion)
        self._following = Following(config.input, config.motion.rotation_length)
        self._laps = LapGuard(config.contour.miss)
        self._times = StateTimes(config, goal)
        # Steady times [s]: of the last decision, and until which the robot may move.
        self._now, self._moving = -np.inf, -np.inf
        self._told = True  # that it stays where it stands

    def cancel(self, code: ReasonCode) -> None:
        """Stop within the robot's limits and end the goal."""
        self._stop(Reason(code))

    def pause(self, paused: bool, now: float) -> None:
        """Hold (true) or go on (false)."""
        self.hold.paused = paused
        self.hold.asked = not paused and self._machine.state == State.HOLD
        if self.hold.asked and self._standstill() is None:
            self._resume_at_rest(now, Reason(ReasonCode.RESUMED))

    def count(self) -> None:
        """Count the way since the last cycle."""
        statistics, reference = self.statistics, self.reference
        if self._machine.state not in TRACKING or reference is None:
            statistics.stand()
            return
        pose = self._inputs.pose
        statistics.move(pose, reference.heading, self._machine.state in ON_TRACK)
        if hasattr(self.goal, 'closed') and getattr(self.goal, 'length', 0.0) == 0.0:
            self._laps.see(pose[:3, 3].tolist(), pose[:3, 2].tolist(), reference.heading,
                           statistics.length)

    def decide(self, now: float, clock: CycleClock, around: Reason | None = None) -> None:
        """Change the state where there is reason to, in the time or around the servo as well."""
        why, overload = self._standstill(), self._inputs.load > self._config.force.max_load
        state = self._machine.state
        why = clock.fault or (around if state is not State.RETREAT else None) or why
        self._now = now
        self._times.count(state, now)
        if state is State.HOLD and not self.ending.stopping:
            self._decide_hold(now, why)
        if self.ending.stopping:
            if now >= self._moving + SETTLE:
                self._machine.fire(Event.REST, self._machine.reason)
            return
        state = self._machine.state
        if state is State.HOLD and (
                why is not None or not overload or self.hold.bound or not self._told):
            return
        if why is not None:
            self._hold(now, why, now - clock.gap)
        elif self._motion.blocked:
            self._end_early(Reason(ReasonCode.MOTION_BLOCKED, self._motion.blocked))
        elif overload and state is not State.RETREAT:
            self._end(Reason(ReasonCode.OVERLOAD, f'{self._inputs.load:.1f} N'), lift=True)
        elif self._times.over(state):
            self._end_early(Reason(ReasonCode.TIME_LIMIT, f'{self._times.longest(state):.0f} s'))
        elif state is State.APPROACH:
            self._decide_approach(now)
        elif state in TRACKING:
            self._decide_track(now)
        elif self._way.lifted and self._motion.standing:
            self._machine.fire(Event.REST, self._machine.reason)

    def _standstill(self) -> Reason | None:
        """Why the robot must stand still whatever is tracked, or None."""
        if self.hold.paused:
            return Reason(ReasonCode.PAUSED)
        inputs, state = self._inputs, self._machine.state
        missing = inputs.joints_missing()
        if missing is None and state != State.RETREAT:  # lifting off needs no image
            missing = inputs.contact_missing(self._law.sees_images)
        if missing is not None or inputs.joints is None or state is State.HOLD:
            return missing  # in a hold nothing is commanded
        return (inputs.astray(self._motion.positions)
                or self._following.problem(inputs.pose, inputs.joints.arrival))

    def _decide_approach(self, now):
        c, load, lacking = self._config, self._inputs.load, self._law.lacks(now)
        since = self._machine.since
        if load >= c.approach.contact_force and lacking is None:
            self._way.touch()
            self._machine.fire(Event.TOUCH, Reason(ReasonCode.CONTACT), now)
        elif lacking is not None and load >= self.goal.force and (
                self.observed > since or now - since > c.input.lost_after):
            self._end(Reason(ReasonCode.NO_EDGE, lacking.text), lift=True)
        elif self._way.advance >= (farthest := self._way.farthest):
            self._end(Reason(ReasonCode.NO_CONTACT, f'within {farthest:.2g} m'), lift=True)

    def _decide_track(self, now):
        deepest = self._config.force.press_depth
        found = self._law.assess(now, self.statistics.length, self._inputs.load)
        if found.state == State.HOLD:
            self._hold(now, found.reason, now)
            self.hold.lost = found.reason
            return
        error = self._law.error
        if error is not None:
            self.statistics.see(error, self._inputs.pose, self._inputs.contact.stamp_ns)
            if error.force >= SOUND_FORCE * self.goal.force:
                self._way.begin()
        if found.state == State.DONE:
            self._end(found.reason, found.success, found.lift)
        elif self._way.advance > deepest:
            self._end(Reason(ReasonCode.TOO_DEEP, f'{deepest:g} m'), lift=True)
        elif self._laps.problem(self.statistics.length):
            self._end(Reason(ReasonCode.LAP_LIMIT, self._laps.problem(self.statistics.length)))
        elif found.state != self._machine.state:
            self._machine.fire(ASSESSED[found.state], found.reason, now)

    def _hold(self, now, reason, began):
        bound = reason.code in ASKED or now - began > self._config.hold.resume_within
        state = self._machine.state
        self.hold = Hold(self.hold.paused, searching=state is State.SEARCH,
                         resumption=RESUMPTION[state], cause=reason, began=began, bound=bound)
        self._moving = max(self._moving, now)
        self._machine.fire(Event.HOLD, reason, now)

    def _decide_hold(self, now, why):
        hold, limits = self.hold, self._config.hold
        if why is not None:
            self._machine.reason = why
            hold.worsen(why, now, limits.resume_within)
        blind = hold.searching and hold.lost is None  # a search sees nothing either
        unseen = None if self._resumption(now) != Event.RESUME_TRACK or blind else (
            self._law.lacks(now))
        if why is None and unseen is not None:
            self._machine.reason = hold.lost or unseen
        back = why is None and unseen is None
        hold.see(back, now)
        if why is None and hold.over(limits.resume_within):
            code = ReasonCode.RESUMED if hold.asked else ReasonCode.INPUT_BACK
            self._resume_at_rest(now, Reason(code))
        elif now - self._machine.since > (limits.longest_pause if hold.paused
                                          else limits.give_up):
            cause = hold.cause if back else self._machine.reason
            self._end(Reason(ReasonCode.GAVE_UP, cause.text))
        elif back and self._told:
            self._machine.reason = Reason(
                ReasonCode.INPUT_BACK, f'{OFFER} (held: {hold.cause.text})')

    def _resume_at_rest(self, now, reason):
        """Go on from the measured state, once the robot stands."""
        if not self._told or now < self._moving or self.ending.stopping:
            return
        if not self.hold.asked and self._see_place() > self._config.input.following_distance:
            return
        resumption = self._resumption(now)
        self._start_here()
        self._law.resume()
        self._machine.fire(resumption, self.ending.reason or reason, now)

    def _resumption(self, now):
        """What takes up again what the hold interrupted."""
        hold = self.hold
        lost = (hold.resumption is Event.RESUME_TRACK and not hold.searching
                and hold.lost is None and self._told and not hold.strayed
                and self._inputs.load < self._config.approach.contact_force
                and self._law.lacks(now) is not None)
        # The stop has led off what bends away: a robot that is still there touches it again.
        there = lost and self._off() <= self._config.input.following_distance
        return Event.RESUME_APPROACH if there else hold.resumption

    def _start_here(self):
        """Forget what was commanded: the robot is where it is measured, at rest."""
        self._motion.seed(self._inputs.joints.value)
        self._following.reset()
        self.reference = None

    def _end(self, reason, success=False, lift=False):
        """End the goal: lift off where that is asked for or needed, else stop."""
        self.ending.reason, self.ending.success = reason, success
        held = self._machine.state is State.HOLD
        if (lift or self.goal.retreat) and self._standstill() is None and not (
                held and (self.hold.bound or not self._told)):
            if held:
                self._start_here()
            self._way.begin()
            self._machine.fire(Event.LIFT, reason, self._now)
        else:
            self._stop(reason)

    def _end_early(self, reason):
        """End a goal whose motion does not get on."""
        self._motion.reset_blocked()
        if self._machine.state == State.RETREAT:  # its outcome stands
            code, detail = self._machine.reason
            self._stop(Reason(code, f'{detail}; {reason.text}' if detail else reason.text))
        else:
            self._end(reason, lift=reason.code is ReasonCode.TIME_LIMIT)

    def _stop(self, reason):
        self.ending.stopping = True
        self._machine.fire(Event.STOP, reason)

    def command(self, now: float, now_ns: int, dt: float, stamped: bool) -> MotionStep | None:
        """Command the next piece of motion, of `dt` [s]; None if there is none."""
        motion = self._motion
        if self._machine.state not in (State.HOLD, State.DONE):
            trust = self._inputs.trust(now, touch=self._machine.state is not State.RETREAT)
            step = motion.command(trust * self.twist(dt), now_ns, stamped)
            self._following.sent(now, motion.pose, self._inputs.pose)
            if step.trajectory is not None:
                self._moving, self._told = now + motion.lasting, False
            return step
        if self._told or now < self._moving + SETTLE or not self._inputs.joints_fresh or dt == 0.0:
            return None
        self._told = True
        off, following = self._see_place(), self._config.input.following_distance
        self._start_here()
        # Not where it has come to be elsewhere: who brought it there has commanded it since.
        if off > NEAR * following:
            return None
        step = motion.command(np.zeros(6), now_ns, stamped)
        if off > SLIGHT * following:  # it moves there
            self._moving = now + motion.lasting
        return step

    def _off(self):
        """How far the robot is from where its last window comes to rest, as in `apart` [m]."""
        return apart(self._motion.rest_pose, self._inputs.pose,
                     self._config.motion.rotation_length)

    def _see_place(self):
        """How far a robot at rest is off [m]; where that is too far it goes on only when asked."""
        off = self._off()
        if off > self._config.input.following_distance:
            self.hold.stray(off)
        return off

    def twist(self, dt: float) -> np.ndarray:
        """Wanted twist of the sensor in its own frame (6,) [m/s, rad/s]."""
        c, state = self._config, self._machine.state
        if state in TRACKING:
            self.reference = self._law.reference(self._inputs.pose, self._motion.pose, dt)
            twist = self.reference.twist
            if self._inputs.saturated and self._inputs.load >= c.approach.contact_force:
                # The force is larger than it seems, nobody knows by how much: give way.
                twist[2] = min(twist[2], -c.approach.speed)
            return twist
        if state is State.APPROACH:
            return self._way.approach()
        return self._way.retreat() if state is State.RETREAT else np.zeros(6)
