"""One self-contained HTML page about a run, with pictures; nothing is loaded from outside."""
import base64
from collections.abc import Mapping
from html import escape
import math
from pathlib import Path
from typing import Any

import numpy as np

from edge_tracking.recording.frames_summary import force_series, METRICS
from edge_tracking.recording.run import RunData
from edge_tracking.recording.summary import rebuilt_outline, truth
from edge_tracking.report import figures, frames_figures, plans
from edge_tracking.report.style import png
from tactile_simulation.metrics import busy, shown
from tactile_simulation.scene import Scene

SHOWN_PRESSES = 8
LEAST = 6e-3  # m that contacts of a surface spread over
_CSS = """
:root { color-scheme: light; }
body { margin: 0 auto; max-width: 62rem; padding: 1rem 1.1rem 3rem; background: #fff;
  color: #22262b; font: 16px/1.5 system-ui, -apple-system, 'Segoe UI', Roboto, sans-serif; }
h1 { font-size: 1.55rem; line-height: 1.25; margin: .6rem 0 .2rem; }
h2 { font-size: 1.15rem; margin: 2.2rem 0 .4rem; }
p { margin: .3rem 0 .8rem; max-width: 46rem; }
.verdict { display: inline-block; padding: .1rem .6rem; border-radius: .3rem; color: #fff;
  background: #3a8a4d; font-weight: 600; font-size: .95rem; }
.verdict.bad { background: #b8372b; }
.numbers { display: grid; grid-template-columns: repeat(auto-fill, minmax(9.5rem, 1fr));
  gap: .5rem; margin: 1rem 0 0; padding: 0; }
.numbers div { border: 1px solid #dfe2e7; border-radius: .4rem; padding: .45rem .7rem; }
.numbers dt { font-size: .82rem; color: #555a61; }
.numbers dd { margin: 0; font-size: 1.2rem; font-weight: 600; white-space: nowrap; }
figure { margin: .4rem 0 0; }
img { display: block; width: 100%; height: auto; }
.picture { overflow-x: auto; }
.picture img { min-width: 34rem; }
.narrow { max-width: 44rem; }
figcaption, footer { font-size: .87rem; color: #555a61; }
@media print { .picture img { min-width: 0; } }
"""


def _listed(summary, *keys):
    return ''.join(f', {name} {value} {unit}'.rstrip() for name, value, unit in shown(
        {key: summary.get(key) for key in keys}))


def of_this_run(summary, *keys):
    """Sentence with what a summary knows of the metrics of a picture."""
    return f' This run: {_listed(summary, *keys)[2:] or "none of its numbers is known"}.'


def make_report(run: RunData, summary: Mapping[str, Any], scene: Scene, path) -> None:
    """Write the report of a run along the edge of a scene, with its `summarise`, as HTML."""
    real = truth(run, scene)
    sections = [
        ('Path of the pad', plans.trajectory(run, scene, real),
         'Centre of the pad over the true edge, with the outline of the pad at first contact '
         f'and at the end. The run begins '
         f'{1e3 * abs(scene.start.offset):.1f} mm beside the edge; the detail shows how touch '
         "takes that away. Positions are from the robot's forward kinematics, errors against "
         'the scene, which only the mock sensor knows.'
         + of_this_run(summary, 'tracked_length', 'edge_length', 'duration'), ''),
        ('Lateral error and force', figures.errors(run, summary, scene, real),
         'True: from pose and scene. Measured: what the contact estimate gave the servo. '
         'The statistics count from the dotted line, 10 mm after first contact; those of the '
         'force only while the edge crosses the whole pad.' + of_this_run(
             summary, 'lateral_rms', 'lateral_max', 'force_rms_error', 'force_max'), ''),
        ('Tactile pictures', figures.pictures(run),
         'Pressure over the pad, compression positive, with the estimated edge drawn in where '
         'the estimate is a valid line; the cross is the centre of pressure where what touches '
         'is no straight line, as on a curve or at the end of the edge.'
         + of_this_run(summary, 'sensor_rate', 'force_target'), ''),
        ('Latency', figures.latency(run, summary),
         'From the last byte of a picture at the driver to the end of the first control cycle '
         'that used it. Later ones than the axis shows are in its last bar.'
         + of_this_run(summary, 'latency_p50', 'latency_p99', 'missed_cycles'), 'narrow'),
    ]
    found = rebuilt_outline(run)
    if found is not None:
        sections.insert(2, (
            'Rebuilt outline', plans.outline(run, scene, found),
            'Lines, arcs and corners, as few as the contacts along the edge allow. Each contact '
            'is a point of the fitted line or, on a curve and at a corner, of the ridge of the '
            'picture, put into the base by the pose of the robot. '
            f'This run: {len(found.sides)} sides, {len(found.corners)} corners'
            f'{_listed(summary, "contour_max_error", "contour_area_error")}.', ''))
    # Of an edge that was touched for the first time a few contacts may look like a surface.
    if len(run.patches) and np.ptp([patch.origin for patch in run.patches], axis=0).max() > LEAST:
        sections.append((
            'Surface', plans.surface(run),
            'Where a surface was touched: patches of second order, coloured by the least one '
            'that explains the contacts, and the way of the contact. '
            f'This run: {len(run.patches)} patches.', 'narrow'))
    verdict = ('Edge tracked' if summary['ok'] else 'Edge not tracked', summary['ok'])
    rms, largest = summary['lateral_rms'], summary['lateral_max']
    title = f'Scene \u201c{scene.name}\u201d'
    if math.isfinite(summary['speed']):
        title += f', {1e3 * summary["speed"]:.0f} mm/s asked for'
    lead = f'{summary["reason"]}.'
    if math.isfinite(rms):
        lead += (f" The pad's centre stayed within {1e3 * largest:.3f} mm of the true edge, "
                 f'{1e3 * rms:.3f} mm RMS, over {1e3 * summary["tracked_length"]:.0f} mm '
                 f'at {1e3 * summary["speed_mean"]:.0f} mm/s on average.')
    lead += f' {busy(summary)}'.rstrip()
    if not summary['approach_recorded']:
        lead += ' No picture was recorded before first contact: the recording began late.'
    write_page(path, title, verdict, lead, shown(summary), sections,
           f'{scene.description} Controller: {summary["controller"]}. Last state: '
           f'{summary["state"]}.' + (f' Seed of the noise: {summary["seed"]}.'
                                     if summary.get('seed') is not None else ''))


