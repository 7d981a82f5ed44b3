"""Summary of a recorded run: how well an edge or surface was tracked, or what a sensor felt."""
from collections.abc import Mapping
from functools import lru_cache
from itertools import pairwise
import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from edge_tracking.recording.run import CONTACTS, read_run, RunData
from tactile_common.errors import ConfigurationError, TactileError
from tactile_common.ros.conversions import name_in
from tactile_sensing.image import image_moments
from tactile_sensing.types.contact import ContactType
from tactile_servo.reasons import ReasonCode
from tactile_servo.track_statistics import SETTLING_LENGTH
from tactile_servo.types import ON_TRACK, State
from tactile_shape.contour.outline import find_outline, Outline
from tactile_shape.types.patch import Kind
from tactile_simulation.metrics import busy, judged, measure, NAN, percentile, rate, span
from tactile_simulation.world import Course, Scene


class Shown(NamedTuple):
    """A recording with its summary, and scene and truth if they are known."""

    name: str
    run: RunData
    summary: dict[str, Any]
    scene: Any = None  # Scene
    real: Any = None  # Course


def read(path: str | Path, scene: Scene | None = None, namespace: str | None = None) -> Shown:
    """Read and summarise a recording; ConfigurationError if it contains nothing to show."""
    run = read_run(path, namespace, joints=scene is not None)
    if not any(len(table.stamp_ns) for table in (
            run.images, run.contacts, run.statuses, run.poses)):
        raise ConfigurationError(f'bag {path}: holds neither images nor contacts, states or '
                                 f'poses of a sensor in {run.namespace}')
    real = truth(run, scene) if scene else None
    name = '/'.join(Path(path).resolve().parts[-2:])
    return Shown(name, run, summarise(run, scene, real), scene, real)


class Stage(NamedTuple):
    """A time during which the servo's state and reason did not change."""

    begin: int  # stamps [ns]
    end: int
    state: int
    reason: str


def stages(run: RunData) -> list[Stage]:
    """Return the states and reasons of the servo in sequence."""
    stamps, state, reason = run.statuses.stamp_ns, run.statuses.state, run.statuses.reason
    if not len(stamps):
        return []
    changed = 1 + np.flatnonzero((state[1:] != state[:-1]) | (reason[1:] != reason[:-1]))
    return [Stage(int(stamps[first]), int(stamps[min(after, len(stamps) - 1)]),
                  int(state[first]), str(reason[first]))
            for first, after in pairwise([0, *changed, len(stamps)])]


def settled_cycles(statuses: np.recarray) -> tuple[np.ndarray, np.ndarray]:
    """Return which cycles track, and which of these come after the settling length: `(N,)`."""
    tracking = np.isin(statuses.state, ON_TRACK)
    return tracking, tracking & (statuses.progress >= SETTLING_LENGTH)


def newest(known: np.ndarray, stamps: np.ndarray) -> np.ndarray:
    """Return the index of the newest known stamp at each stamp, -1 before the first."""
    return np.searchsorted(known, stamps, side='right') - 1


def held(known: np.ndarray, values: np.ndarray, stamps: np.ndarray, before: float) -> np.ndarray:
    """Return the newest values at stamps, and another value before the first."""
    first = np.full((1, *values.shape[1:]), before, values.dtype)
    return np.concatenate([values, first])[newest(known, stamps)]


def truth(run: RunData, scene: Scene) -> Course:
    """Compare the recorded poses of the pad with the scene; time as in `run.seconds`."""
    poses, statuses, world = run.poses, run.statuses, scene.world()
    force, shift = np.empty(len(poses.stamp_ns)), np.zeros((len(poses.stamp_ns), 3))
    for index, pose in enumerate(poses.matrix):
        force[index], shift[index] = world.force(pose), world.shift  # it may slip
    progress, tracking, settled = (
        held(statuses.stamp_ns, values, poses.stamp_ns, 0)
        for values in (statuses.progress, *settled_cycles(statuses)))
    return scene.truth(Course(
        run.seconds(poses.stamp_ns), poses.matrix, force, shift, progress, tracking, settled))


