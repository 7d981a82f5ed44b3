"""The report of a run in a scene: a page and its main picture."""
from collections.abc import Callable, Mapping
import math
from pathlib import Path
from typing import Any, NamedTuple

from edge_tracking.recording.run import RunData
from edge_tracking.report import edge_page, figures, plans, surface_page
from edge_tracking.report.html import of_this_run, Section, Verdict, write_page
from tactile_simulation.metrics import busy, shown
from tactile_simulation.plot import png
from tactile_simulation.world import Scene, Truth


class Kind(NamedTuple):
    """What a report says of a kind of scene."""

    subject: str
    sections: Callable[..., list[Section]]  # of run, summary, scene and truth
    lead: Callable[[Mapping[str, Any]], str]
    picture: Callable[..., Any]  # the figure of run, scene and truth


KINDS = {
    'track_edge': Kind('Edge', edge_page.sections, edge_page.lead, plans.trajectory),
    'track_surface': Kind('Surface', surface_page.sections, surface_page.lead,
                          surface_page.felt)}


def make_report(run: RunData, summary: Mapping[str, Any], scene: Scene, real: Truth,
                path) -> None:
    """Write the report of a run in a scene, with its summary and truth, as HTML."""
    kind = KINDS[scene.action]
    title = f'Scene \u201c{scene.name}\u201d'
    if math.isfinite(summary['speed']):
        title += f', {1e3 * summary["speed"]:.0f} mm/s asked for'
    lead = f'{summary["reason"]}.{kind.lead(summary)} {busy(summary)}'.rstrip()
    verdict = f'{kind.subject} {"" if summary["ok"] else "not "}tracked'
    footer = f'{scene.description} Law: {summary["controller"]}. Last state: {summary["state"]}.'
    if summary['seed'] is not None:
        footer += f' Seed of the noise: {summary["seed"]}.'
    latency = Section(
        'Latency', figures.latency(run, summary),
        'From the last byte of an image at the driver to the end of the first control cycle that '
        'used it. Later ones than the axis shows are in its last bar.'
        + of_this_run(summary, 'latency_p50', 'latency_p99', 'missed_cycles'), 'narrow')
    write_page(path, title, Verdict(verdict, summary['ok']), lead, footer, shown(summary),
               [*kind.sections(run, summary, scene, real), latency])


def picture(run: RunData, scene: Scene, real: Truth, path) -> None:
    """Save the main picture of a run as PNG."""
    Path(path).write_bytes(png(KINDS[scene.action].picture(run, scene, real)))
