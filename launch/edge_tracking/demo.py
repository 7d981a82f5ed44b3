"""Demo: a mock robot follows an edge or a surface; a report is computed from its bag."""
import argparse
from contextlib import ExitStack
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
    PARAMETERS,
    private_port,
    SETTLE,
)
from edge_tracking.parameters import check_file, names_in
from edge_tracking.playback import calibrated, record_frames
from edge_tracking.process_group import apart, Heard
from edge_tracking.recording.summary import describe_recording, read
from edge_tracking.report.page import make_report
from edge_tracking.resources import NAMESPACE, share
from edge_tracking.track import RESUMES, TrackNode
from edge_tracking.transport import local_environment
from tactile_common.command_line import (
    between,
    FAILED,
    Help,
    INTERRUPTED,
    Parser,
    refusing,
    to_json,
)
from tactile_common.errors import ConfigurationError, TactileError
from tactile_common.parameter_file import ParameterFile
from tactile_common.progress import live_progress
from tactile_common.ros.domains import hold_domain
from tactile_common.ros.runner import freeze_heap, stop_on_signals
from tactile_sensing.cli.options import add_shape
from tactile_sensing.devices.recording import load_recording, MAX_RATE
from tactile_servo.config import check_goal, ServoConfig
from tactile_servo.conversions import ACTIONS
from tactile_servo.laws.registry import DEFAULT, law_for, LAWS
from tactile_servo.types import State
from tactile_shape.contour.object_model import ObjectModel
from tactile_shape.mesh import save_mesh
from tactile_simulation.cli.simulate import LAW_HELP, SEED
from tactile_simulation.metrics import describe
from tactile_simulation.scene import describe_scenes, find_scene, load_scene
from tactile_simulation.world import Scene

RECORDING = 'a --recording'
# Options that apply to some actions, or to recordings, only.
ONLY_FOR = {
    'pattern': ('track_surface',),
    **dict.fromkeys(('scene', 'law', 'speed', 'force', 'seed'), tuple(ACTIONS)),
    **dict.fromkeys(('calibration', 'pitch', 'rate', 'shape'), (RECORDING,))}


def parser() -> argparse.ArgumentParser:
    """Return the command-line parser of the demo."""
    arguments = Parser(
        prog='demo', formatter_class=Help,
        description='A robot follows an edge or a surface by touch, on the real graph with a '
        'mock sensor on a pseudo-terminal and a mock robot. Writes a rosbag2 recording (.mcap) '
        'and a report (report.html; of a surface surface.ply). Exit status 0 only if it was '
        'tracked.',
        epilog='With --recording FILE the frames of a real array (.npz with frames (N, rows,\n'
        'columns), rate_hz and pitch_m; or .npy, .csv, with --rate, --pitch, --shape) are\n'
        f'converted and estimated as by driver and estimator instead.\n\n{describe_scenes()}')
    add = arguments.add_argument
    add('--scene', default='real_skin', help='what the mock sensor touches, see below')
    add('--law', choices=tuple(LAWS), help=LAW_HELP)
    add('--speed', type=float, default=0.03, help='along the edge, over the surface [m/s]')
    add('--pattern', choices=tuple(PATTERNS), help='way over a surface; default line')
    add('--force', type=float, default=5.0, help='on the pad [N]')
    add('--seed', type=SEED, default=0, help="of the sensor's noise")
    add('--parameters', metavar='FILE.yaml',
        help='parameter file of all nodes; default edge_tracking.yaml of this package')
    add('--recording', metavar='FILE', help='take a recording instead of a scene')
    add('--calibration', metavar='FILE.yaml',
        help='counts -> pressure of the recording; without it, tared frames of any unit')
    add('--pitch', type=float, help='of the recording, where it does not say it itself [m]')
    add('--rate', type=between(1e-3, MAX_RATE, 'Hz'), metavar='HZ',
        help='of the recording, where it does not say it itself [Hz]')
    add_shape(arguments)
    add('--out', metavar='FOLDER',
        help='new folder for recording and report; default runs/NAME-TIME')
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


def refuse_what_does_not_apply(options: argparse.Namespace, kind: str) -> None:
    """Raise a ConfigurationError for an option that does not apply to the action or recording."""
    default = parser().get_default
    for name, of in ONLY_FOR.items():
        if getattr(options, name) != default(name) and kind not in of:
            raise ConfigurationError(
                f'--{name} does not apply to {kind}, but to {" and ".join(of)}')


def check_parameters(options: argparse.Namespace, law: str) -> None:
    """Check the parameter file; ConfigurationError if no node should start with it."""
    if options.parameters:
        for text in check_file(options.parameters, names_in(NAMESPACE), law):
            print(text, file=sys.stderr)


