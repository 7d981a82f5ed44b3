"""The report of a run over a surface."""
from collections.abc import Mapping
import math
from typing import Any

from matplotlib.figure import Figure
import numpy as np

from edge_tracking.recording.run import RunData
from edge_tracking.report import figures, plans
from edge_tracking.report.page import of_this_run, write_page
from edge_tracking.report.style import BLUE, colour_bar, INK, label, new_figure, note, ORANGE, png
from tactile_servo.types import State
from tactile_simulation.metrics import busy, shown
from tactile_simulation.scene_surface import SurfaceScene
from tactile_simulation.surface_metrics import SurfaceTruth


def make_surface_report(run: RunData, summary: Mapping[str, Any], scene: SurfaceScene,
                        truth: SurfaceTruth, path) -> None:
    """Write the report of a run over a surface, with its summary, as HTML."""
    sections = [
        ('The surface that was felt', felt(run, scene),
         'Contacts, coloured by their distance from the true surface, which only the mock sensor '
         'knows; and the curvature along the way that the shape estimator tells, live.'
         + of_this_run(summary, 'tracked_length', 'surface_rms', 'surface_max'), ''),
        ('Force and place of the contact', course(run, truth, summary),
         'True: from pose and scene. Measured: what the image told.'
         + of_this_run(summary, 'force_target', 'force_rms_error', 'force_max'), ''),
        ('Latency', figures.latency(run, summary),
         'From the last byte of a picture at the driver to the end of the first control cycle '
         'that used it. Later ones than the axis shows are in its last bar.'
         + of_this_run(summary, 'latency_p50', 'latency_p99', 'missed_cycles'), 'narrow')]
    if len(run.patches):
        sections.insert(1, (
            'Patches', plans.surface(run),
            'Patches of second order, coloured by the least one that explains the contacts, and '
            'the way of the contact; surface.ply holds them. '
            f'This run: {len(run.patches)} patches.', 'narrow'))
    lead = f'{summary["reason"]}.'
    if math.isfinite(summary['surface_rms']):
        lead += (f' Over {1e3 * summary["tracked_length"]:.0f} mm the contacts lie within '
                 f'{1e3 * summary["surface_max"]:.3f} mm of the true surface, '
                 f'{1e3 * summary["surface_rms"]:.3f} mm RMS.')
    lead += f' {busy(summary)}'.rstrip()
    lead += f' The least surface that explains them: {summary["surface_kind"]}'
    if math.isfinite(summary['surface_radius']):
        lead += f' of {1e3 * summary["surface_radius"]:.2f} mm radius'
    if len(run.patches) and not summary['surface_seen_across']:
        lead += ' (how it bends across the way was not seen)'
    verdict = (f'Surface {"" if summary["ok"] else "not "}tracked', summary['ok'])
    title = f'Scene \u201c{scene.name}\u201d, {1e3 * summary["speed"]:.0f} mm/s asked for'
    write_page(path, title, verdict, f'{lead}.', shown(summary), sections,
               f'{scene.description} Controller: {summary["controller"]}. Last state: '
               f'{summary["state"]}. Seed of the noise: {summary["seed"]}.')


def felt(run: RunData, scene: SurfaceScene) -> Figure:
    """Contacts from above and from the side, and curvatures along the way."""
    figure = new_figure(10.0, 7.0)
    (above, side), (bend, unused) = figure.subplots(2, 2)
    unused.remove()
    points = run.touches.position
    if len(points):
        errors, places = 1e6 * scene.surface.distance(points), 1e3 * (points - scene.top)
        most = max(np.abs(errors).max(), 1.0)
        for axes, first, second in ((above, 0, 1), (side, 1, 2)):
            dots = axes.scatter(places[:, first], places[:, second], c=errors, s=4,
                                cmap='coolwarm', vmin=-most, vmax=most)
            label(axes, f'{"xyz"[first]} [mm]', f'{"xyz"[second]} [mm]',
                  'From above' if first == 0 else 'From the side')
            axes.set_aspect('equal', adjustable='datalim')
        colour_bar(figure, dots, [above, side], 'off the true surface [\u00b5m]')
    way = 1e3 * np.cumsum([0.0, *(np.linalg.norm(b.origin - a.origin) for a, b in zip(
        run.patches, run.patches[1:], strict=False))])[:len(run.patches)]
    for axis, colour in enumerate((BLUE, ORANGE)):
        seen = [patch.curvature[axis] if patch.seen[axis] else np.nan for patch in run.patches]
        bend.plot(way, seen, '.', color=colour, markersize=2.5, label=('first', 'second')[axis])
    label(bend, 'way [mm]', 'principal curvatures [1/m]', 'Curvature, where the path could see it')
    bend.legend(fontsize=9.5, frameon=False)
    return figure


def course(run: RunData, truth: SurfaceTruth, summary: Mapping[str, Any]) -> Figure:
    """Force and place of the contact on the pad over time."""
    figure = new_figure(10.0, 5.6)
    force, place = figure.subplots(2, 1, sharex=True)
    active = run.statuses.state != State.IDLE
    force.plot(run.seconds(run.contacts.stamp_ns), run.contacts.m0, color=ORANGE, linewidth=0.7,
               label='measured')
    force.plot(truth.time, truth.force, color=BLUE, linewidth=1.3, label='true')
    force.axhline(summary['force_target'], color=INK, linewidth=1.0, linestyle=(0, (6, 4)))
    label(force, '', 'normal force [N]', 'Force on the probe')
    force.legend(fontsize=9.5, frameon=False)
    for axis, colour in enumerate((BLUE, ORANGE)):
        place.plot(truth.time, 1e3 * truth.place[:, axis], color=colour, linewidth=1.3,
                   label='xy'[axis])
    label(place, 'time [s]', "from the pad's centre [mm]", 'True place of the contact on the pad')
    place.legend(fontsize=9.5, frameon=False)
    if active.any():
        times = run.seconds(run.statuses.stamp_ns)[active]
        place.set_xlim(times[0], times[-1])
    else:
        note(place, 0.3, 0.5, 'The servo did not run.')
    return figure


def picture(run: RunData, scene: SurfaceScene, path) -> None:
    """Save the main picture, the contacts that were felt, as PNG."""
    path.write_bytes(png(felt(run, scene)))
