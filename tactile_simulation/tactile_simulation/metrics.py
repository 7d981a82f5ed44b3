"""Metrics of a run, simulated or recorded, compared with the truth of its scene."""
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
import math
from typing import Any

import numpy as np

from tactile_servo.laws.surface_following import OVERFORCE
from tactile_simulation.world import Course, Scene

NAN = float('nan')
TREND = 0.1  # s over which a speed is averaged; the departure from this mean is scatter
BUSY = 0.05  # share of the planned control cycles; a machine that misses more is too busy


# Statistics of samples; NaN if there are too few.

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
    values = np.abs(values)
    values = values[np.isfinite(values)]
    return float(values.max()) if len(values) else NAN


def percentile(values: Sequence[float] | np.ndarray, percent: float = 50.0) -> float:
    """Return a percentile; by default the median."""
    return float(np.percentile(values, percent)) if len(values) else NAN


def speeds(time: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """
    Return the speed [m/s] since the previous sample, (N,); NaN if unknown.

    `time` (N,) is in s, `positions` (N, 3) in m.
    """
    spans = np.diff(time, prepend=np.nan)
    return np.linalg.norm(np.diff(positions, axis=0, prepend=np.nan), axis=1) / np.where(
        spans > 0.0, spans, np.nan)


def accelerations(time: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """Return the second difference (N - 2, n) [1/s^2] of positions (N, n) at N times [s]."""
    steps = np.diff(time)[:, None]
    velocities = np.diff(positions, axis=0) / np.where(steps > 0.0, steps, np.nan)
    return np.diff(velocities, axis=0) / (0.5 * (steps[1:] + steps[:-1]))


def scatter(time: np.ndarray, speed: np.ndarray, chosen: np.ndarray) -> float:
    """
    Return the standard deviation [m/s] of a speed (N,) about its mean over `TREND`.

    Only windows in which all samples are `chosen` and finite count.
    """
    known = chosen & np.isfinite(speed)
    if np.count_nonzero(known) < 3:
        return NAN
    half = max(1, round(0.5 * TREND / float(np.median(np.diff(time[known])))))
    window = np.ones(2 * half + 1)
    whole = np.convolve(known, window, 'same') > 2 * half + 0.5
    trend = np.convolve(np.where(known, speed, 0.0), window, 'same') / len(window)
    return float(np.std((speed - trend)[whole])) if whole.any() else NAN


@dataclass(frozen=True)
class Metric:
    """A number of a summary with its name and format."""

    key: str
    name: str
    unit: str = ''
    factor: float = 1.0  # from SI to the unit
    decimals: int = 1


METRICS = (
    Metric('tracked_length', 'tracked length', 'mm', 1e3),
    Metric('edge_length', 'of the true edge', 'mm', 1e3, 1),
    Metric('lateral_rms', 'lateral error, RMS', 'mm', 1e3, 3),
    Metric('lateral_max', 'lateral error, largest', 'mm', 1e3, 3),
    Metric('lateral_transient_max', 'largest before settling', 'mm', 1e3, 3),
    Metric('surface_rms', 'surface felt, error RMS', 'mm', 1e3, 3),
    Metric('surface_max', 'largest', 'mm', 1e3, 3),
    Metric('surface_radius', 'its radius', 'mm', 1e3, 2),
    Metric('centre_rms', "contact from the pad's centre", 'mm', 1e3, 3),
    Metric('centre_max', 'farthest', 'mm', 1e3, 3),
    Metric('contact_kept', 'contact kept', '%', 100.0, 2),
    Metric('force_target', 'force wanted', 'N', 1.0, 2),
    Metric('force_rms_error', 'force error, RMS', 'N', 1.0, 3),
    Metric('force_max', 'force, largest', 'N', 1.0, 2),
    Metric('joint_acceleration_max', 'joint acceleration, largest', 'rad/s^2', 1.0, 1),
    Metric('joint_acceleration_rms', 'RMS of the roughest joint', 'rad/s^2', 1.0, 2),
    Metric('pad_speed_scatter', "scatter of the pad's speed", 'mm/s', 1e3, 2),
    Metric('contour_max_error', 'rebuilt outline within', 'mm', 1e3, 3),
    Metric('contour_area_error', 'area of the outline off by', '%', 100.0, 3),
    Metric('speed', 'speed asked for', 'mm/s', 1e3),
    Metric('speed_mean', 'speed, mean', 'mm/s', 1e3, 1),
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


def measure(truth: Course, force: float, acceleration: np.ndarray) -> dict[str, Any]:
    """
    Return the metrics of a run that apply to edges and surfaces, in SI units.

    `force` is the target [N]; `acceleration` (K, n) are joint accelerations, of the commands or as
    measured [rad/s^2].
    """
    way, held = truth.progress[truth.tracking], truth.force[truth.on_target]
    lasted = float(np.ptp(truth.time[truth.tracking])) if len(way) else 0.0
    hard = truth.force[truth.tracking] > OVERFORCE * force
    relieved = ~np.minimum.accumulate(hard)  # after what was pressed already at the start
    return {
        'force_target': force, 'force_mean': float(np.mean(held)) if len(held) else NAN,
        'force_rms_error': rms(held - force), 'force_max': largest(truth.force),
        'overforce': bool((hard & relieved).any()),
        'joint_acceleration_max': largest(acceleration),
        'joint_acceleration_rms': largest(np.array(
            [rms(joint[np.isfinite(joint)]) for joint in acceleration.T])),
        'pad_speed_scatter': scatter(
            truth.time, speeds(truth.time, truth.poses[:, :3, 3]), truth.settled),
        'speed_mean': float(np.ptp(way)) / lasted if lasted > 0.0 else NAN}


def judged(numbers: dict[str, Any], success: bool, scene: Scene) -> dict[str, Any]:
    """Return a summary with `ok` and reason, which also consider the truth of the scene."""
    overforce = (f'the true force rose above {OVERFORCE:g} times the wanted one'
                 if numbers['overforce'] else '')
    objection = (scene.objection(numbers) or overforce) if success else ''
    reason = '; but '.join(filter(None, (numbers['reason'], objection)))
    return {'ok': success and not objection, **numbers, 'reason': reason}


def shown(summary: Mapping[str, Any]) -> Iterator[tuple[str, str, str]]:
    """Yield name, value and unit of every number that a summary contains and that is finite."""
    for row in METRICS:
        value = summary.get(row.key)
        if value is not None and math.isfinite(value):
            yield row.name, f'{row.factor * value:.{row.decimals}f}', row.unit


def busy(summary: Mapping[str, Any]) -> str:
    """Return a sentence if a machine missed too many control cycles, else ''."""
    missed = summary.get('missed_cycles') or 0
    planned = missed + (summary.get('cycles') or 0)
    if missed <= BUSY * planned:
        return ''
    return (f'This machine was too busy: {missed} of {planned} control cycles were missed and '
            f'{summary.get("sensor_rate", NAN):.0f} images per second arrived; '
            'on an idle one the same run is smoother and faster.')


def describe(summary: Mapping[str, Any]) -> str:
    """Return the summary of a run as text for the terminal."""
    lines = [f'{summary["scene"]} with {summary["law"]}, '
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
