"""
Report of recordings: one page, whose sections depend on the available data.

The command `report` shows one or two recordings.
"""
import argparse
from collections.abc import Iterator, Mapping
from datetime import datetime, timezone
from html import escape
from pathlib import Path
import sys
from typing import Any

import numpy as np

from edge_tracking.parameters import NODES, parameters_of
from edge_tracking.recording import summary as of_run
from edge_tracking.recording.run import RunData
from edge_tracking.recording.summary import Shown
from edge_tracking.report import charts
from edge_tracking.web import page as html
from tactile_common.atomic_file import replacing
from tactile_common.command_line import (
    file_to_write,
    Help,
    Parser,
    refusing,
    to_json,
    version_of_all,
)
from tactile_common.errors import ConfigurationError
from tactile_common.ros.conversions import name_in
from tactile_servo.laws.registry import DEFAULT, LAWS
from tactile_servo.types import State
from tactile_simulation.metrics import busy, percentile, rate, shown
from tactile_simulation.scene import describe_scenes, load_scene

LEAST = 6e-3  # m, smallest extent of the contacts with a surface
MOST_ROWS = 100  # rows of a table
MOCKS = {'mock_sensor', 'mock_robot'}  # nodes of a simulation
MOST_TEXT = 200  # characters of a value
Section = tuple[str, str, str]  # heading, HTML and its caption
WHAT = {'track_edge': 'Edge', 'track_surface': 'Surface'}


def make_report(path: str | Path, *recordings: Shown) -> None:
    """Write the report of recordings, side by side, as HTML."""
    titles = [f'Scene \u201c{it.scene.name}\u201d' if it.scene else
              f'Recording \u201c{it.name}\u201d' for it in recordings]
    columns = [
        {'': f'<h1>{escape(title)}</h1>\n{_head(it)}',
         **{heading: f'<figure>{content}<figcaption><p>{escape(caption)}</p></figcaption></figure>'
            for heading, content, caption in _sections(it, len(recordings))}}
        for title, it in zip(titles, recordings, strict=True)]
    parts = []
    for heading in dict.fromkeys(name for column in columns for name in column):
        beside = ''.join(f'<div>{column.get(heading, "<p>Not recorded.</p>")}</div>'
                         for column in columns)
        parts.append((f'<h2>{escape(heading)}</h2>\n' if heading else '')
                     + f'<div class="beside">{beside}</div>')
    with replacing(path) as part:
        part.write_text(html.make_page(
            ' \u2013 '.join(titles), '\n'.join(parts), ('tactile.js', 'player.js', 'chart.js'),
            kind='two' if len(columns) > 1 else ''), 'utf-8')


def _head(it: Shown) -> str:
    summary, of_servo = it.summary, it.scene or of_run.is_of_servo(it.run)
    verdict = 'Recording of a sensor' if summary['ok'] else 'No images'
    if of_servo:
        law = LAWS.get(summary['law'])
        action = it.scene.action if it.scene else law.action if law else ''
        verdict = f'{WHAT.get(action, "Goal")} {"" if summary["ok"] else "not "}' + (
            'tracked' if action else 'met')
    origin = 'robot' if it.run.nodes else 'simulated or robot: not recorded'
    if it.scene or it.run.nodes & MOCKS:
        origin = 'simulated'
    lead = f'{summary["reason"]}.{_lead(summary)} {busy(summary)}'.strip(' .') + '.'
    return (f'<p><span class="badge {"" if summary["ok"] else "bad"}">{escape(verdict)}</span>'
            f'<span class="badge plain">{origin}</span></p>\n'
            f'<p>{escape(lead[0].upper() + lead[1:])}</p>\n{html.table(_about(it))}\n'
            + (html.numbers(shown(summary)) if of_servo else ''))


