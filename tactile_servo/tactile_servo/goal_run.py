"""What happens from a goal to its end: when the pad approaches, tracks, holds, lifts off."""

from dataclasses import dataclass

import numpy as np

from tactile_servo.config import ServoConfig
from tactile_servo.inputs import Inputs
from tactile_servo.law import Goal, Reference, ServoLaw
from tactile_servo.motion.motion import Motion
from tactile_servo.reasons import Reason, ReasonCode
from tactile_servo.state_machine import ASSESSED, Event, RESUMPTION, StateMachine
from tactile_servo.track_statistics import TrackStatistics
from tactile_servo.types import State, TRACKING

SOUND_FORCE = 0.5  # of the force, from which the depth of the pad is known to be sound
OFFER = 'resume with ~/pause false'


@dataclass
class Hold:
    """What a hold is about."""

    paused: bool = False  # it was asked for
    resumption: Event = Event.RESUME_APPROACH  # what takes up again what it interrupted
    cause: Reason = Reason(ReasonCode.NONE)  # what is wrong


@dataclass
class Ending:
    """Why a goal ends, None until then; whether it was met; whether the pad stays where it is."""

    reason: Reason | None = None
    success: bool = False
    stopping: bool = False


class GoalRun:
    """
    One goal, from its acceptance to its end.

    Every change of state goes through the table of `state_machine`.
    """

    def __init__(self, goal: Goal, config: ServoConfig, law: ServoLaw, inputs: Inputs,
                 motion: Motion, machine: StateMachine):
        self.goal, self.statistics = goal, TrackStatistics(goal.force)
        self.hold, self.ending = Hold(), Ending()
        self.reference: Reference | None = None  # last one, None unless the law moves the pad
        self.observed = -np.inf  # steady time at which the law was last told something [s],
        self.observed_ns = 0  # and the stamp of that
        self._config, self._law, self._inputs = config, law, inputs
        self._motion, self._machine = motion, machine
        self._anchor = motion.pose  # where the current way (approach, retreat, press) began

    def cancel(self) -> None:
        """Stop within the robot's limits and end the goal."""
        self._stop(Reason(ReasonCode.CANCELLED))

    def pause(self, paused: bool, now: float) -> None:
        """Hold (true) or go on (false)."""
        self.hold.paused = paused
        if (not paused and self._machine.state == State.HOLD and not self.ending.stopping
                and self._standstill() is None):
            self._resume(now, Reason(ReasonCode.RESUMED))

    def count(self) -> None:
        """Count the way since the last cycle."""
        if self._machine.state in TRACKING and self.reference is not None:
            self.statistics.move(self._inputs.pose, self.reference.heading)
        else:
            self.statistics.stand()

    def decide(self, now: float) -> None:
        """Change the state where there is reason to."""
        why, overload = self._standstill(), self._inputs.load > self._config.force.max_load
        if self._machine.state is State.HOLD and not self.ending.stopping:
            self._decide_hold(now, why)
        if self.ending.stopping:
            self._rest_when_standing()
            return
        state = self._machine.state
        if state is State.HOLD and (why is not None or not overload):
            return
        if why is not None:
            self._hold(now, why)
        elif self._motion.blocked:
            self._end_blocked(now)
        elif overload and state is not State.RETREAT:
            self._end(now, Reason(ReasonCode.OVERLOAD, f'{self._inputs.load:.1f} N'), lift=True)
        elif state is State.APPROACH:
            self._decide_approach(now)
        elif state in TRACKING:
            self._decide_track(now)
        elif -self._advance() >= self._config.retreat.distance:
            self._rest_when_standing()

    def _standstill(self) -> Reason | None:
        """Why the robot must stand still whatever is tracked, or None."""
        if self.hold.paused:
            return Reason(ReasonCode.PAUSED)
        missing = self._inputs.joints_missing()
        if missing is None and self._machine.state != State.RETREAT:  # lifting off needs no image
            missing = self._inputs.contact_missing()
        return missing or self._inputs.astray(self._motion.positions)

    def _decide_approach(self, now):
        c, load, lacking = self._config, self._inputs.load, self._law.lacks(now)
        since = self._machine.since
        if load >= c.approach.contact_force and lacking is None:
            self._anchor = self._motion.pose
            self._machine.fire(Event.TOUCH, Reason(ReasonCode.CONTACT), now)
        elif lacking is not None and load >= self.goal.force and (
                self.observed > since or now - since > c.input.lost_after):
            self._end(now, Reason(ReasonCode.NO_EDGE, lacking.text), lift=True)
        elif self._advance() >= c.approach.distance:
            self._end(now, Reason(ReasonCode.NO_CONTACT, f'within {c.approach.distance:g} m'),
                      lift=True)

    def _decide_track(self, now):
        deepest = self._config.force.press_depth
        found = self._law.assess(now, self.statistics.length, self._inputs.load)
        if found.state == State.HOLD:
            self._hold(now, found.reason)
            return
        error = self._law.error
        if error is not None:
            self.statistics.see(error, self._inputs.pose, self._inputs.contact.stamp_ns)
            if error.force >= SOUND_FORCE * self.goal.force:
                self._anchor = self._motion.pose
        if found.state == State.DONE:
            self._end(now, found.reason, found.success, found.lift)
        elif self._advance() > deepest:
            self._end(now, Reason(ReasonCode.TOO_DEEP, f'{deepest:g} m'), lift=True)
        elif found.state != self._machine.state:
            self._machine.fire(ASSESSED[found.state], found.reason, now)

    def _advance(self) -> float:
        """How far the commanded sensor stands beyond the anchor along its own normal [m]."""
        pose, anchor = self._motion.pose, self._anchor
        return 0.0 if pose is anchor else float((pose[:3, 3] - anchor[:3, 3]) @ anchor[:3, 2])

    def _hold(self, now, reason):
        self.hold.resumption, self.hold.cause = RESUMPTION[self._machine.state], reason
        self._machine.fire(Event.HOLD, reason, now)

    def _decide_hold(self, now, why):
        hold, limits = self.hold, self._config.hold
        if why is not None:
            hold.cause = self._machine.reason = why
        held = now - self._machine.since
        back = why is None and (hold.resumption != Event.RESUME_TRACK
                                or self._law.lacks(now) is None)
        if back and held <= limits.resume_within:
            self._resume(now, Reason(ReasonCode.INPUT_BACK))
        elif not hold.paused and held > limits.give_up:
            self._end(now, Reason(ReasonCode.GAVE_UP, hold.cause.text))
        elif back:
            self._machine.reason = Reason(
                ReasonCode.INPUT_BACK, f'{OFFER} (held: {hold.cause.text})')

    def _resume(self, now, reason):
        """Go on from the measured state, or from the commanded one while that still moves."""
        if self._motion.standing:
            self._motion.seed(self._inputs.joints.value)
        self._law.resume()
        self.reference = None
        self._machine.fire(self.hold.resumption, self.ending.reason or reason, now)

    def _end(self, now, reason, success=False, lift=False):
        """End the goal: lift off where that is asked for or needed, else stop."""
        self.ending.reason, self.ending.success = reason, success
        if (lift or self.goal.retreat) and self._standstill() is None:
            self._anchor = self._motion.pose
            self._machine.fire(Event.LIFT, reason, now)
        else:
            self._stop(reason)

    def _end_blocked(self, now):
        """End a goal whose motion a limit, a singularity or the workspace has held back."""
        reason = Reason(ReasonCode.MOTION_BLOCKED, self._motion.blocked)
        self._motion.reset_blocked()
        if self._machine.state == State.RETREAT:  # its outcome stands
            code, detail = self._machine.reason
            self._stop(Reason(code, f'{detail}; {reason.text}' if detail else reason.text))
        else:
            self._end(now, reason)

    def _stop(self, reason):
        self.ending.stopping = True
        self._machine.fire(Event.STOP, reason)

    def _rest_when_standing(self):
        if self._motion.standing:
            self._machine.fire(Event.REST, self._machine.reason)

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
        twist, force = np.zeros(6), self.goal.force
        if state is State.APPROACH and self._inputs.load < force:
            # What is to be touched lightly is touched slowly: the pad stops late.
            softly = c.approach.speed * min(force / c.approach.soft_touch, 1.0)
            twist[2] = min(softly, self._law.touch_speed)
        elif state is State.RETREAT and -self._advance() < c.retreat.distance:
            twist[2] = -c.approach.speed
        return twist