def latencies(run: RunData) -> np.ndarray:
    """
    Return the latencies of images [s], (N,).

    The latency begins when the last byte arrives at the driver, which is the stamp plus the
    acquisition delay. It ends with the first command that used the image, as measured by the
    servo. Only images that a status names while the servo tracks are included.
    """
    statuses = run.statuses
    delay = run.info.acquisition_delay if run.info else 0.0
    tracking, _ = settled_cycles(statuses)
    stamps, first = np.unique(statuses.contact_stamp_ns, return_index=True)
    keep = (stamps > 0) & tracking[first] & np.isfinite(statuses.latency[first])
    return statuses.latency[first[keep]] - delay


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
    goal and the scene's limits are kept. Without a scene there are no errors and forces; without
    a servo, too, the summary is that of `summarise_recording`.
    """
    if not (scene or is_of_servo(run)):
        return summarise_recording(run)
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
    felt = run.touches.matrix[:, :3, 3]
    kinds = [patch.kind for patch in run.patches if patch.valid]
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
    duration = span(statuses.stamp_ns[active])
    cycles = int(np.ptp(statuses.cycles[active])) + 1 if active.size else 0
    latency = latencies(run)
    begin, end = statuses.stamp_ns[tracking][[0, -1]] if tracking.any() else (0, -1)
    last = {'state': 'idle', 'reason': 'the servo did not run', 'reason_code': 'none',
            'missed_cycles': 0}
    if active.size:
        final = active[-1]
        last = {'state': name_in(State, statuses.state[final]), 'reason': statuses.reason[final],
                'reason_code': name_in(ReasonCode, statuses.reason_code[final]),
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


def loads_of(run: RunData) -> np.recarray:
    """Return the contacts or, if these are without moments, a contact of them for each image."""
    if np.isfinite(run.contacts.m0).any():
        return run.contacts
    images, array = run.images, run.images.array  # None without images
    moments = [image_moments(frame, array) for frame in images.frames] if array else []
    found = np.zeros(len(moments), CONTACTS.dtype).view(np.recarray)
    found.stamp_ns, found.type = images.stamp_ns, ContactType.OTHER
    for row, it in zip(found, moments, strict=True):
        row.m0, row.centre_of_pressure = it.m0, it.centre_of_pressure
    return found


def force_unit(run: RunData) -> str:
    """Return the unit of the zeroth moments: N only for a calibrated sensor."""
    return 'N' if run.images.unit in ('Pa', '') else f'{run.images.unit} m^2'


def shown_unit(unit: str) -> tuple[float, str]:
    """Return factor and unit to show forces of a unit: N, or counts mm^2."""
    return (1.0, 'N') if unit == 'N' else (1e6, unit.replace('m^2', 'mm\u00b2'))


def lost_images(run: RunData) -> int:
    """Return the number of missing images, from their sequence numbers."""
    steps = np.diff(run.images.sequence)
    return int((steps[steps > 0] - run.every.get('image', 1)).sum())


def summarise_recording(run: RunData) -> dict[str, Any]:
    """
    Return the summary of a recording in SI units.

    Forces are in `force_unit`, which is N only for a calibrated sensor.
    """
    series, images, stamps = loads_of(run), run.images, run.stamps['image']
    force, centre = NAN, [NAN, NAN]
    if np.isfinite(series.m0).any():
        strongest = int(np.nanargmax(series.m0))
        force, centre = series.m0[strongest], series.centre_of_pressure[strongest].tolist()
    return {
        'ok': bool(len(images.stamp_ns) and len(series)),
        'reason': '' if len(images.stamp_ns) else 'no pictures arrived',
        'sensor': run.info.sensor if run.info else '',
        'rows': images.frames.shape[1], 'columns': images.frames.shape[2],
        'force_unit': force_unit(run), 'force_max': force, 'force_max_centre': centre,
        'duration': span(stamps), 'frames': len(stamps), 'lost_frames': lost_images(run),
        'sensor_rate': rate(stamps),
        'contact_types': {kind.name.lower(): int(np.count_nonzero(series.type == kind))
                          for kind in ContactType},
        'latency_p50': percentile(run.contacts.latency, 50),
        'latency_p99': percentile(run.contacts.latency, 99),
    }


def describe_recording(summary: Mapping[str, Any]) -> str:
    """Return the summary of a recording as text."""
    text = f'{summary["frames"]} pictures of {summary["rows"]} x {summary["columns"]}'
    if math.isfinite(summary['sensor_rate']):
        text += f' at {summary["sensor_rate"]:.1f} Hz'
    text += f', {summary["lost_frames"]} lost; contacts: '
    text += ', '.join(f'{count} {name}' for name, count in summary['contact_types'].items()
                      if count) or 'none'
    (factor, unit), (x, y) = shown_unit(summary['force_unit']), summary['force_max_centre']
    if not math.isfinite(x + y):  # no force, or an unknown one
        return text
    return (f'{text}; largest force {factor * summary["force_max"]:.4g} {unit} at '
            f'({1e3 * x:+.2f}, {1e3 * y:+.2f}) mm')