def _about(it: Shown) -> list[tuple[str, ...]]:
    """Return rows with information about a recording in addition to its numbers."""
    run, summary = it.run, it.summary
    when = datetime.fromtimestamp(1e-9 * run.received_ns, timezone.utc)
    law, seed, sensor, goal = summary.get('law', ''), summary.get('seed'), '', ''
    if run.info:
        array = run.info.array
        sensor = f'{run.info.sensor} in {run.namespace}, {array.rows} \u00d7 {array.columns} ' \
            f'tactels of {1e3 * array.pitch_x:.2f} mm'
    if run.goals:
        goal = _short(', '.join(f'{name} {value}' for name, value in run.goals[-1].items()))
    first: Mapping[str, Any] = next(iter(run.parameters.values()), {})
    command = run.parameters.get('track', first).get('command', '')
    rows = [('recorded', f'{when:%Y-%m-%d %H:%M:%S} UTC'), ('from', it.name),
            ('report made by', f'version {version_of_all()}'),
            ('mock nodes', ', '.join(sorted(run.nodes & MOCKS))), ('sensor', sensor),
            ('law', law), ('last state', summary['state'] if law else ''),
            ('scene', it.scene.description if it.scene else ''),
            ('seed of the noise', '' if seed is None else str(seed)), ('goal', goal),
            ('command', _short(str(command))),
            ('versions', _short(str(first.get('versions', ''))))]
    rows += [(f'{node}, not as by default', _changed(node, known, law))
             for node, known in run.parameters.items()]
    return [row for row in rows if row[1]]


def _changed(node: str, known: Mapping[str, Any], law: str) -> str:
    """Return the parameters of a node that differ from their defaults, as text."""
    defaults = parameters_of(node, law if law in LAWS else DEFAULT) if node in NODES else []
    return ', '.join(f'{it.name} {_short(str(known[it.name]))}' for it in defaults
                     if it.name in known and known[it.name] != it.default) or 'none'


def _short(text: str) -> str:
    text = ' '.join(text.split())
    return f'{text[:MOST_TEXT]} \u2026' if len(text) > MOST_TEXT else text


def _lead(summary: Mapping[str, Any]) -> str:
    """Return sentences about what the numbers do not show."""
    text = ''
    if summary.get('surface_kind', 'none') != 'none':
        text += f' The least surface that explains the contacts: {summary["surface_kind"]}'
        if not summary['surface_seen_across']:
            text += ' (how it bends across the way was not seen)'
        text += '.'
    if not summary.get('approach_recorded', True):
        text += ' No image was recorded before first contact: the recording began late.'
    if summary.get('frames', 0) > 1:
        text += f' {of_run.describe_recording(summary)}.'
    return text


def _sections(it: Shown, columns: int) -> Iterator[Section]:
    run, of_servo, stamps = it.run, of_run.is_of_servo(it.run), of_run.loads_of(it.run).stamp_ns
    yield from _player(run, columns)
    if of_servo:
        yield 'Error and force', html.charts(charts.over_time(it)), (
            'By touch: what the servo measured.' + (
                ' True: from pose and scene. The statistics count from the dashed line, 10 mm '
                'after first contact; those of the force only while an edge crosses the whole '
                'pad.' if it.scene else ' The dashed line is 10 mm after first contact.')
            + ' Coloured: other states than tracking, see there.')
        yield from _states(run)
    yield from _shape(it)
    if not of_servo and len(stamps):
        yield 'Force and centre of pressure', html.charts(charts.pressed(run)), (
            'Force is the zeroth moment of the picture. Without a calibration it is in counts '
            'times area and says nothing about newtons. The centre of pressure is shown where the '
            f'force is above a tenth of its largest value. This recording: {len(stamps)} '
            f'contacts in {1e-9 * np.ptp(stamps):.1f} s.')
    if len(of_run.latencies(run)):
        yield 'Latency', html.charts(charts.latency(it)), (
            'From the last byte of an image at the driver to the end of the first control cycle '
            'that used it. Later ones than the axis shows are in its last bar.')
    yield from _rates(run)


def _player(run: RunData, columns: int) -> Iterator[Section]:
    stamps = charts.chosen(run, columns)
    count = len(run.stamps['image']) if run.images.array else 0
    if not len(stamps):
        return
    canvases = (['tactile image'] if count else []) + (
        ['way of the pad'] if len(run.poses.stamp_ns) else [])
    data = charts.player(run, stamps)
    shown_of = f'{len(stamps)} of {count} images, evenly chosen and none averaged, in 254 ' \
        f'levels up to {data["top"]:.4g} {run.images.unit}' if count else \
        f'{len(stamps)} of {len(run.stamps["sensor_pose"])} poses'
    yield 'Player', html.player(data, canvases), (
        f'Shown: {shown_of}. Blue-green: the estimate, a line where it is one, a cross where it '
        'is a point, or at the centre of pressure. Way of the pad in the base frame, to be '
        f'turned; orange: what it touched. This run: {len(run.stamps["contact"])} contacts.')


