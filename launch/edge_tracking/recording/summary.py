"""A recorded run in numbers: how well the edge was tracked."""
from functools import lru_cache
from typing import Any

import numpy as np

from edge_tracking.recording.run import RunData, Statuses
from tactile_common.errors import TactileError
from tactile_servo.reasons import ReasonCode
from tactile_servo.track_statistics import SETTLING_LENGTH
from tactile_servo.types import ON_TRACK, State
from tactile_shape.contour.outline import find_outline
from tactile_simulation import metrics
from tactile_simulation.metrics import NAN, percentile, rate, Truth
from tactile_simulation.renderer import EdgeRenderer
from tactile_simulation.scene import Scene
from tactile_simulation.smoothness import speeds

# RMS of the pad's centre, once settled, up to which the edge counts as tracked: the object may
# slip further at once [m].
LATERAL_BOUND = 3e-3


def settled_cycles(statuses: Statuses) -> tuple[np.ndarray, np.ndarray]:
    """Return which cycles track, and which of these come after the settling length: `(N,)`."""
    tracking = np.isin(statuses.state, ON_TRACK)
    settled = np.logical_or.accumulate(tracking & (statuses.progress >= SETTLING_LENGTH))
    return tracking, tracking & settled


def truth(run: RunData, scene: Scene) -> Truth:
    """Compare the recorded poses of the pad with the scene; time as of `run.seconds`."""
    poses, statuses = run.poses, run.statuses
    array = run.images.array or (run.info.array if run.info else None)
    count = len(poses.stamp_ns)
    force, shift = np.full(count, NAN), np.zeros((count, 3))
    if array:
        renderer = EdgeRenderer(scene, array)
        for index, pose in enumerate(poses.matrix):
            force[index], shift[index] = renderer.force(pose), renderer.shift  # it may slip
    lateral, along = scene.edge.nearest(poses.position - shift) if count else (
        np.empty(0), np.empty(0))
    # The cycle that was the newest when the pose was taken tells the state.
    newest = np.searchsorted(statuses.stamp_ns, poses.stamp_ns, side='right') - 1
    progress, tracking, settled = (
        np.append(values, values.dtype.type(0))[newest]  # -1, before the first cycle: the 0
        for values in (statuses.progress, *settled_cycles(statuses)))
    settled &= scene.edge.beside(along)
    reach = array.half_width_y if array else 0.0
    whole_edge = (along >= reach) & (along <= scene.edge.length - reach)
    return Truth(run.seconds(poses.stamp_ns), lateral, along, force, progress, tracking, settled,
                 on_target=settled & whole_edge,
                 speed=speeds(1e-9 * poses.stamp_ns, poses.position))


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


def summarise(run: RunData, scene: Scene, *, success: bool, reason: str = '',
              reason_code: int = ReasonCode.NONE, speed: float | None = None,
              force: float | None = None, seed: int | None = None) -> dict[str, Any]:
    """
    Return the summary of a run along the edge of a scene, SI units, NaN = unknown.

    Lateral errors and forces are those of the scene at the recorded poses, not the sensor's own;
    `ok` only if the action succeeded and the pad's centre really was led along the edge.

    Parameters
    ----------
    success, reason, reason_code : bool, str, int
        Of the action; the reason is that of the last control cycle if empty.
    speed, force : float, optional
        What the goal asked for [m/s], [N]; else from the control cycles.
    seed : int, optional
        Of the scene's noise.
    """
    statuses, real = run.statuses, truth(run, scene)
    tracking, _ = settled_cycles(statuses)
    outline = rebuilt_outline(run)
    target = float(force) if force is not None else percentile(statuses.force_target[tracking])
    summary = {
        **of_servo(run, scene.name, reason, reason_code, speed, seed),
        **metrics.measure(metrics.Evidence(
            real, target, metrics.contour_errors(outline and outline.points, scene.edge),
            run.joint_acceleration)),
        'closed': outline is not None and outline.closed,
        'corners': outline.corners.tolist() if outline else [],
        'sides': [{'kind': side.kind, 'length': side.length, 'radius': side.radius}
                  for side in (outline.sides if outline else ())],
    }
    summary['ok'] = bool(
        success and summary['lateral_rms'] < LATERAL_BOUND  # NaN, never settled, fails as well
        and summary['edge_length'] > max(SETTLING_LENGTH, 0.9 * summary['tracked_length']))
    if success and not summary['ok']:
        summary['reason'] += '; but the pad was not led along the edge'
    return summary


def of_servo(run: RunData, scene: str, reason: str, reason_code: int, speed: float | None,
             seed: int | None) -> dict[str, Any]:
    """Give the part of a summary that servo and sensor tell, whatever is tracked."""
    statuses, stamps = run.statuses, run.images.stamp_ns
    tracking, settled = settled_cycles(statuses)
    active = np.flatnonzero(statuses.state != State.IDLE)
    last = active[-1] if active.size else None
    _, latency = latencies(run)
    begin, end = statuses.stamp_ns[tracking][[0, -1]] if tracking.any() else (0, -1)
    return {
        'ok': False,
        'state': State(int(statuses.state[last])).name.lower() if active.size else 'idle',
        'reason': reason or (statuses.reason[last] if active.size else 'the servo did not run'),
        'reason_code': ReasonCode(reason_code).name.lower(),  # type: ignore[call-arg]
        'scene': scene,
        'controller': str(statuses.controller[0]) if len(statuses.controller) else '',
        'seed': seed,
        'speed': float(speed) if speed is not None else percentile(statuses.speed[settled]),
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
