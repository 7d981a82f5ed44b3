"""What a run achieved against the truth of its scene, simulated or recorded, in numbers."""
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import groupby
import json
import math
from typing import Any, NamedTuple

import numpy as np

from tactile_servo.types import EdgeGoal, Status
from tactile_simulation.edge_path import EdgePath
from tactile_simulation.smoothness import scatter

NAN = float('nan')
SPACING = 0.25e-3  # m between the places at which outlines are compared
BUSY = 0.05  # of the planned control cycles; a machine that misses more has too little time


# Of samples; NaN where there are too few.

def span(stamps: np.ndarray) -> float:
    """Return the time between the first and the last stamp [ns], in seconds."""
    return 1e-9 * float(stamps[-1] - stamps[0]) if len(stamps) > 1 else NAN


def rate(stamps: np.ndarray) -> float:
    """Return the mean rate of stamps [ns], in Hz."""
    duration = span(stamps)
    return (len(stamps) - 1) / duration if duration > 0.0 else NAN


def rms(values: np.ndarray) -> float:
    """Return the root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else NAN


def largest(values: np.ndarray) -> float:
    """Return the largest finite magnitude."""
    values = np.abs(values[np.isfinite(values)])
    return float(values.max()) if len(values) else NAN


def roughest(accelerations: np.ndarray) -> float:
    """Return the RMS of the joint of which it is largest, of (K, n)."""
    return (largest(np.sqrt(np.nanmean(accelerations**2, axis=0))) if accelerations.size
            else NAN)


def percentile(values: Sequence[float] | np.ndarray, percent: float = 50.0) -> float:
    """Return a percentile, the median unless told."""
    return float(np.percentile(values, percent)) if len(values) else NAN


class Truth(NamedTuple):
    """Where the pad really was, at each pose of a run; arrays `(N,)`."""

    time: np.ndarray  # s
    lateral: np.ndarray  # of the edge, to its left [m]
    along: np.ndarray  # arc length of the nearest point of the edge [m]
    force: np.ndarray  # on the pad [N]
    progress: np.ndarray  # that the servo had claimed [m]
    tracking: np.ndarray  # whether the servo followed the edge
    settled: np.ndarray  # of it from `SETTLING_LENGTH` after first contact to the edge's end
    on_target: np.ndarray  # where the force can be and is held against its target
    speed: np.ndarray  # of the pad [m/s]; NaN if unknown


def mean_speed(real: Truth) -> float:
    """Return the mean speed along the edge while it is followed [m/s]."""
    time, way = real.time[real.tracking], real.progress[real.tracking]
    return float(np.ptp(way) / np.ptp(time)) if len(time) > 1 and np.ptp(time) > 0.0 else NAN


def _extent(values):
    return float(np.ptp(values)) if len(values) else NAN


class OutlineError(NamedTuple):
    """How far a rebuilt outline is from the true edge."""

    largest: float = NAN  # m
    area: float = NAN  # relative; of a closed edge


class Evidence(NamedTuple):
    """What the errors of a run are computed from."""

    truth: Truth
    force_target: float  # N
    outline: OutlineError
    # (K, n), of what moves the joints: commands of the controller, or what was measured [rad/s^2]
    acceleration: np.ndarray = np.empty((0, 0))


class Metric(NamedTuple):
    """A number of a summary: how it is named, shown and, from the evidence, computed."""

    key: str
    name: str
    unit: str = ''
    factor: float = 1.0  # from SI to the unit
    decimals: int = 1
    compute: Callable[[Evidence], float] | None = None  # else known to whoever ran the servo


METRICS = (
    Metric('tracked_length', 'tracked length', 'mm', 1e3),
    Metric('edge_length', 'of the true edge', 'mm', 1e3, 1,
           lambda e: _extent(e.truth.along[e.truth.tracking])),
    Metric('lateral_rms', 'lateral error, RMS', 'mm', 1e3, 3,
           lambda e: rms(e.truth.lateral[e.truth.settled])),
    Metric('lateral_max', 'lateral error, largest', 'mm', 1e3, 3,
           lambda e: largest(e.truth.lateral[e.truth.settled])),
    Metric('lateral_transient_max', 'largest before settling', 'mm', 1e3, 3,
           lambda e: largest(e.truth.lateral[e.truth.tracking & ~e.truth.settled])),
    Metric('surface_rms', 'surface felt, error RMS', 'mm', 1e3, 3),
    Metric('surface_max', 'largest', 'mm', 1e3, 3),
    Metric('surface_radius', 'its radius', 'mm', 1e3, 2),
    Metric('centre_rms', "contact from the pad's centre", 'mm', 1e3, 3),
    Metric('centre_max', 'farthest', 'mm', 1e3, 3),
    Metric('contact_kept', 'contact kept', '%', 100.0, 2),
    Metric('force_target', 'force wanted', 'N', 1.0, 2, lambda e: e.force_target),
    Metric('force_rms_error', 'force error, RMS', 'N', 1.0, 3,
           lambda e: rms(e.truth.force[e.truth.on_target] - e.force_target)),
    Metric('force_max', 'force, largest', 'N', 1.0, 2, lambda e: largest(e.truth.force)),
    Metric('joint_acceleration_max', 'joint acceleration, largest', 'rad/s^2', 1.0, 1,
           lambda e: largest(e.acceleration)),
    Metric('joint_acceleration_rms', 'RMS of the roughest joint', 'rad/s^2', 1.0, 2,
           lambda e: roughest(e.acceleration)),
    Metric('pad_speed_scatter', "scatter of the pad's speed", 'mm/s', 1e3, 2,
           lambda e: scatter(e.truth.time, e.truth.speed, e.truth.settled)),
    Metric('contour_max_error', 'rebuilt outline within', 'mm', 1e3, 3,
           lambda e: e.outline.largest),
    Metric('contour_area_error', 'area of the outline off by', '%', 100.0, 3,
           lambda e: e.outline.area),
    Metric('speed', 'speed asked for', 'mm/s', 1e3),
    Metric('speed_mean', 'speed, mean', 'mm/s', 1e3, 1, lambda e: mean_speed(e.truth)),
    Metric('duration', 'duration', 's', 1.0, 2),
    Metric('real_time_factor', 'faster than real time', 'times'),
    Metric('sensor_rate', 'sensor rate', 'Hz'),
    Metric('control_rate', 'control rate', 'Hz'),
    Metric('cycles', 'control cycles', '', 1.0, 0),
    Metric('missed_cycles', 'missed beside these', '', 1.0, 0),
    Metric('latency_p50', 'last byte to command, median', 'ms', 1e3, 2),
    Metric('latency_p99', 'last byte to command, 99 %', 'ms', 1e3, 2),
    Metric('cpu_per_cycle', 'processor time per control cycle', 'ms', 1e3, 3),
)


def measure(evidence: Evidence) -> dict[str, float]:
    """Return the numbers of `METRICS` that follow from the evidence, SI units."""
    return {row.key: row.compute(evidence) for row in METRICS if row.compute}


def contour_errors(contour: np.ndarray | None, edge: EdgePath) -> OutlineError:
    """
    Compare a rebuilt contour `(N, 3)` [m] with the true edge, seen from above.

    The largest distance is that of either from the other; of an open edge, of the contour from
    the edge. NaN without a contour.
    """
    if contour is None or len(contour) < 2:
        return OutlineError()
    if edge.closed:
        contour = np.vstack([contour, contour[:1]])
    contour = contour[np.concatenate([[True], (np.diff(contour, axis=0) != 0.0).any(axis=1)])]
    lateral, _ = edge.nearest(_resampled(contour))
    error = largest(lateral)
    if not edge.closed:
        return OutlineError(error)
    lateral, _ = EdgePath(contour).nearest(_resampled(edge.points))
    return OutlineError(max(error, largest(lateral)),
                        area_of(contour) / area_of(edge.points) - 1.0)


def area_of(points: np.ndarray) -> float:
    """Area of a closed polyline (N, >= 2) seen from above [m^2]."""
    x, y = (points[:, :2] - points[0, :2]).T
    return abs(0.5 * float(x[:-1] @ y[1:] - x[1:] @ y[:-1]))


def _resampled(points):
    path = EdgePath(points)
    s = np.linspace(0.0, path.length, math.ceil(path.length / SPACING) + 1)
    return path.point_at(np.union1d(s, path.arclength))


def summarise(simulation, goal: EdgeGoal, status: Status, *, name: str, tracker: str,
              seed: int, elapsed: float = NAN) -> dict[str, Any]:
    """
    Summary of a simulation after its run, with the keys and SI units of every command.

    `status` is its last, `elapsed` the real time that it took [s].
    """
    truth = simulation.truth()
    duration, result = float(np.ptp(truth.time)), simulation.servo.result()
    settled, outline = truth.lateral[truth.settled], simulation.outline()
    return {
        'ok': bool(simulation.servo.success), **_state(status), 'scene': name,
        'controller': tracker, 'seed': seed, 'speed': goal.speed,
        'tracked_length': simulation.servo.statistics.tracked_length,
        **measure(Evidence(
            truth, goal.force,
            contour_errors(outline and outline.points, simulation.scene.edge),
            simulation.accelerations())),
        'lateral_steady': rms(settled[len(settled) // 2:]),
        'closed': result.closed, 'duration': duration,
        'real_time_factor': duration / elapsed, 'sensor_rate': simulation.sensor_rate,
        'control_rate': simulation.control_rate, 'latency_p50': simulation.latency,
        'latency_p99': simulation.latency,
        'cpu_per_cycle': percentile(simulation.cycle_costs),
        'cpu_per_picture': percentile(simulation.picture_costs),
        'states': state_history(simulation)}


def _state(status):
    return {'state': status.state.name.lower(), 'reason': status.reason.text,
            'reason_code': status.reason.code.name.lower()}


def state_history(simulation) -> list[dict[str, Any]]:
    """Every state that was entered: time [s], state and reason."""
    entered = groupby(simulation.log, key=lambda cycle: cycle.status.state)
    return [{'time': first.time, **_state(first.status)} for _, (first, *_) in entered]


def shown(summary: Mapping[str, Any], metrics=METRICS) -> Iterator[tuple[str, str, str]]:
    """Give name, value and unit of every number that a summary has and knows."""
    for row in metrics:
        value = summary.get(row.key)
        if value is not None and math.isfinite(value):
            yield row.name, f'{row.factor * value:.{row.decimals}f}', row.unit


def busy(summary: Mapping[str, Any]) -> str:
    """Sentence about a machine that had too little time for a run; empty if it had enough."""
    missed = summary.get('missed_cycles') or 0
    planned = missed + (summary.get('cycles') or 0)
    if missed <= BUSY * planned:
        return ''
    return (f'This machine was too busy: {missed} of {planned} control cycles were missed and '
            f'{summary.get("sensor_rate", NAN):.0f} pictures per second arrived; '
            'on an idle one the same run is smoother and faster.')


def describe(summary: Mapping[str, Any]) -> str:
    """Text of the summary of a run for the terminal."""
    lines = [f'{summary["scene"]} with {summary["controller"]}, '
             f'{"tracked" if summary["ok"] else "NOT TRACKED"}: {summary["reason"]}']
    lines += [f'  {name:26}{value:>10} {unit}'.rstrip() for name, value, unit in shown(summary)]
    for number, side in enumerate(summary.get('sides', ()), 1):
        radius = '' if side['kind'] == 'line' else f', radius {1e3 * side["radius"]:.2f} mm'
        lines.append(f'  side {number}: {side["kind"]} of {1e3 * side["length"]:.2f} mm{radius}')
    for number, corner in enumerate(summary.get('corners', ()), 1):
        place = ', '.join(f'{1e3 * value:.2f}' for value in corner)
        lines.append(f'  corner {number} at ({place}) mm')
    lines += filter(None, [busy(summary)])
    lines += [f'{entry["time"]:8.3f} s  {entry["state"]}: {entry["reason"]}'
              for entry in summary.get('states', ())]
    return '\n'.join(lines)


def to_json(summary: Mapping[str, Any]) -> str:
    """Return a summary as one line of JSON; NaN and infinity become null."""
    return json.dumps(_jsonable(summary), allow_nan=False)


def _jsonable(value):
    if isinstance(value, Mapping):
        return {str(key): _jsonable(item) for key, item in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [_jsonable(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value
