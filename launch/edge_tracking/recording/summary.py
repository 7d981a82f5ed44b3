"""A recorded run in numbers: how well what was touched was tracked."""
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from edge_tracking.recording.run import RunData, Statuses
from tactile_common.errors import TactileError
from tactile_servo.reasons import ReasonCode
from tactile_servo.track_statistics import SETTLING_LENGTH
from tactile_servo.types import ON_TRACK, State
from tactile_shape.contour.outline import find_outline
from tactile_shape.types.patch import Kind
from tactile_simulation import metrics
from tactile_simulation.metrics import busy, judged, measure, NAN, percentile, rate
from tactile_simulation.world import Course, Scene, Truth


def settled_cycles(statuses: Statuses) -> tuple[np.ndarray, np.ndarray]:
    """Return which cycles track, and which of these come after the settling length: `(N,)`."""
    tracking = np.isin(statuses.state, ON_TRACK)
    settled = np.logical_or.accumulate(tracking & (statuses.progress >= SETTLING_LENGTH))
    return tracking, tracking & settled


def truth(run: RunData, scene: Scene) -> Truth:
    """Compare the recorded poses of the pad with the scene; time as of `run.seconds`."""
    poses, statuses, world = run.poses, run.statuses, scene.world()
    force, shift = np.empty(len(poses.stamp_ns)), np.zeros((len(poses.stamp_ns), 3))
    for index, pose in enumerate(poses.matrix):
        force[index], shift[index] = world.force(pose), world.shift  # it may slip
    # The cycle that was the newest when the pose was taken tells the state.
    newest = np.searchsorted(statuses.stamp_ns, poses.stamp_ns, side='right') - 1
    progress, tracking, settled = (
        np.append(values, values.dtype.type(0))[newest]  # -1, before the first cycle: the 0
        for values in (statuses.progress, *settled_cycles(statuses)))
    return world.truth(Course(
        run.seconds(poses.stamp_ns), poses.matrix, force, shift, progress, tracking, settled))


def latencies(run: RunData) -> tuple[np.ndarray, np.ndarray]:
    """
    Stamps of pictures [ns] and times from their last byte to the command that used it [s], (N,).

    From arrival at the driver, which is the stamp and the acquisition delay, to the first command
    that used it, as the servo measured it; of pictures that a status names, while it tracks.
    """
    statuses = run.statuses
    delay = run.info.acquisition_delay if run.info else 0.0
    tracking, _ = settled_cycles(statuses)
    stamps, first = np.unique(statuses.contact_stamp_ns, return_index=True)
    keep = (stamps > 0) & tracking[first] & np.isfinite(statuses.latency[first])
    stamps, first = stamps[keep], first[keep]
    return stamps, statuses.latency[first] - delay


def cycle_count(statuses: Statuses, active: np.ndarray) -> int:
    """Control cycles from the first to the last of some statuses; once there was one for each."""
    told = statuses.cycles[active]
    return int(np.ptp(told)) + 1 if told.size and np.isfinite(told).all() else len(active)


def cycle_rate(statuses: Statuses, active: np.ndarray) -> float:
    """Control cycles per second from the first to the last of some statuses [Hz]."""
    span = metrics.span(statuses.stamp_ns[active])
    return (cycle_count(statuses, active) - 1) / span if span > 0.0 else NAN


@lru_cache(maxsize=1)
def rebuilt_outline(run):
    """Outline of what was touched, of the recorded contour; None where there is too little."""
    try:
        return find_outline(run.contour)
    except TactileError:
        return None


@dataclass(frozen=True)
class Asked:
    """What a goal asked for, and how its action ended; what is None the recording says."""

    success: bool
    reason: str = ''  # that of the last control cycle if empty
    reason_code: int = ReasonCode.NONE
    speed: float | None = None  # m/s
    force: float | None = None  # N
    seed: int | None = None  # of the scene's noise


def is_of_servo(run: RunData) -> bool:
    """Whether a servo had a goal in a run."""
    return bool((run.statuses.state != State.IDLE).any())


def goal_was_met(run: RunData) -> bool:
    """Whether the servo says that it met its last goal."""
    codes = run.statuses.reason_code
    ends = codes[(codes >= ReasonCode.LENGTH_REACHED) & (codes < ReasonCode.BUSY)]
    ends = ends[(ends < ReasonCode.PAUSED) | (ends >= ReasonCode.CANCELLED)]  # without holds
    return bool(len(ends) and ends[-1] < ReasonCode.PAUSED)


