"""Time limits of the states that move the robot."""

from tactile_servo.config import ServoConfig
from tactile_servo.law import Goal
from tactile_servo.types import State, TRACKING

SLACK = 10.0  # s in addition to the time for the distance
SLOWNESS = 0.05  # share of the wanted speed for which the time is sufficient
SOFT_TOUCH = 2.5  # N, wanted force below which the approach is slower, in proportion
LONGEST_TRACK = 1800.0  # s, for a goal without a length


def approach_speed(config: ServoConfig, force: float) -> float:
    """Return the speed of the approach [m/s], reduced for forces below `SOFT_TOUCH`."""
    return config.approach.speed * min(force / SOFT_TOUCH, 1.0)


class StateTimes:
    """Time that a goal has spent in approach, tracking and retreat, and the limits."""

    def __init__(self, config: ServoConfig, goal: Goal):
        speed = config.approach.speed
        length = getattr(goal, 'length', 0.0)

        def way(distance: float, speed: float) -> float:
            return SLACK + distance / (SLOWNESS * speed)

        self._longest = {
            State.APPROACH: way(config.approach.distance, approach_speed(config, goal.force)),
            State.TRACK: way(length, goal.speed) if length else LONGEST_TRACK,
            State.RETREAT: way(config.retreat.distance, speed)}
        self._spent = dict.fromkeys(self._longest, 0.0)
        self._last: float | None = None

    def count(self, state: State, now: float) -> None:
        """Add the time since the last call to a state; `now` is a steady time [s]."""
        state = _kind(state)
        if state in self._spent and self._last is not None:
            self._spent[state] += now - self._last
        self._last = now

    def longest(self, state: State) -> float:
        """Return the largest total time of a state that moves the robot [s]."""
        return self._longest[_kind(state)]

    def over(self, state: State) -> bool:
        """Return whether a state has exceeded this time."""
        return self._spent[_kind(state)] > self.longest(state)


def _kind(state: State) -> State:
    return State.TRACK if state in TRACKING else state
