"""The demo: a mock robot follows an edge or a surface; its report is computed from the bag."""
import argparse
from datetime import datetime
import os
from pathlib import Path
import sys
from typing import Any

from rclpy.exceptions import ParameterException

from edge_tracking.goals import feedback_text, PATTERNS, way_length
from edge_tracking.graph import (
    add_servo,
    calibrate,
    Graph,
    LAW_HELP,
    linger,
    NAMESPACE,
    PARAMETERS,
    private_port,
    warn_of_parameters,
)
from edge_tracking.parameters import config_in
from edge_tracking.playback import calibration_for, describe_recording, play
from edge_tracking.process_group import apart, Heard, watch
from edge_tracking.recording.frames_summary import summarise_recording
from edge_tracking.recording.reader import read_run
from edge_tracking.recording.summary import summarise
from edge_tracking.recording.surface_summary import summarise_surface_run, surface_truth
from edge_tracking.report.animation import animate
from edge_tracking.report.page import make_recording_report, make_report, picture
from edge_tracking.report.surface_page import make_surface_report
from edge_tracking.report.surface_page import picture as surface_picture
from edge_tracking.resources import find_scene, scene_names, share
from edge_tracking.track import RESUMES, TrackNode
from edge_tracking.transport import local_environment
from tactile_common.command_line import between, Parser
from tactile_common.errors import TactileError
from tactile_common.progress import live_progress
from tactile_common.ros.domains import hold_domain
from tactile_common.ros.runner import freeze_heap, stop_on_signals
from tactile_sensing.cli.options import add_shape
from tactile_sensing.devices.recording import load_recording, MAX_RATE
from tactile_sensing.nodes.driver import DriverConfig
from tactile_servo.config import check_goal, ServoConfig
from tactile_servo.laws.registry import DEFAULT, law_for, LAWS
from tactile_servo.types import State
from tactile_shape.contour.object_model import model_of
from tactile_simulation.cli.simulate import SEED
from tactile_simulation.metrics import describe, to_json
from tactile_simulation.scene import Scene
from tactile_simulation.scene_surface import SurfaceScene
from tactile_simulation.scenes import load_any_scene, parameters_for, renderer_of

INTERRUPTED = 'interrupted'