def _states(run: RunData) -> Iterator[Section]:
    rows = [(f'{run.seconds(stage.begin):.3f}', f'{1e-9 * (stage.end - stage.begin):.3f}',
             name_in(State, stage.state), stage.reason) for stage in of_run.stages(run)]
    yield 'States', html.table(rows[:MOST_ROWS], ('from [s]', 'for [s]', 'state', 'reason')), (
        f'This run: {len(rows)} states' + (
            f', of which the first {MOST_ROWS} are listed.' if len(rows) > MOST_ROWS else '.'))


def _shape(it: Shown) -> Iterator[Section]:
    run, found = it.run, of_run.rebuilt_outline(it.run) if 'sides' in it.summary else None
    if it.scene and it.scene.action == 'track_surface':
        yield 'The surface that was felt', html.charts(charts.felt(it)), (
            'Contacts, and their distance from the true surface, which only the mock sensor '
            'knows.')
    elif it.scene or found is not None:
        text = ''
        if it.scene:
            text = "The pad's centre is from the robot's forward kinematics; the true edge is " \
                'known by the mock sensor alone. '
        if found is not None:
            sides = ', '.join(f'{side.kind} of {1e3 * side.length:.2f} mm' + (
                f', radius {1e3 * side.radius:.1f}' if side.kind == 'arc' else '')
                for side in found.sides)
            text += 'Outline: lines, arcs and corners, as few as the contacts allow, here ' \
                f'{len(found.sides)} sides ({sides}) and {len(found.corners)} corners.'
        yield 'Seen from above', html.charts(charts.plan(it, found)), text
    # At first contact with an edge, a few contacts may look like a surface.
    if len(run.patches) and np.ptp([patch.origin for patch in run.patches], axis=0).max() > LEAST:
        yield 'Surface', html.charts(charts.curvatures(run)), (
            'Where a surface was touched: principal curvatures by the shape estimator, live. '
            f'This run: {len(run.patches)} patches.')


def _rates(run: RunData) -> Iterator[Section]:
    rows = [(name, str(len(stamps)), f'1 of {run.every.get(name, 1)}', f'{rate(stamps):.1f}',
             f'{1e-6 * np.median(np.diff(stamps)):.2f}', f'{1e-6 * np.diff(stamps).max():.2f}')
            for name, stamps in run.stamps.items() if len(stamps) > 1]
    head = 'topic', 'messages', 'read', 'rate [Hz]', 'gap, median [ms]', 'largest [ms]'
    late = 1e3 * run.contacts.latency
    yield 'Rates', html.table(rows, head), (
        'By the stamps of all messages; all else is of those that were read.' + (
            f' From a stamp to the publication of its contact: {percentile(late):.2f} ms in the '
            f'median, {percentile(late, 99):.2f} ms at 99 %.' if len(late) else '')
        + f' This run: {of_run.lost_images(run)} lost images.')


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
    add('--namespace', help='of the sensor, where a recording has several; default: tactile')
    add('--json', action='store_true', help='print the summaries, one JSON object a line')
    return arguments


def main(argv: list[str] | None = None) -> int:
    """Run the command; exit status 2 if a recording cannot be read."""
    with refusing('report', ValueError) as command:
        options = parser().parse_args(argv)
        if len(options.bags) > 2:
            raise ConfigurationError(f'{len(options.bags)} recordings; one or two are shown')
        scene = load_scene(options.scene) if options.scene else None
        recordings = [of_run.read(path, scene, options.namespace) for path in options.bags]
        make_report(options.out, *recordings)
        for it in recordings if options.json else ():
            print(to_json(it.summary))
        print(f'report {options.out}', file=sys.stderr)
    return command.status

