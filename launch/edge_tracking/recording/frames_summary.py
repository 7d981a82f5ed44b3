"""Summary of a recording of sensor frames: force over time, and presses."""
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from edge_tracking.recording.run import RunData
from tactile_sensing.image import image_moments
from tactile_sensing.types.contact import ContactType
from tactile_simulation.metrics import largest, Metric, NAN, percentile, rate, span

# A press begins above the upper and ends below the lower of these fractions of the force's
# range. They differ so that noise does not split a press.
PRESS_THRESHOLDS = (0.55, 0.45)
# Parts of a summary that the report shows.
METRICS = (
    Metric('presses', 'presses', '', 1.0, 0),
    Metric('duration', 'duration', 's'),
    Metric('frames', 'pictures', '', 1.0, 0),
    Metric('lost_frames', 'lost pictures', '', 1.0, 0),
    Metric('sensor_rate', 'rate', 'Hz', 1.0, 2),
    Metric('latency_p50', 'estimate after, median', 'ms', 1e3, 2),
    Metric('latency_p99', 'estimate after, 99 %', 'ms', 1e3, 2),
)


class Press(NamedTuple):
    """A press, as indices into a series."""

    begin: int
    peak: int
    end: int  # one after the last sample


class ForceSeries(NamedTuple):
    """Force over time of a recording, arrays `(N,)`."""

    time: np.ndarray  # since the first image [s]
    force: np.ndarray  # zeroth moment, in `unit`
    unit: str
    type: np.ndarray  # numbers of Contact.msg
    centre_of_pressure: np.ndarray  # (N, 2) [m]
    stamp_ns: np.ndarray


def force_series(run: RunData) -> ForceSeries:
    """Return force and centre of pressure, from contacts or else from the images' moments."""
    unit = {'Pa': 'N', '': 'N'}.get(run.images.unit, f'{run.images.unit} m^2')
    contacts = run.contacts
    if np.isfinite(contacts.m0).any():
        stamps, force, kind = contacts.stamp_ns, contacts.m0, contacts.type
        centre = contacts.centre_of_pressure
    else:
        stamps, array = run.images.stamp_ns, run.images.array  # None without frames
        moments = [image_moments(frame, array) for frame in run.images.frames] if array else []
        force = np.array([each.m0 for each in moments])
        centre = np.array([each.centre_of_pressure for each in moments]).reshape(-1, 2)
        kind = np.full(len(stamps), int(ContactType.OTHER))
    time = 1e-9 * (stamps - stamps[0]) if len(stamps) else np.empty(0)
    return ForceSeries(time, force, unit, kind, centre, stamps)


def force_unit(unit: str) -> tuple[float, str]:
    """Return factor and unit to show forces of a unit: N, or counts mm^2."""
    return (1.0, 'N') if unit == 'N' else (1e6, unit.replace('m^2', 'mm\u00b2'))


def presses(force: np.ndarray) -> list[Press]:
    """Find presses in forces `(N,)` with hysteresis; NaN neither starts nor ends a press."""
    finite = force[np.isfinite(force)]
    if not finite.size or not np.ptp(finite) > 0.0:
        return []
    low, high = np.percentile(finite, (1, 99))
    upper, lower = (low + fraction * (high - low) for fraction in PRESS_THRESHOLDS)
    found, begin = [], None
    for index, value in enumerate([*force, -np.inf]):  # the end of data also ends a press
        if begin is None and value > upper:
            begin = index
        elif begin is not None and value < lower:
            found.append(Press(begin, begin + int(np.nanargmax(force[begin:index])), index))
            begin = None
    return found


def lost_images(run: RunData) -> int:
    """Return the number of missing images, from their sequence numbers."""
    steps = np.diff(run.images.sequence)
    return int((steps[steps > 0] - run.every.get('image', 1)).sum())


def summarise_recording(run: RunData) -> dict[str, Any]:
    """
    Return the summary of a recording in SI units.

    Forces are in `force_unit`, which is N only for a calibrated sensor.
    """
    series, images, stamps = force_series(run), run.images, run.stamps['image']
    found = presses(series.force)
    period = 1.0 / rate(series.stamp_ns) if len(series.stamp_ns) > 1 else NAN
    return {
        'ok': bool(len(images.stamp_ns) and len(series.force)),
        'reason': '' if len(images.stamp_ns) else 'no pictures arrived',
        'sensor': run.info.sensor if run.info else '',
        'rows': images.frames.shape[1], 'columns': images.frames.shape[2],
        'force_unit': series.unit, 'force_max': largest(series.force), 'presses': len(found),
        'press_peaks': [float(series.force[peak]) for _, peak, _ in found],
        'press_times': [float(series.time[peak]) for _, peak, _ in found],
        'press_durations': [float((end - begin) * period) for begin, _, end in found],
        'press_centres': [series.centre_of_pressure[peak].tolist() for _, peak, _ in found],
        'duration': span(stamps), 'frames': len(stamps), 'lost_frames': lost_images(run),
        'sensor_rate': rate(stamps),
        'contact_types': {kind.name.lower(): int(np.count_nonzero(series.type == kind))
                          for kind in ContactType},
        'latency_p50': percentile(run.contacts.latency, 50),
        'latency_p99': percentile(run.contacts.latency, 99),
    }


def describe_recording(summary: Mapping[str, Any]) -> str:
    """Return the summary of a recording as text for the terminal."""
    lines = [f'{summary["frames"]} pictures of {summary["rows"]} x {summary["columns"]} at '
             f'{summary["sensor_rate"]:.1f} Hz, {summary["lost_frames"]} lost, '
             f'{summary["presses"]} presses']
    for start, lasted, peak, (x, y) in zip(
            summary['press_times'], summary['press_durations'], summary['press_peaks'],
            summary['press_centres'], strict=True):
        lines.append(f'  peak at {start:6.1f} s, pressed {lasted:4.1f} s, {peak:.4g} '
                     f'{summary["force_unit"]}, centre ({1e3 * x:+.2f}, {1e3 * y:+.2f}) mm')
    return '\n'.join(lines)