def parser() -> argparse.ArgumentParser:
    """Command line of the demo."""
    arguments = Parser(
        prog='demo', formatter_class=argparse.ArgumentDefaultsHelpFormatter,
        description='A robot follows an edge or a surface by touch, on the real graph with a '
        'mock sensor on a pseudo-terminal and a mock robot. Writes a rosbag2 recording (.mcap) '
        'and a report (report.html, picture.png; of a surface surface.ply). Exit status 0 only '
        'if it was tracked.',
        epilog='With --recording FILE the frames of a real array (.npz with frames (N, rows, '
        'columns), rate_hz and pitch_m; or .npy, .csv, with --rate, --pitch, --shape) run through '
        'driver and estimator instead.')
    add = arguments.add_argument
    add('--scene', default='real_skin',
        help=f'{", ".join(scene_names())}, or the path of a .yaml file')
    add('--law', '--controller', choices=tuple(LAWS), help=LAW_HELP)
    add('--speed', type=float, default=0.03, help='along the edge, over the surface [m/s]')
    add('--pattern', choices=tuple(PATTERNS), default='line', help='way over a surface')
    add('--force', type=float, default=5.0, help='on the pad [N]')
    add('--seed', type=SEED, default=0, help="of the sensor's noise")
    add('--parameters', metavar='FILE.yaml',
        help='parameter file of all nodes; default edge_tracking.yaml of this package')
    add('--recording', metavar='FILE', help='play a recording instead of a scene')
    add('--calibration', metavar='FILE.yaml',
        help='counts -> pressure of the recording; without it, tared frames of any unit')
    add('--pitch', type=float, help='of the recording, where it does not say it itself [m]')
    add('--rate', type=between(1e-3, MAX_RATE, 'Hz'), metavar='HZ',
        help='of the recording, where it does not say it itself [Hz]')
    add_shape(arguments)
    add('--live', metavar='ROWS,COLUMNS', help='use these tactels of the recording only, for '
        'instance 15:26,15:26 (first:end, from 0)')
    add('--out', metavar='FOLDER',
        help='new folder for recording and report; default runs/NAME-TIME')
    add('--animate', action='store_true', help='also write animation.gif, the pad on its way '
        'beside what it feels')
    add('--json', action='store_true',
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


def own_domain() -> int:
    """ROS domain that no other demo is in: two graphs in one would hear each other's sensors."""
    domain = hold_domain()
    print(f'to listen along: ROS_DOMAIN_ID={domain}', file=sys.stderr)
    return domain


def track_scene(options: argparse.Namespace, path: Path, scene: Scene | SurfaceScene,
                folder: Path, **common) -> tuple[bool, str, int]:
    """Run the scene of a file; returns success, reason and its code."""
    robot, own = share('urdf', 'puma260.urdf'), parameters_for(scene)
    if isinstance(scene, SurfaceScene):
        length, goal = way_length(options.pattern), {'surface.pattern': options.pattern}
    else:
        length = scene.edge.length - scene.start.s
        goal = {'closed': scene.edge.closed and LAWS[options.law].closes_contours}
    with private_port() as port, stop_on_signals() as stop, live_progress(length) as progress, \
            apart('listeners', folder / 'bag', own.shape, **common) as listeners, \
            apart('mocks', port, path, robot, options.seed, **common) as mocks, \
            apart('sensing', port, calibrate(port, scene), DriverConfig.protocol,
                  own.contact, **common) as sensing, \
            Graph(**common) as graph:
        parts = {'listeners': listeners, 'mocks': mocks, 'sensing': sensing}
        ended = watch(parts.values())

        def over():
            return stop.is_set() or ended()

        def show(feedback):
            progress.show(feedback.progress, State(feedback.state).name.lower(),
                          feedback_text(feedback))

        servo = add_servo(graph, robot, options.law, **own.servo)
        freeze_heap()
        heard = Heard(servo, graph.namespace)
        graph.spin(lambda: over() or heard.all)
        track = graph.add(TrackNode, own={'on_feedback': show}, action=scene.action,
                          speed=options.speed, force=options.force, resumes=RESUMES, **goal)
        graph.spin(lambda: track.finished or over())
        if stop.is_set():
            track.cancel()
            stop.clear()
            linger(graph, lambda: track.finished or stop.is_set(), 2.0)
            return False, INTERRUPTED, 0
        if not track.finished:
            return False, ', '.join(
                f'{name} ended by itself, with status {part.returncode}'
                for name, part in parts.items() if part.returncode is not None), 0
        linger(graph, stop.is_set)
    return track.success, track.reason, track.reason_code


def run(options: argparse.Namespace) -> tuple[dict[str, Any], Path]:
    """Run the demo; returns the summary and the folder of its results."""
    if options.recording and options.animate:
        raise ValueError('--animate shows a pad on its way, which a --recording has none of')
    name = Path(options.recording or options.scene).stem
    # What cannot be read is refused before a folder is made, and once, not by every part.
    if options.recording:
        recording = load_recording(
            options.recording, options.rate, options.shape and tuple(options.shape))
        calibration = calibration_for(options, recording)
    else:
        path = find_scene(options.scene)
        scene = load_any_scene(path)
        options.law = law_for(scene.action, options.law)
        renderer_of(scene)  # the skin of a round probe is solved once, before it is due
    warn_of_parameters(options.parameters, NAMESPACE, options.law or DEFAULT)
    check_goal(options.speed, options.force, config_in(
        options.parameters or PARAMETERS, f'/{NAMESPACE}/edge_servo', ServoConfig))
    folder = out_folder(options.out, name)
    common = {'parameters': options.parameters, 'domain': own_domain()}
    if options.recording:
        success, reason = play(options.recording, recording, calibration, folder, **common)
    else:
        success, reason, code = track_scene(options, path, scene, folder, **common)
    try:
        data = read_run(folder / 'bag')
    except TactileError as error:  # what was recorded ended with its recorder
        raise RuntimeError(f'{reason}; {error}') from error
    if options.recording:
        summary = summarise_recording(data)
        summary |= {'ok': success and summary['ok'], 'reason': reason}
        make_recording_report(data, summary, Path(options.recording).name, folder / 'report.html')
        return summary, folder
    asked = {'success': success, 'reason': reason, 'reason_code': code, 'speed': options.speed,
             'force': options.force, 'seed': options.seed}
    if isinstance(scene, SurfaceScene):
        truth = surface_truth(data, scene)
        summary = summarise_surface_run(data, scene, truth, **asked)
        make_surface_report(data, summary, scene, truth, folder / 'report.html')
        surface_picture(data, scene, folder / 'picture.png')
        model_of(data.patches).save_surface(folder / 'surface.ply')
    else:
        summary = summarise(data, scene, **asked)
        make_report(data, summary, scene, folder / 'report.html')
        picture(data, scene, folder / 'picture.png')
        if options.animate:
            animate(data, scene, folder / 'animation.gif')
    return summary, folder


def main(args: list[str] | None = None) -> int:
    """Run the demo; exit status 0 if the edge was tracked, or the recording played."""
    os.environ.update(local_environment())  # also of the parts
    try:
        options = parser().parse_args(args)
        summary, folder = run(options)
    except (ValueError, RuntimeError, ParameterException, TactileError) as error:
        print(f'demo: {" ".join(str(error).split())}', file=sys.stderr)
        return 1
    text = to_json if options.json else describe_recording if options.recording else describe
    print(text(summary))
    print(f'recording {folder / "bag"}\nreport    {folder / "report.html"}', file=sys.stderr)
    return 0 if summary['ok'] else 130 if summary['reason'] == INTERRUPTED else 1