def run_scene(options: argparse.Namespace) -> tuple[dict[str, Any], Path]:
    """Track once in a scene; return the summary and the folder of its results."""
    # Unreadable input is refused once, here, before a folder is made.
    path = find_scene(options.scene)
    scene = load_scene(path)
    refuse_what_does_not_apply(options, scene.action)
    options.law = law_for(scene.action, options.law)
    scene.world()  # solves the skin of a round probe in advance
    check_parameters(options, options.law)
    check_goal(options.speed, options.force, ParameterFile(
        options.parameters or PARAMETERS).config(f'/{NAMESPACE}/edge_servo', ServoConfig))
    folder = out_folder(options.out, path.stem)
    domain = hold_domain()  # of its own, so that two graphs do not receive each other's data
    print(f'to listen along: ROS_DOMAIN_ID={domain}', file=sys.stderr)
    problem = track(options, path, scene, folder, domain)
    try:
        shown = read(folder / 'bag', scene)
        if problem:
            shown.summary.update(ok=False, reason=problem)
        make_report(folder / 'report.html', shown)
        if LAWS[options.law].maps_surface:
            model = ObjectModel()
            for patch in shown.run.patches:
                model.add_patch(patch)
            save_mesh(folder / 'surface.ply', model.patches)
        return shown.summary, folder
    except TactileError as error:  # the recorder died, so its recording is incomplete
        return {'ok': False, 'reason': '; '.join(filter(None, (problem, str(error))))}, folder


def track(options: argparse.Namespace, path: Path, scene: Scene, folder: Path, domain: int
          ) -> str:
    """
    Run the graph for one goal, record into the folder's `bag`, and return what went wrong.

    The graph is in several processes; this one has the servo and its client.
    """
    robot, law, pattern = share('urdf', 'puma260.urdf'), options.law, options.pattern or 'line'
    common = {'parameters': options.parameters, 'domain': domain, 'own': scene.parameters()}
    with ExitStack() as stack:
        enter = stack.enter_context
        port, stop = enter(private_port()), enter(stop_on_signals())
        progress = enter(live_progress(scene.way or way_length(pattern)))
        parts = {name: enter(apart(name, *arguments, **common)) for name, arguments in (
            ('recorder', (folder / 'bag',)),
            ('shape', ()),
            ('mocks', (port, path, robot, options.seed)),
            ('sensing', (port, calibrate(port, scene))))}
        graph = enter(Graph(**common))

        def over() -> bool:
            return stop.is_set() or any(part.poll() is not None for part in parts.values())

        def show(feedback: Any) -> None:
            progress.show(feedback.progress, State(feedback.state).name.lower(),
                          feedback_text(feedback))

        servo = add_servo(graph, robot, law)
        freeze_heap()
        heard = Heard(servo)
        graph.spin(lambda: over() or heard.all)
        client = graph.add(
            TrackNode, own={'on_feedback': show}, action=scene.action, speed=options.speed,
            force=options.force, resumes=RESUMES, **{'surface.pattern': pattern},
            closed=scene.closed and LAWS[law].closes_contours)
        graph.spin(lambda: client.finished or over())
        if stop.is_set():
            client.cancel()
            stop.requested = False
            graph.spin(lambda: client.finished or stop.is_set(), 2.0)
            return 'interrupted'
        if not client.finished:
            return ', '.join(
                f'{name} ended by itself, with status {part.returncode}'
                for name, part in parts.items() if part.returncode is not None)
        graph.spin(stop.is_set, SETTLE)
    return '; '.join(filter(None, ('' if client.success else client.reason, heard.failed)))


def take_recording(options: argparse.Namespace) -> tuple[dict[str, Any], Path]:
    """Convert and estimate the frames of a recording; return the same as `run_scene`."""
    refuse_what_does_not_apply(options, RECORDING)
    recording = load_recording(
        options.recording, options.rate, options.shape and tuple(options.shape))
    calibration, counts = calibrated(options, recording)
    check_parameters(options, DEFAULT)
    path = Path(options.recording)
    folder = out_folder(options.out, path.stem)
    record_frames(counts, recording.rate_hz, calibration, folder / 'bag',
                  options.parameters or PARAMETERS)
    shown = read(folder / 'bag')
    make_report(folder / 'report.html', shown)
    return shown.summary, folder


def main(args: list[str] | None = None) -> int:
    """Run the demo; exit status 0 if the edge was tracked, or the recording taken."""
    os.environ.update(local_environment())  # the child processes inherit it
    with refusing('demo', ValueError, RuntimeError, ParameterException) as command:
        options = parser().parse_args(args)
        summary, folder = (take_recording if options.recording else run_scene)(options)
        if not summary['ok']:
            command.status = INTERRUPTED if summary['reason'] == 'interrupted' else FAILED
        if len(summary) == 2:  # only the reason is known
            print(f'demo: {" ".join(summary["reason"].split())}', file=sys.stderr)
            if options.json:
                print(to_json(summary))
            return command.status
        text = to_json if options.json else describe_recording if options.recording else describe
        print(text(summary))
        print(f'recording {folder / "bag"}\nreport    {folder / "report.html"}',
              file=sys.stderr)
    return command.status
