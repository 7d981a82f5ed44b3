"""Summary of a recorded run: how well an edge or surface was tracked."""
from functools import lru_cache
from typing import Any

import numpy as np

from edge_tracking.recording.run import RunData, Statuses
from tactile_common.errors import TactileError
from tactile_servo.reasons import ReasonCode
from tactile_servo.track_statistics import SETTLING_LENGTH
from tactile_servo.types import ON_TRACK, State
from tactile_shape.contour.outline import find_outline, Outline
from tactile_shape.types.patch import Kind
from tactile_simulation import metrics
from tactile_simulation.metrics import busy, judged, measure, NAN, percentile, rate
from tactile_simulation.world import Course, Scene


def settled_cycles(statuses: Statuses) -> tuple[np.ndarray, np.ndarray]:
    """Return which cycles track, and which of these come after the settling length: `(N,)`."""
    tracking = np.isin(statuses.state, ON_TRACK)
    return tracking, tracking & (statuses.progress >= SETTLING_LENGTH)


def truth(run: RunData, scene: Scene) -> Course:
    """Compare the recorded poses of the pad with the scene; time as in `run.seconds`."""
    poses, statuses, world = run.poses, run.statuses, scene.world()
    force, shift = np.empty(len(poses.stamp_ns)), np.zeros((len(poses.stamp_ns), 3))
    for index, pose in enumerate(poses.matrix):
        force[index], shift[index] = world.force(pose), world.shift  # it may slip
    # The state at a pose is that of the newest cycle at its stamp.
    newest = np.searchsorted(statuses.stamp_ns, poses.stamp_ns, side='right') - 1
    progress, tracking, settled = (
        np.append(values, values.dtype.type(0))[newest]  # -1, before the first cycle, gives 0
        for values in (statuses.progress, *settled_cycles(statuses)))
    return scene.truth(Course(
        run.seconds(poses.stamp_ns), poses.matrix, force, shift, progress, tracking, settled))


def latencies(run: RunData) -> tuple[np.ndarray, np.ndarray]:
    """
    Return stamps of images [ns] and their latencies [s], (N,) each.

    The latency begins when the last byte arrives at the driver, which is the stamp plus the
    acquisition delay. It ends with the first command that used the image, as measured by the
    servo. Only images that a status names while the servo tracks are included.
    """
    statuses = run.statuses
    delay = run.info.acquisition_delay if run.info else 0.0
    tracking, _ = settled_cycles(statuses)
    stamps, first = np.unique(statuses.contact_stamp_ns, return_index=True)
    keep = (stamps > 0) & tracking[first] & np.isfinite(statuses.latency[first])
    stamps, first = stamps[keep], first[keep]
    return stamps, statuses.latency[first] - delay


@lru_cache(maxsize=1)
def rebuilt_outline(run: RunData) -> Outline | None:
    """Return the outline of the recorded contour; None if there are too few points."""
    try:
        return find_outline(run.contour)
    except TactileError:
        return None


def is_of_servo(run: RunData) -> bool:
    """Return True if a servo had a goal in a run."""
    return bool((run.statuses.state != State.IDLE).any())


def goal_was_met(run: RunData) -> bool:
    """Return True if the servo reported that it met its last goal."""
    codes = run.statuses.reason_code
    ends = codes[(codes >= ReasonCode.LENGTH_REACHED) & (codes < ReasonCode.BUSY)]
    ends = ends[(ends < ReasonCode.PAUSED) | (ends >= ReasonCode.CANCELLED)]  # without holds
    return bool(len(ends) and ends[-1] < ReasonCode.PAUSED)


def summarise(run: RunData, scene: Scene | None = None, real: Course | None = None
              ) -> dict[str, Any]:
    """
    Return the summary of a run in SI units; NaN means unknown.

    In a scene, errors and forces are those of the scene at the recorded poses, not the sensor's;
    they come from `real`, or from `truth` if it is missing. `ok` is True only if the servo met its
    goal and the scene's limits are kept. Without a scene there are no errors and forces.
    """
    statuses, met = run.statuses, goal_was_met(run)
    tracking, _ = settled_cycles(statuses)
    target = percentile(statuses.force_target[tracking])
    felt_surface = len(run.touches.stamp_ns) > 0
    action = scene.action if scene else 'track_surface' if felt_surface else 'track_edge'
    shape_of = shape_of_surface if action == 'track_surface' else shape_of_edge
    felt, shape = shape_of(run)
    common = of_servo(run, scene.name if scene else '')
    common['too_busy'] = bool(busy(common))
    if scene is None:
        return {'ok': met, **common, 'force_target': target, **shape}
    real = real or truth(run, scene)
    return judged({**common, **measure(real, target, run.joint_acceleration),
                   **scene.numbers(real, felt, target), **shape}, met, scene)


def shape_of_edge(run: RunData) -> tuple[np.ndarray, dict[str, Any]]:
    """Return the vertices (N, 3) of the rebuilt outline [m] and a description of its parts."""
    outline = rebuilt_outline(run)
    if outline is None:
        return np.zeros((0, 3)), {'closed': False, 'corners': [], 'sides': []}
    return outline.points, {
        'closed': outline.closed, 'corners': outline.corners.tolist(),
        'sides': [{'kind': side.kind, 'length': side.length, 'radius': side.radius}
                  for side in outline.sides]}


def shape_of_surface(run: RunData) -> tuple[np.ndarray, dict[str, Any]]:
    """
    Return contacts (N, 3) [m], and the most frequent kind of patch with its radius [m].

    A straight path over a sphere looks the same as one around a cylinder: it does not show the
    curvature across the path.
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


def of_servo(run: RunData, scene: str) -> dict[str, Any]:
    """Return the part of a summary that comes from servo and sensor, for any action."""
    statuses, stamps = run.statuses, run.stamps['image']
    tracking, settled = settled_cycles(statuses)
    active = np.flatnonzero(statuses.state != State.IDLE)
    duration = metrics.span(statuses.stamp_ns[active])
    cycles = int(np.ptp(statuses.cycles[active])) + 1 if active.size else 0
    _, latency = latencies(run)
    begin, end = statuses.stamp_ns[tracking][[0, -1]] if tracking.any() else (0, -1)
    last = {'state': 'idle', 'reason': 'the servo did not run', 'reason_code': 'none',
            'missed_cycles': 0}
    if active.size:
        code = statuses.reason_code[active[-1]]
        last = {'state': State(int(statuses.state[active[-1]])).name.lower(),
                'reason': statuses.reason[active[-1]],
                'reason_code': next(
                    (it.name.lower() for it in ReasonCode if it == code), str(code)),
                'missed_cycles': int(np.ptp(statuses.missed_cycles[active[[0, -1]]]))}
    return {
        **last,
        'scene': scene,
        'law': str(statuses.controller[0]) if len(statuses.controller) else '',
        'seed': run.parameters.get('mock_sensor', {}).get('seed'),
        'speed': run.goals[-1].get('speed', NAN) if run.goals else percentile(
            statuses.speed[settled]),
        'tracked_length': statuses.progress[tracking].max(initial=0.0),
        'approach_recorded': bool(tracking.any() and stamps.size and stamps[0] < begin),
        'duration': duration,
        'sensor_rate': rate(stamps[(stamps >= begin) & (stamps <= end)]),
        'control_rate': (cycles - 1) / duration if duration > 0.0 else NAN,
        'cycles': cycles,
        'latency_p50': percentile(latency, 50),
        'latency_p99': percentile(latency, 99),
        'cpu_per_cycle': statuses.cpu_time[tracking].mean() if tracking.any() else NAN,
    }
