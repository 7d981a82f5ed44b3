"""Demo with a recording: its frames pass through driver and estimator as from the array."""
from argparse import Namespace
from collections.abc import Mapping
from pathlib import Path
import sys
import time
from typing import Any

import numpy as np

from edge_tracking.graph import Graph, linger, private_port
from edge_tracking.process_group import PATIENCE, record
from tactile_common.progress import live_progress
from tactile_common.ros.runner import stop_on_signals
from tactile_sensing.devices.calibration import Calibration
from tactile_sensing.devices.calibration_file import load_calibration
from tactile_sensing.devices.counts import Counts, MAX_BITS
from tactile_sensing.devices.recording import Recording
from tactile_sensing.nodes.contact_estimator import ContactEstimatorNode
from tactile_sensing.nodes.driver import DriverNode
from tactile_simulation.nodes.mock_sensor import MockSensorNode

MAX_OFFSET = 0.1  # summed offset of unloaded tactels, as a share of the largest load


def calibration_for(options: Namespace, recording: Recording) -> Calibration:
    """Return the calibration of a recording from the demo's options; ValueError on a mismatch."""
    rows, columns = recording.shape
    if options.calibration:
        calibration, source = load_calibration(options.calibration), options.calibration
    elif options.pitch or recording.pitch:
        outside = live_window(options.live, recording.shape) if options.live else ()
        calibration = Calibration.uncalibrated(
            rows, columns, options.pitch or recording.pitch, nominal_rate=recording.rate_hz,
            dead_tactels=tuple(sorted({*outside, *recording.absent})), **_range_of(recording))
        source = 'the recording'
    else:
        raise ValueError(f'{options.recording}: no pitch_m in the file; give --pitch')
    if calibration.raw_shape != (rows, columns):
        raise ValueError(f'{options.recording}: frames of {rows}x{columns}, but '
                         f'{options.calibration} is for {calibration.raw_shape}')
    counts, impossible = recording.counts(calibration.counts, calibration.resolution)
    if impossible:
        raise ValueError(
            f'{options.recording}: {impossible} values are outside {calibration.counts.lowest} to '
            f'{calibration.counts.highest}, what `bits: {calibration.bits}` of {source} allows')
    offset = _offset(calibration, counts) * calibration.resolution
    if offset and options.calibration:
        print(f'{options.recording}: nearly all tactels read {offset:+.3g} and more off the '
              f'baseline of {source}: if nothing touched them, every place is wrong',
              file=sys.stderr)
    elif offset:
        raise ValueError(
            f'{options.recording}: tactels without a load read {offset:+.3g}, an offset that '
            'moves every place: give a --calibration CAL.yaml with their baseline, or subtract '
            'the unloaded picture')
    return calibration


def _range_of(recording: Recording) -> dict[str, Any]:
    """Return the fields of a calibration that can represent unknown frames without loss."""
    values = recording.frames[np.isfinite(recording.frames)]
    low, high = (float(values.min()), float(values.max())) if values.size else (0.0, 0.0)
    signed = low < 0.0
    if np.array_equal(values, np.rint(values)):
        for bits in (8, MAX_BITS):
            limits = Counts(bits, signed)
            if limits.lowest <= low and high <= limits.highest:
                return {'bits': bits, 'signed': signed}
    step = max(-low, high) / 32000  # for real numbers, such as volts: images keep their unit
    return {'bits': MAX_BITS, 'signed': True, 'resolution': step, 'gain': step}


def _offset(calibration: Calibration, frames: np.ndarray) -> float:
    """Return the offset of nearly all tactels from the baseline [counts]; 0 if negligible."""
    counts, live = calibration.arrange(frames), calibration.live
    above = np.where(counts < calibration.counts.threshold, 0.0, counts - calibration.baseline)
    above = above[:, live]
    low, high = np.percentile(np.median(above, axis=0), (10, 90))
    offset = max(low, 0.0) + min(high, 0.0)  # percentiles exclude tactels under a steady load
    load = np.abs(above.sum(axis=1) - offset * live.sum()).max()
    return float(offset) if abs(offset) * live.sum() > MAX_OFFSET * load else 0.0


def live_window(text: str, shape: tuple[int, int]) -> tuple[int, ...]:
    """Return row-major indices of the tactels outside a window 'ROWS,COLUMNS', see `--live`."""
    height, width = shape
    try:
        rows, columns = (range(*map(int, part.split(':'))) for part in text.split(','))
        inside = (0 <= rows.start < rows.stop <= height
                  and 0 <= columns.start < columns.stop <= width)
    except (TypeError, ValueError):
        inside = False
    if not inside:
        raise ValueError(f'--live {text}: must be ROWS,COLUMNS such as 15:26,15:26 within '
                         f'{height} x {width}')
    return tuple(r * width + c for r in range(height) for c in range(width)
                 if r not in rows or c not in columns)


def _listeners(driver: DriverNode) -> int:
    """Return the number of subscribers of the driver's images."""
    return sum(publisher.get_subscription_count() for publisher in driver.publishers
               if publisher.topic_name.endswith('/image'))


def play(path: str | Path, recording: Recording, calibration: Calibration, folder: Path,
         **common) -> tuple[bool, str]:
    """
    Stream a recording through driver and estimator; return success and reason.

    The topics are recorded in the folder's `bag`; `common` are arguments of `Graph`.
    """
    duration = len(recording.frames) / recording.rate_hz  # s
    with private_port() as port, stop_on_signals() as stop, Graph(**common) as graph, \
            live_progress(duration) as progress:
        record(graph, folder / 'bag')
        graph.add(ContactEstimatorNode)
        sensor = graph.add(
            MockSensorNode, own={'recording': recording, 'calibration': calibration},
            port=str(port), recording=str(path))
        driver = graph.add(DriverNode, own={'calibration': calibration}, port=str(port),
                           tare_at_start=False, autostart=False)
        # The sensor starts when the port is opened, so wait for recorder and estimator first.
        linger(graph, lambda: stop.is_set() or _listeners(driver) >= 2, PATIENCE)
        driver.trigger_configure()
        driver.trigger_activate()
        started = time.monotonic()

        def until():
            gone = time.monotonic() - started
            progress.show(gone, 'playing', f'{gone:.0f} of {duration:.0f} s')
            return stop.is_set() or sensor.finished.is_set()
        graph.spin(until)
        if stop.is_set():
            return False, 'interrupted'
        linger(graph, stop.is_set)
    return True, 'recording played'


def describe_recording(summary: Mapping[str, Any]) -> str:
    """Return the summary of a recording as text for the terminal."""
    lines = [f'{summary["reason"]}: {summary["frames"]} pictures of {summary["rows"]} x '
             f'{summary["columns"]} at {summary["sensor_rate"]:.1f} Hz, '
             f'{summary["lost_frames"]} lost, {summary["presses"]} presses']
    for start, lasted, peak, (x, y) in zip(
            summary['press_times'], summary['press_durations'], summary['press_peaks'],
            summary['press_centres'], strict=True):
        lines.append(f'  peak at {start:6.1f} s, pressed {lasted:4.1f} s, {peak:.4g} '
                     f'{summary["force_unit"]}, centre ({1e3 * x:+.2f}, {1e3 * y:+.2f}) mm')
    return '\n'.join(lines)
