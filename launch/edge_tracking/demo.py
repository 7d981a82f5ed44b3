"""
The demo: a mock robot follows an edge by touch, recorded and reported.

Sensor bytes run over a pseudo-terminal through driver, estimator and servo to a mock robot;
everything that is reported is computed from the recorded bag.
"""

import argparse
from datetime import datetime
import math
import os
from pathlib import Path
import sys
import time

from rclpy.exceptions import ParameterException

from edge_tracking.composed import add_servo, Graph, private_port
from edge_tracking.parts import apart, record
from edge_tracking.read_run import read_run
from edge_tracking.recording_summary import summarise_recording
from edge_tracking.report import make_recording_report, make_report, picture
from edge_tracking.resources import find_scene, scene_names, share
from edge_tracking.summary import summarise, to_json
from edge_tracking.track import TrackNode
from tactile_sensing.calibration import Calibration, load_calibration
from tactile_sensing.errors import TactileSensingError
from tactile_sensing.nodes.contact_estimator import ContactEstimatorNode
from tactile_sensing.nodes.driver import DriverNode
from tactile_sensing.nodes.mock_sensor import MockSensorNode
from tactile_sensing.nodes.runner import stop_on_signals
from tactile_sensing.progress import Progress
from tactile_sensing.recording import load_recording
from tactile_sensing.scene import load_scene
from tactile_servo.servo_types import State
from tactile_servo.trackers import DEFAULT, TRACKERS

DOMAINS = 100  # the demo picks one of the domains 1 to 100, unless told
SETTLE = 0.3  # s recorded after the end, so that the last messages arrive


def parser():
    """Command line of the demo."""
    arguments = argparse.ArgumentParser(
        prog='demo', formatter_class=argparse.ArgumentDefaultsHelpFormatter,
        description='A robot follows an edge by touch, on the real graph with a mock sensor on '
        'a pseudo-terminal and a mock robot. Writes a rosbag2 recording (.mcap) and a report '
        '(report.html, picture.png). Exit status 0 only if the edge was tracked.',
        epilog='With --recording FILE.npz the frames of a real array (frames (N, rows, '
        'columns), rate_hz, optional pitch_m) run through driver and estimator instead.')
    arguments.add_argument('--scene', default='straight',
                           help=f'{", ".join(scene_names())}, or the path of a .yaml file')
    arguments.add_argument('--controller', choices=tuple(TRACKERS), default=DEFAULT,
                           help='how the edge is followed')
    arguments.add_argument('--speed', type=float, default=0.03, help='along the edge [m/s]')
    arguments.add_argument('--force', type=float, default=5.0, help='on the pad [N]')
    arguments.add_argument('--seed', type=int, default=0, help="of the sensor's noise")
    arguments.add_argument('--parameters', default=None, metavar='FILE.yaml',
                           help='parameter file of all nodes; default edge_tracking.yaml of '
                           'this package')
    arguments.add_argument('--recording', default=None, metavar='FILE.npz',
                           help='play a recording instead of a scene')
    arguments.add_argument('--calibration', default=None, metavar='FILE.yaml',
                           help='counts -> pressure of the recording; without it, raw counts')
    arguments.add_argument('--pitch', type=float, default=None,
                           help='of the recording, where it does not say it itself [m]')
    arguments.add_argument('--live', default=None, metavar='ROWS,COLUMNS',
                           help='use these tactels of the recording only, for instance '
                           '15:26,15:26 (first:end, from 0)')
    arguments.add_argument('--out', default=None, metavar='FOLDER',
                           help='new folder for recording and report; default runs/NAME-TIME')
    arguments.add_argument('--json', action='store_true',
                           help='print the summary as one JSON object, all else to stderr')
    return arguments


def out_folder(wanted, name):
    """Make the folder of the results."""
    folder = Path(wanted or f'runs/{name}-{datetime.now():%Y%m%d-%H%M%S}')
    try:
        folder.mkdir(parents=True, exist_ok=wanted is None)
    except OSError as error:
        raise ValueError(f'--out {folder}: {error.strerror}') from error
    return folder


