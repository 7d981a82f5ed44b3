"""Summary of a recording of sensor frames: force and centre of pressure over time."""
from collections.abc import Mapping
import math
from typing import Any, NamedTuple

import numpy as np

from edge_tracking.recording.run import RunData
from tactile_sensing.image import image_moments
from tactile_sensing.types.contact import ContactType
from tactile_simulation.metrics import NAN, percentile, rate, span


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
    force, centre = NAN, [NAN, NAN]
    if np.isfinite(series.force).any():
        strongest = int(np.nanargmax(series.force))
        force, centre = series.force[strongest], series.centre_of_pressure[strongest].tolist()
    return {
        'ok': bool(len(images.stamp_ns) and len(series.force)),
        'reason': '' if len(images.stamp_ns) else 'no pictures arrived',
        'sensor': run.info.sensor if run.info else '',
        'rows': images.frames.shape[1], 'columns': images.frames.shape[2],
        'force_unit': series.unit, 'force_max': force, 'force_max_centre': centre,
        'duration': span(stamps), 'frames': len(stamps), 'lost_frames': lost_images(run),
        'sensor_rate': rate(stamps),
        'contact_types': {kind.name.lower(): int(np.count_nonzero(series.type == kind))
                          for kind in ContactType},
        'latency_p50': percentile(run.contacts.latency, 50),
        'latency_p99': percentile(run.contacts.latency, 99),
    }


def describe_recording(summary: Mapping[str, Any]) -> str:
    """Return the summary of a recording as text."""
    text = (f'{summary["frames"]} pictures of {summary["rows"]} x {summary["columns"]} at '
            f'{summary["sensor_rate"]:.1f} Hz, {summary["lost_frames"]} lost; contacts: ')
    text += ', '.join(f'{count} {name}' for name, count in summary['contact_types'].items()
                      if count) or 'none'
    if not math.isfinite(summary['force_max']):
        return text
    (factor, unit), (x, y) = force_unit(summary['force_unit']), summary['force_max_centre']
    return (f'{text}; largest force {factor * summary["force_max"]:.4g} {unit} at '
            f'({1e3 * x:+.2f}, {1e3 * y:+.2f}) mm')
