"""Demo: a mock robot follows an edge or a surface; a report is computed from its bag."""
import argparse
from datetime import datetime
import os
from pathlib import Path
import sys
from typing import Any

from rclpy.exceptions import ParameterException

from edge_tracking.episode import Episode, INTERRUPTED
from edge_tracking.goals import PATTERNS
from edge_tracking.graph import LAW_HELP, NAMESPACE, PARAMETERS, warn_of_parameters
from edge_tracking.playback import calibration_for, describe_recording, play
from edge_tracking.recording.frames_summary import summarise_recording
from edge_tracking.recording.reader import read_run
from edge_tracking.report.page import make_report, Shown
from edge_tracking.transport import local_environment
from tactile_common.command_line import between, FAILED, Help, Parser, refusing
from tactile_common.command_line import INTERRUPTED as STOPPED
from tactile_common.errors import ConfigurationError, TactileError
from tactile_common.parameter_file import ParameterFile
from tactile_common.ros.domains import hold_domain
from tactile_sensing.cli.options import add_shape
from tactile_sensing.devices.recording import load_recording, MAX_RATE
from tactile_servo.config import check_goal, ServoConfig
from tactile_servo.laws.registry import DEFAULT, law_for, LAWS
from tactile_simulation.cli.simulate import SEED
from tactile_simulation.metrics import describe, to_json
from tactile_simulation.scene import describe_scenes, find_scene, load_scene

RECORDING = 'a --recording'
# Options that apply to one action, or to recordings, only.
ONLY_FOR = {'pattern': 'track_surface', 'animate': 'track_edge', **dict.fromkeys(
    ('calibration', 'pitch', 'rate', 'shape', 'live'), RECORDING)}


def parser() -> argparse.ArgumentParser:
    """Return the command-line parser of the demo."""
    arguments = Parser(
        prog='demo', formatter_class=Help,
        description='A robot follows an edge or a surface by touch, on the real graph with a '
        'mock sensor on a pseudo-terminal and a mock robot. Writes a rosbag2 recording (.mcap) '
        'and a report (report.html, picture.png; of a surface surface.ply). Exit status 0 only '
        'if it was tracked.',
        epilog='With --recording FILE the frames of a real array (.npz with frames (N, rows,\n'
        'columns), rate_hz and pitch_m; or .npy, .csv, with --rate, --pitch, --shape) run\n'
        f'through driver and estimator instead.\n\n{describe_scenes()}')
    add = arguments.add_argument
    add('--scene', default='real_skin', help='what the mock sensor touches, see below')
    add('--law', choices=tuple(LAWS), help=LAW_HELP)
    add('--speed', type=float, default=0.03, help='along the edge, over the surface [m/s]')
    add('--pattern', choices=tuple(PATTERNS), help='way over a surface; default line')
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
    """Reserve a ROS domain for this demo, so that two graphs do not receive each other's data."""
    domain = hold_domain()
    print(f'to listen along: ROS_DOMAIN_ID={domain}', file=sys.stderr)
    return domain


def refuse_what_does_not_apply(options: argparse.Namespace, kind: str) -> None:
    """Raise a ConfigurationError for an option that does not apply to the action or recording."""
    for name, of in ONLY_FOR.items():
        if getattr(options, name) and of != kind:
            raise ConfigurationError(f'--{name} does not apply to {kind}, but to {of}')


def run(options: argparse.Namespace) -> tuple[dict[str, Any], Path]:
    """Run the demo; return the summary and the folder of its results."""
    # Unreadable input is refused once, here, before a folder is made.
    if options.recording:
        return play_recording(options)
    path = find_scene(options.scene)
    scene = load_scene(path)
    refuse_what_does_not_apply(options, scene.action)
    law = law_for(scene.action, options.law)
    scene.world()  # solves the skin of a round probe in advance
    check(options, law)
    episode = Episode(path, scene, law, options.speed, options.force, options.pattern or 'line',
                      options.seed)
    folder = out_folder(options.out, path.stem)
    ended = episode.run(folder, parameters=options.parameters, domain=own_domain())
    try:
        return episode.report(folder, ended, options.animate), folder
    except TactileError as error:  # the recorder died, so its recording is incomplete
        return {'ok': False, 'reason': f'{ended.reason}; {error}'}, folder


def play_recording(options: argparse.Namespace) -> tuple[dict[str, Any], Path]:
    """Play a recording; return the same as `run`."""
    refuse_what_does_not_apply(options, RECORDING)
    recording = load_recording(
        options.recording, options.rate, options.shape and tuple(options.shape))
    calibration = calibration_for(options, recording)
    check(options, options.law or DEFAULT)
    path = Path(options.recording)
    folder = out_folder(options.out, path.stem)
    success, reason = play(options.recording, recording, calibration, folder,
                           parameters=options.parameters, domain=own_domain())
    data = read_run(folder / 'bag')
    summary = summarise_recording(data)
    summary |= {'ok': success and summary['ok'], 'reason': reason}
    make_report(folder / 'report.html', Shown(path.name, data, summary))
    return summary, folder


def check(options: argparse.Namespace, law: str) -> None:
    """Check parameters and goal; ConfigurationError if no node should start with them."""
    warn_of_parameters(options.parameters, NAMESPACE, law)
    check_goal(options.speed, options.force, ParameterFile(
        options.parameters or PARAMETERS).config(f'/{NAMESPACE}/edge_servo', ServoConfig))


def main(args: list[str] | None = None) -> int:
    """Run the demo; exit status 0 if the edge was tracked, or the recording played."""
    os.environ.update(local_environment())  # the child processes inherit it
    with refusing('demo', ValueError, RuntimeError, ParameterException) as command:
        options = parser().parse_args(args)
        summary, folder = run(options)
        if not summary['ok']:
            command.status = STOPPED if summary['reason'] == INTERRUPTED else FAILED
        if len(summary) == 2:  # only the reason is known
            print(f'demo: {" ".join(summary["reason"].split())}', file=sys.stderr)
            return command.status
        text = to_json if options.json else describe_recording if options.recording else describe
        print(text(summary))
        print(f'recording {folder / "bag"}\nreport    {folder / "report.html"}',
              file=sys.stderr)
    return command.status