def own_domain():
    """
    ROS domain of the demo: that of the environment, else one that no other demo is likely to use.

    Two graphs in one domain would hear each other's sensors.
    """
    if os.environ.get('ROS_DOMAIN_ID'):
        return None
    domain = os.getpid() % DOMAINS + 1
    print(f'to listen along: ROS_DOMAIN_ID={domain}', file=sys.stderr)
    return domain


def linger(graph, stop):
    """Spin a little longer."""
    end = time.monotonic() + SETTLE
    graph.spin(lambda: stop.is_set() or time.monotonic() > end)


def track_scene(options, folder, progress):
    """Run the scene; returns (success, reason)."""
    path = find_scene(options.scene)
    edge = load_scene(path)
    robot = share('urdf', 'puma260.urdf')
    length = edge.edge.length - edge.start.s

    def show(feedback):
        progress.show(
            min(feedback.progress / length, 1.0), State(feedback.state).name.lower(),
            f'{1e3 * feedback.progress:5.0f} mm  lateral {1e3 * feedback.lateral_error:+.3f} mm'
            f'  force {feedback.normal_force:.2f} N')
    common = {'parameters': options.parameters, 'domain': own_domain()}
    with private_port() as port, stop_on_signals() as stop, \
            apart('listeners', folder / 'bag', **common) as listeners, \
            apart('mocks', port, path, robot, options.seed, **common) as mocks, \
            apart('sensing', port, **common) as sensing, Graph(**common) as graph:
        parts = {'listeners': listeners, 'mocks': mocks, 'sensing': sensing}

        def over():
            return stop.is_set() or any(part.poll() is not None for part in parts.values())
        servo = add_servo(graph, robot, options.controller)
        graph.spin(lambda: over() or servo.count_subscribers('servo_status'))  # the recorder
        track = graph.add(TrackNode, own={'on_feedback': show}, speed=options.speed,
                          force=options.force,
                          closed=edge.edge.closed
                          and TRACKERS[options.controller].closes_contours)
        graph.spin(lambda: track.finished or over())
        if stop.is_set():
            track.cancel()
            stop.clear()
            end = time.monotonic() + 2.0
            graph.spin(lambda: track.finished or stop.is_set() or time.monotonic() > end)
            return False, 'interrupted'
        if over():
            return False, ', '.join(
                f'{name} ended by itself, with status {part.returncode}'
                for name, part in parts.items() if part.returncode is not None)
        linger(graph, stop)
    return track.success, track.reason


def play_recording(options, folder, progress):
    """Stream a recording through driver and estimator."""
    recording = load_recording(options.recording)
    rows, columns = recording.shape
    if options.calibration:
        calibration = load_calibration(options.calibration)
    elif options.pitch or recording.pitch:
        calibration = Calibration.uncalibrated(
            rows, columns, options.pitch or recording.pitch, nominal_rate=recording.rate_hz,
            dead_tactels=live_window(options.live, recording.shape) if options.live else ())
    else:
        raise ValueError(f'{options.recording}: no pitch_m in the file; give --pitch')
    if calibration.array.shape != (rows, columns):
        raise ValueError(f'{options.recording}: frames of {rows}x{columns}, but '
                         f'{options.calibration} is for {calibration.array.shape}')
    duration = len(recording.frames) / recording.rate_hz
    with private_port() as port, stop_on_signals() as stop, \
            Graph(options.parameters, domain=own_domain()) as graph:
        record(graph, folder / 'bag')
        sensor = graph.add(MockSensorNode, port=str(port), recording=str(options.recording))
        graph.add(DriverNode, own={'calibration': calibration}, port=str(port),
                  tare_at_start=False)
        graph.add(ContactEstimatorNode)
        started = time.monotonic()

        def until():
            gone = time.monotonic() - started
            progress.show(min(gone / duration, 1.0), 'playing', f'{gone:.0f} of {duration:.0f} s')
            return stop.is_set() or sensor.finished.is_set()
        graph.spin(until)
        if stop.is_set():
            return False, 'interrupted'
        linger(graph, stop)
    return True, 'recording played'


