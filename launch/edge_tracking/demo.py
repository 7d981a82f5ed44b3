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
from typing import Any

from rclpy.exceptions import ParameterException

from edge_tracking.graph import add_servo, calibrate, Graph, linger, private_port
from edge_tracking.playback import calibration_for, describe_recording, play
from edge_tracking.process_group import apart
from edge_tracking.recording.frames_summary import summarise_recording
from edge_tracking.recording.reader import read_run
from edge_tracking.recording.summary import summarise
from edge_tracking.report.page import make_recording_report, make_report, picture
from edge_tracking.resources import find_scene, scene_names, share
from edge_tracking.track import TrackNode
from tactile_common.errors import TactileError
from tactile_common.progress import Progress
from tactile_common.ros.runner import stop_on_signals
from tactile_msgs.action import TrackEdge
from tactile_sensing.devices.recording import load_recording
from tactile_servo.laws.registry import DEFAULT, LAWS
from tactile_servo.types import State
from tactile_simulation.metrics import describe, to_json
from tactile_simulation.scene import load_scene

DOMAINS = 100  # the demo picks one of the domains 1 to 100, unless told


def parser() -> argparse.ArgumentParser:
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
    arguments.add_argument('--controller', choices=tuple(LAWS), default=DEFAULT,
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


def out_folder(wanted: str | None, name: str) -> Path:
    """Make the folder of the results."""
    folder = Path(wanted or f'runs/{name}-{datetime.now():%Y%m%d-%H%M%S}')
    try:
        folder.mkdir(parents=True, exist_ok=wanted is None)
    except OSError as error:
        raise ValueError(f'--out {folder}: {error.strerror}') from error
    return folder


def own_domain() -> int | None:
    """
    ROS domain of the demo: that of the environment, else one that no other demo is likely to use.

    Two graphs in one domain would hear each other's sensors.
    """
    if os.environ.get('ROS_DOMAIN_ID'):
        return None
    domain = os.getpid() % DOMAINS + 1
    print(f'to listen along: ROS_DOMAIN_ID={domain}', file=sys.stderr)
    return domain


def feedback_text(feedback: TrackEdge.Feedback) -> str:
    """What the progress bar says of the tracking."""
    text = [f'{1e3 * feedback.progress:.0f} mm']
    if feedback.state == State.HOLD:
        text.append(feedback.reason)
    else:  # what is not known, before the edge is felt, is left out
        text += [form.format(value) for form, value in (
            ('lateral {:+.3f} mm', 1e3 * feedback.lateral_error),
            ('force {:.2f} N', feedback.normal_force)) if math.isfinite(value)]
    return ', '.join(text)


def track_scene(options: argparse.Namespace, folder: Path, **common) -> tuple[bool, str]:
    """Run the scene; returns success and reason."""
    path, robot = find_scene(options.scene), share('urdf', 'puma260.urdf')
    scene = load_scene(path)
    closed = scene.edge.closed and LAWS[options.controller].closes_contours
    with private_port() as port, stop_on_signals() as stop, \
            Progress(scene.edge.length - scene.start.s) as progress, \
            apart('listeners', folder / 'bag', **common) as listeners, \
            apart('mocks', port, path, robot, options.seed, **common) as mocks, \
            apart('sensing', port, calibrate(port, scene), **common) as sensing, \
            Graph(**common) as graph:
        parts = {'listeners': listeners, 'mocks': mocks, 'sensing': sensing}

        def over():
            return stop.is_set() or any(part.poll() is not None for part in parts.values())

        def show(feedback):
            progress.show(feedback.progress, State(feedback.state).name.lower(),
                          feedback_text(feedback))

        servo = add_servo(graph, robot, options.controller)
        graph.spin(lambda: over() or servo.count_subscribers('servo_status'))  # the recorder
        track = graph.add(TrackNode, own={'on_feedback': show}, speed=options.speed,
                          force=options.force, closed=closed)
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


def run(options: argparse.Namespace) -> tuple[dict[str, Any], Path]:
    """Run the demo; returns the summary and the folder of its results."""
    name = Path(options.recording or options.scene).stem
    # What cannot be read is refused before a folder is made, and once, not by every part.
    if options.recording:
        recording = load_recording(options.recording)
        calibration = calibration_for(options, recording)
    else:
        scene = load_scene(find_scene(options.scene))
    with Graph(options.parameters):
        pass
    folder = out_folder(options.out, name)
    common = {'parameters': options.parameters, 'domain': own_domain()}
    report = folder / 'report.html'
    if options.recording:
        success, reason = play(
            options.recording, len(recording.frames) / recording.rate_hz, calibration,
            folder, **common)
    else:
        success, reason = track_scene(options, folder, **common)
    try:
        data = read_run(folder / 'bag')
    except TactileError as error:  # what was recorded ended with its recorder
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


def main(args: list[str] | None = None) -> int:
    """Run the demo; exit status 0 if the edge was tracked, or the recording played."""
    options = parser().parse_args(args)
    try:
        summary, folder = run(options)
    except (ValueError, RuntimeError, ParameterException, TactileError) as error:
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
