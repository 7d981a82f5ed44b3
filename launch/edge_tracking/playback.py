"""The demo with a recording: its frames run through driver and estimator, as from the array."""
from argparse import Namespace
from collections.abc import Mapping
from pathlib import Path
import time
from typing import Any

from edge_tracking.graph import Graph, linger, private_port
from edge_tracking.process_group import record
from tactile_common.progress import live_progress
from tactile_common.ros.runner import stop_on_signals
from tactile_sensing.devices.calibration import Calibration
from tactile_sensing.devices.calibration_file import load_calibration
from tactile_sensing.devices.recording import Recording
from tactile_sensing.nodes.contact_estimator import ContactEstimatorNode
from tactile_sensing.nodes.driver import DriverNode
from tactile_simulation.nodes.mock_sensor import MockSensorNode


def calibration_for(options: Namespace, recording: Recording) -> Calibration:
    """Calibration of a recording by options of the demo; ValueError where they do not fit it."""
    rows, columns = recording.shape
    if options.calibration:
        calibration = load_calibration(options.calibration)
    elif options.pitch or recording.pitch:
        outside = live_window(options.live, recording.shape) if options.live else ()
        calibration = Calibration.uncalibrated(
            rows, columns, options.pitch or recording.pitch, nominal_rate=recording.rate_hz,
            dead_tactels=tuple(sorted({*outside, *recording.absent})))
    else:
        raise ValueError(f'{options.recording}: no pitch_m in the file; give --pitch')
    if calibration.array.shape != (rows, columns):
        raise ValueError(f'{options.recording}: frames of {rows}x{columns}, but '
                         f'{options.calibration} is for {calibration.array.shape}')
    return calibration


def live_window(text: str, shape: tuple[int, int]) -> tuple[int, ...]:
    """Row-major indices of the tactels outside a window 'ROWS,COLUMNS', see `--live`."""
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


def play(path: str | Path, duration: float, calibration: Calibration, folder: Path,
         **common) -> tuple[bool, str]:
    """
    Stream a recording of some duration [s] through driver and estimator; success and reason.

    That is recorded in the folder's `bag`; `common` is of the `Graph`.
    """
    with private_port() as port, stop_on_signals() as stop, Graph(**common) as graph, \
            live_progress(duration) as progress:
        record(graph, folder / 'bag')
        graph.add(ContactEstimatorNode)
        sensor = graph.add(MockSensorNode, port=str(port), recording=str(path))
        graph.add(DriverNode, own={'calibration': calibration}, port=str(port),
                  tare_at_start=False)
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
    """Text of the summary of a recording for the terminal."""
    lines = [f'{summary["reason"]}: {summary["frames"]} pictures of {summary["rows"]} x '
             f'{summary["columns"]} at {summary["sensor_rate"]:.1f} Hz, '
             f'{summary["lost_frames"]} lost, {summary["presses"]} presses']
    for start, lasted, peak, (x, y) in zip(
            summary['press_times'], summary['press_durations'], summary['press_peaks'],
            summary['press_centres'], strict=True):
        lines.append(f'  peak at {start:6.1f} s, pressed {lasted:4.1f} s, {peak:.4g} '
                     f'{summary["force_unit"]}, centre ({1e3 * x:+.2f}, {1e3 * y:+.2f}) mm')
    return '\n'.join(lines)
