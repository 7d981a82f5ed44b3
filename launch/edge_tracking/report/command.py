"""Command `report`: shows recordings as one self-contained page."""
import argparse
from pathlib import Path
import sys
from typing import Any

from edge_tracking.recording.frames_summary import summarise_recording
from edge_tracking.recording.run import read_run, RunData
from edge_tracking.recording.summary import is_of_servo, summarise, truth
from edge_tracking.report.page import make_report, Shown
from tactile_common.command_line import file_to_write, Help, Parser, refusing
from tactile_common.errors import ConfigurationError
from tactile_simulation.metrics import to_json
from tactile_simulation.scene import describe_scenes, load_scene
from tactile_simulation.world import Scene


def parser() -> argparse.ArgumentParser:
    """Return the command-line parser."""
    arguments = Parser(
        prog='report', formatter_class=Help, epilog=describe_scenes(),
        description='Writes the content of a rosbag2 recording as one HTML page: a player of '
        'images and estimates, the path of the pad, error, force, states, latency. Two recordings '
        'are shown side by side. Exit status 2, and nothing written, if one cannot be read.')
    add = arguments.add_argument
    add('bags', nargs='+', metavar='BAG', help='one or two recordings: folders, .mcap or .db3')
    add('-o', '--out', metavar='FILE.html', type=file_to_write('.html', '.htm'), required=True,
        help='page to write')
    add('--scene', help='scene that was simulated, for the true errors, see below')
    add('--namespace', help='of the sensor, where a recording has several')
    add('--json', action='store_true', help='print the summaries, one JSON object a line')
    return arguments


def read(path: str | Path, scene: Scene | None = None, namespace: str | None = None) -> Shown:
    """Read and summarise a recording; ConfigurationError if it contains nothing to show."""
    run = read_run(path, namespace, joints=scene is not None)
    if not any(len(table.stamp_ns) for table in (
            run.images, run.contacts, run.statuses, run.poses)):
        raise ConfigurationError(f'bag {path}: holds neither images nor contacts, states or '
                                 f'poses of a sensor in {run.namespace}')
    real = truth(run, scene) if scene else None
    name = '/'.join(Path(path).resolve().parts[-2:])
    return Shown(name, run, summary_of(run, scene, real), scene, real)


def summary_of(run: RunData, scene: Scene | None, real: Any) -> dict[str, Any]:
    """Return the summary of a servo's run or, without a servo, of the sensor's data."""
    if scene or is_of_servo(run):
        return summarise(run, scene, real)
    return summarise_recording(run)


def main(argv: list[str] | None = None) -> int:
    """Run the command; exit status 2 if a recording cannot be read."""
    with refusing('report', ValueError) as command:
        options = parser().parse_args(argv)
        if len(options.bags) > 2:
            raise ConfigurationError(f'{len(options.bags)} recordings; one or two are shown')
        scene = load_scene(options.scene) if options.scene else None
        recordings = [read(path, scene, options.namespace) for path in options.bags]
        make_report(options.out, *recordings)
        for it in recordings if options.json else ():
            print(to_json(it.summary))
        print(f'report {options.out}', file=sys.stderr)
    return command.status