def make_recording_report(run: RunData, summary: Mapping[str, Any], name: str, path) -> None:
    """Write the report of a recording of some name, with its `summarise_recording`, as HTML."""
    series = force_series(run)
    sections = [] if not len(series.time) else [
        ('Force and centre of pressure over time', frames_figures.force_over_time(series),
         'Force is the zeroth moment of the picture. Without a calibration it is in counts '
         'times area and says nothing about newtons. The centre of pressure is shown where '
         'the force is above a tenth of its largest value. This recording: '
         f'{len(series.time)} contacts in {np.ptp(series.time):.1f} s.', ''),
        ('Presses', frames_figures.press_pictures(run, series, SHOWN_PRESSES),
         f'The pictures at the peaks of {min(summary["presses"], SHOWN_PRESSES)} of '
         f'{summary["presses"]} presses, with the centre of pressure.', ''),
        ('Path of the centre of pressure', frames_figures.centre_path(run, series),
         'The frame is the array; the colour is the force. This recording: the centre moves over '
         '{:.1f} by {:.1f} mm.'.format(*1e3 * frames_figures.centre_extent(series)), '')]
    types = ', '.join(f'{count} {name}' for name, count in summary['contact_types'].items()
                      if count) or 'none'
    count, largest = summary['presses'], summary['force_max']
    lead = f'{count} press' + ('' if count == 1 else 'es')
    if math.isfinite(largest):
        factor, unit = frames_figures.force_unit(series)
        lead += f'; the largest force is {factor * largest:.4g} {unit}'
    verdict = ('Recording played' if summary['ok'] else 'No pictures', summary['ok'])
    tactels = f'{summary["rows"]} \u00d7 {summary["columns"]} tactels'
    write_page(path, f'Recording \u201c{name}\u201d, {tactels}', verdict,
           f'{lead}. Contacts by type: {types}.', shown(summary, METRICS), sections,
           summary.get('reason', ''))


def picture(run: RunData, scene: Scene, path) -> None:
    """Save the main picture, the path of the pad over the true edge, as PNG."""
    Path(path).write_bytes(png(plans.trajectory(run, scene, truth(run, scene))))


def write_page(path, title, verdict, lead, rows, sections, footer) -> None:
    """
    Write a page: its verdict is a text and whether it is a good one, rows are of `shown`.

    Each section has a heading, a figure, a caption and the class of its style.
    """
    text, good = verdict
    numbers = ''.join(
        f'<div><dt>{escape(name[0].upper() + name[1:])}</dt>'
        f'<dd>{escape(f"{value} {unit}".strip())}</dd></div>' for name, value, unit in rows)
    parts = []
    for heading, figure, caption, kind in sections:
        data = base64.b64encode(png(figure)).decode('ascii')
        parts.append(
            f'<h2>{escape(heading)}</h2>\n<figure class="{kind}"><div class="picture">'
            f'<img alt="{escape(heading)}" src="data:image/png;base64,{data}"></div>'
            f'<figcaption><p>{escape(caption)}</p></figcaption></figure>')
    Path(path).write_text(
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<title>{escape(title)}</title><style>{_CSS}</style></head><body>\n'
        f'<h1>{escape(title)}</h1>\n'
        f'<p><span class="verdict{"" if good else " bad"}">{escape(text)}</span></p>\n'
        f'<p>{escape(lead)}</p>\n<dl class="numbers">{numbers}</dl>\n'
        + '\n'.join(parts) + f'\n<footer><p>{escape(footer)}</p></footer>\n</body></html>\n',
        encoding='utf-8')