# Key, name, unit, factor from SI and decimals of what the terminal shows.
_ROWS = (
    ('tracked_length', 'tracked length', 'mm', 1e3, 1),
    ('lateral_rms', 'lateral error, RMS', 'mm', 1e3, 4),
    ('lateral_max', 'lateral error, largest', 'mm', 1e3, 4),
    ('force_rms_error', 'force error, RMS', 'N', 1.0, 3),
    ('force_max', 'force, largest', 'N', 1.0, 2),
    ('contour_max_error', 'rebuilt outline within', 'mm', 1e3, 3),
    ('duration', 'duration', 's', 1.0, 1),
    ('sensor_rate', 'sensor rate', 'Hz', 1.0, 1),
    ('control_rate', 'control rate', 'Hz', 1.0, 1),
    ('missed_cycles', 'missed cycles', '', 1.0, 0),
    ('latency_p50', 'frame to command, p50', 'ms', 1e3, 2),
    ('latency_p99', 'frame to command, p99', 'ms', 1e3, 2))


def describe(summary):
    """Text of the summary of a scene for the terminal."""
    verdict = 'tracked' if summary['ok'] else 'NOT TRACKED'
    lines = [f'{verdict}: {summary["reason"]}']
    for key, name, unit, factor, decimals in _ROWS:
        value = summary[key]
        if not math.isnan(value):
            lines.append(f'  {name:24}{factor * value:10.{decimals}f} {unit}')
    for number, side in enumerate(summary['sides'], 1):
        radius = '' if side['kind'] == 'line' else f', radius {1e3 * side["radius"]:.2f} mm'
        lines.append(f'  side {number}: {side["kind"]} of {1e3 * side["length"]:.2f} mm{radius}')
    for number, corner in enumerate(summary['corners'], 1):
        place = ', '.join(f'{1e3 * value:.2f}' for value in corner)
        lines.append(f'  corner {number} at ({place}) mm')
    return '\n'.join(lines)


def describe_recording(summary):
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


def live_window(text, shape):
    """
    Row-major indices of the tactels outside a window 'ROWS,COLUMNS' such as '15:26,15:26'.

    Raises
    ------
    ValueError
        The text is no window within the shape.
    """
    try:
        rows, columns = (range(*map(int, part.split(':'))) for part in text.split(','))
        inside = (0 <= rows.start < rows.stop <= shape[0]
                  and 0 <= columns.start < columns.stop <= shape[1])
    except (TypeError, ValueError):
        inside = False
    if not inside:
        raise ValueError(f'--live {text}: must be ROWS,COLUMNS such as 15:26,15:26 within '
                         f'{shape[0]} x {shape[1]}')
    return tuple(r * shape[1] + c for r in range(shape[0]) for c in range(shape[1])
                 if r not in rows or c not in columns)


def run(options):
    """Run the demo; returns the summary and the folder of its results."""
    name = Path(options.recording or options.scene).stem
    if not options.recording:
        scene = load_scene(find_scene(options.scene))  # before a folder is made
    with Graph(options.parameters):  # likewise; once, not by every part
        pass
    folder = out_folder(options.out, name)
    report = folder / 'report.html'
    with Progress(sys.stderr) as progress:
        play = play_recording if options.recording else track_scene
        success, reason = play(options, folder, progress)
    try:
        data = read_run(folder / 'bag')
    except TactileSensingError as error:  # what was recorded ended with its recorder
        raise RuntimeError(f'{reason}; {error}') from error
    if options.recording:
        summary = summarise_recording(data)
        summary |= {'ok': success and summary['ok'], 'reason': reason}
        make_recording_report(data, summary, report)
    else:
        summary = summarise(data, scene, success=success, reason=reason, speed=options.speed,
                            force=options.force, seed=options.seed)
        make_report(data, summary, scene, report)
        picture(data, scene, folder / 'picture.png')
    return summary, folder


def main(args=None):
    """Run the demo; exit status 0 if the edge was tracked, or the recording played."""
    options = parser().parse_args(args)
    try:
        summary, folder = run(options)
    except (ValueError, RuntimeError, ParameterException, TactileSensingError) as error:
        print(f'demo: {" ".join(str(error).split())}', file=sys.stderr)
        return 1
    except KeyboardInterrupt:  # while the report is made; before, the graph takes it
        print('demo: interrupted', file=sys.stderr)
        return 1
    if options.json:
        print(to_json(summary))
    else:
        print((describe_recording if options.recording else describe)(summary))
    print(f'recording {folder / "bag"}\nreport    {folder / "report.html"}', file=sys.stderr)
    return 0 if summary['ok'] else 1
