"""Goals of the servo's actions from parameters, and texts of their feedback."""
from dataclasses import dataclass, field
import math
from typing import Any

from geometry_msgs.msg import Vector3

from tactile_common.config import bounded, documented, one_of
from tactile_msgs.action import TrackEdge, TrackSurface
from tactile_servo.conversions import ACTIONS
from tactile_servo.laws.surface_goal import LINE_LENGTH, Pattern, SurfaceGoal
from tactile_servo.supervisor import LONGEST_SILENCE
from tactile_servo.types import State

PATTERNS = {pattern.name.lower(): pattern for pattern in Pattern if pattern != Pattern.POINTS}


@dataclass(frozen=True)
class SurfaceWay:
    """Path over a surface."""

    pattern: str = one_of('line', 'way over the surface', PATTERNS)
    heading: float = bounded(
        0.5 * math.pi, 'of a line or of rows, from base x about base z', 'rad', -7.0, 7.0)
    duration: float = documented(0.0, 'time to track; 0 = no bound', 's')
    size: tuple[float, ...] = documented(
        (0.06, 0.06), 'of a raster along and across its rows; radius of a spiral', 'm')
    step_over: float = documented(0.006, 'between rows of a raster or turns of a spiral', 'm')
    features: str = documented('', 'name of taught features to keep')


@dataclass(frozen=True)
class TrackConfig:
    """Goal of the servo, and how long and how often its client tries."""

    action: str = one_of('track_edge', 'of the servo', ACTIONS)
    speed: float = documented(0.03, 'along the edge, over the surface', 'm/s')
    force: float = documented(5.0, 'normal force on the pad', 'N')
    direction: int = bounded(1, "+1 or -1 along the sensor's y, of an edge", '', -1, 1)
    length: float = documented(
        0.0, f'way to track; 0 = until the edge ends, {1e3 * LINE_LENGTH:g} mm of a line over a '
        'surface without a duration', 'm')
    closed: bool = documented(False, 'end when the contour closes on its start')
    retreat: bool = documented(True, 'lift off at the end')
    client_timeout: float = bounded(
        1.0, 'the servo ends the goal when its client is silent for so long; 0 = never', 's',
        0.0, LONGEST_SILENCE)
    surface: SurfaceWay = field(default_factory=SurfaceWay)
    wait: float = bounded(
        15.0, 'give up when sensor and servo are not ready within this time', 's', 0.1, 3600.0)
    resumes: int = bounded(
        0, 'how often a servo that holds, and could continue, is asked to; above 0 only for a '
        'robot that nobody is near', '', 0, 10000)
    record: str = documented('', 'new folder that everything is recorded into while the goal runs')


def goal_message(c: TrackConfig) -> TrackEdge.Goal | TrackSurface.Goal:
    """Return the goal message of the action in the configuration."""
    if c.action == 'track_edge':
        return TrackEdge.Goal(speed=c.speed, force=c.force, direction=c.direction,
                              length=c.length, closed=c.closed, retreat=c.retreat,
                              client_timeout=c.client_timeout)
    way = c.surface
    line = way.pattern == 'line' and not way.duration
    return TrackSurface.Goal(
        speed=c.speed, force=c.force, pattern=int(PATTERNS[way.pattern]),
        direction=Vector3(x=math.cos(way.heading), y=math.sin(way.heading)),
        length=c.length or (LINE_LENGTH if line else 0.0), duration=way.duration,
        size=[float(side) for side in way.size], step_over=way.step_over,
        features=way.features, retreat=c.retreat, client_timeout=c.client_timeout)


def way_length(pattern: str) -> float:
    """Return the length of a pattern of the default size [m], about."""
    way = SurfaceWay()
    if pattern == 'line':
        return LINE_LENGTH
    return SurfaceGoal(0.0, 0.0, pattern=PATTERNS[pattern], size=(way.size[0], way.size[1]),
                       step_over=way.step_over).way


def feedback_text(feedback: Any) -> str:
    """Return a text for a feedback message of either action."""
    text = [f'{1e3 * feedback.progress:.0f} mm']
    if feedback.state == State.HOLD:
        return f'{text[0]}, {feedback.reason}'
    if isinstance(feedback, TrackSurface.Feedback):
        name, place = 'contact', [feedback.contact_error.x, feedback.contact_error.y]
    else:
        name, place = 'lateral', [feedback.lateral_error]
    if all(map(math.isfinite, place)):  # NaN before the first contact
        text.append(f'{name} {", ".join(f"{1e3 * value:+.3f}" for value in place)} mm')
    if math.isfinite(feedback.normal_force):
        text.append(f'force {feedback.normal_force:.2f} N')
    return ', '.join(text)