def summarise(run: RunData, scene: Scene | None, real: Truth | None = None, **known
              ) -> dict[str, Any]:
    """
    Return the summary of a run, SI units, NaN = unknown.

    In a scene errors and forces are those of the scene at the recorded poses, `truth` if `real`
    is not given, not the sensor's own; `ok` only if the action succeeded and the scene does not
    object. Without one there are none.

    Parameters
    ----------
    run : RunData
    scene : Scene or None
    real : Truth, optional
    **known
        Fields of `Asked`.
    """
    asked, statuses = Asked(**known), run.statuses
    tracking, _ = settled_cycles(statuses)
    target = percentile(statuses.force_target[tracking]) if asked.force is None else asked.force
    action = 'track_surface' if len(run.touches.stamp_ns) else 'track_edge'
    felt, shape = SHAPES[scene.action if scene else action](run)
    told = of_servo(run, scene.name if scene else '', asked)
    told['too_busy'] = bool(busy(told))
    if scene is None:
        return {'ok': asked.success, **told, 'force_target': target, **shape}
    world, real = scene.world(), real or truth(run, scene)
    return judged({**told, **measure(real, target, run.joint_acceleration),
                   **world.numbers(real, felt, target), **shape}, asked.success, world)


def shape_of_edge(run: RunData) -> tuple[np.ndarray, dict[str, Any]]:
    """Vertices (N, 3) of the rebuilt outline [m], and what it consists of."""
    outline = rebuilt_outline(run)
    if outline is None:
        return np.zeros((0, 3)), {'closed': False, 'corners': [], 'sides': []}
    return outline.points, {
        'closed': outline.closed, 'corners': outline.corners.tolist(),
        'sides': [{'kind': side.kind, 'length': side.length, 'radius': side.radius}
                  for side in outline.sides]}


def shape_of_surface(run: RunData) -> tuple[np.ndarray, dict[str, Any]]:
    """
    Contacts (N, 3) [m], the kind of surface that most patches are, and its radius [m].

    A straight way over a sphere is as one round a cylinder: the curvature across it is not seen.
    """
    felt, kinds = run.touches.position, [patch.kind for patch in run.patches if patch.valid]
    if not kinds:
        return felt, {'surface_kind': Kind.NONE.name.lower(), 'surface_radius': NAN,
                      'surface_seen_across': False}
    kind = max(set(kinds), key=kinds.count)
    of_kind = [patch for patch in run.patches if patch.kind == kind]
    curvature = percentile([patch.curvature[0] for patch in of_kind if patch.seen[0]])
    round_ = kind in (Kind.CYLINDER, Kind.SPHERE) and curvature != 0.0
    return felt, {
        'surface_kind': kind.name.lower(), 'surface_radius': 1.0 / curvature if round_ else NAN,
        'surface_seen_across': bool(np.mean([patch.seen.all() for patch in of_kind]) > 0.5)}


# What was felt and what that is, by the action of a scene.
SHAPES = {'track_edge': shape_of_edge, 'track_surface': shape_of_surface}


def of_servo(run: RunData, scene: str, asked: Asked) -> dict[str, Any]:
    """Give the part of a summary that servo and sensor tell, whatever is tracked."""
    statuses, stamps = run.statuses, run.stamps['image']
    tracking, settled = settled_cycles(statuses)
    active = np.flatnonzero(statuses.state != State.IDLE)
    last = active[-1] if active.size else None
    _, latency = latencies(run)
    begin, end = statuses.stamp_ns[tracking][[0, -1]] if tracking.any() else (0, -1)
    return {
        'state': State(int(statuses.state[last])).name.lower() if active.size else 'idle',
        'reason': asked.reason or (
            statuses.reason[last] if active.size else 'the servo did not run'),
        'reason_code': ReasonCode(asked.reason_code).name.lower(),  # type: ignore[call-arg]
        'scene': scene,
        'law': str(statuses.controller[0]) if len(statuses.controller) else '',
        'seed': asked.seed,
        'speed': percentile(statuses.speed[settled]) if asked.speed is None else asked.speed,
        'tracked_length': statuses.progress[tracking].max(initial=0.0),
        'approach_recorded': bool(tracking.any() and stamps.size and stamps[0] < begin),
        'duration': metrics.span(statuses.stamp_ns[active]),
        'sensor_rate': rate(stamps[(stamps >= begin) & (stamps <= end)]),
        'control_rate': cycle_rate(statuses, active),
        'cycles': cycle_count(statuses, active),
        'missed_cycles': int(statuses.missed_cycles[last] - statuses.missed_cycles[active[0]])
        if active.size else 0,
        'latency_p50': percentile(latency, 50),
        'latency_p99': percentile(latency, 99),
        'cpu_per_cycle': statuses.cpu_time[tracking].mean() if tracking.any() else NAN,
    }
